"""What the operator said: decisions on pairs, limbs, masters and the mode, with undo and redo.

A `Decision` is one act; what is decided in one go is a step. `Ledger` is the list of steps with a
cursor: undo moves back, redo forward, and a new step drops what was undone. `Verdicts` is what
holds after the steps up to the cursor, and the only thing that a mapping builder looks at.

A pair's partner may be a human bone or a control point (``hand.R``), or for a whole limb one of the
performer's limbs (``arm.R``): then it is about the limb that the bone belongs to.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import msgspec

from puppet.armature import Armature
from puppet.errors import BadDecisionError
from puppet.mapping.human import CONTROL_POINTS, LIMB_NAMES, WHOLE_LIMBS
from puppet.mapping.proposal import Mode
from puppet.skeleton import HUMAN_BONE_NAMES

#: accept: the proposal was right. lock: keep it, whatever else changes. set: by hand, and the human
#: bone may drive others too. reject: it was wrong. forbid: never. clear: nothing was said of it.
#: mode: be driven by FK or IK. group, ungroup: make a master of effectors, or take it apart.
Act = Literal["accept", "lock", "set", "reject", "forbid", "clear", "mode", "group", "ungroup"]
KEEPS: Final = frozenset({"accept", "lock", "set"})
BANS: Final = frozenset({"reject", "forbid"})
#: Steps that a ledger keeps one by one; older ones are kept as what they came to.
LONGEST_HISTORY: Final = 500


class Decision(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """One act of the operator.

    act: see `Act`. mode: which mapping a pair belongs to; for the act "mode", the new one.
    bone: a bone, effector or master. human: its partner; "" with clear means all of the bone's.
    effectors: of a new master. who, when: for the history; ISO 8601.
    """

    act: Act
    mode: Mode
    bone: str = ""
    human: str = ""
    effectors: tuple[str, ...] = ()
    who: str = ""
    when: str = ""

    def sentence(self) -> str:
        """For people."""
        if self.act == "mode":
            return f"drive it by {self.mode.upper()}"
        if self.act == "group":
            return f"join {', '.join(self.effectors)} under the master {self.bone}"
        if self.act == "ungroup":
            return f"take the master {self.bone} apart"
        if self.act == "clear":
            return f"clear what was said of {self.bone}" + (self.human and f" and {self.human}")
        return f"{self.act} {self.bone} = {self.human}"


@dataclass(frozen=True, slots=True)
class Verdicts:
    """What holds now.

    mode: how the puppet is driven. kept: by (mode, bone), the partner and the act that said so.
    banned: (mode, bone, partner) and the act. masters: by name, their effectors.
    """

    mode: Mode = "fk"
    kept: Mapping[tuple[Mode, str], tuple[str, Act]] = field(default_factory=dict)
    banned: Mapping[tuple[Mode, str, str], Act] = field(default_factory=dict)
    masters: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def kept_in(self, mode: Mode) -> dict[str, tuple[str, Act]]:
        """By bone, for one mode."""
        return {bone: verdict for (its, bone), verdict in self.kept.items() if its == mode}

    def banned_in(self, mode: Mode) -> dict[tuple[str, str], Act]:
        """By bone and partner, for one mode."""
        return {(b, human): act for (its, b, human), act in self.banned.items() if its == mode}

    def with_act(self, decision: Decision, armature: Armature) -> Verdicts:
        """What holds after one more act.

        Raises BadDecisionError for a bone, partner or master that is not there, a partner that
        another bone is locked to, and an act that makes no sense.
        """
        if decision.act == "mode":
            return replace(self, mode=decision.mode)
        if decision.act in ("group", "ungroup"):
            return self._grouped(decision, armature)
        self._check_pair(decision, armature)
        mode, bone, human = decision.mode, decision.bone, decision.human
        kept, banned = dict(self.kept), dict(self.banned)
        if decision.act == "clear":
            if not human or kept.get((mode, bone), ("",))[0] == human:
                kept.pop((mode, bone), None)
            for key in [k for k in banned if k[:2] == (mode, bone) and human in ("", k[2])]:
                del banned[key]
        elif decision.act in KEEPS:
            if mode == "ik":
                self._check_movable(decision, armature)
            if decision.act != "set":
                self._check_free(decision)
            kept[mode, bone] = (human, decision.act)
            banned.pop((mode, bone, human), None)
        else:
            banned[mode, bone, human] = decision.act
            if kept.get((mode, bone), ("",))[0] == human:
                del kept[mode, bone]
        return replace(self, kept=kept, banned=banned)

    def _grouped(self, decision: Decision, armature: Armature) -> Verdicts:
        masters = dict(self.masters)
        if decision.act == "ungroup":
            if masters.pop(decision.bone, None) is None:
                raise _wrong("there is no such master", decision.bone, sorted(masters))
            gone = ("ik", decision.bone)
            return replace(
                self,
                masters=masters,
                kept={key: value for key, value in self.kept.items() if key != gone},
                banned={key: value for key, value in self.banned.items() if key[:2] != gone},
            )
        if not decision.bone or decision.bone in armature.names:
            raise BadDecisionError(
                "a master needs a name that no bone has", where="bone", found=repr(decision.bone)
            )
        for name in decision.effectors:
            if name not in armature.names:
                raise _wrong("there is no such bone", name, armature.names)
        if len(set(decision.effectors)) < 2:
            raise BadDecisionError(
                "a master drives two or more bones",
                where=decision.bone,
                found=", ".join(decision.effectors) or "none",
            )
        for name, effectors in masters.items():
            shared = set(effectors) & set(decision.effectors)
            if name != decision.bone and shared:
                raise BadDecisionError(
                    "an effector belongs to another master already",
                    where=decision.bone,
                    found=f"{', '.join(sorted(shared))} of {name}",
                    hint=f"ungroup {name} first",
                )
        masters[decision.bone] = tuple(dict.fromkeys(decision.effectors))
        # From now on the master is what is decided about.
        held = {("ik", effector) for effector in decision.effectors}
        kept = {key: value for key, value in self.kept.items() if key not in held}
        return replace(self, masters=masters, kept=kept)

    def _check_pair(self, decision: Decision, armature: Armature) -> None:
        bones = [*armature.names, *(self.masters if decision.mode == "ik" else ())]
        if decision.bone not in bones:
            raise _wrong("there is no such bone", decision.bone, bones)
        partners = (*partners_of(decision.mode), *LIMB_NAMES)
        if decision.human not in partners and not (decision.act == "clear" and not decision.human):
            what = "human bone" if decision.mode == "fk" else "control point"
            raise _wrong(
                f"there is no such {what} or limb", decision.human, dict.fromkeys(partners)
            )
        movement = (
            armature.movements[armature.index(decision.bone)]
            if decision.bone in armature.names
            else "turn"
        )
        if decision.act in KEEPS and decision.mode == "fk" and movement != "turn":
            raise BadDecisionError(
                "this bone cannot turn, so nothing can drive it",
                where=decision.bone,
                found=f"a bone that {'slides' if movement == 'slide' else 'is fixed'}",
            )

    def _check_movable(self, decision: Decision, armature: Armature) -> None:
        """That a goal can move the bone."""
        if decision.bone not in armature.names:
            return
        if armature.parents[armature.index(decision.bone)] < 0:
            raise BadDecisionError(
                "this bone is a root: it goes where the performer goes, and no goal moves it",
                where=decision.bone,
                found=decision.sentence(),
            )
        for master, effectors in self.masters.items():
            if decision.bone in effectors:
                raise BadDecisionError(
                    "a master moves this bone already",
                    where=decision.bone,
                    found=f"{decision.bone} of {master}",
                    hint=f"decide about {master}, or ungroup it first",
                )

    def _check_free(self, decision: Decision) -> None:
        if decision.mode == "fk" and decision.human in WHOLE_LIMBS:
            return
        ours = _driver(decision.mode, decision.human)
        for (mode, bone), (human, act) in self.kept.items():
            if mode == decision.mode and _driver(mode, human) == ours and bone != decision.bone:
                raise BadDecisionError(
                    f"{human} drives another bone already",
                    where=f"{decision.act} {decision.bone} = {human}",
                    found=f"{act} {bone} = {human}",
                    hint=f"clear {bone} first, or set {decision.bone} by hand: then both follow it",
                )


def _driver(mode: Mode, human: str) -> str:
    """What moves a bone; under IK that of a whole limb is its control point."""
    if mode == "ik" and human in LIMB_NAMES:
        return CONTROL_POINTS[LIMB_NAMES.index(human)]
    return human


def partners_of(mode: Mode) -> tuple[str, ...]:
    """What can drive something: 17 human bones, or 5 control points."""
    return HUMAN_BONE_NAMES if mode == "fk" else CONTROL_POINTS


def _wrong(what: str, found: str, there: Iterable[str]) -> BadDecisionError:
    return BadDecisionError(what, expected=f"one of {', '.join(there)}", found=found)


def check_together(decisions: Iterable[Decision]) -> None:
    """Raises BadDecisionError if decisions that are given at once contradict each other.

    One after the other, a later one would replace an earlier one; given at once, nobody can say
    which was meant.
    """
    kept: dict[tuple[Mode, str], str] = {}
    banned: set[tuple[Mode, str, str]] = set()
    for decision in decisions:
        bone = (decision.mode, decision.bone)
        if decision.act in KEEPS:
            if kept.get(bone, decision.human) != decision.human:
                raise BadDecisionError(
                    "a bone cannot be locked to two things at once",
                    where=decision.bone,
                    found=f"{kept[bone]} and {decision.human}",
                )
            kept[bone] = decision.human
        elif decision.act in BANS:
            banned.add((*bone, decision.human))
    for (mode, name), human in kept.items():
        if (mode, name, human) in banned:
            raise BadDecisionError("a pair cannot be locked and forbidden", where=f"{name}={human}")


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
        check_together(step)
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
