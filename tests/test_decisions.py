"""What the operator says: every act, what contradicts it, and a history that can be walked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from puppet.armature import Armature
from puppet.errors import BadDecisionError
from puppet.mapping.anatomy import anatomy
from puppet.mapping.decisions import BANS, KEEPS, Act, Decision, partners_of
from puppet.mapping.human import CONTROL_POINTS, LIMB_NAMES, WHOLE_LIMBS
from puppet.mapping.ledger import LONGEST_HISTORY, Ledger, check_together
from puppet.mapping.proposal import Mode
from puppet.mapping.verdicts import Verdicts
from puppet.skeleton import HUMAN_BONE_NAMES
from tests.rig_changes import MODES, shipped

SEAGULL = shipped("seagull").armature
keeping: st.SearchStrategy[Act] = st.sampled_from(("accept", "lock", "set"))
banning: st.SearchStrategy[Act] = st.sampled_from(("reject", "forbid"))


def lock(bone: str, human: str, mode: Mode = "fk") -> Decision:
    return Decision("lock", mode, bone, human)


def after(*acts: Decision, start: Verdicts | None = None) -> Verdicts:
    verdicts = start or Verdicts()
    for act in acts:
        verdicts = verdicts.with_act(act, SEAGULL)
    return verdicts


def group(name: str, *effectors: str) -> Decision:
    return Decision("group", "ik", name, effectors=effectors)


# -- what each act does -----------------------------------------------------------------------


@given(keeping, st.sampled_from(SEAGULL.names), st.sampled_from(HUMAN_BONE_NAMES))
def test_what_is_kept_is_kept_with_the_word_that_kept_it(act: Act, bone: str, human: str) -> None:
    verdicts = after(Decision(act, "fk", bone, human))
    assert verdicts.kept_in("fk") == {bone: (human, act)}
    assert verdicts.kept_in("ik") == {}
    assert verdicts.banned == {}


@given(banning, st.sampled_from(SEAGULL.names), st.sampled_from(HUMAN_BONE_NAMES))
def test_what_is_ruled_out_is_that_pair_and_no_other(act: Act, bone: str, human: str) -> None:
    verdicts = after(Decision(act, "fk", bone, human))
    assert verdicts.banned_in("fk") == {(bone, human): act}
    assert verdicts.banned_in("ik") == {}
    assert verdicts.kept == {}


@given(keeping, keeping)
def test_a_later_word_on_a_bone_replaces_an_earlier_one(first: Act, second: Act) -> None:
    verdicts = after(Decision(first, "fk", "tail", "head"), Decision(second, "fk", "tail", "chest"))
    assert verdicts.kept_in("fk") == {"tail": ("chest", second)}


@given(keeping, banning)
def test_a_pair_is_kept_or_ruled_out_but_never_both(keeps: Act, bans: Act) -> None:
    keep, ban = Decision(keeps, "fk", "tail", "head"), Decision(bans, "fk", "tail", "head")
    assert after(keep, ban).kept == {}
    assert after(keep, ban).banned_in("fk") == {("tail", "head"): bans}
    assert after(ban, keep).banned == {}
    assert after(ban, keep).kept_in("fk") == {"tail": ("head", keeps)}


def test_ruling_out_another_pair_keeps_what_was_kept() -> None:
    verdicts = after(lock("tail", "head"), Decision("forbid", "fk", "tail", "chest"))
    assert verdicts.kept_in("fk") == {"tail": ("head", "lock")}


@given(keeping, banning)
def test_clear_forgets_one_pair_or_all_of_a_bone(keeps: Act, bans: Act) -> None:
    said = (
        Decision(keeps, "fk", "tail", "head"),
        Decision(bans, "fk", "tail", "chest"),
        Decision(bans, "fk", "tail", "pelvis"),
        Decision(bans, "fk", "neck", "chest"),
        Decision(bans, "ik", "tail", "head"),
    )
    all_of_it = after(*said, Decision("clear", "fk", "tail"))
    assert all_of_it.kept == {}
    assert set(all_of_it.banned) == {("fk", "neck", "chest"), ("ik", "tail", "head")}
    one_ban = after(*said, Decision("clear", "fk", "tail", "chest"))
    assert one_ban.kept_in("fk") == {"tail": ("head", keeps)}
    assert set(one_ban.banned_in("fk")) == {("tail", "pelvis"), ("neck", "chest")}
    one_keep = after(*said, Decision("clear", "fk", "tail", "head"))
    assert one_keep.kept == {}
    assert len(one_keep.banned) == 4


def test_clearing_what_was_never_said_changes_nothing() -> None:
    said = after(lock("tail", "head"))
    assert after(Decision("clear", "fk", "neck"), start=said) == said
    assert after(Decision("clear", "fk", "tail", "chest"), start=said) == said


@pytest.mark.parametrize("mode", MODES)
def test_the_mode_changes_and_nothing_else(mode: Mode) -> None:
    said = after(lock("tail", "head"), lock("tail", "hand.L", "ik"))
    assert after(Decision("mode", mode), start=said) == replace(said, mode=mode)


def test_each_mode_has_decisions_of_its_own() -> None:
    verdicts = after(lock("tail", "head"), lock("tail", "hand.L", "ik"))
    assert verdicts.kept_in("fk") == {"tail": ("head", "lock")}
    assert verdicts.kept_in("ik") == {"tail": ("hand.L", "lock")}


LIMBS = {
    bone: limb.bones for limb in anatomy(SEAGULL).pieces for bone in limb.bones
}  # all bones of the limb that a bone belongs to


@given(st.sampled_from(sorted(LIMBS)), st.sampled_from(WHOLE_LIMBS), keeping)
def test_a_whole_limb_can_be_a_partner_whichever_of_its_bones_is_named(
    bone: int, limb: str, act: Act
) -> None:
    names = SEAGULL.names
    first, tip = names[LIMBS[bone][0]], names[LIMBS[bone][-1]]
    point = CONTROL_POINTS[LIMB_NAMES.index(limb)]
    assert after(Decision(act, "fk", names[bone], limb)).limbs == {first: (limb, act)}
    assert after(Decision(act, "ik", names[bone], limb)).kept_in("ik") == {tip: (point, act)}
    assert after(Decision("forbid", "fk", names[bone], limb)).banned_in("fk") == {
        (first, limb): "forbid"
    }
    assert after(Decision("forbid", "ik", names[bone], limb)).banned_in("ik") == {
        (tip, point): "forbid"
    }


@pytest.mark.parametrize("mode", MODES)
def test_the_trunk_belongs_to_no_limb_and_says_so(mode: Mode) -> None:
    with pytest.raises(BadDecisionError, match="belongs to the trunk"):
        after(lock("chest", "arm.R", mode))


def test_a_limb_that_was_given_away_is_not_given_again() -> None:
    with pytest.raises(BadDecisionError, match="drives another limb already"):
        after(lock("wing.L", "arm.R"), lock("wing_tip.R", "arm.R"))
    both = after(lock("wing.L", "arm.R"), Decision("set", "fk", "wing_tip.R", "arm.R"))
    assert both.limbs == {"wing.L": ("arm.R", "lock"), "wing.R": ("arm.R", "set")}
    master = after(group("wings", "wing_tip.L", "wing_tip.R"), lock("wing.L", "arm.R", "ik"))
    assert master.kept_in("ik") == {"wings": ("hand.R", "lock")}


def test_a_later_word_on_a_limb_replaces_an_earlier_one_on_it_or_its_bones() -> None:
    assert after(lock("wing.L", "arm.R"), lock("wing_tip.L", "leg.L")).limbs == {
        "wing.L": ("leg.L", "lock")
    }
    forbidden = after(lock("wing_tip.L", "hand.L"), Decision("forbid", "fk", "wing.L", "arm.L"))
    assert not forbidden.kept
    allowed = after(Decision("forbid", "fk", "wing.L", "arm.L"), lock("wing_tip.L", "hand.L"))
    assert not allowed.banned
    assert after(lock("wing.L", "arm.R"), Decision("clear", "fk", "wing_tip.L")) == Verdicts()


@pytest.mark.parametrize(
    "step",
    [
        [lock("wing.L", "arm.R"), lock("wing_tip.L", "leg.R")],
        [lock("wing_tip.L", "hand.L"), Decision("forbid", "fk", "wing_mid.L", "arm.L")],
        [lock("wing.L", "arm.R"), Decision("forbid", "fk", "wing_tip.L", "arm.R")],
        [lock("wing_tip.L", "arm.R", "ik"), Decision("forbid", "ik", "wing_tip.L", "hand.R")],
        [lock("wing_tip.L", "hand.R", "ik"), Decision("forbid", "ik", "wing.L", "arm.R")],
        [lock("wing_tip.L", "hand.R", "ik"), lock("wing.L", "leg.L", "ik")],
    ],
)
def test_words_on_a_limb_and_its_bones_at_once_must_agree(step: list[Decision]) -> None:
    for order in (step, step[::-1]):
        with pytest.raises(BadDecisionError):
            check_together(order, SEAGULL)


# -- masters ----------------------------------------------------------------------------------


def test_a_master_is_made_decided_about_and_taken_apart() -> None:
    made = after(group("wings", "wing_tip.L", "wing_tip.R"))
    assert made.masters == {"wings": ("wing_tip.L", "wing_tip.R")}
    said = after(
        lock("wings", "hand.L", "ik"), Decision("forbid", "ik", "wings", "head"), start=made
    )
    assert said.kept_in("ik") == {"wings": ("hand.L", "lock")}
    apart = after(lock("tail", "hand.R", "ik"), Decision("ungroup", "ik", "wings"), start=said)
    assert apart.masters == {}
    assert apart.kept_in("ik") == {"tail": ("hand.R", "lock")}
    assert apart.banned == {}


def test_a_master_takes_over_what_was_decided_of_its_members() -> None:
    verdicts = after(
        lock("wing_tip.L", "foot.L", "ik"),
        lock("tail", "hand.R", "ik"),
        group("wings", "wing_tip.L", "wing_tip.R"),
    )
    assert verdicts.kept_in("ik") == {"tail": ("hand.R", "lock")}


def test_a_member_that_is_named_twice_is_one_member() -> None:
    made = after(group("wings", "tail", "wing_tip.L", "tail"))
    assert made.masters == {"wings": ("tail", "wing_tip.L")}


def test_a_master_can_be_made_anew_with_other_members() -> None:
    verdicts = after(group("all", "wing_tip.L", "wing_tip.R"), group("all", "tail", "wing_tip.L"))
    assert verdicts.masters == {"all": ("tail", "wing_tip.L")}


@pytest.mark.parametrize(
    ("acts", "says", "found"),
    [
        ([group("tail", "wing_tip.L", "wing_tip.R")], "name of a bone", "tail"),
        ([group("", "wing_tip.L", "wing_tip.R")], "needs a name", "''"),
        ([group("wings", "wing_tip.L")], "two or more", "wing_tip.L"),
        ([group("wings")], "two or more", "none"),
        ([group("wings", "tail", "tail")], "two or more", "tail, tail"),
        ([group("wings", "tail", "beak")], "no such bone", "beak"),
        ([group("all", "pelvis", "tail")], "a root goes where", "pelvis"),
        ([group("wing", "wing.L", "wing_tip.L")], "hangs on it", "wing.L and wing_tip.L"),
        (
            [group("a", "wing_tip.L", "wing_tip.R"), group("b", "wing_tip.R", "tail")],
            "belongs to another master",
            "wing_tip.R of a",
        ),
        ([Decision("ungroup", "ik", "wings")], "no such master", "wings"),
        (
            [group("wings", "wing_tip.L", "wing_tip.R"), lock("wing_tip.L", "head", "ik")],
            "master moves this bone",
            "wing_tip.L of wings",
        ),
        ([lock("wings", "hand.L", "ik")], "no such bone", "wings"),
    ],
)
def test_a_master_that_makes_no_sense_is_refused(
    acts: Sequence[Decision], says: str, found: str
) -> None:
    with pytest.raises(BadDecisionError, match=says) as error:
        after(*acts)
    assert error.value.found == found


# -- what is not possible ---------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("act", sorted(KEEPS | BANS))
def test_bones_and_partners_that_are_not_there_are_told_with_those_that_are(
    act: Act, mode: Mode
) -> None:
    with pytest.raises(BadDecisionError, match="no such bone") as error:
        after(Decision(act, mode, "beak", "head"))
    assert error.value.found == "beak"
    assert "wing_tip.L" in str(error.value.expected)
    with pytest.raises(BadDecisionError, match="no such") as error:
        after(Decision(act, mode, "tail", "nose"))
    assert error.value.found == "nose"
    for partner in partners_of(mode):
        assert partner in str(error.value.expected)


def test_a_human_bone_is_no_control_point() -> None:
    with pytest.raises(BadDecisionError, match="no such control point"):
        after(lock("tail", "shin.L", "ik"))
    for point in CONTROL_POINTS:
        after(lock("tail", point, "ik"))


def test_a_pair_needs_a_partner_unless_it_is_cleared() -> None:
    words: tuple[Act, ...] = ("accept", "lock", "set", "reject", "forbid")
    for act in words:
        with pytest.raises(BadDecisionError, match="no such human bone"):
            after(Decision(act, "fk", "tail"))


@pytest.mark.parametrize("act", sorted(KEEPS))
def test_a_bone_that_does_not_turn_cannot_be_driven_but_may_be_ruled_out(act: Act) -> None:
    movements = tuple("slide" if bone == "tail" else "turn" for bone in SEAGULL.names)
    stiff = replace(SEAGULL, movements=movements)  # type: ignore[arg-type]
    with pytest.raises(BadDecisionError, match="cannot turn") as error:
        Verdicts().with_act(Decision(act, "fk", "tail", "head"), stiff)
    assert error.value.found == "a bone that slides"
    Verdicts().with_act(Decision("forbid", "fk", "tail", "head"), stiff)


@pytest.mark.parametrize("act", sorted(KEEPS))
def test_no_goal_moves_a_root(act: Act) -> None:
    with pytest.raises(BadDecisionError, match="is a root"):
        after(Decision(act, "ik", "pelvis", "head"))
    after(Decision(act, "fk", "pelvis", "head"))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("human", ["head", "hand.L"])
@pytest.mark.parametrize("before", sorted(KEEPS))
@pytest.mark.parametrize("act", ["accept", "lock"])
def test_a_human_bone_that_drives_another_already_is_an_error_that_helps(
    act: Act, before: Act, human: str, mode: Mode
) -> None:
    taken = after(Decision(before, mode, "tail", human))
    with pytest.raises(BadDecisionError, match=f"{human} drives another bone already") as error:
        after(Decision(act, mode, "neck", human), start=taken)
    assert error.value.where == f"{act} neck = {human}"
    assert error.value.found == f"{before} tail = {human}"
    # Both ways out that the hint names are ways out.
    assert "clear tail first" in str(error.value.hint)
    freed = after(Decision("clear", mode, "tail"), Decision(act, mode, "neck", human), start=taken)
    assert freed.kept_in(mode) == {"neck": (human, act)}
    assert "set neck by hand" in str(error.value.hint)
    shared = after(Decision("set", mode, "neck", human), start=taken)
    assert shared.kept_in(mode) == {"tail": (human, before), "neck": (human, "set")}


def test_under_ik_a_limb_and_its_control_point_are_the_same() -> None:
    with pytest.raises(BadDecisionError, match="drives another bone already"):
        after(lock("tail", "arm.L", "ik"), lock("neck", "hand.L", "ik"))
    with pytest.raises(BadDecisionError, match="drives another bone already"):
        after(lock("tail", "hand.L", "ik"), lock("neck", "arm.L", "ik"))


def test_saying_the_same_again_is_no_contradiction() -> None:
    verdicts = after(lock("tail", "head"), Decision("accept", "fk", "tail", "head"))
    assert verdicts.kept_in("fk") == {"tail": ("head", "accept")}


# -- given at once ----------------------------------------------------------------------------


@given(keeping, keeping)
def test_two_partners_at_once_are_an_error_that_names_both(first: Act, second: Act) -> None:
    with pytest.raises(BadDecisionError) as error:
        check_together(
            [Decision(first, "fk", "tail", "head"), Decision(second, "fk", "tail", "chest")],
            SEAGULL,
        )
    told = str(error.value)
    assert all(word in told for word in ("tail", "head", "chest"))


@given(keeping, banning, st.booleans())
def test_a_pair_kept_and_ruled_out_at_once_is_an_error_that_names_it(
    keeps: Act, bans: Act, ban_first: bool
) -> None:
    both = [Decision(keeps, "fk", "tail", "head"), Decision(bans, "fk", "tail", "head")]
    with pytest.raises(BadDecisionError) as error:
        check_together(both[::-1] if ban_first else both, SEAGULL)
    assert "tail" in str(error.value)
    assert "head" in str(error.value)


def test_two_bones_that_want_one_human_bone_at_once_are_an_error_that_names_both() -> None:
    with pytest.raises(BadDecisionError) as error:
        Ledger().with_step([lock("tail", "head"), lock("neck", "head")], SEAGULL)
    assert all(word in str(error.value) for word in ("tail", "neck", "head"))


def test_what_is_right_for_each_mode_is_no_contradiction() -> None:
    ledger = Ledger().with_step([lock("tail", "head"), lock("tail", "hand.L", "ik")], SEAGULL)
    assert len(ledger.verdicts.kept) == 2


def test_a_ban_in_one_mode_does_not_contradict_a_lock_in_the_other() -> None:
    step = [lock("tail", "head"), Decision("forbid", "ik", "tail", "head")]
    verdicts = Ledger().with_step(step, SEAGULL).verdicts
    assert verdicts.kept
    assert verdicts.banned


def test_a_step_of_which_one_part_is_wrong_changes_nothing() -> None:
    ledger = Ledger().with_step([lock("tail", "head")], SEAGULL)
    with pytest.raises(BadDecisionError):
        ledger.with_step([lock("neck", "chest"), lock("beak", "pelvis")], SEAGULL)
    assert ledger.verdicts.kept_in("fk") == {"tail": ("head", "lock")}
    assert len(ledger.steps) == 1


def test_nothing_is_no_step() -> None:
    with pytest.raises(BadDecisionError, match="nothing was decided"):
        Ledger().with_step([], SEAGULL)


# -- for people -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("decision", "sentence"),
    [
        (Decision("mode", "ik"), "drive it by IK"),
        (group("wings", "a", "b"), "join a, b under the master wings"),
        (Decision("ungroup", "ik", "wings"), "take the master wings apart"),
        (Decision("clear", "fk", "tail"), "clear what was said of tail"),
        (Decision("clear", "fk", "tail", "head"), "clear what was said of tail and head"),
        (lock("tail", "head"), "lock tail = head"),
        (Decision("forbid", "fk", "tail", "head"), "forbid tail = head"),
    ],
)
def test_every_decision_is_a_sentence(decision: Decision, sentence: str) -> None:
    assert decision.sentence() == sentence


# -- history ----------------------------------------------------------------------------------

acts = st.builds(
    Decision,
    st.sampled_from(("accept", "lock", "set", "reject", "forbid", "clear", "mode")),
    st.sampled_from(MODES),
    st.sampled_from(SEAGULL.names),
    st.sampled_from(CONTROL_POINTS),
)
masters = st.one_of(
    st.builds(
        group,
        st.sampled_from(("m", "n")),
        *[st.sampled_from(("wing_tip.L", "wing_tip.R", "tail", "head"))] * 2,
    ),
    st.builds(Decision, st.just("ungroup"), st.just("ik"), st.sampled_from(("m", "n"))),
)


class History(RuleBasedStateMachine):
    """A ledger beside the simplest thing that could be one: two piles of what held."""

    @initialize()
    def begin(self) -> None:
        self.ledger = Ledger()
        self.done: list[Verdicts] = [Verdicts()]
        self.undone: list[Verdicts] = []

    @rule(step=st.lists(st.one_of(acts, masters), min_size=1, max_size=3))
    def decide(self, step: list[Decision]) -> None:
        state = self.done[-1]
        try:
            check_together(step, SEAGULL, state.masters)
            for act in step:
                state = state.with_act(act, SEAGULL)
        except BadDecisionError:
            before = self.ledger
            with pytest.raises(BadDecisionError):
                self.ledger.with_step(step, SEAGULL)
            assert self.ledger == before
            return
        self.ledger = self.ledger.with_step(step, SEAGULL)
        self.done.append(state)
        self.undone.clear()

    @precondition(lambda self: len(self.done) > 1)
    @rule()
    def undo(self) -> None:
        self.ledger = self.ledger.undone()
        self.undone.append(self.done.pop())

    @precondition(lambda self: bool(self.undone))
    @rule()
    def redo(self) -> None:
        self.ledger = self.ledger.redone()
        self.done.append(self.undone.pop())

    @precondition(lambda self: len(self.done) == 1)
    @rule()
    def nothing_to_undo(self) -> None:
        with pytest.raises(BadDecisionError, match="nothing to undo"):
            self.ledger.undone()

    @precondition(lambda self: not self.undone)
    @rule()
    def nothing_to_redo(self) -> None:
        with pytest.raises(BadDecisionError, match="nothing to redo"):
            self.ledger.redone()

    @invariant()
    def holds_what_was_decided(self) -> None:
        assert self.ledger.verdicts == self.done[-1]
        assert self.ledger.cursor == len(self.done) - 1
        assert len(self.ledger.steps) == len(self.done) - 1 + len(self.undone)


TestUndoAndRedoAreAStack: Any = History.TestCase


def back_and_forth(count: int) -> list[Decision]:
    """So many decisions that are all different from what held before."""
    humans = [name for name in HUMAN_BONE_NAMES if name != "head"]
    return [lock("neck" if i % 3 else "tail", humans[(7 * i) % 16]) for i in range(count)]


def decided(steps: Sequence[Decision], armature: Armature = SEAGULL) -> tuple[Ledger, Verdicts]:
    ledger, plain = Ledger(), Verdicts()
    for step in steps:
        try:
            following = plain.with_act(step, armature)
        except BadDecisionError:
            continue
        ledger, plain = ledger.with_step([step], armature), following
    return ledger, plain


def test_a_history_is_bounded_without_changing_what_holds() -> None:
    ledger, plain = decided(back_and_forth(2 * LONGEST_HISTORY))
    assert len(ledger.steps) == len(ledger.states) == LONGEST_HISTORY
    assert ledger.cursor == LONGEST_HISTORY
    assert ledger.verdicts == plain


def test_what_was_forgotten_step_by_step_is_kept_as_what_it_came_to() -> None:
    first = lock("head", "head")
    ledger, _ = decided([first, *back_and_forth(LONGEST_HISTORY + 200)])
    for _ in range(LONGEST_HISTORY):
        ledger = ledger.undone()
    with pytest.raises(BadDecisionError, match="nothing to undo"):
        ledger.undone()
    assert ledger.verdicts == ledger.start
    assert ledger.verdicts.kept_in("fk")["head"] == ("head", "lock")


def test_a_new_step_drops_what_was_undone() -> None:
    ledger, _ = decided([lock("tail", "head"), lock("neck", "chest")])
    ledger = ledger.undone().with_step([lock("neck", "pelvis")], SEAGULL)
    assert [step[0].human for step in ledger.steps] == ["head", "pelvis"]
    with pytest.raises(BadDecisionError, match="nothing to redo"):
        ledger.redone()


@given(st.integers(-5, 20))
def test_the_cursor_stays_within_the_history(cursor: int) -> None:
    ledger, _ = decided(back_and_forth(5))
    assert ledger.moved_to(cursor).cursor == min(max(cursor, 0), len(ledger.steps))
