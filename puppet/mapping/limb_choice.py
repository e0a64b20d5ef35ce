"""Limbs (FK) or end effectors (IK) against the performer's limbs, with the operator's decisions.

Rows are what is to be driven, columns the performer's limbs. Decisions only open and close places
of this small matrix, so that the evidence behind it is never worked out again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from puppet.kernel import Floats
from puppet.mapping.decisions import BANS, KEEPS, Verdicts
from puppet.mapping.evidence import PARTS, TOPOLOGY, Evidence
from puppet.mapping.human import HUMAN_LIMBS, LIMB_NAMES, WHOLE_LIMBS
from puppet.mapping.pair_reasons import Reasoning
from puppet.mapping.proposal import Mode, RunnerUp
from puppet.mapping.ranking import Assignment, Merit, Solver, hungarian, ranked, sum_of_powers
from puppet.skeleton import HUMAN_BONE_NAMES


@dataclass(frozen=True, slots=True, eq=False)
class LimbChoice:
    """scores: (R, 5), 0..1. parts: (6, R, 5), their sums. allowed: (R, 5) after the decisions.

    possible: (R, 5) what could be if nothing were kept. evidence: what it was made from.
    """

    scores: Floats
    parts: Floats
    allowed: np.ndarray
    possible: np.ndarray
    evidence: Evidence

    def ranked(self, solve: Solver) -> Iterator[tuple[Merit, Assignment]]:
        """Assignments, best first."""
        return ranked(self.scores, self.allowed, solve)

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


def choices(evidence: Evidence, verdicts: Verdicts, mode: Mode) -> LimbChoice:
    """The limbs of an armature as rows."""
    allowed = evidence.allowed.copy()
    rows = {
        evidence.armature.names[bone]: row
        for row, limb in enumerate(evidence.limbs)
        for bone in limb.bones
    }
    for (bone, human), act in verdicts.banned_in(mode).items():
        if act in BANS and bone in rows and human in WHOLE_LIMBS:
            allowed[rows[bone], LIMB_NAMES.index(human)] = False
    _close_what_cannot_be_paired(evidence, verdicts, allowed, mode)
    possible = allowed.copy()
    kept = {rows[bone] for bone in verdicts.kept_in(mode) if bone in rows}
    for bone, (human, act) in verdicts.kept_in(mode).items():
        column = limb_of(human)
        if act not in KEEPS or bone not in rows or column is None:
            continue
        # One correction, and the rest of the limb goes with it.
        row = rows[bone]
        allowed[row, :] = False
        if act != "set":
            allowed[:, column] = False
        allowed[row, column] = True
        across = _across(evidence, row, column)
        if across is not None and across[0] not in kept:
            other, free = across
            allowed[other, :] = False
            allowed[:, free] = False
            allowed[other, free] = possible[other, column]
    return LimbChoice(evidence.scores, evidence.parts, allowed, possible, evidence)


def _across(evidence: Evidence, row: int, column: int) -> tuple[int, int] | None:
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
    """The column of a human bone, control point or limb; None for the trunk."""
    if human in LIMB_NAMES:
        return LIMB_NAMES.index(human)
    bone = HUMAN_BONE_NAMES.index(human)
    return next((i for i, limb in enumerate(HUMAN_LIMBS) if bone in limb.bones), None)


def _close_what_cannot_be_paired(
    evidence: Evidence, verdicts: Verdicts, allowed: np.ndarray, mode: Mode
) -> None:
    """A limb whose every pair with a human limb is banned does not go with it."""
    banned = set(verdicts.banned_in(mode))
    if not banned:
        return
    names = evidence.armature.names
    for row, limb in enumerate(evidence.limbs):
        for column, human in enumerate(HUMAN_LIMBS):
            bones = limb.bones if mode == "fk" else limb.bones[-1:]
            humans = human.playable if mode == "fk" else (human.tip,)
            if all((names[b], HUMAN_BONE_NAMES[h]) in banned for b in bones for h in humans):
                allowed[row, column] = False
