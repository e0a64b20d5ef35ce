"""A finisher that keeps any bone from turning faster than a puppet's joints could.

A tracker's glitch of a single frame would otherwise be seen as a twitch; what is slower than the
limit goes through untouched.
"""

from __future__ import annotations

import math

import numpy as np

from puppet.kernel import Floats, kernel
from puppet.pose import Pose
from puppet.rotation import conjugate, exp, log, multiply, shortest

#: Radians a second. An elbow in an ordinary gesture stays below; only throwing is faster.
FASTEST = math.radians(720.0)


@kernel
def _limit(shown: Floats, wanted: Floats, most: float, out: Floats) -> None:
    for bone in range(len(wanted)):
        turn = log(shortest(multiply(wanted[bone], conjugate(shown[bone]))))
        angle = math.sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2])
        if angle <= most:
            out[bone] = wanted[bone]
        else:
            out[bone] = multiply(exp(turn * (most / angle)), shown[bone])


class TurnLimit:
    """Remembers what was shown. fastest: radians a second, for bones and the whole puppet."""

    def __init__(self, fastest: float = FASTEST) -> None:
        self.fastest = fastest
        self.reset()

    def reset(self) -> None:
        """Forget what was shown: the next pose goes through as it is."""
        self._shown: Floats | None = None

    def __call__(self, pose: Pose, dt: float) -> Pose:
        """The pose to show, `dt` seconds after the one before."""
        wanted = np.vstack([pose.rotation, pose.bones])
        out = wanted
        if self._shown is not None:
            out = np.empty_like(wanted)
            _limit(self._shown, wanted, self.fastest * dt, out)
        self._shown = out
        return Pose(pose.translation, out[0], out[1:])
