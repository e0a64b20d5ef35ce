"""Keeps a performer's left and right apart when the pose network takes front for back.

The outline of a body is the same from the front and from behind. Where the face does not tell, the
network jumps between the two readings, and left and right change places within one frame, which no
body can do. A frame that has jumped is looked at again, turned a little, which often suffices; and
if it does not, it is turned back: the two readings are each other's reflection in depth, with the
sides exchanged.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from puppet.kernel import Floats
from puppet.tracking.people.blazepose import EXCHANGED, Landmarks

#: Shoulders, elbows, wrists, hips, knees, ankles.
_LEFT: Final = [11, 13, 15, 23, 25, 27]
_RIGHT: Final = [12, 14, 16, 24, 26, 28]
#: A body seen from its side tells nothing: this much width, in sides of the region, is a doubt.
BLUR: Final = 0.2
#: How well a frame has to go on from the one before: the cosine between their left-to-rights.
AGREEMENT: Final = 0.9
#: How far (rad) the region is turned to look again. A turn that has helped is kept up, and fades
#: with this half-life (s): landmarks would tremble if it came and went.
TURN: Final = 0.4
TURN_HALF_LIFE: Final = 0.3
LEAST_TURN: Final = 0.05
#: A frame that does not go on from the one before is passed over for so long (s) ...
HOLD: Final = 0.1
#: ... and after a longer gap anything may have happened.
GAP: Final = 0.25
#: The network is believed when it has disagreed most of the time, with this half-life (s).
HALF_LIFE: Final = 0.5
CONVINCED: Final = 0.8

#: Looks again at the same image, with the region turned by an angle (rad).
LookAgain = Callable[[float], Landmarks | None]


def reversed_in_depth(landmarks: Landmarks) -> Landmarks:
    """The other reading of the same outline: sides exchanged, depth reflected at the hips."""
    return replace(
        landmarks,
        pixels=landmarks.pixels[EXCHANGED],
        world=landmarks.world[EXCHANGED] * (1.0, 1.0, -1.0),
        visibility=landmarks.visibility[EXCHANGED],
        presence=landmarks.presence[EXCHANGED],
    )


class Sides:
    """Undoes jumps between front and back in one performer's landmarks, frame after frame."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Take the next frame as it comes."""
        self._turn = 0.0
        self._last: Landmarks | None = None
        self._time = 0.0
        self._held_since: float | None = None
        self._doubt = 0.0

    def keep(self, landmarks: Landmarks, time: float, look_again: LookAgain) -> Landmarks:
        """`landmarks`, or how they should have been to go on from the frame before.

        time: capture time, s. If the network disagrees for long, it is believed.
        """
        step = time - self._time
        if self._last is None or not 0.0 <= step <= GAP:
            self.reset()
        else:
            landmarks = self._going_on(self._last, landmarks, step, time, look_again)
        self._last, self._time = landmarks, time
        return landmarks

    def _going_on(
        self,
        last: Landmarks,
        landmarks: Landmarks,
        step: float,
        time: float,
        look_again: LookAgain,
    ) -> Landmarks:
        agreement = _agreement(last, landmarks)
        keep = 0.5 ** (step / HALF_LIFE)
        self._doubt = keep * self._doubt + (1.0 - keep) * (agreement < 0.0)
        if self._doubt > CONVINCED:
            self._doubt = 0.0
            return landmarks
        self._turn *= 0.5 ** (step / TURN_HALF_LIFE)
        if abs(self._turn) > LEAST_TURN:
            again = look_again(self._turn)
            most = 2.0 * _distance(last, landmarks)
            if again is not None and (agreement < AGREEMENT or _distance(last, again) < most):
                landmarks, agreement = again, _agreement(last, again)
        if agreement < AGREEMENT:
            # Turned towards the upright image first: a leaning body is taken for what it is there.
            upright = -TURN if landmarks.region.angle > 0.0 else TURN
            for turn in (upright, -upright):
                again = look_again(turn)
                if again is not None and _agreement(last, again) >= AGREEMENT:
                    self._turn = turn
                    self._held_since = None
                    return again
            if self._held_since is None:
                self._held_since = time
            if time - self._held_since < HOLD:
                return last
            other = reversed_in_depth(landmarks)
            return other if _agreement(last, other) > agreement else landmarks
        self._held_since = None
        return landmarks


def _agreement(before: Landmarks, after: Landmarks) -> float:
    """1 if left is where left was, -1 if it is where right was; near 1 if that cannot be seen."""
    a, b = _left_to_right(before), _left_to_right(after)
    lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
    return (float(np.sum(a * b)) + BLUR**2) / (lengths + BLUR**2)


def _distance(before: Landmarks, after: Landmarks) -> float:
    """How far the landmarks have moved in the image, pixels, on average."""
    return float(np.linalg.norm(after.pixels - before.pixels, axis=1).mean())


def _left_to_right(landmarks: Landmarks) -> Floats:
    """(6, 2), in sides of the region."""
    pixels = landmarks.pixels
    return (pixels[_RIGHT] - pixels[_LEFT]) / landmarks.region.side
