"""All that was decided of one puppet, step by step, with undo and redo."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from puppet.armature import Armature
from puppet.errors import BadDecisionError
from puppet.mapping.decisions import BANS, KEEPS, Decision
from puppet.mapping.human import HUMAN_LIMBS, WHOLE_LIMBS
from puppet.mapping.proposal import Mode
from puppet.mapping.verdicts import Verdicts
from puppet.mapping.whole_limbs import bones_of, first_of_limb, said_of

#: Steps that a ledger keeps one by one; older ones are kept as what they came to.
LONGEST_HISTORY: Final = 500
#: What was decided in one go, and is undone in one go.
Step = tuple[Decision, ...]


@dataclass(frozen=True, slots=True)
class Ledger:
    """All that was decided of one puppet, step by step, and how many steps hold.

    start: what held before the first of them. steps and states: each step, and what held after it.
    cursor: steps from here on were undone.
    """

    start: Verdicts = field(default_factory=Verdicts)
    steps: tuple[Step, ...] = ()
    states: tuple[Verdicts, ...] = ()
    cursor: int = 0

    @property
    def verdicts(self) -> Verdicts:
        """What holds now."""
        return self.states[self.cursor - 1] if self.cursor else self.start

    def with_step(self, step: Iterable[Decision], armature: Armature) -> Ledger:
        """One step more; what was undone is dropped.

        Raises BadDecisionError if something in it is not possible, or contradicts the rest of it.
        """
        step = tuple(step)
        if not step:
            raise BadDecisionError("nothing was decided")
        check_together(step, armature, self.verdicts.masters)
        state = self.verdicts
        for decision in step:
            state = state.with_act(decision, armature)
        steps = (*self.steps[: self.cursor], step)
        states = (*self.states[: self.cursor], state)
        if len(steps) <= LONGEST_HISTORY:
            return Ledger(self.start, steps, states, len(steps))
        return Ledger(states[0], steps[1:], states[1:], len(steps) - 1)

    def moved_to(self, cursor: int) -> Ledger:
        """The same steps, of which the first `cursor` hold."""
        return replace(self, cursor=min(max(cursor, 0), len(self.steps)))

    def undone(self) -> Ledger:
        """One step less. Raises BadDecisionError if there is none."""
        if not self.cursor:
            raise BadDecisionError("there is nothing to undo")
        return self.moved_to(self.cursor - 1)

    def redone(self) -> Ledger:
        """The last undone step again. Raises BadDecisionError if there is none."""
        if self.cursor == len(self.steps):
            raise BadDecisionError("there is nothing to redo")
        return self.moved_to(self.cursor + 1)


def check_together(
    decisions: Iterable[Decision],
    armature: Armature,
    masters: Mapping[str, tuple[str, ...]] | None = None,
) -> None:
    """Raises BadDecisionError if decisions that are given at once contradict each other.

    One after the other, a later one would replace an earlier one; given at once, nobody can say
    which was meant. masters: those there are before.
    """
    masters = dict(masters or {})
    kept: dict[tuple[Mode, str, bool], str] = {}
    banned: set[tuple[Mode, str, str]] = set()
    for decision in decisions:
        if decision.act == "group":
            masters[decision.bone] = decision.effectors
        if decision.act not in KEEPS | BANS:
            continue
        said = decision
        if decision.bone in armature.names or decision.bone in masters:
            said = said_of(decision, armature, masters)
        whole = said.mode == "fk" and said.human in WHOLE_LIMBS
        key = (said.mode, said.bone, whole)
        if decision.act in BANS:
            banned.add((said.mode, said.bone, said.human))
        elif kept.setdefault(key, said.human) != said.human:
            raise BadDecisionError(
                f"a {'limb' if whole else 'bone'} cannot be locked to two things at once",
                where=decision.bone,
                found=f"{kept[key]} and {said.human}",
            )
    for (mode, name, _), human in kept.items():
        ruled_out = {(mode, name, human)}
        limb = next((limb for limb in HUMAN_LIMBS if human in bones_of(limb)), None)
        first = first_of_limb(armature, name)
        if mode == "fk" and limb is not None and first is not None:
            ruled_out.add((mode, first, limb.name))
        clash = banned & ruled_out
        if clash:
            _, bone, partner = min(clash)
            raise BadDecisionError(
                "a pair cannot be locked and forbidden",
                where=f"{name}={human}",
                found=f"{bone}={partner} is forbidden",
            )
