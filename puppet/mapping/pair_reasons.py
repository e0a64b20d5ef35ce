"""Why a pair was proposed: the parts of its score, how sure that is, and what else there was."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from puppet.mapping.confidence import confidence
from puppet.mapping.proposal import Pair, RunnerUp


@dataclass(frozen=True, slots=True)
class Reasoning:
    """What stands behind the pairs of one limb, or behind one pair of the trunk.

    parts: contributions by the names in `evidence.PARTS`; they add up to score.
    margin: how much worse the whole would be without it. weight: how much of the evidence it
    rests on, 0..1; what rests on a part of it is less sure.
    """

    score: float
    margin: float
    parts: dict[str, float]
    runners_up: tuple[RunnerUp, ...]
    weight: float = 1.0

    def pair(
        self,
        name: str,
        bones: tuple[int, ...],
        human: int,
        decided: str,
        never: Collection[int] = (),
    ) -> Pair:
        """A pair with this reasoning; what the operator decided is certain.

        never: what cannot be a runner-up.
        """
        sure = 1.0 if decided else confidence(self.weight * self.score, self.weight * self.margin)
        return Pair(
            name,
            bones,
            human,
            self.score,
            sure,
            self.margin,
            self.parts,
            tuple(other for other in self.runners_up if other.human not in (human, *never)),
            decided,
        )
