"""The mapping service: what it decides holds, is told once, can be undone, and survives a kill."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

from puppet.armature import Armature
from puppet.errors import BadDecisionError, BadFileError, PuppetError
from puppet.formats.armature_toml import load_puppet
from puppet.formats.mapping_file import read_mappings
from puppet.mapping.decisions import Decision
from puppet.mapping.fingerprint import BoneRecord, bone_records
from puppet.mapping.proposal import Mode, Proposal
from puppet.mapping.service import MOST_PROPOSALS, MappingService, Rig
from puppet.mapping.verdicts import Verdicts
from puppet.skeleton import HUMAN_BONE_NAMES
from tests.shows import ARMATURES, REPOSITORY


@cache
def rig(name: str) -> Rig:
    return Rig(load_puppet(ARMATURES / f"{name}.glb").model.armature)


def lock(bone: str, human: str, mode: Mode = "fk") -> Decision:
    return Decision("lock", mode, bone, human)


def partners(proposal: Proposal) -> dict[str, str]:
    return {pair.name: pair.partner for pair in proposal.pairs}


class Heard:
    """What the stage would hear."""

    def __init__(self) -> None:
        self.changes: list[tuple[str, dict[str, str]]] = []

    def __call__(self, puppet: str, proposal: Proposal) -> None:
        self.changes.append((puppet, partners(proposal)))


@pytest.fixture
def heard() -> Heard:
    return Heard()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "show.mappings.toml"


@pytest.fixture
def service(path: Path, heard: Heard) -> MappingService:
    return MappingService({"fish": rig("fish"), "lamp": rig("lamp")}, path=path, on_change=heard)


def snapshot(service: MappingService) -> object:
    return [
        (name, partners(service.current(name)), service.history(name), service.verdicts(name))
        for name in service.names
    ]


def test_what_was_locked_holds_and_the_rest_is_mapped_around_it(service: MappingService) -> None:
    before = partners(service.current("lamp"))
    assert before["shade"] == "hand.R"
    after = service.decide("lamp", [lock("shade", "hand.L")])
    assert partners(after)["shade"] == "hand.L"
    assert partners(service.current("lamp")) == partners(after)
    pair = next(pair for pair in after.pairs if pair.name == "shade")
    assert pair.decided == "lock"
    humans = [pair.human for pair in after.pairs]
    assert len(set(humans)) == len(humans), "a human bone drives two bones, which nobody asked for"


def test_undo_and_redo_walk_through_the_same_mappings(service: MappingService) -> None:
    seen = [partners(service.current("fish"))]
    steps = (
        [lock("fin.R", "hand.L")],
        [Decision("mode", "ik"), lock("dorsal", "head", "ik")],
        [Decision("reject", "ik", "fin_tip.R", "hand.R")],
    )
    for step in steps:
        seen.append(partners(service.decide("fish", step)))
    for wanted in seen[-2::-1]:
        assert partners(service.undo("fish")) == wanted
    with pytest.raises(BadDecisionError, match="nothing to undo"):
        service.undo("fish")
    for wanted in seen[1:]:
        assert partners(service.redo("fish")) == wanted
    with pytest.raises(BadDecisionError, match="nothing to redo"):
        service.redo("fish")


def test_a_new_decision_drops_what_was_undone(service: MappingService) -> None:
    service.decide("fish", [lock("fin.R", "hand.L")])
    service.decide("fish", [lock("fin.L", "hand.R")])
    service.undo("fish")
    service.decide("fish", [lock("dorsal", "head")])
    assert service.history("fish").steps == ("lock fin.R = hand.L", "lock dorsal = head")
    with pytest.raises(BadDecisionError, match="nothing to redo"):
        service.redo("fish")


def test_undo_survives_a_restart(service: MappingService, path: Path) -> None:
    first = partners(service.current("fish"))
    second = partners(service.decide("fish", [lock("fin.R", "hand.L")], "Ann"))
    service.undo("fish")
    again = MappingService({"fish": rig("fish")}, path=path)
    assert partners(again.current("fish")) == first
    assert again.history("fish").steps == ("lock fin.R = hand.L (Ann)",)
    assert again.history("fish").holds == 0
    assert partners(again.redo("fish")) == second


def test_each_change_is_told_once_before_the_answer_and_after_the_disk(
    path: Path, heard: Heard
) -> None:
    answered = False
    holds: list[int] = []

    def hear(puppet: str, proposal: Proposal) -> None:
        assert not answered
        holds.append(read_mappings(path).puppets[0].holds)
        heard(puppet, proposal)

    service = MappingService({"fish": rig("fish")}, path=path, on_change=hear)
    changes: list[Callable[[], Proposal]] = [
        lambda: service.decide("fish", [lock("fin.R", "hand.L"), lock("fin.L", "hand.R")]),
        lambda: service.undo("fish"),
        lambda: service.redo("fish"),
    ]
    for number, change in enumerate(changes, start=1):
        answered = False
        answer = change()
        answered = True
        assert heard.changes[number - 1 :] == [("fish", partners(answer))]
    assert holds == [1, 0, 1]
    service.current("fish")
    service.propose("fish", "ik", 3)
    service.explain("fish", "fin.R")
    service.save()
    assert len(heard.changes) == 3, "asking is no change"


@pytest.mark.parametrize(
    ("decisions", "says"),
    [
        ([], "nothing was decided"),
        ([lock("fin.X", "hand.L")], "no such bone"),
        ([lock("fin.R", "hand.Q")], "no such human bone"),
        ([lock("fin_tip.R", "forearm.R", "ik")], "no such control point"),
        ([lock("fin.R", "hand.L"), lock("fin.R", "hand.R")], "two things at once"),
        ([lock("fin.R", "hand.L"), lock("fin.L", "hand.L")], "drives another bone already"),
        ([lock("fin.R", "hand.L"), Decision("forbid", "fk", "fin.R", "hand.L")], "and forbidden"),
        ([lock("fin.R", "hand.L"), lock("fin.X", "hand.R")], "no such bone"),
        ([Decision("ungroup", "ik", "wings")], "no such master"),
        ([Decision("group", "ik", "fin.R", effectors=("dorsal", "head"))], "name of a bone"),
        ([Decision("group", "ik", "", effectors=("dorsal", "head"))], "needs a name"),
        ([Decision("group", "ik", "fins", effectors=("dorsal",))], "two or more different"),
        ([Decision("group", "ik", "fins", effectors=("dorsal", "x"))], "no such bone"),
        ([Decision("forbid", "fk", bone, limb) for bone in rig("fish").armature.names
          for limb in HUMAN_BONE_NAMES], "nothing would drive"),
    ],
)  # fmt: skip
def test_a_refused_decision_changes_nothing(
    service: MappingService, path: Path, heard: Heard, decisions: list[Decision], says: str
) -> None:
    service.decide("fish", [lock("head", "head")])
    before, data, told = snapshot(service), path.read_bytes(), len(heard.changes)
    with pytest.raises(BadDecisionError, match=says) as caught:
        service.decide("fish", decisions)
    assert caught.value.where, "it is not said what this is about"
    assert snapshot(service) == before
    assert path.read_bytes() == data
    assert len(heard.changes) == told


def test_a_lock_that_another_step_contradicts_is_refused_with_what_to_do(
    service: MappingService,
) -> None:
    service.decide("fish", [lock("fin.R", "hand.L")])
    with pytest.raises(BadDecisionError, match=r"hand\.L drives another bone") as caught:
        service.decide("fish", [lock("fin.L", "hand.L")])
    assert caught.value.found == "lock fin.R = hand.L"
    assert "clear fin.R first" in str(caught.value.hint)
    both = service.decide("fish", [Decision("set", "fk", "fin.L", "hand.L")])
    assert partners(both)["fin.R"] == partners(both)["fin.L"] == "hand.L"


def test_no_decision_can_end_a_show() -> None:
    """A puppet that nothing drives does not start, so no decision may lead there."""
    stick = Rig(Armature.build("stick", ["stick"], [-1], [[0.0, 0.0, 0.0]]))
    service = MappingService({"stick": stick})
    assert service.current("stick").pairs
    with pytest.raises(BadDecisionError, match="nothing would drive") as caught:
        service.decide("stick", [Decision("mode", "ik")])
    assert "chain of two bones" in str(caught.value.hint)
    assert service.current("stick").mode == "fk"


@pytest.mark.parametrize("k", [0, -1, MOST_PROPOSALS + 1, 10**9])
def test_as_many_proposals_as_cannot_be_made_are_refused(service: MappingService, k: int) -> None:
    with pytest.raises(BadDecisionError) as caught:
        service.propose("fish", k=k)
    assert (caught.value.expected, caught.value.found) == (f"1 to {MOST_PROPOSALS}", str(k))


def test_the_k_best_are_different_and_best_first(service: MappingService) -> None:
    service.decide("fish", [lock("fin.R", "upper_arm.R")])
    for mode in ("fk", "ik"):
        found = service.propose("fish", mode, k=5)
        assert len(found) == 5
        assert len({tuple(sorted(partners(one).items())) for one in found}) == 5
        assert [one.mode for one in found] == [mode] * 5
    found = service.propose("fish", "fk", k=5)
    assert partners(found[0]) == partners(service.current("fish"))
    assert all(partners(one)["fin.R"] == "upper_arm.R" for one in found), "a lock is broken"
    # Best first; and once more for those that merely leave a limb out.
    merits = [one.merit for one in found]
    assert sum(later > earlier for earlier, later in pairwise(merits)) <= 1


def test_an_unknown_puppet_is_told_with_those_there_are(service: MappingService) -> None:
    asked: list[Callable[[], object]] = [
        lambda: service.current("dog"),
        lambda: service.propose("dog"),
        lambda: service.decide("dog", [Decision("mode", "ik")]),
        lambda: service.undo("dog"),
        lambda: service.redo("dog"),
        lambda: service.history("dog"),
        lambda: service.verdicts("dog"),
        lambda: service.warnings("dog"),
        lambda: service.explain("dog", "head"),
    ]
    for ask in asked:
        with pytest.raises(BadDecisionError, match="no such puppet") as caught:
            ask()
        assert (caught.value.expected, caught.value.found) == ("one of fish, lamp", "dog")


def test_fk_to_ik_and_back_gives_the_first_mapping_again(service: MappingService) -> None:
    service.decide("fish", [lock("fin.R", "forearm.R")])
    first = service.current("fish")
    moved = service.decide("fish", [Decision("mode", "ik")])
    assert moved.mode == "ik"
    assert set(partners(moved).values()) <= {"head", "hand.L", "hand.R", "foot.L", "foot.R"}
    back = service.decide("fish", [Decision("mode", "fk")])
    assert back.mode == "fk"
    assert back.pairs == first.pairs
    assert back.unmapped == first.unmapped


def test_what_is_said_of_fk_says_nothing_of_ik(service: MappingService) -> None:
    before = service.propose("fish", "ik")[0]
    service.decide("fish", [lock("head", "hand.L")])
    assert service.propose("fish", "ik")[0].pairs == before.pairs


def test_masters_are_made_and_taken_apart(path: Path) -> None:
    service = MappingService({"gull": rig("seagull")}, {"gull": "ik"}, path)
    before = partners(service.current("gull"))
    assert {"wing_tip.L", "wing_tip.R"} <= set(before)
    tips = ("wing_tip.L", "wing_tip.R")
    grouped = service.decide("gull", [Decision("group", "ik", "wings", effectors=tips)])
    assert not set(tips) & set(partners(grouped))
    pair = next(pair for pair in grouped.pairs if pair.name == "wings")
    assert {grouped.armature.names[bone] for bone in pair.bones} == set(tips)
    held = service.decide("gull", [lock("wings", "hand.L", "ik")])
    assert partners(held)["wings"] == "hand.L"
    with pytest.raises(BadDecisionError, match="another master already") as caught:
        service.decide("gull", [Decision("group", "ik", "more", effectors=("tail", "wing_tip.L"))])
    assert caught.value.hint == "ungroup wings first"
    again = MappingService({"gull": rig("seagull")}, {"gull": "ik"}, path)
    assert again.current("gull").pairs == held.pairs
    apart = again.decide("gull", [Decision("ungroup", "ik", "wings")])
    assert partners(apart) == before
    assert partners(again.undo("gull"))["wings"] == "hand.L"


def test_a_master_of_the_model_can_be_taken_apart_for_good(path: Path) -> None:
    puppet = load_puppet(ARMATURES / "seagull_with_master.toml")
    gull = Rig(puppet.model.armature, masters=dict(puppet.traits.masters))
    service = MappingService({"gull": gull}, {"gull": "ik"}, path)
    assert "wings" in partners(service.current("gull"))
    service.decide("gull", [Decision("ungroup", "ik", "wings")])
    again = MappingService({"gull": gull}, {"gull": "ik"}, path)
    assert "wings" not in partners(again.current("gull"))
    assert again.warnings("gull") == ()
    # A model whose file has no master any more has none, whatever else was decided of it.
    plain = MappingService({"gull": rig("seagull")}, {"gull": "ik"}, path)
    assert "wings" not in partners(plain.current("gull"))


def test_every_pair_is_explained_and_what_is_not_there_is_told(service: MappingService) -> None:
    service.decide("fish", [lock("fin.R", "hand.L")])
    for mode in ("fk", "ik"):
        for pair in service.propose("fish", mode)[0].pairs:
            reason = service.explain("fish", pair.name, mode)
            assert reason == pair
            assert reason.reasons
            assert sum(reason.reasons.values()) == pytest.approx(reason.score, abs=0.01)
    locked = service.explain("fish", "fin.R")
    assert locked is not None
    assert (locked.partner, locked.decided) == ("hand.L", "lock")
    assert "hand.L" not in [HUMAN_BONE_NAMES[other.human] for other in locked.runners_up]
    for name in service.current("fish").unmapped:
        assert service.explain("fish", name) is None
    with pytest.raises(BadDecisionError, match="no such bone") as caught:
        service.explain("fish", "gill")
    assert caught.value.where == "fish"


def test_a_file_that_somebody_edited_is_read_anew_and_told(
    service: MappingService, path: Path, heard: Heard
) -> None:
    service.decide("lamp", [lock("shade", "hand.L")])
    service.decide("fish", [lock("fin.R", "hand.L")])
    edited = path.read_text().replace(
        'bone = "shade", human = "hand.L"', 'bone = "shade", human = "head"'
    )
    path.write_text(edited.replace('bone = "fin.R", human', 'bone = "fin.Q", human'))
    heard.changes.clear()
    warnings = service.load()
    assert warnings == ("fish: left out “lock fin.Q = hand.L”: there is no such bone (fin.Q)",)
    assert partners(service.current("lamp"))["shade"] == "head"
    assert service.history("fish").steps == ()
    assert heard.changes == [(name, partners(service.current(name))) for name in ("fish", "lamp")]
    path.unlink()
    assert service.load() == ()
    assert partners(service.current("lamp"))["shade"] == "hand.R"


@pytest.mark.parametrize("spoil", ["cut", "version", "garbage"])
def test_loading_a_broken_file_leaves_all_as_it_was(
    service: MappingService, path: Path, heard: Heard, spoil: str
) -> None:
    service.decide("fish", [lock("fin.R", "hand.L")])
    service.decide("lamp", [Decision("mode", "ik")])
    before, told, whole = snapshot(service), len(heard.changes), path.read_bytes()
    path.write_bytes(
        {
            "cut": whole[: len(whole) // 2],
            "version": whole.replace(b"version = 1", b"version = 9"),
            "garbage": b"\x00\xff" * 50,
        }[spoil]
    )
    with pytest.raises(BadFileError) as caught:
        service.load()
    assert str(path) in str(caught.value)
    assert snapshot(service) == before
    assert len(heard.changes) == told
    path.write_bytes(whole)
    assert service.load() == ()
    assert snapshot(service) == before


def test_a_file_after_which_a_puppet_would_stand_still_is_refused_whole(
    service: MappingService, path: Path, heard: Heard
) -> None:
    service.decide("fish", [lock("fin.R", "hand.L")])
    service.decide("lamp", [lock("shade", "hand.L")])
    before, told = snapshot(service), len(heard.changes)
    bones = rig("lamp").armature.names
    rows = ", ".join(
        f'{{act = "forbid", mode = "fk", bone = "{bone}", human = "{human}"}}'
        for bone in bones
        for human in HUMAN_BONE_NAMES
    )
    edited = path.read_text().replace('human = "hand.L"', 'human = "hand.R"', 1)
    head, lamp = edited.split('puppet = "lamp"')
    steps = lamp.split("steps = [\n")[1].split("\n]\n")[0]
    lamp = lamp.replace(steps, f"    {{decisions = [{rows}]}},")
    path.write_text(f'{head}puppet = "lamp"{lamp}')
    with pytest.raises(BadDecisionError, match="nothing would drive") as caught:
        service.load()
    assert caught.value.where == f"{path}: lamp"
    assert snapshot(service) == before, "the edit of the fish was taken over, and not the lamp's"
    assert len(heard.changes) == told


def test_many_proposals_do_not_hold_up_a_decision(monkeypatch: pytest.MonkeyPatch) -> None:
    service = MappingService({"fish": rig("fish")})
    begun, goes_on = threading.Event(), threading.Event()
    propose = Rig.propose

    def slowly(self: Rig, verdicts: Verdicts, mode: Mode | None = None, k: int = 1) -> object:
        if k > 1:
            begun.set()
            assert goes_on.wait(30.0)
        return propose(self, verdicts, mode, k)

    monkeypatch.setattr(Rig, "propose", slowly)
    found: list[list[Proposal]] = []
    asks = threading.Thread(target=lambda: found.append(service.propose("fish", k=3)))
    asks.start()
    assert begun.wait(30.0)
    decides = threading.Thread(target=lambda: service.decide("fish", [lock("head", "hand.L")]))
    decides.start()
    decides.join(30.0)
    waited = decides.is_alive()
    goes_on.set()
    asks.join(30.0)
    decides.join(30.0)
    assert not waited
    # The answer is of the instant at which it was asked for.
    assert partners(found[0][0])["head"] == "head"
    assert partners(service.current("fish"))["head"] == "hand.L"


def test_a_pair_is_explained_with_the_proposal_that_it_is_of(service: MappingService) -> None:
    pair, proposal = service.explained("fish", "fin.R", "ik")
    assert pair is None
    assert proposal.mode == "ik"
    pair, proposal = service.explained("fish", "fin.R")
    assert pair in proposal.pairs


def test_bones_are_looked_at_once_for_all_decisions(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked = []

    def records(armature: Armature) -> dict[str, BoneRecord]:
        looked.append(armature.name)
        return bone_records(armature)

    monkeypatch.setattr("puppet.mapping.service.bone_records", records)
    fresh = Rig(rig("fish").armature)
    service = MappingService({"fish": fresh}, path=path)
    for human in ("hand.L", "hand.R", "head"):
        service.decide("fish", [lock("fin.R", human)])
    service.load()
    assert looked == ["fish"]


def test_the_shows_mode_holds_until_another_was_decided(path: Path) -> None:
    service = MappingService({"fish": rig("fish")}, {"fish": "ik"}, path)
    assert service.current("fish").mode == "ik"
    service.decide("fish", [lock("fin.R", "hand.L")])
    # The show was changed to FK, and nobody decided against it.
    again = MappingService({"fish": rig("fish")}, {"fish": "fk"}, path)
    assert again.current("fish").mode == "fk"
    again.decide("fish", [Decision("mode", "ik")])
    assert MappingService({"fish": rig("fish")}, {"fish": "fk"}, path).current("fish").mode == "ik"


def test_without_a_file_there_is_nothing_to_save_or_load() -> None:
    service = MappingService({"fish": rig("fish")})
    for ask in (service.save, service.load):
        with pytest.raises(BadDecisionError, match="in memory only"):
            ask()


def test_save_writes_a_file_that_was_lost(service: MappingService, path: Path) -> None:
    service.decide("fish", [lock("fin.R", "hand.L")])
    data = path.read_bytes()
    path.unlink()
    assert service.save() == path
    assert path.read_bytes() == data


def test_many_who_decide_at_once_lose_nothing(service: MappingService, path: Path) -> None:
    failed: list[BaseException] = []

    def decide(name: str) -> None:
        try:
            for _ in range(10):
                service.decide("fish", [Decision("mode", "fk")], name)
                service.propose("lamp", "ik", 2)
                service.history("fish")
        except PuppetError as error:
            failed.append(error)

    threads = [threading.Thread(target=decide, args=(f"{n}",)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert failed == []
    steps = MappingService({"fish": rig("fish")}, path=path).history("fish").steps
    assert sorted(steps) == sorted(f"drive it by FK ({n})" for n in range(4) for _ in range(10))


KILLS = 15
#: Forks a process that decides without end and says what was confirmed, and kills it, again and
#: again. Prints for each kill what was confirmed last, what the file says then, and the litter.
KILLER = """
import os, random, select, signal, sys, time
from pathlib import Path
from puppet.formats.armature_toml import load_puppet
from puppet.formats.mapping_file import read_mappings
from puppet.mapping.decisions import Decision
from puppet.mapping.fingerprint import BoneRecord, bone_records
from puppet.mapping.service import MappingService, Rig

path, model, kills = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
rigs = {"fish": Rig(load_puppet(model).model.armature)}
MappingService(rigs).current("fish")
rng = random.Random(5)

def last_on_disk():
    service = MappingService(rigs, path=path)  # fails if the file is not whole
    service.current("fish")
    entries = read_mappings(path).puppets
    return int(entries[0].steps[-1].decisions[0].who) if entries else 0

def decide(out, number):
    service = MappingService(rigs, path=path)
    while True:
        number += 1
        human = ("hand.L", "hand.R")[number % 2]
        service.decide("fish", [Decision("lock", "fk", "fin.R", human)], str(number))
        os.write(out, b"%d\\n" % number)

for _ in range(kills):
    start = last_on_disk()
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        try:
            decide(write, start)
        finally:
            os._exit(1)
    os.close(write)
    select.select([read], [], [], 20.0)  # it has begun
    time.sleep(rng.uniform(0.0, 0.08))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    said = b""
    while data := os.read(read, 65536):
        said += data
    os.close(read)
    litter = sum(1 for left in path.parent.iterdir() if left != path)
    print(start, said.split()[-1].decode(), last_on_disk(), litter, flush=True)
"""


def test_what_was_confirmed_survives_a_kill_at_any_instant(path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", KILLER, str(path), str(ARMATURES / "fish.glb"), str(KILLS)],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    rows = [tuple(map(int, line.split())) for line in done.stdout.splitlines()]
    assert len(rows) == KILLS
    for number, (start, confirmed, on_disk, litter) in enumerate(rows, start=1):
        assert start < confirmed, "nothing was decided before the kill"
        # One more may be there: written, but killed before it could be said.
        assert confirmed <= on_disk <= confirmed + 1
        assert litter <= number, "more is left over than one part of a file for each kill"
