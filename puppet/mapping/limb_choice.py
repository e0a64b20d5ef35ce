"""Limbs (FK) or end effectors (IK) against the performer's limbs, with the operator's decisions.

Rows are what is to be driven, columns the performer's limbs. Decisions only open and close places
of this small matrix, so that the evidence behind it is never worked out again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from puppet.kernel import Floats
from puppet.mapping.decisions import Act
from puppet.mapping.evidence import PARTS, TOPOLOGY, Evidence
from puppet.mapping.human import HUMAN_LIMBS, LIMB_NAMES, LIMB_OF_BONE, WHOLE_LIMBS
from puppet.mapping.pair_reasons import Reasoning
from puppet.mapping.proposal import RunnerUp
from puppet.mapping.ranking import hungarian, sum_of_powers
from puppet.mapping.verdicts import Verdicts
from puppet.skeleton import HUMAN_BONE_NAMES


@dataclass(frozen=True, slots=True, eq=False)
class LimbChoice:
    """scores: (R, 5), 0..1. parts: (6, R, 5), their sums. allowed: (R, 5) after the decisions.

    possible: (R, 5) what could be if nothing were kept. evidence: what it was made from.
    whole: rows that were decided about as a whole, their column and the act.
    """

    scores: Floats
    parts: Floats
    allowed: np.ndarray
    possible: np.ndarray
    evidence: Evidence
    whole: Mapping[int, tuple[int, Act]] = field(default_factory=dict)

    def reasoning(self, row: int, column: int) -> Reasoning:
        """Why this row goes with this column."""
        others = sorted(
            (
                RunnerUp(HUMAN_LIMBS[other].tip, float(self.scores[row, other]))
                for other in range(len(HUMAN_LIMBS))
                if other != column and self.possible[row, other]
            ),
            key=lambda runner: -runner.score,
        )
        parts = {part: float(self.parts[i, row, column]) for i, part in enumerate(PARTS)}
        return Reasoning(
            float(self.scores[row, column]), self._margin(row, column), parts, tuple(others)
        )

    def spine_reasoning(self, bone: int, human: int) -> Reasoning:
        """Why this bone goes with this human bone, for bones that belong to no limb."""
        # Bones have the paper's blocks alone: a part of the score of limbs, and here the whole.
        scores = np.clip(self.evidence.bone_scores[bone] / TOPOLOGY, 0.0, 1.0)
        best = np.argsort(-scores, kind="stable")[:4]
        others = tuple(
            RunnerUp(int(h), float(scores[h])) for h in best if h != human and scores[h] > 0.0
        )
        second = max((other.score for other in others), default=0.0)
        parts = {
            part: float(self.evidence.bones[i, bone, human]) / TOPOLOGY
            for i, part in enumerate(PARTS)
        }
        score = float(scores[human])
        return Reasoning(score, score - second, parts, others[:3], weight=TOPOLOGY)

    def _margin(self, row: int, column: int) -> float:
        """How much the best assignment loses without this pair."""
        with_pair, without = self.allowed.copy(), self.allowed.copy()
        with_pair[row, :] = False
        with_pair[:, column] = False
        with_pair[row, column] = True
        without[row, column] = False
        best = sum_of_powers(self.scores, hungarian(self.scores, with_pair))[0]
        return best - sum_of_powers(self.scores, hungarian(self.scores, without))[0]


def choices(evidence: Evidence, verdicts: Verdicts) -> LimbChoice:
    """The limbs of an armature as rows, under FK."""
    names = evidence.armature.names
    rows = {names[bone]: row for bone, row in evidence.row_of_bone.items()}
    closed = _closed(evidence, verdicts, rows)
    allowed = evidence.allowed & ~closed
    possible = allowed.copy()
    # One correction, and the rest of the limb goes with it; what was said of the limb comes first.
    led: dict[int, tuple[int, Act]] = {}
    for bone, (human, act) in verdicts.kept_in("fk").items():
        column = limb_of(human)
        if column is not None and bone in rows:
            led[rows[bone]] = (column, act)
    whole = {rows[bone]: (LIMB_NAMES.index(h), act) for bone, (h, act) in verdicts.limbs.items()}
    led.update(whole)
    for row, (column, act) in led.items():
        allowed[row, :] = False
        if act != "set":
            allowed[:, column] = False
    for row, (column, _) in led.items():
        allowed[row, column] = True
        twin = across(evidence, row, column)
        given = {its for its, _ in led.values()}
        if twin is not None and twin[0] not in led and twin[1] not in given:
            other, free = twin
            allowed[other, :] = False
            allowed[:, free] = False
            allowed[other, free] = bool(possible[other, column] and not closed[other, free])
    return LimbChoice(evidence.scores, evidence.parts, allowed, possible, evidence, whole)


def _closed(evidence: Evidence, verdicts: Verdicts, rows: dict[str, int]) -> np.ndarray:
    """(L, 5) what was ruled out: as a whole, or pair by pair."""
    closed = np.zeros(evidence.allowed.shape, bool)
    banned = verdicts.banned_in("fk")
    for name, limb_name in banned:
        if limb_name in WHOLE_LIMBS and name in rows:
            closed[rows[name], LIMB_NAMES.index(limb_name)] = True
    if not banned:
        return closed
    names = evidence.armature.names
    for row, limb in enumerate(evidence.limbs):
        for column, human in enumerate(HUMAN_LIMBS):
            closed[row, column] |= all(
                (names[b], HUMAN_BONE_NAMES[h]) in banned
                for b in limb.bones
                for h in human.playable
            )
    return closed


def across(evidence: Evidence, row: int, column: int) -> tuple[int, int] | None:
    """If a limb is given to the other side, the one across from it, and what that leaves free."""
    limb, human = evidence.limbs[row], HUMAN_LIMBS[column]
    if not limb.side or not human.side or limb.side == human.side:
        return None
    twins = [
        other
        for other, its in enumerate(evidence.limbs)
        if its.side == human.side and its.hub == limb.hub
    ]
    if not twins:
        return None
    twin = min(twins, key=lambda other: abs(evidence.limbs[other].reach - limb.reach))
    return twin, LIMB_NAMES.index(f"{human.name.split('.')[0]}.{limb.side}")


def limb_of(human: str) -> int | None:
    """The column of a human bone's limb; None for the trunk."""
    return LIMB_OF_BONE.get(HUMAN_BONE_NAMES.index(human))
