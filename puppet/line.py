"""The line: from a raw skeleton frame to the poses of all puppets on stage.

Pure but for its memory (conditioning, neutral stance, transitions), which lives on capture time
alone: the same frames give the same poses, bit for bit, at any speed and in any process. The stage
runs it live; `puppet render`, the tests and the benchmarks run it without a bus.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from puppet.cast import StagedPuppet
from puppet.driven import DrivenPuppet
from puppet.mapping.proposal import Proposal
from puppet.mapping.stance import Stance, upright
from puppet.pose import Pose
from puppet.show import ConditioningConfig
from puppet.skeleton import SkeletonFrame, nobody
from puppet.tracking.condition import Conditioner
from puppet.tracking.neutral import NeutralStance


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """What one step of the line gives.

    frame: the conditioned skeleton. neutral: the stance puppets count from, None until somebody
    was seen. measured: whether that stance was really seen. poses: by the puppets' names.
    """

    frame: SkeletonFrame
    neutral: Stance | None
    measured: bool
    poses: dict[str, Pose]


class Line:
    """Conditioning, mapping and finishing for one performer and the puppets that follow."""

    def __init__(
        self, puppets: Iterable[StagedPuppet], conditioning: ConditioningConfig | None = None
    ) -> None:
        self.puppets = tuple(puppets)
        self._condition = Conditioner(conditioning)
        self._neutral = NeutralStance()
        unseen = upright(np.zeros(3), 0.0)
        self._driven = {puppet.name: DrivenPuppet(puppet, unseen) for puppet in self.puppets}
        self._last: SkeletonFrame | None = None

    @property
    def time(self) -> float | None:
        """Capture time of the last step."""
        return None if self._last is None else self._last.time

    def step(self, frame: SkeletonFrame) -> Tick:
        """Take in a frame; its time must be later than the last one's."""
        dt = 0.0 if self._last is None else frame.time - self._last.time
        self._last = frame
        conditioned = self._condition(frame)
        if self._neutral(conditioned):
            self._count_from(self._neutral.stance)
        poses = {
            name: driven.step(conditioned, max(dt, 0.0)) for name, driven in self._driven.items()
        }
        return Tick(conditioned, self._neutral.stance, self._neutral.measured, poses)

    def idle(self, time: float) -> Tick:
        """Go on without a frame: as if nobody was there. Holding and easing go on."""
        last = self._last
        if last is None:
            return self.step(nobody(time, 0))
        return self.step(replace(nobody(time, last.sequence), performer=last.performer))

    def at_rest(self, time: float) -> Tick:
        """Every puppet at rest at its place, as before any frame; changes nothing."""
        unseen = nobody(time, 0)
        unseen = replace(unseen, influence=np.zeros_like(unseen.influence))
        poses = {name: driven.asked(unseen) for name, driven in self._driven.items()}
        return Tick(unseen, None, False, poses)

    def set_mapping(self, puppet: str, proposal: Proposal) -> None:
        """Drive a puppet by another mapping from the next step on; it gets there without a jump."""
        self._driven[puppet].set_mapping(proposal)

    def mapping(self, puppet: str) -> Proposal:
        """What drives a puppet now."""
        return self._driven[puppet].proposal

    def warm_up(self) -> None:
        """Compile every kernel of the line before the show, with a line that is thrown away."""
        stand_in = Line(self.puppets)
        points = np.zeros((20, 3))
        for sequence in range(3):
            frame = SkeletonFrame(
                sequence / 30.0, sequence, 0, points, np.full(20, sequence, np.uint8)
            )
            tick = stand_in.step(frame)
        for driven in stand_in._driven.values():
            driven.warm_up(tick.frame)

    def _count_from(self, stance: Stance | None) -> None:
        if stance is None:
            return
        for driven in self._driven.values():
            driven.set_neutral(stance)
