"""How the performer's bones are turned, and the neutral stance that all turning is counted from.

A tracker gives points, not rotations, and about its own axis a straight limb cannot be seen to
turn. So each bone gets the one rotation that the points do determine:

* Pelvis and chest have a direction and a line across (hips, shoulders): a full frame.
* Every other bone swings, without twist, out of its reference direction in the frame of the bone
  that carries it: arms out to the sides, legs down, feet forward, a forearm in line with its upper
  arm. The one place where a swing is not continuous lies opposite to the reference, and there a
  human limb cannot go; counted from hanging arms instead, it would lie straight up.

Everything is taken in the performer's heading (the yaw of shoulders and hips), so that turning
round turns the puppet and bends nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from puppet.kernel import Floats, Ints, frozen, kernel
from puppet.rotation import conjugate, from_axes, multiply, rotate, swing
from puppet.skeleton import HUMAN_BONES, Joint

#: The bone whose frame each human bone swings in. Not the graph's parent for the arms: shoulders
#: are part of the chest's own frame already.
CARRIERS: Final[Ints] = frozen([-1, 0, 1, 1, 1, 4, 5, 1, 1, 8, 9, 0, 11, 12, 0, 14, 15], np.int32)
_STARTS: Final[Ints] = frozen([bone.start for bone in HUMAN_BONES], np.int32)
_ENDS: Final[Ints] = frozen([bone.end for bone in HUMAN_BONES], np.int32)


def _references() -> Floats:
    directions = {
        "head": (0.0, 1.0, 0.0),
        "shoulder": (1.0, 0.0, 0.0),
        "upper_arm": (1.0, 0.0, 0.0),
        "forearm": (1.0, 0.0, 0.0),
        "hand": (1.0, 0.0, 0.0),
        "thigh": (0.0, -1.0, 0.0),
        "shin": (0.0, -1.0, 0.0),
        "foot": (0.0, 0.0, 1.0),
    }
    rows = []
    for bone in HUMAN_BONES:
        x, y, z = directions.get(bone.name.split(".")[0], (0.0, 1.0, 0.0))
        rows.append((-x if bone.name.endswith(".R") else x, y, z))
    return frozen(rows)


#: (17, 3) the direction from which each bone swings, in its carrier's frame.
REFERENCES: Final = _references()


@kernel
def _unit(v: Floats) -> Floats:
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return v / length if length > 1e-9 else v * 0.0


@kernel
def _square_frame(across: Floats, up: Floats) -> Floats:
    """The frame with y along `up` and x as near to `across` as it can be; identity if undefined."""
    y = _unit(up)
    x = _unit(across - y * (across[0] * y[0] + across[1] * y[1] + across[2] * y[2]))
    z = np.empty(3)
    z[0] = x[1] * y[2] - x[2] * y[1]
    z[1] = x[2] * y[0] - x[0] * y[2]
    z[2] = x[0] * y[1] - x[1] * y[0]
    if z[0] * z[0] + z[1] * z[1] + z[2] * z[2] < 0.5:
        out = np.zeros(4)
        out[3] = 1.0
        return out
    return from_axes(x, y, z)


@kernel
def heading_of(positions: Floats) -> float:
    """Radians about +Y, 0 facing +Z: the yaw of shoulders and hips. (20, 3) ->"""
    across = _unit(positions[12] - positions[16]) + _unit(positions[4] - positions[8])
    return math.atan2(-across[2], across[0])


@kernel
def measure(
    positions: Floats,
    carriers: Ints,
    references: Floats,
    starts: Ints,
    ends: Ints,
    swings: Floats,
    frames: Floats,
) -> float:
    """Turn points into rotations. Fills `swings` and `frames`, both (17, 4); returns the heading.

    swings: carrier_from_bone. frames: heading_from_bone. heading: radians about +Y, 0 facing +Z.
    """
    hips = positions[12] - positions[16]
    shoulders = positions[4] - positions[8]
    heading = heading_of(positions)
    back = np.zeros(4)
    back[1], back[3] = math.sin(-0.5 * heading), math.cos(-0.5 * heading)

    # A Kinect's spine joint sits so close to the hip centre that the line between them is mostly
    # noise; some of the line to the shoulders steadies it.
    up = (positions[1] - positions[0]) + 0.25 * (positions[2] - positions[0])
    frames[0] = _square_frame(rotate(back, hips), rotate(back, up))
    swings[0] = frames[0]
    frames[1] = _square_frame(rotate(back, shoulders), rotate(back, positions[2] - positions[1]))
    swings[1] = multiply(conjugate(frames[0]), frames[1])
    for bone in range(2, len(carriers)):
        carrier = frames[carriers[bone]]
        direction = rotate(back, positions[ends[bone]] - positions[starts[bone]])
        swings[bone] = swing(references[bone], rotate(conjugate(carrier), direction))
        frames[bone] = multiply(carrier, swings[bone])
    return heading


@dataclass(frozen=True, slots=True, eq=False)
class Stance:
    """A performer's bearing at one instant; as the neutral one, what a puppet's rest stands for.

    hip: (3,) metres, stage frame. heading: radians about +Y, 0 facing +Z.
    swings: (17, 4) carrier_from_bone. frames: (17, 4) heading_from_bone.
    joints: (20, 3) metres from the hip centre, along the performer's own left, up and forward.
    """

    hip: Floats
    heading: float
    swings: Floats
    frames: Floats
    joints: Floats


def stance_of(positions: Floats) -> Stance:
    """The stance of a skeleton. positions: (20, 3) metres, stage frame."""
    swings, frames = np.empty((len(HUMAN_BONES), 4)), np.empty((len(HUMAN_BONES), 4))
    heading = measure(positions, CARRIERS, REFERENCES, _STARTS, _ENDS, swings, frames)
    hip = positions[Joint.HIP_CENTER]
    joints = in_heading(positions, hip, heading)
    return Stance(frozen(hip), heading, frozen(swings), frozen(frames), frozen(joints))


def in_heading(positions: Floats, hip: Floats, heading: float) -> Floats:
    """(N, 3) metres from the hip, along the performer's own left, up and forward."""
    sine, cosine = math.sin(heading), math.cos(heading)
    x, y, z = (positions - hip).T
    return np.stack([cosine * x - sine * z, y, sine * x + cosine * z], axis=1)


def measure_into(positions: Floats, swings: Floats, frames: Floats) -> float:
    """`stance_of` without a new object: fills (17, 4) swings and frames, returns the heading."""
    return measure(positions, CARRIERS, REFERENCES, _STARTS, _ENDS, swings, frames)


def upright(hip: Floats, heading: float) -> Stance:
    """Standing straight with hanging arms: the neutral stance before one has been measured."""
    points = np.zeros((len(Joint), 3))
    for joint, place in UPRIGHT.items():
        points[joint] = place
    stance = stance_of(points)
    return Stance(frozen(hip), heading, stance.swings, stance.frames, stance.joints)


def _upright() -> dict[Joint, tuple[float, float, float]]:
    points = {
        Joint.HIP_CENTER: (0.0, 0.95, 0.0),
        Joint.SPINE: (0.0, 1.05, 0.0),
        Joint.SHOULDER_CENTER: (0.0, 1.45, 0.0),
        Joint.HEAD: (0.0, 1.65, 0.0),
    }
    sides = {
        "SHOULDER": (0.18, 1.42, 0.0),
        "ELBOW": (0.20, 1.12, 0.0),
        "WRIST": (0.21, 0.87, 0.0),
        "HAND": (0.21, 0.79, 0.0),
        "HIP": (0.09, 0.9, 0.0),
        "KNEE": (0.09, 0.5, 0.0),
        "ANKLE": (0.09, 0.08, 0.0),
        "FOOT": (0.09, 0.03, 0.12),
    }
    for name, (x, y, z) in sides.items():
        points[Joint[f"{name}_LEFT"]] = (x, y, z)
        points[Joint[f"{name}_RIGHT"]] = (-x, y, z)
    return points


#: Where the joints of an ordinary adult are who stands with hanging arms, metres.
UPRIGHT: Final = _upright()
