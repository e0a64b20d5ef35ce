"""A finisher that lets a puppet pass from one way of being driven to another without a jump."""

from __future__ import annotations

import numpy as np

from puppet.kernel import Floats, kernel
from puppet.pose import Pose
from puppet.rotation import slerp


@kernel
def _mix(a: Floats, b: Floats, share: float, out: Floats) -> None:
    for bone in range(len(out)):
        out[bone] = slerp(a[bone], b[bone], share)


class Transition:
    """Blends from the last pose that was shown to the one that is asked for now.

    seconds: how long a transition takes.
    """

    def __init__(self, seconds: float = 0.5) -> None:
        self.seconds = seconds
        self.reset()

    def reset(self) -> None:
        """Forget what was shown."""
        self._shown: Pose | None = None
        self._from: Pose | None = None
        self._elapsed = 0.0

    def start(self) -> None:
        """From now on ease from what is shown; to be called when the mapping changes."""
        self._from = self._shown
        self._elapsed = 0.0

    def __call__(self, pose: Pose, dt: float) -> Pose:
        """The pose to show, `dt` seconds after the one before."""
        if self._from is not None:
            self._elapsed += dt
            t = min(self._elapsed / self.seconds, 1.0) if self.seconds > 0 else 1.0
            pose = blend(self._from, pose, t * t * (3.0 - 2.0 * t))
            if t >= 1.0:
                self._from = None
        self._shown = pose
        return pose


def blend(a: Pose, b: Pose, share: float) -> Pose:
    """From pose `a` (share 0) to pose `b` (share 1)."""
    bones = np.empty_like(b.bones)
    _mix(np.ascontiguousarray(a.bones), np.ascontiguousarray(b.bones), share, bones)
    return Pose(
        a.translation + (b.translation - a.translation) * share,
        slerp(a.rotation, b.rotation, share),
        bones,
    )
