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

    position: (3,) metres, world. yaw: radians about +Y. follow: how many metres the puppet goes for
    each metre of the performer's hip: (3,) along the performer's own left, up and forward; or one
    number, which leaves it to legs that stand how far they bend; None leaves all to the drive.
    turn: how much of the performer's turning on the spot it takes over, 0..1.
    grounded: whether it stands on the floor, and so never sinks when the performer squats.
    sinks: whether it stands on legs of its own, which bend when the performer squats.
    """

    position: Floats = field(default_factory=lambda: np.zeros(3))
    yaw: float = 0.0
    follow: Floats | float | None = None
    turn: float = 1.0
    grounded: bool = False
    sinks: bool = False

    @property
    def along(self) -> Floats:
        """(3,) what `follow` comes to."""
        return np.broadcast_to(FOLLOW if self.follow is None else self.follow, 3)

    def on_legs(self, scale: float, bend: bool) -> Placement:
        """The same, standing on legs that take `scale` times the performer's steps.

        Then it goes about as far as its steps are long, and down as far as its legs bend if they
        can, in all directions for which nothing else was asked.
        """
        follow = self.follow
        if not isinstance(follow, np.ndarray):
            aside = scale if follow is None else follow
            follow = np.array([aside, scale, aside])
        return replace(self, follow=follow, sinks=bend)

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
