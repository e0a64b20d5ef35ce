"""`puppet map` as typed: its JSON to the key, its tables, and what it says of what cannot be."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from puppet.cli import main
from puppet.formats.armature_toml import load_puppet
from puppet.mapping.blocks import BLOCKS
from puppet.mapping.human import HUMAN
from puppet.skeleton import HUMAN_BONE_NAMES
from tests.shows import ARMATURES

RIGS = ("dog", "fish", "lamp", "ostrich", "seagull", "snake")
FISH = ARMATURES / "fish.glb"
CONTROL_POINTS = {"head", "hand.L", "hand.R", "foot.L", "foot.R"}
EXPLAINED = {"confidence", "certainty", "margin", "reasons", "runners_up"}


@dataclass
class Done:
    code: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        assert self.code == 0, self.err
        document: dict[str, Any] = json.loads(self.out)
        return document

    @property
    def partners(self) -> dict[str, str]:
        return partners(self.json)


def partners(document: dict[str, Any]) -> dict[str, str]:
    names = ("bone", "human") if document["mode"] == "fk" else ("effector", "control_point")
    return {pair[names[0]]: pair[names[1]] for pair in document["pairs"]}


class Map:
    """`puppet map …` in this process, which saves the start of another."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self._monkeypatch = monkeypatch
        self._capsys = capsys
        monkeypatch.setenv("COLUMNS", "160")

    def __call__(self, *arguments: str | Path) -> Done:
        self._monkeypatch.setattr(sys, "argv", ["puppet", "map", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        streams = self._capsys.readouterr()
        return Done(int(end.value.code or 0), streams.out, streams.err)


@pytest.fixture
def map_(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Map:
    return Map(monkeypatch, capsys)


def test_it_is_a_command_that_prints_json_and_nothing_else(tmp_path: Path) -> None:
    """A process of its own, from a folder of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "puppet", "map", str(FISH), "--mode", "fk", "--json"],
        cwd=tmp_path,
        env=os.environ,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["armature"] == "fish"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", RIGS)
def test_fk_json_has_exactly_these_keys(map_: Map, name: str) -> None:
    found = map_(ARMATURES / f"{name}.glb", "--json").json
    assert set(found) == {"armature", "mode", "pairs", "unmapped"}
    assert (found["armature"], found["mode"]) == (name, "fk")
    assert found["pairs"]
    for pair in found["pairs"]:
        assert set(pair) == {"bone", "human", "score"}
        assert pair["human"] in HUMAN_BONE_NAMES
        assert 0.0 <= pair["score"] <= 1.0
    bones = load_puppet(ARMATURES / f"{name}.glb").model.armature.names
    assert sorted([*partners(found), *found["unmapped"]]) == sorted(bones)


@pytest.mark.parametrize("name", [*RIGS, "seagull_with_master"])
def test_ik_json_has_exactly_these_keys(map_: Map, name: str) -> None:
    found = map_(ARMATURES / f"{name}.glb", "--mode", "ik", "--json").json
    assert set(found) == {"armature", "mode", "pairs", "unmapped"}
    assert (found["armature"], found["mode"]) == (name, "ik")
    masters = load_puppet(ARMATURES / f"{name}.glb").traits.masters
    for pair in found["pairs"]:
        drives = {"drives"} if pair["effector"] in masters else set()
        assert set(pair) == {"effector", "control_point", "score"} | drives
        assert pair["control_point"] in CONTROL_POINTS
        if drives:
            assert pair["drives"] == list(masters[pair["effector"]])
    assert set(masters) <= set(partners(found)), "a master has no control point"
    used = list(partners(found).values())
    assert len(set(used)) == len(used)


@pytest.mark.parametrize("character", ["fish", "lamp"])
def test_the_published_mapping_is_found(
    map_: Map, published: dict[str, Any], character: str
) -> None:
    found = map_(ARMATURES / f"{character}.glb", "--mode", "fk", "--json")
    for bone, allowed in published[character]["expect"].items():
        assert found.partners[bone] in allowed
    assert set(found.partners) | set(found.json["unmapped"]) == set(published[character]["parents"])


def test_a_toml_speaks_for_a_model_that_is_not_there(map_: Map) -> None:
    assert not (ARMATURES / "seagull_with_master.glb").exists()
    by_model = map_(ARMATURES / "seagull_with_master.glb", "--mode", "ik", "--json")
    by_toml = map_(ARMATURES / "seagull_with_master.toml", "--mode", "ik", "--json")
    assert by_model.json == by_toml.json
    assert by_model.json["armature"] == "seagull_with_master"
    assert {"wings", "tail"} <= set(by_model.partners)
    hands = {by_model.partners["wings"], by_model.partners["tail"]}
    assert hands == {"hand.L", "hand.R"}, "one hand flies, the other has the tail"


def test_alternatives_are_others_and_best_first(map_: Map) -> None:
    found = map_(FISH, "--json", "--k", "4", "--explain").json
    assert set(found) == {
        "armature", "mode", "pairs", "unmapped", "merit", "offered_masters", "alternatives",
    }  # fmt: skip
    assert len(found["alternatives"]) == 3
    ranked = [found, *found["alternatives"]]
    assert len({tuple(sorted(partners(one).items())) for one in ranked}) == 4
    merits = [one["merit"] for one in ranked]
    assert merits == sorted(merits, reverse=True)
    plain = map_(FISH, "--json", "--k", "2").json
    assert set(plain) == {"armature", "mode", "pairs", "unmapped", "alternatives"}
    assert set(plain["alternatives"][0]) == {"armature", "mode", "pairs", "unmapped"}
    assert partners(plain) == partners(found)


@pytest.mark.parametrize("mode", ["fk", "ik"])
def test_every_pair_is_explained(map_: Map, mode: str) -> None:
    human = "human" if mode == "fk" else "control_point"
    for pair in map_(FISH, "--mode", mode, "--json", "--explain").json["pairs"]:
        assert set(pair) >= EXPLAINED
        assert sum(pair["reasons"].values()) == pytest.approx(pair["score"], abs=0.01)
        assert pair["certainty"] in ("sure", "likely", "doubtful")
        assert 0.0 <= pair["confidence"] <= 1.0
        for other in pair["runners_up"]:
            assert set(other) == {human, "score"}
            assert other[human] != pair[human]


def test_a_lock_is_kept_and_the_rest_goes_around_it(map_: Map) -> None:
    found = map_(FISH, "--json", "--explain", "--lock", "fin.R=hand.L", "--lock", "dorsal=head")
    assert found.partners["fin.R"] == "hand.L"
    assert found.partners["dorsal"] == "head"
    assert list(found.partners.values()).count("hand.L") == 1
    assert {pair["bone"] for pair in found.json["pairs"] if "decided" in pair} == {
        "fin.R", "dorsal",
    }  # fmt: skip
    ik = map_(FISH, "--json", "--mode", "ik", "--lock", "dorsal=hand.R")
    assert ik.partners["dorsal"] == "hand.R"


def test_a_whole_limb_is_locked_and_forbidden(map_: Map) -> None:
    assert map_(FISH, "--json").partners["fin.R"] == "upper_arm.R"
    locked = map_(FISH, "--json", "--lock", "fin.R=arm.L").partners
    for bone in ("fin.R", "fin_tip.R"):
        assert locked[bone] in ("shoulder.L", "upper_arm.L", "forearm.L", "hand.L")
    # The fin across gets the arm that this leaves free, and nothing else changes.
    assert locked["fin.L"] == "upper_arm.R"
    assert locked["head"] == "head"
    forbidden = map_(FISH, "--json", "--forbid", "fin.R=arm.R", "--forbid", "fin.L=arm.L").partners
    for side in "LR":
        for bone in (f"fin.{side}", f"fin_tip.{side}"):
            assert forbidden.get(bone) not in [
                f"{part}.{side}" for part in ("shoulder", "upper_arm", "forearm", "hand")
            ]


def test_what_is_forbidden_is_not_proposed_again(map_: Map) -> None:
    first = map_(FISH, "--json").partners
    arguments = [text for bone in first for text in ("--forbid", f"{bone}={first[bone]}")]
    second = map_(FISH, "--json", *arguments).partners
    assert second
    assert not set(first.items()) & set(second.items())
    ranked = map_(FISH, "--json", "--k", "5", *arguments).json
    for other in ranked["alternatives"]:
        assert not set(first.items()) & set(partners(other).items())


@pytest.mark.parametrize("block", BLOCKS)
def test_each_block_of_the_matrix_is_printed(map_: Map, block: str) -> None:
    found = map_(FISH, "--matrix", block, "--json").json
    assert set(found) == {"armature", "block", "bones", "human", "matrix"}
    armature = load_puppet(FISH).model.armature
    assert found["bones"] == list(armature.names)
    assert found["human"] == list(HUMAN_BONE_NAMES)
    np.testing.assert_allclose(found["matrix"], BLOCKS[block](armature, HUMAN), atol=1e-6)
    table = map_(FISH, "--matrix", block)
    assert table.code == 0
    assert f"fish: {block}" in table.out
    for word in (*armature.names, "forearm.L"):
        assert word in table.out, "a name is cut off"


def test_a_table_tells_people_what_drives_what_and_how_sure_that_is(map_: Map) -> None:
    done = map_(FISH)
    assert done.code == 0
    for word in ("forward kinematics", "turns with", "fin.R", "upper_arm.R", "dorsal",
                 "its parent", "likely"):  # fmt: skip
        assert word in done.out
    ik = map_(FISH, "--mode", "ik", "--explain", "--k", "2")
    for word in ("inverse kinematics", "goes with", "because", "geometry +", "choice 2",
                 "* is not as in the first"):  # fmt: skip
        assert word in ik.out
    locked = map_(FISH, "--lock", "fin.R=hand.L")
    row = next(line for line in locked.out.splitlines() if " fin.R " in line)
    assert "hand.L" in row
    assert "lock" in row


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("nothing.glb",), ("nothing.glb",)),
        (("empty.glb",), ("empty.glb",)),
        (("text.glb",), ("text.glb",)),
        (("alone.toml",), ("alone.glb",)),
        (("notes.pdf",), ("notes.pdf",)),
        ((FISH, "--mode", "xk"), ("--mode", "expected: fk or ik", "found:    xk")),
        ((FISH, "--lock", "fin.X=hand.L"), ("fish", "no such bone", "fin.R, fin_tip.R", "fin.X")),
        ((FISH, "--lock", "fin.R=hand.X"), ("fish", "no such human bone", "hand.R", "hand.X")),
        ((FISH, "--mode", "ik", "--lock", "fin.R=forearm.R"), ("control point", "forearm.R")),
        ((FISH, "--lock", "fin.R"), ("--lock", "not a pair", "BONE=HUMAN")),
        ((FISH, "--lock", "=hand.R"), ("--lock", "not a pair")),
        ((FISH, "--forbid", "fin.R="), ("--forbid", "not a pair")),
        ((FISH, "--lock", "fin.R=hand.L", "--lock", "fin.R=hand.R"),
         ("fin.R", "two things at once", "hand.L and hand.R")),
        ((FISH, "--lock", "fin.R=hand.L", "--lock", "fin.L=hand.L"),
         ("hand.L drives another bone already", "lock fin.R = hand.L", "clear fin.R first")),
        ((FISH, "--lock", "fin.R=hand.L", "--forbid", "fin.R=hand.L"),
         ("fin.R=hand.L", "locked and forbidden")),
        ((FISH, "--matrix", "beauty"), ("--matrix", "similarity, constraint, path", "beauty")),
        ((FISH, "--matrix", "path", "--mode", "ik"), ("--matrix", "of FK", "--explain")),
        ((FISH, "--k", "0"), ("--k", "1 to 50", "found:    0")),
        ((FISH, "--k", "51"), ("--k", "1 to 50")),
        ((FISH, "--k", "some"), ("--k", "integer")),
    ],
)  # fmt: skip
def test_what_cannot_be_is_told_with_what_can(
    map_: Map, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str | Path, ...], says: tuple[str, ...],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("empty.glb").touch()
    Path("text.glb").write_text("hello, this is text\n")
    Path("alone.toml").write_text("grounded = true\n")
    Path("notes.pdf").write_bytes(b"%PDF-1.4\n")
    done = map_(*arguments)
    assert done.code == 2, done.out
    assert done.out == ""
    for text in says:
        assert text in done.err
