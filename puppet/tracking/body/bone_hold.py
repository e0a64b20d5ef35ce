"""Bones are held at their lengths, by moving joints along their lines of sight.

Across the line of sight a camera sees well and along it badly. So a joint that is seen keeps its
place in the image, and its distance is the most likely one by three things: the network's guess, or
measured depth; the frame before; and above all the length that the bone is known to have. A bone
that lies nearly across the line of sight says little of it; there the frame before keeps it from
trembling. At one length there are two places, the one before and the one behind: if the network
insists on the other one, it is right.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Bytes, Floats, Ints, frozen, kernel
from puppet.skeleton import JOINT_COUNT, Joint

#: Metres: how far the lengths are wrong that are learned, and how far the network's distances are
#: along the line of sight; less within the trunk, which is stiff.
LENGTH_SPREAD: Final = 0.02
DEPTH_SPREAD: Final = 0.12
#: The same of measured depth: at the lens, and for each square metre of the distance's square.
MEASURED_SPREAD, MEASURED_GROWTH = 0.02, 0.003
#: Depth is believed where it makes a bone no more wrong than by so many metres and this share of
#: it; or, while its length is not known, where it differs from the network by less than this.
MISFIT, MISFIT_SHARE = 0.06, 0.2
FITS: Final = 0.25
#: How far a joint wanders along the line of sight from its parent, metres in the square root of a
#: second: so that it comes to the same at any rate of frames.
WANDER: Final = 0.3
#: After so many seconds the frame before says nothing.
GAP: Final = 0.5
#: Frames may carry the same time; some has passed all the same, s.
LEAST_STEP: Final = 1e-4
_TRUNK_SPREAD: Final = 0.07
_ACROSS_SPREAD: Final = 0.05
#: Metres by which the other of two places must fit better what the network or depth says, and the
#: seconds for which it must, to be taken.
BETTER: Final = 0.02
INSISTENCE: Final = 0.2
#: The trunk is one bone here, with the spine on it: the short pieces are mostly noise.
PARENTS: Final[Ints] = frozen(
    [-1, 0, 0, 2, 2, 4, 5, 6, 2, 8, 9, 10, 0, 12, 13, 14, 0, 16, 17, 18], np.int32
)
_ORDER: Final[Ints] = frozen([j for j in range(1, JOINT_COUNT) if j != Joint.SPINE], np.int32)
_ACROSS: Final = (Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT, Joint.HIP_LEFT, Joint.HIP_RIGHT)
_SPREADS: Final = frozen(
    [
        _TRUNK_SPREAD
        if joint == Joint.SHOULDER_CENTER
        else _ACROSS_SPREAD
        if joint in _ACROSS
        else DEPTH_SPREAD
        for joint in Joint
    ]
)
#: Where on the trunk the spine lies, from the hip centre: 0.30 - 0.12 of 1.10 - 0.12.
SPINE_SHARE: Final = 0.18 / 0.98
#: What depth says if there is none.
NOTHING: Final = frozen(np.full(JOINT_COUNT, np.nan))


@kernel
def _fits(joint: Floats, measured: float, parent: Floats, length: float) -> bool:
    """Whether what depth says of a joint can be it, and not something before or behind it."""
    fits: bool = False
    if measured < -0.1 and length <= 0.0:
        fits = abs(measured - joint[2]) < FITS
    elif measured < -0.1:
        bone = joint * (measured / joint[2]) - parent
        now = math.sqrt(bone[0] * bone[0] + bone[1] * bone[1] + bone[2] * bone[2])
        fits = abs(now - length) < MISFIT + MISFIT_SHARE * length
    return fits


@kernel
def _trust(measured: float) -> float:
    """The weight of what depth says: one by its variance."""
    return 1.0 / (MEASURED_SPREAD + MEASURED_GROWTH * measured * measured) ** 2


@kernel
def _settle(
    ray: Floats, parent: Floats, length: float, start: float, guess: float, pull: float
) -> float:
    """The likeliest z on the ray (through z = 1), near `start`: `guess` by the weight `pull`, and
    that far from the parent. Gauss-Newton."""
    z = start
    for _ in range(8):
        bone = ray * z - parent
        now = math.sqrt(bone[0] * bone[0] + bone[1] * bone[1] + bone[2] * bone[2])
        slope = (bone[0] * ray[0] + bone[1] * ray[1] + bone[2] * ray[2]) / max(now, 1e-6)
        slope /= LENGTH_SPREAD
        off = (now - length) / LENGTH_SPREAD
        step = (pull * (z - guess) + off * slope) / (pull + slope * slope)
        z -= min(max(step, -0.1), 0.1)
    return z


@kernel
def _misfit(
    ray: Floats, parent: Floats, length: float, z: float, guess: float, pull: float
) -> float:
    """How unlikely that z is: what `_settle` makes small."""
    bone = ray * z - parent
    now = math.sqrt(bone[0] * bone[0] + bone[1] * bone[1] + bone[2] * bone[2])
    off = (now - length) / LENGTH_SPREAD
    return off * off + pull * (z - guess) ** 2


@kernel
def _hold(
    positions: Floats,
    seen: Bytes,
    lengths: Floats,
    spreads: Floats,
    measured: Floats,
    before: Floats,
    doubts: Floats,
    dt: float,
    wander: float,
    parents: Ints,
    order: Ints,
    out: Floats,
) -> None:
    """Fill `out`, (20, 3), metres from the lens: each bone as long as `lengths` says, if > 0.

    measured: (20,) z as depth says, NaN for nothing. before: (20,) how much nearer than its parent
    each joint was, and the hips than they were put; it becomes that of this frame. doubts: (20,)
    seconds for which the other place was better. dt: seconds since the frame before. wander: by how
    much `before` may have changed since, metres; infinite if that is not known.
    """
    old = 1.0 / wander**2
    # The hips are where the body was put, or where depth says; from one to the other they wander.
    off, word = 0.0, 1.0 / spreads[0] ** 2
    if seen[0] == 2 and abs(measured[0] - positions[0, 2]) < FITS:
        off, word = measured[0] - positions[0, 2], _trust(measured[0])
    before[0] = (word * off + old * before[0]) / (word + old)
    out[0] = positions[0] * ((positions[0, 2] + before[0]) / positions[0, 2])
    for joint in order:
        length, parent = lengths[joint], out[parents[joint]]
        bone = positions[joint] - positions[parents[joint]]
        word = 1.0 / spreads[joint] ** 2
        if seen[joint] == 2 and _fits(positions[joint], measured[joint], parent, length):
            bone[2] = measured[joint] - parent[2]
            word = _trust(measured[joint])
        # The word of the network, or of depth, and that of the frame before, each by its weight.
        said = parent[2] + bone[2]
        guess = parent[2] + (word * bone[2] + old * before[joint]) / (word + old)
        ahead = positions[joint, 2] < -0.1
        if length <= 0.0:
            out[joint] = positions[joint]
            if ahead:
                out[joint] *= guess / positions[joint, 2]
        elif seen[joint] != 2 or not ahead:
            # The image does not say where it is: the network's direction does.
            bone[2] = guess - parent[2]
            now = math.sqrt(bone[0] * bone[0] + bone[1] * bone[1] + bone[2] * bone[2])
            out[joint] = parent + bone * (length / max(now, 1e-6))
        else:
            ray = positions[joint] / positions[joint, 2]
            pull = word + old
            z = _settle(ray, parent, length, said, guess, pull)
            nearest = (ray[0] * parent[0] + ray[1] * parent[1] + parent[2]) / (
                ray[0] * ray[0] + ray[1] * ray[1] + 1.0
            )
            other = _settle(ray, parent, length, 2.0 * nearest - z, guess, pull)
            if _misfit(ray, parent, length, other, guess, pull) < _misfit(
                ray, parent, length, z, guess, pull
            ):
                z = other
            other = 2.0 * nearest - z
            insists = abs(said - other) + BETTER < abs(said - z)
            doubts[joint] = doubts[joint] + dt if insists else 0.0
            if doubts[joint] > INSISTENCE:
                z = _settle(ray, parent, length, other, said, word)
                doubts[joint] = 0.0
            out[joint] = ray * min(z, -0.1)
        before[joint] = out[joint, 2] - parent[2]


class BoneHold:
    """One performer's bones, frame after frame."""

    def __init__(self) -> None:
        self._before = np.zeros(JOINT_COUNT)
        self._doubts = np.zeros(JOINT_COUNT)
        self._time = -math.inf

    def __call__(
        self,
        positions: Floats,
        states: NDArray[np.uint8],
        lengths: Floats,
        time: float,
        measured: Floats = NOTHING,
    ) -> Floats:
        """The joints with each bone at its length: (20, 3) metres from the lens.

        positions: (20, 3), x right, y up, z from the scene to the camera. states: (20,). lengths:
        (20,) metres from each of `PARENTS`; 0 if not known. time: capture time, s. measured: (20,)
        z as depth says, metres; NaN where it says nothing.
        """
        step = time - self._time
        self._time = time
        known = 0.0 <= step <= GAP
        step = max(step, LEAST_STEP) if known else 0.0
        wander = WANDER * math.sqrt(step) if known else math.inf
        out = np.empty((JOINT_COUNT, 3))
        _hold(
            *(positions, states, lengths, _SPREADS, measured, self._before, self._doubts),
            *(step, wander, PARENTS, _ORDER, out),
        )
        out[Joint.SPINE] = out[0] + SPINE_SHARE * (out[Joint.SHOULDER_CENTER] - out[0])
        return out
