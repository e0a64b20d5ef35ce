"""Where a puppet stands, and how it goes about with the performer: the root of its pose."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from puppet.kernel import Floats
from puppet.mapping.stance import Stance
from puppet.rotation import multiply, rotate
from puppet.skeleton import Joint, SkeletonFrame

#: How far a puppet goes about with the performer if nobody says.
FOLLOW: Final = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Where a puppet stands and how it follows the performer about.

    position: (3,) metres, world. yaw: radians about +Y. follow: (3,) how many metres the puppet
    goes for each metre of the performer's hip, along the performer's own left, up and forward;
    None leaves it to the drive.
    turn: how much of the performer's turning on the spot it takes over, 0..1.
    grounded: whether it stands on the floor, and so never sinks when the performer squats.
    sinks: whether it stands on legs of its own, which bend when the performer squats.
    """

    position: Floats = field(default_factory=lambda: np.zeros(3))
    yaw: float = 0.0
    follow: Floats | None = None
    turn: float = 1.0
    grounded: bool = False
    sinks: bool = False

    @property
    def along(self) -> Floats:
        """What `follow` comes to."""
        return np.full(3, FOLLOW) if self.follow is None else self.follow

    def going(self, follow: float) -> Placement:
        """The same, following so far if nothing else was asked for."""
        if self.follow is not None:
            return self
        return replace(self, follow=np.full(3, follow))

    def root(self, frame: SkeletonFrame, neutral: Stance, heading: float) -> tuple[Floats, Floats]:
        """World translation (3,) and rotation (4,): the placement, then the performer's own way.

        heading: radians, the performer's now.
        """
        trust = float(frame.influence[Joint.HIP_CENTER])
        turned = math.remainder(heading - neutral.heading, 2.0 * math.pi)
        place = yaw(self.yaw)
        translation = self.position + rotate(place, self.moved(frame, neutral))
        return translation, multiply(place, yaw(turned * self.turn * trust))

    def moved(self, frame: SkeletonFrame, neutral: Stance) -> Floats:
        """(3,) metres that the puppet has gone, along the neutral stance's left, up and forward."""
        trust = float(frame.influence[Joint.HIP_CENTER])
        gone = rotate(yaw(-neutral.heading), frame.positions[Joint.HIP_CENTER] - neutral.hip)
        moved = gone * self.along * trust
        if self.grounded and not self.sinks:
            moved[1] = max(moved[1], 0.0)
        return np.asarray(moved)


def yaw(angle: float) -> Floats:
    """The rotation about +Y by `angle` radians. -> (4,)"""
    return np.array([0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)])
