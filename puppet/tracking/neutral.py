"""Finding the performer's neutral stance: the moment when somebody simply stands there.

With hanging arms a short moment is enough, with arms held out (a T) a longer one, and in any other
bearing two seconds; whoever sits, or whose legs are out of the image, is measured by the upper
body. Until such a moment comes, an upright stance at the place and in the heading where the
performer was first seen has to do. It is found once for each performer, and again on request.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np

from puppet.kernel import Floats
from puppet.mapping.stance import Stance, stance_of, upright
from puppet.skeleton import Joint, SkeletonFrame, TrackingState
from puppet.tracking.standing import Kind, kind_of, neutral_of

#: Seconds for which a stance has to be held.
SECONDS: Final[dict[Kind, float]] = {"I": 0.6, "T": 1.0, "still": 2.0}
#: And if no legs are seen, at least:
UPPER_BODY_SECONDS: Final = 1.0
#: This part of it has to be there, in so many frames.
WHOLE: Final = 0.95
FRAMES: Final = 4
#: Metres within which every needed joint stays for that long.
STILL_WITHIN: Final = 0.06

_UPPER: Final = [
    Joint.SHOULDER_CENTER,
    Joint.SHOULDER_LEFT,
    Joint.SHOULDER_RIGHT,
    Joint.ELBOW_LEFT,
    Joint.ELBOW_RIGHT,
    Joint.WRIST_LEFT,
    Joint.WRIST_RIGHT,
]
_HIPS: Final = [Joint.HIP_CENTER, Joint.HIP_LEFT, Joint.HIP_RIGHT]
_KNEES: Final = [Joint.KNEE_LEFT, Joint.KNEE_RIGHT]


class NeutralStance:
    """Watches conditioned frames and knows the neutral stance.

    stance: the one to count from now; None before anybody was seen.
    measured: whether the performer stood still for it, or it is only assumed.
    kind: how they stood; None while it is not measured, or of one that was saved.
    progress: 0..1, how much of the time they have held still that is needed.
    """

    def __init__(self, saved: Stance | None = None) -> None:
        """saved: one that was measured earlier; it holds until `reset`."""
        self.stance = saved
        self.measured = saved is not None
        self.kind: Kind | None = None
        self.progress = 1.0 if self.measured else 0.0
        self._recent: deque[SkeletonFrame] = deque()

    def reset(self) -> None:
        """Forget it: the next frame gives an assumed stance, the next stillness a measured one."""
        self.stance, self.measured, self.kind, self.progress = None, False, None, 0.0
        self._recent.clear()

    def __call__(self, frame: SkeletonFrame) -> bool:
        """Take a frame in. True if the stance has changed."""
        if not frame.present:
            self._forget()
            return False
        changed = False
        if self.stance is None:
            now = stance_of(frame.positions)
            self.stance = upright(now.hip, now.heading)
            changed = True
        if not self.measured:
            found = self._stillness(frame)
            if found is not None:
                self.stance = stance_of(found)
                self.measured = changed = True
                self._recent.clear()
        return changed

    def _forget(self) -> None:
        self._recent.clear()
        if not self.measured:
            self.progress = 0.0

    def _stillness(self, frame: SkeletonFrame) -> Floats | None:
        """The mean (20, 3) of the last moments with hanging arms, if somebody stood still."""
        if not (frame.states[_UPPER] == TrackingState.TRACKED).all() or not _seen(frame, _HIPS):
            self._forget()
            return None
        self._recent.append(frame)
        while frame.time - self._recent[0].time > max(SECONDS.values()):
            self._recent.popleft()
        legs = _whole(frame, _HIPS + _KNEES)
        kind = kind_of(frame.positions, legs)
        if kind is None:
            self.progress = 0.0
            return None
        seconds = SECONDS[kind] if legs else max(SECONDS[kind], UPPER_BODY_SECONDS)
        held = [past for past in self._recent if frame.time - past.time <= seconds]
        needed = _UPPER + (_HIPS + _KNEES if legs else _HIPS)
        points = np.stack([past.positions for past in held])
        self.progress = self._held(points[:, needed], [past.time for past in held], seconds)
        if frame.time - held[0].time < WHOLE * seconds or len(held) < FRAMES:
            return None
        if any(_whole(past, _HIPS + _KNEES) != legs for past in held):
            return None
        if np.ptp(points[:, needed], axis=0).max() > STILL_WITHIN:
            return None
        mean = np.asarray(points.mean(axis=0))
        if kind_of(mean, legs) != kind:
            return None
        self.kind, self.progress = kind, 1.0
        return neutral_of(mean, legs)

    @staticmethod
    def _held(points: Floats, times: list[float], seconds: float) -> float:
        """The part of `seconds` for which points (T, N, 3) have been near to the last ones."""
        off = np.abs(points - points[-1]).max(axis=(1, 2)) > STILL_WITHIN
        start = int(np.flatnonzero(off)[-1]) + 1 if off.any() else 0
        return min(1.0, (times[-1] - times[start]) / (WHOLE * seconds))


def _whole(frame: SkeletonFrame, joints: list[Joint]) -> bool:
    return bool((frame.states[joints] == TrackingState.TRACKED).all())


def _seen(frame: SkeletonFrame, joints: list[Joint]) -> bool:
    return bool((frame.states[joints] != TrackingState.NOT_TRACKED).all())
