"""IK mapping: control points to end effectors, best pair first; masters; what is left over.

The published mappings are in test_published_mappings.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature, Movement
from puppet.errors import BadDecisionError
from puppet.mapping.anatomy import anatomy
from puppet.mapping.decisions import Decision
from puppet.mapping.effector_rows import effector_table
from puppet.mapping.effectors import propose_effectors
from puppet.mapping.evidence import gather
from puppet.mapping.human import CONTROL_POINTS, HUMAN_LIMBS, LIMB_NAMES
from puppet.mapping.masters import master_problem
from puppet.mapping.offers import fresh_name
from puppet.mapping.preferences import LimbName, Preferences
from puppet.mapping.proposal import Proposal
from puppet.mapping.verdicts import Verdicts
from puppet.skeleton import HUMAN_BONE_NAMES
from tests.armatures import armature_of, armatures
from tests.mapping_claims import check_possible, check_reasons, check_sound, decided, pairs_of
from tests.rig_changes import (
    CAST,
    bare,
    by_name,
    creatures,
    limb,
    mirrored,
    other_side,
    placed,
    reordered,
    shipped,
)

any_armature = st.one_of(armatures(), creatures())


def effectors_in(armature: Armature, preferences: Preferences | None = None) -> dict[str, str]:
    return by_name(propose_effectors(gather(armature, preferences, pieces=False))[0])


def decide(armature: Armature, *acts: Decision) -> Verdicts:
    verdicts = Verdicts("ik")
    for act in acts:
        verdicts = verdicts.with_act(act, armature)
    return verdicts


def group(name: str, *effectors: str) -> Decision:
    return Decision("group", "ik", name, effectors=effectors)


def bones_of(proposal: Proposal) -> list[int]:
    return [bone for pair in proposal.pairs for bone in pair.bones]


# -- any armature, any decisions --------------------------------------------------------------


@given(any_armature)
def test_control_points_move_different_tips_until_one_or_the_other_is_used_up(
    armature: Armature,
) -> None:
    proposal = propose_effectors(armature)[0]
    check_sound(proposal, Verdicts("ik"))
    check_reasons(proposal)
    assert {pair.partner for pair in proposal.pairs} <= set(CONTROL_POINTS)
    tips = {
        armature.names[found.bones[-1]]
        for found in anatomy(armature).limbs
        if armature.parents[found.bones[-1]] >= 0
    }
    assert {pair.name for pair in proposal.pairs} | set(proposal.unmapped) == tips
    # Nothing is left on both sides that could go together.
    evidence = gather(armature, pieces=False)
    used = {pair.human for pair in proposal.pairs}
    for row, found in enumerate(evidence.limbs):
        if armature.names[found.bones[-1]] in proposal.unmapped:
            free = [i for i, human in enumerate(HUMAN_LIMBS) if human.tip not in used]
            assert not evidence.allowed[row, free].any()


@given(any_armature)
def test_the_best_pair_of_all_is_taken_then_the_best_of_what_is_left(armature: Armature) -> None:
    """Figure 6, with a pencil."""
    evidence = gather(armature, pieces=False)
    rows = [r for r, found in enumerate(evidence.limbs) if armature.parents[found.bones[-1]] >= 0]
    open_pairs = {
        (row, column): evidence.scores[row, column]
        for row in rows
        for column in range(len(HUMAN_LIMBS))
        if evidence.allowed[row, column]
    }
    expected = {}
    while open_pairs:
        row, column = max(open_pairs, key=lambda pair: (open_pairs[pair], -pair[0], -pair[1]))
        tip = armature.names[evidence.limbs[row].bones[-1]]
        expected[tip] = CONTROL_POINTS[column]
        open_pairs = {p: s for p, s in open_pairs.items() if p[0] != row and p[1] != column}
    assert by_name(propose_effectors(armature)[0]) == expected


@given(any_armature, st.data(), st.integers(1, 6))
def test_what_was_decided_holds_in_every_proposal(
    armature: Armature, data: st.DataObject, k: int
) -> None:
    verdicts = data.draw(decided(armature, "ik"))
    proposals = propose_effectors(armature, verdicts, k)
    assert 1 <= len(proposals) <= k
    for proposal in proposals:
        check_sound(proposal, verdicts)
        check_reasons(proposal)


@given(any_armature, st.data())
def test_proposals_are_all_different(armature: Armature, data: st.DataObject) -> None:
    proposals = propose_effectors(armature, data.draw(decided(armature, "ik")), 6)
    assert len({pairs_of(proposal) for proposal in proposals}) == len(proposals)


@given(any_armature)
def test_proposals_come_by_their_greatest_pair_then_by_the_next(armature: Armature) -> None:
    """Among equal pairs the first row has the first choice, so there the order is not strict."""
    evidence = gather(armature, pieces=False)
    scores = evidence.scores[evidence.allowed]
    if len(np.unique(scores)) < len(scores):
        return
    words: dict[bool, list[list[float]]] = {False: [], True: []}
    proposals = propose_effectors(armature, k=6)
    for proposal in proposals:
        word = sorted((round(pair.score, 9) for pair in proposal.pairs), reverse=True)
        words[leaves_one_out(proposal)].append(word)
    for kind in words.values():
        assert kind == sorted(kind, reverse=True)
    left_out = [leaves_one_out(proposal) for proposal in proposals]
    assert left_out == sorted(left_out), "what leaves an effector out is no real alternative"


def leaves_one_out(proposal: Proposal) -> bool:
    """Whether an effector is left that a control point could move that is left too."""
    evidence = gather(proposal.armature, pieces=False)
    used = {pair.human for pair in proposal.pairs}
    free = [i for i, human in enumerate(HUMAN_LIMBS) if human.tip not in used]
    return any(
        evidence.allowed[row, free].any()
        for row, found in enumerate(evidence.limbs)
        if proposal.armature.names[found.bones[-1]] in proposal.unmapped
    )


def test_other_choices_for_a_dog_use_every_control_point_too() -> None:
    for proposal in propose_effectors(shipped("dog").armature, k=6):
        assert set(by_name(proposal).values()) == set(CONTROL_POINTS)


@given(any_armature, st.data())
def test_fewer_proposals_are_the_first_of_more(armature: Armature, data: st.DataObject) -> None:
    verdicts = data.draw(decided(armature, "ik"))
    six = [pairs_of(proposal) for proposal in propose_effectors(armature, verdicts, 6)]
    for k in (1, 2, 3):
        few = [pairs_of(proposal) for proposal in propose_effectors(armature, verdicts, k)]
        assert few == six[:k]


@given(creatures(), st.data())
def test_what_can_never_be_is_no_runner_up(armature: Armature, data: st.DataObject) -> None:
    verdicts = data.draw(decided(armature, "ik", most=3))
    proposal = propose_effectors(armature, verdicts)[0]
    check_possible(proposal, verdicts, anatomy(armature).sides)


@given(creatures())
def test_sides_are_never_crossed(armature: Armature) -> None:
    sides = anatomy(armature).sides
    for proposal in propose_effectors(armature, k=3):
        for pair in proposal.pairs:
            side = pair.partner[-1] if "." in pair.partner else ""
            assert not (sides[pair.bone] and sides[pair.bone] != side)


# -- what must not matter ---------------------------------------------------------------------


@given(any_armature, st.data())
def test_the_order_of_bones_does_not_matter(armature: Armature, data: st.DataObject) -> None:
    order = data.draw(st.permutations(range(len(armature))))
    found, told = (
        propose_effectors(armature, k=3),
        propose_effectors(reordered(armature, order), k=3),
    )
    assert [pairs_of(p) for p in told] == [pairs_of(p) for p in found]
    assert [sorted(p.unmapped) for p in told] == [sorted(p.unmapped) for p in found]
    assert [{(o.name, o.effectors) for o in p.offers} for p in told] == [
        {(o.name, o.effectors) for o in p.offers} for p in found
    ]


@given(creatures())
def test_in_a_mirror_left_and_right_change_places(armature: Armature) -> None:
    """With the other hand leading, which is what a mirror shows."""
    if not any(armature.sides):
        return
    seen = effectors_in(mirrored(armature), Preferences(hand="L"))
    expected = {other_side(tip): other_side(point) for tip, point in effectors_in(armature).items()}
    assert seen == expected


@given(creatures(), st.floats(1e-3, 1e3), st.tuples(*[st.floats(-100, 100)] * 3))
def test_size_and_place_do_not_matter(
    armature: Armature, scale: float, place: tuple[float, float, float]
) -> None:
    assert effectors_in(placed(armature, scale, None, place)) == effectors_in(armature)


# -- preferences ------------------------------------------------------------------------------


@given(any_armature, st.lists(st.sampled_from(LIMB_NAMES), max_size=4, unique=True))
def test_a_limb_that_is_left_out_moves_nothing(armature: Armature, names: list[LimbName]) -> None:
    wishes = Preferences(leave_out=tuple(names))
    tips = {human.tip for human in HUMAN_LIMBS if human.name in names}
    for proposal in propose_effectors(gather(armature, wishes, pieces=False), k=3):
        assert not tips & {pair.human for pair in proposal.pairs}


def test_the_other_hand_can_lead() -> None:
    snake = shipped("snake").armature
    assert effectors_in(snake) == {"head": "hand.R", "tail": "hand.L"}
    assert effectors_in(snake, Preferences(hand="L")) == {"head": "hand.L", "tail": "hand.R"}
    ostrich = shipped("ostrich").armature
    assert effectors_in(ostrich, Preferences(hand="L"))["head"] == "hand.L"


# -- masters ----------------------------------------------------------------------------------


@given(creatures(), st.data())
def test_a_master_scores_what_its_members_score_on_average(
    armature: Armature, data: st.DataObject
) -> None:
    evidence = gather(armature, pieces=False)
    rows = {
        armature.names[found.bones[-1]]: row
        for row, found in enumerate(evidence.limbs)
        if armature.parents[found.bones[-1]] >= 0
    }
    if len(rows) < 2:
        return
    members = data.draw(
        st.lists(st.sampled_from(sorted(rows)), min_size=2, max_size=4, unique=True)
    )
    if master_problem("handle", members, armature) is not None:
        return
    verdicts = decide(armature, group("handle", *members))
    singles = {name for name in rows if name not in members}
    assert {e.name for e in effector_table(evidence, verdicts).rows} == {"handle", *singles}
    for proposal in propose_effectors(evidence, verdicts, 4):
        check_reasons(proposal)
        names = {pair.name for pair in proposal.pairs} | set(proposal.unmapped)
        assert names == {"handle", *singles}
        assert len(set(bones_of(proposal))) == len(bones_of(proposal))
        for pair in proposal.pairs:
            if pair.name == "handle":
                assert [armature.names[bone] for bone in pair.bones] == members
                column = [human.tip for human in HUMAN_LIMBS].index(pair.human)
                average = evidence.parts[:, [rows[m] for m in members], column].mean(axis=1).sum()
                assert pair.score == pytest.approx(np.clip(average, 0.0, 1.0), abs=1e-9)


def test_the_members_of_a_master_are_no_effectors_of_their_own() -> None:
    rig = shipped("seagull_with_master")
    proposal = rig.propose(Verdicts("ik", masters=dict(rig.masters)))[0]
    assert not {"wing_tip.L", "wing_tip.R"} & {pair.name for pair in proposal.pairs}
    assert not {"wing_tip.L", "wing_tip.R"} & set(proposal.unmapped)
    wings = next(pair for pair in proposal.pairs if pair.name == "wings")
    assert {rig.armature.names[bone] for bone in wings.bones} == {"wing_tip.L", "wing_tip.R"}
    assert "drives" in next(
        row for row in proposal.as_json()["pairs"] if row["effector"] == "wings"
    )


def test_a_master_can_be_locked_and_forbidden_like_any_effector() -> None:
    rig = shipped("seagull_with_master")
    start = Verdicts("ik", masters=dict(rig.masters))
    locked = start.with_act(Decision("lock", "ik", "wings", "foot.L"), rig.armature)
    forbidden = start.with_act(Decision("forbid", "ik", "wings", "hand.R"), rig.armature)
    for proposal in rig.propose(locked, k=4):
        check_sound(proposal, locked)
    for proposal in rig.propose(forbidden, k=4):
        check_sound(proposal, forbidden)


def test_the_seagull_is_offered_to_join_its_wings() -> None:
    proposal = propose_effectors(shipped("seagull").armature)[0]
    assert proposal.unmapped == ("tail",)
    (offer,) = proposal.offers
    assert set(offer.effectors) == {"wing_tip.L", "wing_tip.R"}
    assert "tail" in offer.why


def test_an_accepted_offer_leaves_nothing_over() -> None:
    armature = shipped("seagull").armature
    (offer,) = propose_effectors(armature)[0].offers
    verdicts = decide(armature, group(offer.name, *offer.effectors))
    proposal = propose_effectors(armature, verdicts)[0]
    assert proposal.unmapped == ()
    assert proposal.offers == ()


def beetle(pairs: int) -> Armature:
    """Legs in pairs along a body, all of the same build, and a head."""
    bones: dict[str, tuple[str, Sequence[float]]] = {"b0": ("", (0.0, 0.5, 0.0))}
    for ring in range(1, pairs):
        bones[f"b{ring}"] = (f"b{ring - 1}", (0.0, 0.0, 0.3))
    bones["head"] = (f"b{pairs - 1}", (0.0, 0.0, 0.3))
    for ring in range(pairs):
        bones |= limb(f"leg{ring}_", f"b{ring}", (0.2, -0.2, 0.0), 2)
    return bare(bones)


@pytest.mark.parametrize("pairs", [3, 4, 6])
def test_legs_that_are_left_over_could_move_with_those_like_them(pairs: int) -> None:
    armature = beetle(pairs)
    proposal = propose_effectors(armature)[0]
    left = set(proposal.unmapped)
    assert len(left) == 2 * pairs - 4
    offered: list[str] = []
    mapped = {pair.name for pair in proposal.pairs}
    for offer in proposal.offers:
        offered += offer.effectors
        assert len(set(offer.effectors) & mapped) == 1
        joined = set(offer.effectors) - mapped
        assert joined
        assert joined <= left
        assert all(name in offer.why for name in joined)
        assert offer.name not in armature.names
    assert len(set(offered)) == len(offered)
    assert left <= set(offered)


@pytest.mark.parametrize("pairs", [3, 4, 6])
def test_offers_can_be_accepted_together_as_they_are(pairs: int) -> None:
    armature = beetle(pairs)
    offers = propose_effectors(armature)[0].offers
    verdicts = decide(armature, *(group(offer.name, *offer.effectors) for offer in offers))
    assert len(verdicts.masters) == len(offers)
    assert propose_effectors(armature, verdicts)[0].unmapped == ()


@pytest.mark.parametrize("pairs", [3, 4, 6])
def test_what_is_joined_is_on_one_side(pairs: int) -> None:
    """Two left legs can step together; a left one and a right one would kick."""
    for offer in propose_effectors(beetle(pairs))[0].offers:
        assert len({name[-1] for name in offer.effectors}) == 1


@pytest.mark.parametrize(
    ("effectors", "side", "name"),
    [
        (("wing_tip.L", "wing_tip.R"), "", "wing_tip"),
        (("leg0_1.L", "leg3_1.L"), "L", "leg.L"),
        (("leg.L", "leg.L.2"), "L", "leg.L"),
        (("b_RightHand_08", "b_Tail03_014"), "", "master_b_RightHand_08"),
        (("FF.R", "FF.L"), "", "master_FF.R"),
        (("b57", "b5"), "L", "master_b57"),
        (("taken_1", "taken_2"), "", "master_taken"),
        (("x1", "x2"), "", "master_x1_2"),
    ],
)
def test_an_offered_master_has_a_name_that_says_something(
    effectors: tuple[str, ...], side: str, name: str
) -> None:
    assert fresh_name(effectors, side, {"taken", "master_x1", "other"}) == name


@given(creatures(), st.data())
def test_what_is_remembered_of_an_armature_does_not_leak_into_other_decisions(
    armature: Armature, data: st.DataObject
) -> None:
    """Whatever was asked before, the answer is that of a fresh start."""
    evidence = gather(armature, pieces=False)
    asked = [data.draw(decided(armature, "ik")) for _ in range(3)]
    for verdicts in (*asked, *asked):
        seen = propose_effectors(evidence, verdicts, 2)
        fresh = propose_effectors(gather(armature, pieces=False), verdicts, 2)
        assert [p.as_json(explain=True) for p in seen] == [p.as_json(explain=True) for p in fresh]


@given(any_armature)
def test_every_offer_can_be_accepted(armature: Armature) -> None:
    proposal = propose_effectors(armature)[0]
    for offer in proposal.offers:
        verdicts = decide(armature, group(offer.name, *offer.effectors))
        again = propose_effectors(armature, verdicts)[0]
        assert len(again.unmapped) < len(proposal.unmapped)


@pytest.mark.parametrize("name", ["dog", "fish", "snake", "ostrich", "lamp"])
def test_nothing_is_offered_where_nothing_is_left_over(name: str) -> None:
    proposal = propose_effectors(shipped(name).armature)[0]
    if not proposal.unmapped:
        assert proposal.offers == ()


# -- any bone by hand -------------------------------------------------------------------------


@pytest.mark.parametrize("name", CAST)
def test_any_bone_below_the_root_can_be_moved_by_hand(name: str) -> None:
    armature = shipped(name).armature
    for bone in range(len(armature)):
        if armature.parents[bone] < 0:
            continue
        verdicts = decide(armature, Decision("set", "ik", armature.names[bone], "hand.L"))
        assert by_name(propose_effectors(armature, verdicts)[0])[armature.names[bone]] == "hand.L"


def test_two_effectors_that_were_set_to_one_control_point_both_have_it() -> None:
    armature = shipped("seagull").armature
    verdicts = decide(
        armature,
        Decision("set", "ik", "wing_tip.L", "hand.R"),
        Decision("set", "ik", "wing_tip.R", "hand.R"),
    )
    proposals = propose_effectors(armature, verdicts, 4)
    for proposal in proposals:
        found = by_name(proposal)
        assert found["wing_tip.L"] == found["wing_tip.R"] == "hand.R"
    assert "tail" in by_name(proposals[0])
    assert len({pairs_of(proposal) for proposal in proposals}) == len(proposals)


def test_what_lies_across_from_a_crossed_effector_takes_nothing_from_a_locked_one() -> None:
    armature = shipped("seagull").armature
    verdicts = decide(
        armature,
        Decision("lock", "ik", "wing_tip.L", "hand.R"),
        Decision("lock", "ik", "tail", "hand.L"),
    )
    for proposal in propose_effectors(armature, verdicts, 4):
        check_sound(proposal, verdicts)
        assert by_name(proposal).get("wing_tip.R") != "hand.L"


def test_what_lies_across_from_a_crossed_effector_does_not_get_what_was_ruled_out() -> None:
    armature = shipped("seagull").armature
    crossed = Decision("lock", "ik", "wing_tip.L", "hand.R")
    assert by_name(propose_effectors(armature, decide(armature, crossed))[0])["wing_tip.R"] == (
        "hand.L"
    )
    verdicts = decide(armature, crossed, Decision("forbid", "ik", "wing_tip.R", "hand.L"))
    for proposal in propose_effectors(armature, verdicts, 4):
        check_sound(proposal, verdicts)


def test_a_whole_limb_means_its_control_point() -> None:
    armature = shipped("snake").armature
    locked = decide(armature, Decision("lock", "ik", "tail", "leg.L"))
    assert by_name(propose_effectors(armature, locked)[0])["tail"] == "foot.L"
    forbidden = decide(armature, Decision("forbid", "ik", "tail", "arm.L"))
    for proposal in propose_effectors(armature, forbidden, 4):
        assert by_name(proposal).get("tail") != "hand.L"


def test_a_control_point_and_its_limb_are_the_same_thing_to_two_bones() -> None:
    armature = shipped("snake").armature
    with pytest.raises(BadDecisionError, match="drives another bone already"):
        decide(
            armature,
            Decision("lock", "ik", "tail", "leg.L"),
            Decision("lock", "ik", "head", "foot.L"),
        )


def test_what_only_a_root_could_move_is_moved_by_nothing() -> None:
    """A root goes where the performer goes; no goal turns it."""
    for bones in ({"a": "", "b": "a"}, {"a": "", "b": "a", "c": "b"}):
        movements: list[Movement] = ["slide" for _ in bones]
        movements[0] = "turn"
        stuck = replace(armature_of(bones), movements=tuple(movements))
        assert propose_effectors(stuck)[0].pairs == ()


def test_the_explanation_names_what_it_is_about() -> None:
    told = propose_effectors(shipped("seagull").armature)[0].as_json(explain=True)
    assert told["mode"] == "ik"
    for row in told["pairs"]:
        assert row["control_point"] in CONTROL_POINTS
        assert row["certainty"] in ("sure", "likely", "doubtful")
        assert row["reasons"]
        assert all(r["control_point"] in HUMAN_BONE_NAMES for r in row["runners_up"])
    assert told["offered_masters"][0]["why"]
