"""Arms or legs that change sides for a few frames, though the body does not turn: undone.

`sides.py` sees to the whole body. Where arms cross or legs pass each other, the network may
exchange just these. No wrist goes over to the other's place within a frame, and back later. It is
undone before the whole body is looked at, which would be taken for turned.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from puppet.tracking.people.blazepose import Landmarks

#: Elbow, wrist and hand; knee, ankle and foot: left, and the same on the right.
_LIMBS: Final = (
    ([13, 15, 17, 19, 21], [14, 16, 18, 20, 22]),
    ([25, 27, 29, 31], [26, 28, 30, 32]),
)
#: Shoulders and hips, left and right: where these are exchanged, too, it is the whole body.
_TRUNK: Final = ([11, 23], [12, 24])
#: How far, in sides of the region, the two have to lie apart for an exchange to be told.
APART: Final = 0.08
#: Exchanged, the way from the frame before has to be this much shorter.
SHORTER: Final = 0.4
#: A gap of more seconds than this may have anything in it; and who insists for so long is right.
GAP: Final = 0.25
INSISTENCE: Final = 0.5


class LimbSwaps:
    """One performer's arms and legs, frame after frame."""

    def __init__(self) -> None:
        self._last: Landmarks | None = None
        self._time = 0.0
        self._since: list[float | None] = [None] * len(_LIMBS)

    def undone(self, landmarks: Landmarks, time: float) -> Landmarks:
        """The landmarks with limbs that have changed sides put back. time: capture time, s."""
        last = self._last
        if last is not None and 0.0 < time - self._time <= GAP and not _turned(last, landmarks):
            for index, (left, right) in enumerate(_LIMBS):
                if not _exchanged(last, landmarks, left, right):
                    self._since[index] = None
                    continue
                since = self._since[index]
                self._since[index] = since = time if since is None else since
                if time - since < INSISTENCE:
                    landmarks = _exchange(landmarks, left, right)
                else:
                    self._since[index] = None
        else:
            self._since = [None] * len(_LIMBS)
        self.keep(landmarks, time)
        return landmarks

    def keep(self, landmarks: Landmarks, time: float) -> None:
        """What has become of the frame in the end; the next one is compared with it."""
        self._last, self._time = landmarks, time


def _turned(last: Landmarks, now: Landmarks) -> bool:
    """Whether left and right of the trunk are nearer to where the other was."""
    straight, crossed = _ways(last, now, *_TRUNK)
    return crossed < straight


def _exchanged(last: Landmarks, now: Landmarks, left: list[int], right: list[int]) -> bool:
    straight, crossed = _ways(last, now, left, right)
    apart = float(np.linalg.norm(now.pixels[left] - now.pixels[right], axis=1).mean())
    return apart > APART * now.region.side and crossed < SHORTER * straight


def _ways(
    last: Landmarks, now: Landmarks, left: list[int], right: list[int]
) -> tuple[float, float]:
    """Pixels that left and right have gone if each stayed itself, and if they were exchanged."""
    straight = _way(last, now, left, left) + _way(last, now, right, right)
    crossed = _way(last, now, left, right) + _way(last, now, right, left)
    return straight, crossed


def _way(last: Landmarks, now: Landmarks, before: list[int], after: list[int]) -> float:
    return float(np.linalg.norm(now.pixels[after] - last.pixels[before], axis=1).mean())


def _exchange(landmarks: Landmarks, left: list[int], right: list[int]) -> Landmarks:
    order = np.arange(len(landmarks.pixels))
    order[left], order[right] = right, left
    return replace(
        landmarks,
        pixels=landmarks.pixels[order],
        world=landmarks.world[order],
        visibility=landmarks.visibility[order],
        presence=landmarks.presence[order],
    )
