"""Which joints are tracked, which are inferred, and which are not there.

The network's visibility is optimistic and flickers. So a landmark is called tracked late and
inferred again early, by two thresholds each; it has to deserve the better word for a moment; and
what lies at the border of the image, or behind something nearer, is inferred at best.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from puppet.skeleton import Joint, TrackingState
from puppet.tracking.body.lift import DEPENDS
from puppet.tracking.people.blazepose import LANDMARK_COUNT, Landmarks

#: Visibility from which a landmark is seen, and below which it is not any more.
SEEN, UNSEEN = 0.8, 0.7
#: The same for being there at all: below it the network only guesses.
THERE, GONE = 0.4, 0.2
#: Parts of the image's shorter side: so far inside of the border a landmark must come to be seen
#: again. Outside of it, it is never seen.
INSIDE: Final = 0.01
#: So far outside it is not there, whatever the network makes of it, parts of the region's side.
OUTSIDE: Final = 0.15
#: Seconds for which a landmark must deserve a better state before it gets it.
PATIENCE: Final = 0.1

_NOSE, _EARS = 0, (7, 8)
_SHOULDERS: Final = [11, 12]
#: What each landmark of arms and legs hangs on, for those that hang on something.
_FARTHER: Final = [*range(13, 23), *range(25, 33)]
_NEARER: Final = [11, 12, 13, 14, 15, 16, 15, 16, 15, 16, 23, 24, 25, 26, 27, 28, 27, 28]
_TRUNK: Final = [Joint.HIP_CENTER, Joint.SPINE, Joint.HIP_LEFT, Joint.HIP_RIGHT]


class JointStates:
    """One performer's states, frame after frame, in images of one camera."""

    def __init__(self) -> None:
        self._seen = np.zeros(LANDMARK_COUNT, bool)
        self._there = np.zeros(LANDMARK_COUNT, bool)
        self._states = np.zeros(LANDMARK_COUNT, np.uint8)
        self._better = np.zeros(LANDMARK_COUNT)
        self._time: float | None = None

    def __call__(
        self,
        landmarks: Landmarks,
        hidden: NDArray[np.bool_],
        size: tuple[int, int],
        time: float,
    ) -> NDArray[np.uint8]:
        """(20,) states. hidden: (33,) what something nearer stands before, as depth says.
        size: width and height of the image. time: capture time, s."""
        first, before = self._time is None, self._time or 0.0
        self._time = time
        wanted = self._wanted(landmarks, hidden, size)
        if first:
            self._states = wanted
        else:
            better = wanted > self._states
            self._better = np.where(better, self._better + max(time - before, 0.0), 0.0)
            worse = wanted < self._states
            changes = worse | (better & (self._better >= PATIENCE))
            self._states = np.where(changes, wanted, self._states).astype(np.uint8)
            self._better[changes] = 0.0
        return _joints(self._states)

    def _wanted(
        self, landmarks: Landmarks, hidden: NDArray[np.bool_], size: tuple[int, int]
    ) -> NDArray[np.uint8]:
        last = np.array(size) - 0.5
        margin = np.minimum(landmarks.pixels + 0.5, last - landmarks.pixels).min(axis=1)
        margin = np.nan_to_num(margin, nan=-1e9)
        inside = margin >= np.where(self._seen, 0.0, INSIDE * min(size))
        visibility = np.where(inside & ~hidden, landmarks.visibility, 0.0)
        self._seen = visibility > np.where(self._seen, UNSEEN, SEEN)
        self._there = landmarks.presence > np.where(self._there, GONE, THERE)
        self._there &= margin > -OUTSIDE * landmarks.region.side
        # A hand beyond the border can be guessed from its arm, but not if the elbow is there, too.
        outside = margin < 0.0
        self._there[_FARTHER] &= ~(outside[_FARTHER] & outside[_NEARER])
        states: NDArray[Any] = np.where(
            self._there,
            np.where(self._seen, TrackingState.TRACKED, TrackingState.INFERRED),
            TrackingState.NOT_TRACKED,
        )
        return states.astype(np.uint8)


def _joints(landmarks: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(33,) -> (20,): a joint is known as well as the worst landmark that it depends on ..."""
    states: NDArray[Any] = np.where(DEPENDS, landmarks, np.uint8(TrackingState.TRACKED)).min(axis=1)
    # ... but from the side one ear is hidden, and the head is seen all the same.
    states[Joint.HEAD] = landmarks[[_NOSE, *_EARS]].max()
    # ... the neck lies between the shoulders, and the hips move it little ...
    states[Joint.SHOULDER_CENTER] = landmarks[_SHOULDERS].min()
    # ... and whoever has shoulders has a trunk, below the border of the image or a table.
    least = min(states[Joint.SHOULDER_CENTER], TrackingState.INFERRED)
    states[_TRUNK] = np.maximum(states[_TRUNK], least)
    return states.astype(np.uint8)
