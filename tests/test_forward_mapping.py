"""FK mapping: what is proposed, in which order, why, and what must not matter.

The published mappings are in test_published_mappings.py.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.mapping.anatomy import anatomy
from puppet.mapping.decisions import Decision
from puppet.mapping.evidence import gather
from puppet.mapping.forward import propose_forward
from puppet.mapping.human import HUMAN_LIMBS, LIMB_NAMES
from puppet.mapping.preferences import LimbName, Preferences
from puppet.mapping.proposal import Mode
from puppet.mapping.verdicts import Verdicts
from tests.armatures import armature_of, armatures
from tests.mapping_claims import check_possible, check_reasons, check_sound, decided, pairs_of
from tests.rig_changes import (
    CAST,
    MODES,
    bare,
    by_name,
    creatures,
    limb,
    mirrored,
    numbered,
    other_side,
    placed,
    propose,
    renamed,
    reordered,
    retold,
    shipped,
)

any_armature = st.one_of(armatures(), creatures())


def mapping(armature: Armature, preferences: Preferences | None = None) -> dict[str, str]:
    return by_name(propose_forward(gather(armature, preferences))[0])


def decide(armature: Armature, *acts: Decision) -> Verdicts:
    verdicts = Verdicts()
    for act in acts:
        verdicts = verdicts.with_act(act, armature)
    return verdicts


# -- any armature, any decisions --------------------------------------------------------------


@given(any_armature)
def test_any_armature_gets_a_mapping_without_doubles(armature: Armature) -> None:
    proposal = propose_forward(armature)[0]
    assert proposal.pairs
    check_sound(proposal, Verdicts())
    check_reasons(proposal)
    told = {pair.name for pair in proposal.pairs} | set(proposal.unmapped)
    assert told == set(armature.names)
    assert len(proposal.pairs) + len(proposal.unmapped) == len(armature)


@given(any_armature, st.data(), st.integers(1, 6))
def test_what_was_decided_holds_in_every_proposal(
    armature: Armature, data: st.DataObject, k: int
) -> None:
    verdicts = data.draw(decided(armature, "fk"))
    proposals = propose_forward(armature, verdicts, k)
    assert 1 <= len(proposals) <= k
    for proposal in proposals:
        check_sound(proposal, verdicts)
        check_reasons(proposal)


@given(any_armature, st.data())
def test_leftovers_and_shoulders_do_not_break_what_was_decided(
    armature: Armature, data: st.DataObject
) -> None:
    verdicts = data.draw(decided(armature, "fk"))
    wishes = Preferences(shoulders=True, leftovers=True)
    for proposal in propose_forward(gather(armature, wishes), verdicts, 3):
        check_sound(proposal, verdicts)


@given(any_armature, st.data())
def test_proposals_are_all_different_and_the_best_comes_first(
    armature: Armature, data: st.DataObject
) -> None:
    """First the whole ones, best first; then those that merely drop a pair, best first."""
    proposals = propose_forward(armature, data.draw(decided(armature, "fk")), 6)
    assert len({pairs_of(proposal) for proposal in proposals}) == len(proposals)
    merits = [round(proposal.merit, 12) for proposal in proposals]
    assert merits[0] == max(merits)
    assert (np.diff(merits) > 0.0).sum() <= 1


@given(any_armature, st.data())
def test_fewer_proposals_are_the_first_of_more(armature: Armature, data: st.DataObject) -> None:
    verdicts = data.draw(decided(armature, "fk"))
    six = [pairs_of(proposal) for proposal in propose_forward(armature, verdicts, 6)]
    for k in (1, 2, 3):
        few = [pairs_of(proposal) for proposal in propose_forward(armature, verdicts, k)]
        assert few == six[:k]


@given(creatures(), st.data())
def test_what_can_never_be_is_no_runner_up(armature: Armature, data: st.DataObject) -> None:
    verdicts = data.draw(decided(armature, "fk", most=3))
    proposal = propose_forward(armature, verdicts)[0]
    check_possible(proposal, verdicts, anatomy(armature).sides)


@given(any_armature)
def test_what_is_known_already_need_not_be_worked_out_again(armature: Armature) -> None:
    evidence = gather(armature)
    assert propose_forward(evidence)[0].pairs == propose_forward(armature)[0].pairs


# -- what must not matter ---------------------------------------------------------------------


@given(any_armature, st.data())
def test_the_order_of_bones_does_not_matter(armature: Armature, data: st.DataObject) -> None:
    order = data.draw(st.permutations(range(len(armature))))
    told = [pairs_of(p) for p in propose_forward(reordered(armature, order), k=3)]
    assert told == [pairs_of(p) for p in propose_forward(armature, k=3)]


@given(creatures())
def test_in_a_mirror_left_and_right_change_places(armature: Armature) -> None:
    """With the other hand leading, which is what a mirror shows. Twigs in the middle for which
    nothing speaks at all may go to either hand."""
    proposal = propose_forward(armature)[0]
    if not any(armature.sides) or any(pair.score == 0.0 for pair in proposal.pairs):
        return
    seen = mapping(mirrored(armature), Preferences(hand="L"))
    expected = {other_side(b): other_side(human) for b, human in by_name(proposal).items()}
    assert seen == expected


@given(creatures(), st.floats(1e-3, 1e3), st.tuples(*[st.floats(-100, 100)] * 3))
def test_size_and_place_do_not_matter(
    armature: Armature, scale: float, place: tuple[float, float, float]
) -> None:
    assert mapping(placed(armature, scale, None, place)) == mapping(armature)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", CAST)
def test_names_do_not_matter_where_the_shape_tells_sides(name: str, mode: Mode) -> None:
    rig = shipped(name)
    names = numbered(rig.armature, keep_sides=False)
    other = retold(rig, renamed(rig.armature, names), names)
    assert by_name(propose(other, mode)[0]) == {
        names[bone]: partner for bone, partner in by_name(propose(rig, mode)[0]).items()
    }


_ELSEWHERE = """
import json
from tests.armatures import armature_of
from tests.rig_changes import CAST, MODES, propose, shipped
from tests.test_forward_mapping import told_whole
print(json.dumps(told_whole()))
"""


def told_whole() -> list[object]:
    """Everything that is said about the cast, to the last digit."""
    return [
        [proposal.as_json(explain=True), repr(proposal.merit), repr(proposal.pairs)]
        for name in CAST
        for mode in MODES
        for proposal in propose(shipped(name), mode, k=4)
    ]


def test_another_process_says_the_same() -> None:
    here = json.dumps(told_whole())
    run = subprocess.run(
        [sys.executable, "-c", _ELSEWHERE],
        env={**os.environ, "PYTHONHASHSEED": "12345"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.strip() == here


# -- limbs and sides --------------------------------------------------------------------------


@given(creatures())
def test_sides_are_never_crossed(armature: Armature) -> None:
    sides = anatomy(armature).sides
    for proposal in propose_forward(armature, k=3):
        for pair in proposal.pairs:
            side = pair.partner[-1] if "." in pair.partner else ""
            assert not (sides[pair.bone] and side and sides[pair.bone] != side)


@given(any_armature)
def test_human_bones_follow_each_other_down_one_limb(armature: Armature) -> None:
    """No chain is torn over two human limbs, unless it is all that there is."""
    shape = anatomy(armature)
    if not shape.trunk:
        return
    found = {pair.bone: pair.human for pair in propose_forward(armature)[0].pairs}
    for chain in shape.limbs:
        humans = [found[bone] for bone in chain.bones if bone in found]
        spine = [human for human in humans if human < 3]
        others = humans[len(spine) :]
        assert humans == [*spine, *others]
        assert humans == sorted(set(humans))
        if others:
            assert any(set(others) <= set(human.bones) for human in HUMAN_LIMBS)


def test_wings_are_arms_and_what_hangs_below_is_legs() -> None:
    bones = {
        "hips": ("", (0.0, 1.0, 0.0)),
        "chest": ("hips", (0.0, 0.2, 0.1)),
        **limb("wing", "chest", (0.5, 0.1, 0.0), 2),
        **limb("leg", "hips", (0.0, -0.4, 0.0), 2, (0.1, 0.0, 0.0)),
    }
    found = mapping(bare(bones))
    assert found["wing0.L"] == "upper_arm.L"
    assert found["leg0.R"] == "thigh.R"


@given(st.data(), st.floats(0.85, 0.99))
def test_of_two_pairs_of_wings_both_hands_have_the_longer(
    data: st.DataObject, share: float
) -> None:
    """Not the left one of one pair and the right one of the other."""
    bones = {
        "hips": ("", (0.0, 1.0, 0.0)),
        "chest": ("hips", (0.0, 0.3, 0.3)),
        **limb("front", "chest", (0.5 * share, 0.1, 0.0), 3, (0.0, 0.0, 0.2)),
        **limb("back", "chest", (0.5, 0.1, 0.0), 3, (0.0, 0.0, 0.2)),
        **limb("leg", "hips", (0.0, -0.4, 0.0), 2, (0.1, 0.0, 0.0)),
    }
    order = data.draw(st.permutations(range(len(bones))))
    armature = reordered(bare(bones), order)
    for told in (armature, mirrored(armature)):
        found = mapping(told)
        assert found["back0.L"] == "upper_arm.L"
        assert found["back0.R"] == "upper_arm.R"


def test_a_chain_without_a_trunk_goes_to_the_arms_tip_first_to_the_right() -> None:
    bones = ["a", "b", "c", "d", "e"]
    chain = {bone: (bones[i - 1] if i else "") for i, bone in enumerate(bones)}
    assert mapping(armature_of(chain)) == {
        "a": "upper_arm.L",
        "b": "forearm.L",
        "c": "upper_arm.R",
        "d": "forearm.R",
        "e": "hand.R",
    }


def test_a_creature_without_sides_is_played_with_the_hands() -> None:
    found = mapping(shipped("snake").armature)
    assert found["head"] == "hand.R"
    assert found["tail"] == "hand.L"
    assert not [human for human in found.values() if human.split(".")[0] in ("thigh", "shin")]


def test_a_single_bone_of_a_limb_goes_to_the_forearm_before_the_upper_arm() -> None:
    armature = bare(
        {
            "hips": ("", (0.0, 1.0, 0.0)),
            "chest": ("hips", (0.0, 0.4, 0.0)),
            **limb("flipper", "chest", (0.4, 0.0, 0.0), 1),
            **limb("leg", "hips", (0.0, -0.4, 0.0), 2),
        }
    )
    assert mapping(armature)["flipper0.L"] == "forearm.L"


# -- preferences ------------------------------------------------------------------------------


@given(any_armature, st.lists(st.sampled_from(LIMB_NAMES), max_size=4, unique=True))
def test_a_limb_that_is_left_out_drives_nothing(armature: Armature, names: list[LimbName]) -> None:
    out = {bone for human in HUMAN_LIMBS if human.name in names for bone in human.bones}
    for leftovers in (False, True):
        wishes = Preferences(leave_out=tuple(names), leftovers=leftovers)
        for proposal in propose_forward(gather(armature, wishes), k=3):
            assert not out & {pair.human for pair in proposal.pairs}


def test_without_legs_the_dog_walks_on_nothing_but_keeps_its_forelegs() -> None:
    wishes = Preferences(leave_out=("leg.L", "leg.R"))
    found = mapping(shipped("dog").armature, wishes)
    assert found["fore_leg.L"].endswith(".L")
    assert "hind_leg.L" not in found


@pytest.mark.parametrize("name", ["snake", "lamp"])
def test_the_other_hand_can_lead(name: str) -> None:
    armature = shipped(name).armature
    right, left = mapping(armature), mapping(armature, Preferences(hand="L"))
    assert left == {bone: other_side(partner) for bone, partner in right.items()}
    assert left != right


def test_the_leading_hand_does_not_matter_to_a_body_with_sides() -> None:
    for name in ("fish", "dog", "seagull"):
        armature = shipped(name).armature
        assert mapping(armature, Preferences(hand="L")) == mapping(armature)


@given(any_armature)
def test_shoulders_drive_nothing_unless_they_are_wished_for(armature: Armature) -> None:
    for leftovers in (False, True):
        found = mapping(armature, Preferences(leftovers=leftovers))
        assert not [human for human in found.values() if human.startswith("shoulder")]


def test_shoulders_turn_the_fourth_bone_of_an_arm_if_they_are_wished_for() -> None:
    armature = bare(
        {
            "hips": ("", (0.0, 1.0, 0.0)),
            "chest": ("hips", (0.0, 0.4, 0.0)),
            **limb("arm", "chest", (0.2, 0.0, 0.0), 4),
            **limb("leg", "hips", (0.0, -0.4, 0.0), 2),
        }
    )
    found = mapping(armature, Preferences(shoulders=True))
    assert [found[f"arm{bone}.L"] for bone in range(4)] == [
        "shoulder.L",
        "upper_arm.L",
        "forearm.L",
        "hand.L",
    ]
    assert "arm0.L" not in mapping(armature) or len(set(mapping(armature).values())) == 7


@given(any_armature)
def test_leftovers_leave_no_bone_without_a_partner_that_could_have_one(
    armature: Armature,
) -> None:
    plain = mapping(armature)
    proposal = propose_forward(gather(armature, Preferences(leftovers=True)))[0]
    found = by_name(proposal)
    assert found.items() >= plain.items()
    free = {human for human in ("pelvis", "chest", "head") if human not in found.values()}
    assert not (free and proposal.unmapped)


# -- decisions change what lies beside them ---------------------------------------------------


def test_one_correction_takes_the_rest_of_the_limb_along() -> None:
    snake = shipped("snake").armature
    verdicts = decide(snake, Decision("lock", "fk", "tail", "foot.R"))
    found = by_name(propose_forward(snake, verdicts)[0])
    assert found["tail"] == "foot.R"
    legs = {found[bone] for bone in ("tail.1", "tail.2", "tail.3") if bone in found}
    assert legs <= {"thigh.R", "shin.R"}
    assert legs


def test_a_limb_can_be_locked_as_a_whole() -> None:
    snake = shipped("snake").armature
    verdicts = decide(snake, Decision("lock", "fk", "tail", "leg.L"))
    found = by_name(propose_forward(snake, verdicts)[0])
    on_tail = [found[bone] for bone in ("tail.1", "tail.2", "tail.3", "tail") if bone in found]
    assert on_tail
    assert all(human in ("thigh.L", "shin.L", "foot.L") for human in on_tail)


def test_a_limb_can_be_forbidden_as_a_whole() -> None:
    snake = shipped("snake").armature
    verdicts = decide(snake, Decision("forbid", "fk", "head", "arm.R"))
    for proposal in propose_forward(snake, verdicts, 6):
        found = by_name(proposal)
        body = [bone for bone in snake.names if bone.startswith("body") or bone == "head"]
        assert not [b for b in body if found.get(b, "") in ("upper_arm.R", "forearm.R", "hand.R")]


def test_a_human_bone_that_was_set_by_hand_may_drive_two() -> None:
    fish = shipped("fish").armature
    verdicts = decide(
        fish,
        Decision("lock", "fk", "head", "head"),
        Decision("set", "fk", "dorsal", "head"),
    )
    found = by_name(propose_forward(fish, verdicts)[0])
    assert found["head"] == found["dorsal"] == "head"


def test_the_order_of_words_does_not_matter_to_a_human_bone_that_is_shared() -> None:
    fish = shipped("fish").armature
    verdicts = decide(
        fish,
        Decision("set", "fk", "dorsal", "chest"),
        Decision("lock", "fk", "fin.L", "hand.R"),
        Decision("set", "fk", "dorsal", "hand.R"),
    )
    found = by_name(propose_forward(fish, verdicts)[0])
    assert found["dorsal"] == found["fin.L"] == "hand.R"


def test_a_limb_and_a_bone_of_another_may_share_a_human_limb_but_no_human_bone() -> None:
    snake = shipped("snake").armature
    verdicts = decide(
        snake,
        Decision("lock", "fk", "body.1", "thigh.R"),
        Decision("lock", "fk", "tail", "leg.R"),
    )
    proposal = propose_forward(snake, verdicts)[0]
    check_sound(proposal, verdicts)
    found = by_name(proposal)
    assert found["body.1"] == "thigh.R"
    assert {found.get(b) for b in ("tail.1", "tail.2", "tail.3", "tail")} & {"shin.R", "foot.R"}


def test_a_locked_pair_takes_its_human_bone_from_everything_else() -> None:
    fish = shipped("fish").armature
    verdicts = decide(fish, Decision("lock", "fk", "dorsal", "head"))
    found = by_name(propose_forward(fish, verdicts)[0])
    assert found["dorsal"] == "head"
    assert found.get("head") != "head"


def test_what_the_ik_side_was_told_is_nothing_to_fk() -> None:
    fish = shipped("fish").armature
    verdicts = decide(fish, Decision("lock", "ik", "dorsal", "head"))
    assert pairs_of(propose_forward(fish, verdicts)[0]) == pairs_of(propose_forward(fish)[0])


# -- following --------------------------------------------------------------------------------


@given(any_armature, st.integers(0, 2**32 - 1))
def test_only_bones_without_a_partner_follow_by_their_share(armature: Armature, seed: int) -> None:
    shares = np.random.default_rng(seed).integers(0, 3, len(armature)) / 2.0
    proposal = propose_forward(gather(armature, follows=shares))[0]
    expected = {
        armature.names[bone]: shares[bone]
        for bone in range(len(armature))
        if shares[bone] and armature.names[bone] in proposal.unmapped
    }
    assert {armature.names[bone]: share for bone, share in proposal.follows} == expected
    assert proposal.as_json().get("follow", {}) == expected


# -- rigs that are hardly any -----------------------------------------------------------------


def odd_rigs() -> dict[str, Armature]:
    many = 5000
    step = np.tile([0.0, 0.01, 0.0], (many, 1))
    names = [f"b{bone}" for bone in range(many)]
    chain = list(range(-1, many - 1))
    rng = np.random.default_rng(0)
    return {
        "one bone": armature_of({"a": ""}),
        "two bones": armature_of({"a": "", "b": "a"}),
        "two roots": armature_of({"a": "", "b": ""}),
        "no chain": armature_of({f"b{bone}": "" for bone in range(40)}),
        "all at one point": Armature.build(
            "point",
            names[:9],
            [-1, 0, 1, 1, 3, 1, 5, 0, 7],
            np.zeros((9, 3)),
            tips=np.zeros((9, 3)),
        ),
        "long chain": Armature.build("chain", names, chain, step),
        "brush": Armature.build(
            "brush", names, [-1, *[0] * (many - 1)], rng.normal(size=(many, 3))
        ),
        "nothing turns": replace(armature_of({"a": "", "b": "a"}), movements=("fixed", "slide")),
    }


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", list(odd_rigs()))
def test_hardly_a_rig_is_no_error(name: str, mode: Mode) -> None:
    from puppet.mapping.service import Rig

    rig = Rig(odd_rigs()[name])
    proposals = propose(rig, mode, k=2)
    assert proposals
    for proposal in proposals:
        check_sound(proposal, Verdicts(mode))
        check_reasons(proposal)
    if name != "nothing turns" and (mode == "fk" or name in ("two bones", "long chain")):
        assert proposals[0].pairs
