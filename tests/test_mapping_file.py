"""The mapping file: what is read is what was written, and what is spoilt is refused by name."""

from __future__ import annotations

import os
import stat
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.errors import BadFileError, UnavailableError
from puppet.formats.armature_toml import load_puppet
from puppet.formats.mapping_file import (
    BoneRow,
    Entry,
    KeptRecord,
    MappingFile,
    StepRow,
    mappings_path,
    read_mappings,
    write_mappings,
)
from puppet.mapping.decisions import Act, Decision
from puppet.mapping.proposal import Mode
from puppet.mapping.service import MappingService, Rig
from tests.shows import ARMATURES

TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
MODES: st.SearchStrategy[Mode] = st.sampled_from(["fk", "ik"])
ACTS: st.SearchStrategy[Act] = st.sampled_from(
    ["accept", "lock", "set", "reject", "forbid", "clear", "mode", "group", "ungroup"]
)
DECISIONS = st.builds(
    Decision, ACTS, MODES, TEXT, TEXT, st.lists(TEXT, max_size=3).map(tuple), TEXT, TEXT
)
STEPS = st.lists(DECISIONS, min_size=1, max_size=3).map(lambda step: StepRow(tuple(step)))
RECORDS = st.builds(KeptRecord, MODES, TEXT, TEXT, ACTS)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
BONES = st.builds(BoneRow, TEXT, TEXT, st.tuples(*[NUMBERS] * 7))


@st.composite
def entries(draw: st.DrawFn) -> Entry:
    steps = tuple(draw(st.lists(STEPS, max_size=4)))
    return Entry(
        puppet=draw(TEXT),
        fingerprint=draw(TEXT),
        mode=draw(st.none() | MODES),
        holds=draw(st.integers(0, len(steps))),
        steps=steps,
        kept=tuple(draw(st.lists(RECORDS, max_size=2))),
        banned=tuple(draw(st.lists(RECORDS, max_size=2))),
        masters=draw(st.dictionaries(TEXT, st.lists(TEXT, max_size=3).map(tuple), max_size=2)),
        bones=tuple(draw(st.lists(BONES, max_size=3))),
    )


FILES = st.lists(entries(), max_size=3).map(lambda puppets: MappingFile(puppets=tuple(puppets)))


@cache
def rig(name: str) -> Rig:
    return Rig(load_puppet(ARMATURES / f"{name}.glb").model.armature)


def changed(armature: Armature, *, rename: dict[str, str] | None = None) -> Armature:
    names = tuple((rename or {}).get(bone, bone) for bone in armature.names)
    return replace(armature, names=names)


def partners(service: MappingService, puppet: str) -> dict[str, str]:
    return {pair.name: pair.partner for pair in service.current(puppet).pairs}


def lock(bone: str, human: str) -> list[Decision]:
    return [Decision("lock", "fk", bone, human)]


@given(FILES)
def test_what_is_read_is_what_was_written(
    tmp_path_factory: pytest.TempPathFactory, file: MappingFile
) -> None:
    path = tmp_path_factory.mktemp("kept") / "show.mappings.toml"
    write_mappings(path, file)
    assert read_mappings(path) == file
    tomllib.loads(path.read_text(encoding="utf-8"))  # any other reader of TOML reads it too


def test_no_file_is_no_decisions(tmp_path: Path) -> None:
    assert read_mappings(tmp_path / "none.toml") == MappingFile()
    assert mappings_path(tmp_path / "my.show.toml") == tmp_path / "my.show.mappings.toml"


def test_people_can_read_what_was_decided(tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    service = MappingService({"fish": rig("fish")}, path=path)
    service.decide("fish", lock("fin.R", "hand.L"), "Ann")
    service.decide("fish", [Decision("mode", "ik"), Decision("lock", "ik", "dorsal", "head")])
    text = path.read_text()
    assert "# lock fin.R = hand.L\n" in text
    assert "# drive it by IK; lock dorsal = head\n" in text
    assert 'bone = "fin.R", human = "hand.L", who = "Ann"' in text
    assert "puppet writes this file" in text
    assert max(map(len, text.splitlines())) < 300


def test_a_name_that_spans_lines_cannot_break_the_file(tmp_path: Path) -> None:
    armature = changed(rig("fish").armature, rename={"fin.R": 'fin\n[[puppets]]\x07"'})
    path = tmp_path / "kept.toml"
    service = MappingService({"fish": Rig(armature)}, path=path)
    service.decide("fish", lock('fin\n[[puppets]]\x07"', "hand.L"))
    again = MappingService({"fish": Rig(armature)}, path=path)
    assert partners(again, "fish") == partners(service, "fish")
    assert again.history("fish").holds == 1


def test_what_is_not_on_stage_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    MappingService({"lamp": rig("lamp")}, path=path).decide("lamp", lock("shade", "hand.L"))
    MappingService({"fish": rig("fish")}, path=path).decide("fish", lock("fin.R", "hand.L"))
    again = MappingService({"lamp": rig("lamp")}, path=path)
    assert partners(again, "lamp")["shade"] == "hand.L"


def test_the_same_rig_under_another_name_is_recognised(tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    MappingService({"lamp": rig("lamp")}, path=path).decide("lamp", lock("shade", "hand.L"))
    renamed = MappingService({"Luxo": rig("lamp")}, path=path)
    assert partners(renamed, "Luxo")["shade"] == "hand.L"
    assert renamed.warnings("Luxo") == ()
    renamed.decide("Luxo", lock("base", "head"))
    # From then on each name has an entry of its own.
    assert "base" in partners(MappingService({"lamp": rig("lamp")}, path=path), "lamp")
    assert partners(MappingService({"lamp": rig("lamp")}, path=path), "lamp")["base"] != "head"


def test_two_puppets_with_the_same_rig_keep_decisions_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    twins = {"one": rig("lamp"), "two": rig("lamp")}
    service = MappingService(twins, path=path)
    untouched = partners(service, "two")
    service.decide("one", lock("shade", "hand.L"))
    again = MappingService(twins, path=path)
    assert partners(again, "one")["shade"] == "hand.L"
    assert partners(again, "two") == untouched, "what was decided of one drives the other"
    again.decide("two", lock("shade", "head"))
    third = MappingService(twins, path=path)
    assert partners(third, "one")["shade"] == "hand.L"
    assert partners(third, "two")["shade"] == "head"


def test_a_rig_that_differs_by_rounding_only_is_the_same(tmp_path: Path) -> None:
    """A model that was exported again, at another scale and in single precision."""
    path = tmp_path / "kept.toml"
    fish = rig("fish").armature
    MappingService({"fish": Rig(fish)}, path=path).decide("fish", lock("fin.R", "hand.L"))
    noise = np.random.default_rng(0)
    for _ in range(20):
        again = replace(
            fish,
            offsets=100.0 * fish.offsets * (1 + noise.uniform(-1e-6, 1e-6, fish.offsets.shape)),
            rotations=fish.rotations + noise.uniform(-1e-6, 1e-6, fish.rotations.shape),
        )
        service = MappingService({"fish": Rig(again)}, path=path)
        assert service.warnings("fish") == ()
        assert partners(service, "fish")["fin.R"] == "hand.L"


def test_a_changed_rig_keeps_what_fits_and_says_what_does_not(tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    fish = rig("fish").armature
    service = MappingService({"fish": Rig(fish)}, path=path)
    service.decide("fish", lock("fin.R", "hand.L"))
    service.decide("fish", lock("dorsal", "head"))
    before = read_mappings(path)
    rotations = np.array(fish.rotations)
    rotations[fish.index("back")] = np.roll(rotations[fish.index("back")], 1)
    other = Rig(changed(replace(fish, rotations=rotations), rename={"dorsal": "sail"}))
    met = MappingService({"fish": other}, path=path)
    assert partners(met, "fish")["fin.R"] == "hand.L"
    assert met.history("fish").steps == ("lock fin.R = hand.L",)
    changes, left_out = met.warnings("fish")
    for words in ("fish: its rig has changed", "dorsal is gone", "sail is new, on",
                  "back rests differently"):  # fmt: skip
        assert words in changes
    assert "fin.R" not in changes, "a bone that is as it was is reported"
    assert "left out “lock dorsal = head”" in left_out
    assert "there is no such bone (dorsal)" in left_out
    met.decide("fish", lock("sail", "head"))
    assert read_mappings(path).entry("fish", before.puppets[0].fingerprint) == before.puppets[0]
    back = MappingService({"fish": Rig(fish)}, path=path)
    assert back.warnings("fish") == ()
    assert partners(back, "fish")["dorsal"] == "head"


def test_a_file_of_another_rig_leaves_this_one_as_proposed(tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    MappingService({"lamp": rig("lamp")}, path=path).decide("lamp", lock("shade", "hand.L"))
    fresh = MappingService({"fish": rig("fish")})
    service = MappingService({"fish": rig("fish")}, path=path)
    assert partners(service, "fish") == partners(fresh, "fish")
    assert service.warnings("fish") == ()
    # The same name on a wholly other rig: nothing fits, and that is said.
    namesake = MappingService({"lamp": rig("fish")}, path=path)
    assert partners(namesake, "lamp") == partners(fresh, "fish")
    assert "shade is gone" in namesake.warnings("lamp")[0]
    assert "left out" in namesake.warnings("lamp")[1]


@pytest.fixture(scope="module")
def decided() -> bytes:
    """A mapping file with two puppets, locks, a ban, a mode and something undone."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "kept.toml"
        service = MappingService({"fish": rig("fish"), "lamp": rig("lamp")}, path=path)
        service.decide("fish", lock("fin.R", "hand.L"), "Ann")
        service.decide("fish", [Decision("forbid", "fk", "fin.L", "arm.R")])
        service.decide("lamp", [Decision("mode", "ik")])
        service.decide("lamp", lock("base", "head"))
        service.undo("lamp")
        return path.read_bytes()


@given(st.data())
def test_a_file_that_was_cut_off_anywhere_is_refused(
    tmp_path_factory: pytest.TempPathFactory, decided: bytes, data: st.DataObject
) -> None:
    whole = decided.rindex(b"[end]") + len(b"[end]")
    # Hypothesis likes small numbers; the ends of lines, where a cut leaves TOML, are the hard ones.
    ends = [place for place, byte in enumerate(decided[:whole]) if byte == ord("\n")]
    length = data.draw(st.integers(0, whole - 1) | st.sampled_from(ends))
    path = tmp_path_factory.mktemp("cut") / "show.mappings.toml"
    path.write_bytes(decided[:length])
    with pytest.raises(BadFileError, match="cut off") as caught:
        read_mappings(path)
    assert str(path) in str(caught.value)
    with pytest.raises(BadFileError):
        MappingService({"fish": rig("fish")}, path=path)
    assert path.read_bytes() == decided[:length], "a file that was refused was touched"


def test_a_file_that_lost_only_its_last_comment_is_whole(tmp_path: Path, decided: bytes) -> None:
    path = tmp_path / "kept.toml"
    path.write_bytes(decided)
    file = read_mappings(path)
    for length in range(decided.rindex(b"[end]") + 5, len(decided)):
        path.write_bytes(decided[:length])
        assert read_mappings(path) == file


GOOD = """
version = 1
[[puppets]]
puppet = "fish"
fingerprint = "0123456789abcdef"
holds = 1
steps = [{decisions = [{act = "lock", mode = "fk", bone = "fin.R", human = "hand.L"}]}]
[end]
"""


@pytest.mark.parametrize(
    ("was", "becomes", "place", "says"),
    [
        ("version = 1", "version = 2", "", "of another version"),
        ("version = 1", "", "", "no version"),
        ("version = 1", 'version = "1"', "", "of another version"),
        ("version = 1", "version = true", "version", "expected `int`"),
        ("version = 1", "version =", "", "not TOML"),
        ("version = 1", "version = 1\nx = " + "[" * 4000, "", "not TOML"),
        ("[end]", "", "", "cut off"),
        ("[end]", "[end]\nmine = 3", "end[...]", "expected `bool`"),
        ("holds = 1", "holds = 1\nmood = 3", "puppets[0]", "unknown field `mood`"),
        ("holds = 1", "holds = -1", "puppets[0].holds", ">= 0"),
        ("holds = 1", "holds = 2", "puppets[0].holds", "more steps hold than there are"),
        ("holds = 1", 'holds = "all"', "puppets[0].holds", "expected `int`"),
        ('"lock"', '"glue"', "puppets[0].steps[0].decisions[0].act", "glue"),
        ('"fk"', '"xk"', "puppets[0].steps[0].decisions[0].mode", "xk"),
        ('human = "hand.L"', "human = 3", "puppets[0].steps[0].decisions[0].human", "`str`"),
        ('puppet = "fish"', "", "puppets[0]", "required field `puppet`"),
        ("holds = 1", 'holds = 1\nbones = [{name = "a", parent = "", rest = [1.0]}]',
         "puppets[0].bones[0].rest", "7"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused_with_its_place(
    tmp_path: Path, was: str, becomes: str, place: str, says: str
) -> None:
    path = tmp_path / "kept.toml"
    path.write_text(GOOD)
    read_mappings(path)
    assert GOOD.count(was) == 1
    path.write_text(GOOD.replace(was, becomes))
    with pytest.raises(BadFileError) as caught:
        read_mappings(path)
    assert says in str(caught.value)
    assert caught.value.where == (f"{path}: {place}" if place else str(path))
    assert caught.value.hint


@pytest.mark.parametrize("data", [b"\xff\xfe\x00", b"version = 1\nx = '\xff'", b"\x00" * 40])
def test_bytes_that_are_no_text_are_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "kept.toml"
    path.write_bytes(data)
    with pytest.raises(BadFileError, match="not TOML"):
        read_mappings(path)


def test_a_folder_in_the_place_of_the_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(BadFileError, match="cannot be read"):
        read_mappings(tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(BadFileError, match="cannot be read"):
        read_mappings(tmp_path / "file" / "kept.toml")


def test_a_bone_or_human_bone_that_is_not_there_is_left_out_and_named(tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    fish = rig("fish")
    text = GOOD.replace("0123456789abcdef", fish.fingerprint)
    path.write_text(text.replace("fin.R", "fin.X"))
    service = MappingService({"fish": fish}, path=path)
    assert service.warnings("fish") == (
        "fish: left out “lock fin.X = hand.L”: there is no such bone (fin.X)",
    )
    path.write_text(text.replace("hand.L", "wing"))
    service = MappingService({"fish": fish}, path=path)
    assert "there is no such human bone or limb (wing)" in service.warnings("fish")[0]
    assert service.history("fish").steps == ()


@pytest.mark.parametrize("obstacle", ["no folder", "a file in the folder's place"])
def test_what_cannot_be_saved_does_not_hold(tmp_path: Path, obstacle: str) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    path = folder / "kept.toml"
    heard: list[str] = []
    service = MappingService(
        {"fish": rig("fish")}, path=path, on_change=lambda name, _: heard.append(name)
    )
    before = partners(service, "fish")
    folder.rmdir()
    if obstacle != "no folder":
        folder.touch()
    for change in (
        lambda: service.decide("fish", lock("fin.R", "hand.L")),
        service.save,
    ):
        with pytest.raises(UnavailableError, match="cannot be saved") as caught:
            change()
        assert caught.value.where == str(path)
        assert caught.value.hint
    assert partners(service, "fish") == before
    assert service.history("fish").steps == ()
    assert heard == []
    assert [p.name for p in tmp_path.iterdir()] == ([] if obstacle == "no folder" else ["folder"])
    # Once it can be saved again, everything works.
    folder.unlink(missing_ok=True)
    folder.mkdir()
    service.decide("fish", lock("fin.R", "hand.L"))
    assert partners(MappingService({"fish": rig("fish")}, path=path), "fish")["fin.R"] == "hand.L"


def test_a_file_keeps_its_permissions_and_a_link_stays_a_link(tmp_path: Path) -> None:
    kept, link = tmp_path / "kept.toml", tmp_path / "link.toml"
    service = MappingService({"fish": rig("fish")}, path=kept)
    service.decide("fish", lock("fin.R", "hand.L"))
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(kept.stat().st_mode) == 0o666 & ~umask, "others cannot read it"
    kept.chmod(0o640)
    link.symlink_to(kept)
    linked = MappingService({"fish": rig("fish")}, path=link)
    linked.decide("fish", lock("fin.L", "hand.R"))
    assert link.is_symlink()
    assert stat.S_IMODE(kept.stat().st_mode) == 0o640
    assert MappingService({"fish": rig("fish")}, path=kept).history("fish").holds == 2


def test_what_killed_writers_left_is_removed_when_it_is_old(tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    old, new, other = (
        tmp_path / name for name in (".kept.toml.1-a", ".kept.toml.2-b", ".other.toml.1-a")
    )
    for left in (old, new, other):
        left.write_text("version = ")
    for left in (old, other):
        os.utime(left, (1.0, 1.0))
    write_mappings(path, MappingFile())
    assert not old.exists()
    assert new.exists(), "somebody may be writing it just now"
    assert other.exists()


def test_two_shows_that_share_a_file_lose_nothing_of_each_other(tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    one = MappingService({"fish": rig("fish")}, path=path)
    two = MappingService({"lamp": rig("lamp")}, path=path)
    for _ in range(3):
        one.decide("fish", lock("fin.R", "hand.L"))
        two.decide("lamp", lock("shade", "hand.L"))
    assert {entry.puppet: entry.holds for entry in read_mappings(path).puppets} == {
        "fish": 3,
        "lamp": 3,
    }


def test_an_edit_that_makes_no_sense_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "kept.toml"
    service = MappingService({"fish": rig("fish")}, path=path)
    service.decide("fish", lock("fin.R", "hand.L"))
    spoilt = path.read_text().replace("version = 1", "version = one")
    path.write_text(spoilt)
    with pytest.raises(BadFileError, match="not TOML"):
        service.decide("fish", lock("fin.L", "hand.R"))
    assert path.read_text() == spoilt
    assert service.history("fish").steps == ("lock fin.R = hand.L",)


def test_the_oldest_of_many_steps_still_hold(tmp_path: Path) -> None:
    """A ledger drops its oldest steps one day; what they came to does not go with them."""
    path = tmp_path / "kept.toml"
    puppet = load_puppet(ARMATURES / "seagull_with_master.toml")
    gull = Rig(puppet.model.armature, masters=dict(puppet.traits.masters))
    service = MappingService({"gull": gull}, path=path)
    service.decide("gull", [Decision("ungroup", "ik", "wings")])
    service.decide("gull", [Decision("mode", "ik")])
    service.decide("gull", [Decision("set", "fk", "neck", "head")])
    service.decide("gull", [Decision("lock", "fk", "tail", "hand.L")])
    service.decide("gull", [Decision("set", "fk", "neck", "hand.L")])
    service.decide("gull", [Decision("forbid", "fk", "head", "head")])
    entry = read_mappings(path).puppets[0]
    more = Decision("lock", "fk", "pelvis", "pelvis")
    many = (*entry.steps, *[StepRow((more,))] * 493)
    write_mappings(
        path,
        MappingFile(puppets=(msgspec.structs.replace(entry, steps=many, holds=len(many)),)),
    )
    service = MappingService({"gull": gull}, path=path)
    for _ in range(10):
        service.decide("gull", [more])
    again = MappingService({"gull": gull}, {"gull": "fk"}, path=path)
    assert again.warnings("gull") == ()
    assert again.verdicts("gull") == service.verdicts("gull")
    assert again.verdicts("gull").masters == {}
    assert again.verdicts("gull").mode == "ik"
    assert again.history("gull") == service.history("gull")
    for _ in range(3):
        assert again.undo("gull").mode == "ik"
    assert again.history("gull").holds == 497
