"""What IK can move, one row for each: single end effectors, masters, and bones set by hand.

All that only masters change is worked out once for an armature and its masters; a decision on a
pair then opens and closes places of a small matrix and nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from puppet.kernel import Floats, Ints
from puppet.mapping.decisions import BANS, KEEPS, Act
from puppet.mapping.evidence import Evidence
from puppet.mapping.human import CONTROL_POINTS, HUMAN_LIMBS, LIMB_NAMES
from puppet.mapping.limb_choice import LimbChoice, across
from puppet.mapping.verdicts import Verdicts

#: Tables that are remembered: that of what holds, and those of what is offered beside it.
_REMEMBERED: Final = 64


@dataclass(frozen=True, slots=True)
class Effector:
    """One row of the choice: a single end effector, or a master.

    bones: what it moves. limbs: the rows of the evidence that these belong to.
    """

    name: str
    bones: tuple[int, ...]
    limbs: tuple[int, ...]

    @property
    def is_master(self) -> bool:
        """Whether it stands for several."""
        return len(self.bones) > 1


@dataclass(frozen=True, slots=True, eq=False)
class EffectorTable:
    """R rows: masters first, then the single effectors that no master holds, then what was set by
    hand.

    parts: (6, R, 5) as in `Evidence`, of a master the means of its effectors'. scores: (R, 5) their
        sums, 0..1. allowed: (R, 5) before any decision.
    row_of: by the name of an effector, a master or a bone of one.
    lengths, reaches: (R,) bones and metres of the chain that each ends; -1 where it ends none.
    """

    rows: tuple[Effector, ...]
    parts: Floats
    scores: Floats
    allowed: np.ndarray
    row_of: Mapping[str, int]
    lengths: Ints
    reaches: Floats

    def choice(self, evidence: Evidence, verdicts: Verdicts) -> LimbChoice:
        """The rows against the control points, after the decisions on pairs."""
        closed = np.zeros_like(self.allowed)
        for (bone, human), act in verdicts.banned_in("ik").items():
            if act in BANS and bone in self.row_of:
                closed[self.row_of[bone], column_of(human)] = True
        allowed = self.allowed & ~closed
        possible = allowed.copy()
        kept = self.kept(verdicts)
        for row, (column, act) in kept.items():
            allowed[row, :] = False
            if act != "set":
                allowed[:, column] = False
        for row, (column, act) in kept.items():
            # What is locked is no choice; what was set by hand still takes its control point from
            # whatever is less like it.
            if act == "set":
                allowed[row, column] = True
        for row, (column, _) in kept.items():
            self._cross_over(evidence, row, column, kept, possible, closed, allowed)
        return LimbChoice(self.scores, self.parts, allowed, possible, evidence)

    def _cross_over(
        self,
        evidence: Evidence,
        row: int,
        column: int,
        kept: Mapping[int, tuple[int, Act]],
        possible: np.ndarray,
        closed: np.ndarray,
        allowed: np.ndarray,
    ) -> None:
        """What lies across from an effector that went to the other side gets what that left."""
        limbs = self.rows[row].limbs
        twin = across(evidence, limbs[0], column) if len(limbs) == 1 else None
        if twin is None:
            return
        limb, free = twin
        if any(free == its for its, _ in kept.values()):
            return  # it was given away as well
        for other, effector in enumerate(self.rows):
            if effector.limbs == (limb,) and other not in kept:
                allowed[other, :] = False
                allowed[:, free] = False
                allowed[other, free] = possible[other, column] and not closed[other, free]

    def kept(self, verdicts: Verdicts) -> dict[int, tuple[int, Act]]:
        """By row, the column that the operator gave it, and the act that said so; in the order of
        the rows."""
        kept = {
            self.row_of[name]: (column_of(human), act)
            for name, (human, act) in verdicts.kept_in("ik").items()
            if name in self.row_of and self.rows[self.row_of[name]].name == name
        }
        return dict(sorted(kept.items()))


def column_of(human: str) -> int:
    """The column of a control point, or of the limb that ends in it."""
    return (LIMB_NAMES if human in LIMB_NAMES else CONTROL_POINTS).index(human)


def effector_table(evidence: Evidence, verdicts: Verdicts) -> EffectorTable:
    """What can be moved, under the masters and with the bones set by hand that hold."""
    masters = tuple(sorted((name, tuple(its)) for name, its in verdicts.masters.items()))
    table = _table(evidence, masters, ())
    # By hand, any bone may be moved, not only a tip; a master's own bones move with it.
    others = tuple(
        sorted(
            bone
            for bone, (_, act) in verdicts.kept_in("ik").items()
            if act in KEEPS and bone not in table.row_of and _can_be_moved(evidence, bone)
        )
    )
    return _table(evidence, masters, others) if others else table


def _can_be_moved(evidence: Evidence, bone: str) -> bool:
    armature = evidence.armature
    return bone in armature.names and bool(armature.parents[armature.index(bone)] >= 0)


@dataclass(frozen=True, slots=True, eq=False)
class _Limbs:
    """owner: for each bone the limb that it belongs to or branches off. turns: (L,) whether
    anything in a limb turns under a goal, as a root never does. tips: an effector for each limb
    that does not end at a root. lengths, reaches: (L,) as in `EffectorTable`."""

    owner: Mapping[int, int]
    turns: np.ndarray
    tips: tuple[Effector, ...]
    lengths: Ints
    reaches: Floats


@lru_cache(maxsize=_REMEMBERED)
def _limbs(evidence: Evidence) -> _Limbs:
    armature, limbs = evidence.armature, evidence.limbs
    owner = {bone: row for row, limb in enumerate(limbs) for bone in limb.bones}
    for bone, parent in enumerate(armature.parents):
        if bone not in owner and int(parent) in owner:
            owner[bone] = owner[int(parent)]
    turns = [
        any(armature.movements[b] == "turn" and armature.parents[b] >= 0 for b in limb.bones)
        for limb in limbs
    ]
    tips = tuple(
        Effector(armature.names[limb.bones[-1]], (limb.bones[-1],), (row,))
        for row, limb in enumerate(limbs)
        if armature.parents[limb.bones[-1]] >= 0
    )
    return _Limbs(
        owner,
        np.array(turns, bool),
        tips,
        np.array([len(limb.bones) for limb in limbs], np.int32),
        np.array([limb.reach for limb in limbs], float),
    )


@lru_cache(maxsize=_REMEMBERED)
def _table(
    evidence: Evidence, masters: tuple[tuple[str, tuple[str, ...]], ...], others: tuple[str, ...]
) -> EffectorTable:
    limbs, index = _limbs(evidence), evidence.armature.index

    def of(name: str, bones: tuple[int, ...]) -> Effector:
        return Effector(name, bones, tuple(limbs.owner[b] for b in bones if b in limbs.owner))

    joined = [of(name, tuple(map(index, effectors))) for name, effectors in masters]
    held = {bone for effector in joined for bone in effector.bones}
    singles = [effector for effector in limbs.tips if effector.bones[0] not in held]
    rows = (*joined, *singles, *(of(bone, (index(bone),)) for bone in others))

    limb = np.array([row.limbs[0] if row.limbs else -1 for row in rows], np.int32)
    has = limb >= 0
    parts = np.zeros((len(evidence.parts), len(rows), len(HUMAN_LIMBS)))
    allowed = np.zeros((len(rows), len(HUMAN_LIMBS)), bool)
    lengths, reaches = np.full(len(rows), -1, np.int32), np.full(len(rows), -1.0)
    parts[:, has] = evidence.parts[:, limb[has]]
    allowed[has] = evidence.allowed[limb[has]] & limbs.turns[limb[has], None]
    lengths[has], reaches[has] = limbs.lengths[limb[has]], limbs.reaches[limb[has]]
    for row, effector in enumerate(rows):
        if len(effector.limbs) > 1:
            several = list(effector.limbs)
            parts[:, row] = evidence.parts[:, several].mean(axis=1)
            turning = [one for one in several if limbs.turns[one]]
            allowed[row] = evidence.allowed[turning].any(axis=0)
    names = evidence.armature.names
    row_of = {names[bone]: row for row, effector in enumerate(rows) for bone in effector.bones}
    row_of |= {effector.name: row for row, effector in enumerate(rows)}
    scores = np.clip(parts.sum(axis=0), 0.0, 1.0)
    for array in (parts, scores, allowed, lengths, reaches):
        array.setflags(write=False)
    return EffectorTable(rows, parts, scores, allowed, row_of, lengths, reaches)
