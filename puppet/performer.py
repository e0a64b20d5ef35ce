"""One performer on the line: conditioned joints, and the neutral stance that they count from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from puppet.mapping.stance import Stance
from puppet.show import ConditioningConfig
from puppet.skeleton import SkeletonFrame, nobody
from puppet.tracking.conditioning.condition import Conditioner
from puppet.tracking.conditioning.steps import ConditioningSteps
from puppet.tracking.neutral import NeutralStance


@dataclass(frozen=True, slots=True, eq=False)
class PerformerTick:
    """A performer after one step.

    raw: what the tracker said; joints that it did not see are not tracked. frame: the conditioned
    skeleton. neutral: the stance that puppets count from; None until somebody was seen.
    measured: whether that stance was really seen. anew: whether it is another one since the last
    step. steps: the skeleton before and after each step of conditioning.
    """

    raw: SkeletonFrame
    frame: SkeletonFrame
    neutral: Stance | None
    measured: bool
    anew: bool
    steps: ConditioningSteps


#: Influence that nobody sees.
FAINT: Final = 0.001


class Performer:
    """The memory of one performer. `number` is what the tracker calls them."""

    def __init__(
        self,
        number: int,
        conditioning: ConditioningConfig | None = None,
        stance: Stance | None = None,
    ) -> None:
        """stance: the neutral one, if it was captured before the show."""
        self.number = number
        self.seen = 0.0  # capture time at which somebody was there last
        self.faded = False  # whether nothing is left of them until they are seen again
        self.condition = Conditioner(conditioning)
        self.neutral = NeutralStance(stance)
        if stance is not None:
            self.condition.count_from(stance)

    def step(self, frame: SkeletonFrame | None, time: float, sequence: int) -> PerformerTick:
        """Take in what is seen of them, or None: then holding and easing go on."""
        if frame is None:
            frame = nobody(time, sequence, self.number)
        elif frame.present:
            self.seen = time
        conditioned = self.condition(frame)
        self.faded = not frame.present and not (conditioned.influence > FAINT).any()
        anew = self.neutral(conditioned)
        if anew and self.neutral.stance is not None:
            self.condition.count_from(self.neutral.stance)
        steps = self.condition.steps
        assert steps is not None  # there was a frame just now
        return PerformerTick(
            frame,
            conditioned,
            self.neutral.stance,
            self.neutral.measured,
            anew,
            steps,
        )
