"""From 33 landmarks in an image to the 20 joints in metres, with their tracking states.

The network gives a body's shape in metres about its hips, and where each landmark is in the image.
The body is put at the one place before the lens from which it looks like that; what is clearly
seen is then moved onto its line of sight, and what is not keeps the shape that the network gave it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats, frozen
from puppet.rotation import rotate, swing
from puppet.skeleton import JOINT_COUNT, Joint
from puppet.tracking.body.depth_fit import VISIBLE, DepthFit
from puppet.tracking.body.depth_probe import depths_at
from puppet.tracking.cameras.camera import Shot
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.people.blazepose import LANDMARK_COUNT, Landmarks

#: Visibility from which, and up to which, a landmark moves over to its line of sight.
SIGHT_BEGINS, SIGHT_WHOLE = 0.3, 0.7
#: Nobody is nearer to the lens than this, metres.
NEAREST: Final = 0.2
#: How far away a body is, is the one thing that a single image tells badly: its half-life, s.
DISTANCE_HALF_LIFE: Final = 0.08

#: Metres by which depth is nearer than the body's shape when something stands before a landmark.
HIDDEN: Final = 0.35
_AHEAD: Final = frozen([0.0, 0.0, 1.0])

_EARS = (7, 8)
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
_WEIGHTS, DEPENDS = _mix(
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


def joints_of(landmarks: Floats) -> Floats:
    """(33, 3) landmarks -> (20, 3) joints, in the same axes."""
    return np.asarray(_WEIGHTS @ landmarks)


def joint_depths(landmarks: Floats) -> Floats:
    """(33,) depths of landmarks -> (20,) of joints; NaN where one of its landmarks' is."""
    known = np.isfinite(landmarks)
    depths = _WEIGHTS @ np.where(known, landmarks, 0.0)
    return np.where((DEPENDS & ~known).any(axis=1), np.nan, depths)


@dataclass(frozen=True, slots=True, eq=False)
class Lifted:
    """positions: (20, 3) metres from the lens; x to the right in the image, y up in it, z from the
    scene to the camera. hidden: (33,) landmarks before which something stands, as depth says.
    measured: (20,) the joints' z as depth says, metres; NaN where it says nothing."""

    positions: Floats
    hidden: NDArray[np.bool_]
    measured: Floats


class Lift:
    """Lifts the landmarks of one performer, frame after frame."""

    def __init__(self) -> None:
        self._distance: float | None = None
        self._time = 0.0
        self._fit = DepthFit()

    @property
    def size(self) -> float:
        """How many times larger the performer is than the network takes them for."""
        return self._fit.size

    def __call__(self, landmarks: Landmarks, shot: Shot, lens: Intrinsics) -> Lifted:
        """One performer's joints in a shot, through that lens."""
        rays = lens.rays(landmarks.pixels)
        height, width = shot.colour.shape[:2]
        inside = (landmarks.pixels >= -0.5) & (landmarks.pixels <= (width - 0.5, height - 0.5))
        visibility = np.where(inside.all(axis=1), landmarks.visibility, 0.0)
        world = facing_sight(landmarks.world, lens.rays(landmarks.region.centre[None])[0])
        distance = distance_of(world, rays, visibility)
        measured = None
        if shot.depth is not None:
            measured = depths_at(shot.depth, shot.colour, landmarks.pixels, landmarks.region.side)
            away = self._fit.away(measured, world[:, 2], distance, visibility, shot.time)
            if away is None:
                measured = None  # as if there were none
            else:
                distance = away / self.size
        distance = self._smoothed(distance * self.size, shot.time)
        body = world * self.size
        hidden = np.zeros(LANDMARK_COUNT, bool)
        deep = np.full(JOINT_COUNT, np.nan)
        if measured is not None:
            off = np.nan_to_num(measured - (body[:, 2] + distance), nan=0.0)
            hidden = off < -HIDDEN
            visibility = np.where(hidden, 0.0, visibility)
            measured[visibility < VISIBLE] = np.nan
            deep = -joint_depths(measured)
        points = joints_of(lifted(body, rays, visibility, distance))
        return Lifted(points * (1.0, -1.0, -1.0), hidden, deep)

    def _smoothed(self, distance: float, time: float) -> float:
        if self._distance is not None:
            keep = 0.5 ** (max(time - self._time, 0.0) / DISTANCE_HALF_LIFE)
            distance += keep * (self._distance - distance)
        self._distance, self._time = distance, time
        return distance


def facing_sight(world: Floats, sight: Floats) -> Floats:
    """(33, 3) metres: the body as the camera sees it, not as the network's region does.

    The network sees the region from straight ahead. Where that lies off the lens's axis, the line
    of sight to it is what the network took for the axis. sight: (2,), the ray to its middle.
    """
    turn = swing(_AHEAD, np.array([sight[0], sight[1], 1.0]) / math.hypot(*sight, 1.0))
    return np.asarray(world @ np.stack([rotate(turn, axis) for axis in np.eye(3)]))


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
