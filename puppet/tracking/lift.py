"""From 33 landmarks in an image to the 20 joints in metres, with their tracking states.

The network gives a body's shape in metres about its hips, and where each landmark is in the image.
The body is put at the one place before the lens from which it looks like that; what is clearly
seen is then moved onto its line of sight, and what is not keeps the shape that the network gave it.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats, frozen
from puppet.skeleton import JOINT_COUNT, Joint, TrackingState
from puppet.tracking.blazepose import LANDMARK_COUNT, Landmarks
from puppet.tracking.intrinsics import Intrinsics

#: Visibility is optimistic, so a landmark is called tracked late, and inferred again early.
SEEN, UNSEEN = 0.8, 0.6
#: The same for being there at all: below it the network only guesses.
THERE, GONE = 0.4, 0.2
#: Visibility from which, and up to which, a landmark moves over to its line of sight.
SIGHT_BEGINS, SIGHT_WHOLE = 0.3, 0.7
#: Nobody is nearer to the lens than this, metres.
NEAREST: Final = 0.2
#: How far away a body is, is the one thing that a single image tells badly: its half-life, s.
DISTANCE_HALF_LIFE: Final = 0.08

_NOSE, _EARS = 0, (7, 8)
_HIPS, _SHOULDERS = (23, 24), (11, 12)


def _mix(**joints: dict[int, float]) -> tuple[Floats, NDArray[np.bool_]]:
    weights = np.zeros((JOINT_COUNT, LANDMARK_COUNT))
    for name, parts in joints.items():
        for landmark, weight in parts.items():
            weights[Joint[name.upper()], landmark] = weight
    return frozen(weights), frozen(weights != 0.0, np.bool_)


def _trunk(t: float) -> dict[int, float]:
    """The point that lies at `t` between the hips (0) and the shoulders (1)."""
    return dict.fromkeys(_HIPS, 0.5 * (1.0 - t)) | dict.fromkeys(_SHOULDERS, 0.5 * t)


#: Every joint as a weighted mean of landmarks, and which landmarks it depends on.
_WEIGHTS, _DEPENDS = _mix(
    hip_center=_trunk(0.12),
    spine=_trunk(0.30),
    shoulder_center=_trunk(1.10),
    head=dict.fromkeys(_EARS, 0.5),
    shoulder_left={11: 1.0},
    elbow_left={13: 1.0},
    wrist_left={15: 1.0},
    hand_left={17: 0.5, 19: 0.5},
    shoulder_right={12: 1.0},
    elbow_right={14: 1.0},
    wrist_right={16: 1.0},
    hand_right={18: 0.5, 20: 0.5},
    hip_left={23: 1.0},
    knee_left={25: 1.0},
    ankle_left={27: 1.0},
    foot_left={31: 1.0},
    hip_right={24: 1.0},
    knee_right={26: 1.0},
    ankle_right={28: 1.0},
    foot_right={32: 1.0},
)


class Lift:
    """Lifts the landmarks of one performer, frame after frame, in images of one size."""

    def __init__(self, intrinsics: Intrinsics, width: int, height: int) -> None:
        self.intrinsics = intrinsics
        self._size = (width, height)
        self.reset()

    def reset(self) -> None:
        """Forget what was seen of the landmarks before."""
        self._seen = np.zeros(LANDMARK_COUNT, bool)
        self._there = np.zeros(LANDMARK_COUNT, bool)
        self._distance: float | None = None
        self._time = 0.0

    def joints(self, landmarks: Landmarks, time: float) -> tuple[Floats, NDArray[np.uint8]]:
        """Positions (20, 3), metres from the lens, and states (20,). time: capture time, s.

        Axes: x to the right in the image, y up in the image, z from the scene to the camera.
        """
        pixels = landmarks.pixels
        inside = ((pixels >= -0.5) & (pixels <= np.array(self._size) - 0.5)).all(axis=1)
        visibility = np.where(inside, landmarks.visibility, 0.0)
        rays = self.intrinsics.rays(pixels)
        distance = distance_of(landmarks.world, rays, visibility)
        if self._distance is not None:
            keep = 0.5 ** (max(time - self._time, 0.0) / DISTANCE_HALF_LIFE)
            distance += keep * (self._distance - distance)
        self._distance, self._time = distance, time
        positions = _WEIGHTS @ lifted(landmarks.world, rays, visibility, distance)
        return positions * (1.0, -1.0, -1.0), self._states(visibility, landmarks.presence)

    def _states(self, visibility: Floats, presence: Floats) -> NDArray[np.uint8]:
        self._seen = visibility > np.where(self._seen, UNSEEN, SEEN)
        self._there = presence > np.where(self._there, GONE, THERE)
        landmark_states = np.where(
            self._there,
            np.where(self._seen, TrackingState.TRACKED, TrackingState.INFERRED),
            TrackingState.NOT_TRACKED,
        )
        # A joint is known as well as the worst landmark that it depends on ...
        states: NDArray[Any] = np.where(_DEPENDS, landmark_states, int(TrackingState.TRACKED)).min(
            axis=1
        )
        # ... but from the side one ear is hidden, and the head is seen all the same.
        states[Joint.HEAD] = landmark_states[[_NOSE, *_EARS]].max()
        return states.astype(np.uint8)


def distance_of(world: Floats, rays: Floats, visibility: Floats) -> float:
    """Metres along the lens's axis to the hips, at which the body looks most like its image.

    world: (33, 3) metres about the hips. rays: (33, 2). visibility: (33,), 0..1.
    """
    # At the right place (X + tx) - u (Z + tz) = 0 for each landmark, and the same in y: linear in
    # the shift. Taking the means out leaves one equation for tz.
    weights = visibility + 1e-3
    offset = rays * world[:, 2:] - world[:, :2]
    rays = rays - np.average(rays, axis=0, weights=weights)
    offset -= np.average(offset, axis=0, weights=weights)
    spread = float(np.sum(weights[:, None] * rays * rays))
    distance = -float(np.sum(weights[:, None] * rays * offset)) / max(spread, 1e-12)
    # Behind the lens, or in it, is no place for a body, however odd the landmarks are.
    return max(distance, NEAREST - float(world[:, 2].min()))


def lifted(world: Floats, rays: Floats, visibility: Floats, distance: float) -> Floats:
    """(33, 3) metres from the lens: x right, y down, z away. Arguments as for `distance_of`."""
    body = world + np.array([0.0, 0.0, distance])
    off_sight = rays * body[:, 2:] - body[:, :2]
    shift = np.average(off_sight, axis=0, weights=visibility + 1e-3)
    sight = np.clip((visibility - SIGHT_BEGINS) / (SIGHT_WHOLE - SIGHT_BEGINS), 0.0, 1.0)
    sight = (sight * sight * (3.0 - 2.0 * sight))[:, None]
    body[:, :2] += shift + sight * (off_sight - shift)
    return np.asarray(body)
