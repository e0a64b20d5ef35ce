"""Finding the performer's neutral stance: the moment when somebody simply stands there.

Until such a moment comes, an upright stance at the place and in the heading where the performer was
first seen has to do. It is found once for each performer, and again on request.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from puppet.kernel import Floats
from puppet.mapping.stance import Stance, stance_of, upright
from puppet.skeleton import Joint, SkeletonFrame, TrackingState

STILL_SECONDS: Final = 0.7
#: Metres within which every needed joint stays for that long.
STILL_WITHIN: Final = 0.06
#: Radians by which a hanging upper arm, a thigh or the trunk may lean.
LEAN: Final = math.radians(30.0)

_NEEDED: Final = (
    Joint.HIP_CENTER,
    Joint.SHOULDER_CENTER,
    Joint.SHOULDER_LEFT,
    Joint.SHOULDER_RIGHT,
    Joint.ELBOW_LEFT,
    Joint.ELBOW_RIGHT,
    Joint.WRIST_LEFT,
    Joint.WRIST_RIGHT,
    Joint.HIP_LEFT,
    Joint.HIP_RIGHT,
    Joint.KNEE_LEFT,
    Joint.KNEE_RIGHT,
)
_HANGING: Final = (
    (Joint.SHOULDER_CENTER, Joint.HIP_CENTER),
    (Joint.SHOULDER_LEFT, Joint.ELBOW_LEFT),
    (Joint.SHOULDER_RIGHT, Joint.ELBOW_RIGHT),
    (Joint.ELBOW_LEFT, Joint.WRIST_LEFT),
    (Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT),
    (Joint.HIP_LEFT, Joint.KNEE_LEFT),
    (Joint.HIP_RIGHT, Joint.KNEE_RIGHT),
)


class NeutralStance:
    """Watches conditioned frames and knows the neutral stance.

    stance: the one to count from now; None before anybody was seen.
    measured: whether the performer stood still for it, or it is only assumed.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget it: the next frame gives an assumed stance, the next stillness a measured one."""
        self.stance: Stance | None = None
        self.measured = False
        self._recent: deque[SkeletonFrame] = deque()

    def __call__(self, frame: SkeletonFrame) -> bool:
        """Take a frame in. True if the stance has changed."""
        if not frame.present:
            self._recent.clear()
            return False
        changed = False
        if self.stance is None:
            now = stance_of(frame.positions)
            self.stance = upright(now.hip, now.heading)
            changed = True
        if not self.measured:
            still = self._stillness(frame)
            if still is not None:
                self.stance = stance_of(still)
                self.measured = changed = True
                self._recent.clear()
        return changed

    def _stillness(self, frame: SkeletonFrame) -> Floats | None:
        """The mean (20, 3) of the last moments, if they were a neutral stance."""
        if not (frame.states[list(_NEEDED)] == TrackingState.TRACKED).all():
            self._recent.clear()
            return None
        self._recent.append(frame)
        while frame.time - self._recent[0].time > STILL_SECONDS:
            self._recent.popleft()
        if frame.time - self._recent[0].time < 0.8 * STILL_SECONDS or len(self._recent) < 8:
            return None
        points = np.stack([past.positions for past in self._recent])
        if np.ptp(points[:, _NEEDED], axis=0).max() > STILL_WITHIN:
            return None
        mean = np.asarray(points.mean(axis=0))
        return mean if all(_hangs(mean[end] - mean[start]) for start, end in _HANGING) else None


def _hangs(direction: Floats) -> bool:
    length = float(np.linalg.norm(direction))
    return length > 1e-6 and -direction[1] >= math.cos(LEAN) * length
