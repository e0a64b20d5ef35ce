"""The performer's bones keep their lengths: learned over the first seconds, and then held.

Across the line of sight a camera sees well and along it badly. So a joint that is seen keeps its
place in the image, and its distance is the most likely one by three things: the network's guess,
the frame before, and above all the length that the bone was learned to have. A bone that lies
nearly across the line of sight says little of it; there the frame before keeps it from trembling.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Bytes, Floats, Ints, frozen, kernel
from puppet.skeleton import JOINT_COUNT, OTHER_SIDE, Joint, TrackingState

#: Seconds of seen bones after which their lengths are held.
LEARN_SECONDS: Final = 3.0
#: Samples that are kept of a bone; more often than 30 times a second tells nothing new.
SAMPLES: Final = 90
SAMPLE_STEP: Final = 1.0 / 30.0
#: Samples from which a median is believed.
LEAST_SAMPLES: Final = 8
#: Somebody whose bones are this much longer or shorter for a whole memory is somebody else.
ANOTHER: Final = 0.2
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
#: The trunk is one bone here, with the spine on it: the short pieces are mostly noise.
_PARENTS: Final[Ints] = frozen(
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
_SPINE: Final = 0.18 / 0.98
#: Lengths as parts of the whole (trunk, thigh and shin), and how far anybody's are from that
#: (Drillis and Contini 1966, to the joints of this skeleton).
_USUAL: Final = {
    Joint.SHOULDER_CENTER: 0.37,
    Joint.HEAD: 0.13,
    Joint.SHOULDER_LEFT: 0.14,
    Joint.ELBOW_LEFT: 0.22,
    Joint.WRIST_LEFT: 0.20,
    Joint.HAND_LEFT: 0.06,
    Joint.HIP_LEFT: 0.08,
    Joint.KNEE_LEFT: 0.31,
    Joint.ANKLE_LEFT: 0.31,
    Joint.FOOT_LEFT: 0.14,
}
_STRANGEST: Final = 1.6
#: How much usual proportions count against what was learned: where the network is not sure, it
#: makes bones shorter than they are, and so does its median.
USUAL_SHARE: Final = 0.4


_NOTHING: Final = frozen(np.full(JOINT_COUNT, np.nan))


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
def _hold(
    positions: Floats,
    seen: Bytes,
    lengths: Floats,
    spreads: Floats,
    measured: Floats,
    before: Floats,
    wander: float,
    parents: Ints,
    order: Ints,
    out: Floats,
) -> None:
    """Fill `out`, (20, 3), metres from the lens: each bone as long as `lengths` says, if > 0.

    measured: (20,) z as depth says, NaN for nothing. before: (20,) how much nearer than its parent
    each joint was, and the hips than they were put. wander: by how much that may have changed
    since, metres; infinite if it is not known.
    """
    old = 1.0 / wander**2
    # The hips are where the body was put, or where depth says; from one to the other they wander.
    off, word = 0.0, 1.0 / spreads[0] ** 2
    if seen[0] == 2 and abs(measured[0] - positions[0, 2]) < FITS:
        off, word = measured[0] - positions[0, 2], _trust(measured[0])
    off = (word * off + old * before[0]) / (word + old)
    out[0] = positions[0] * ((positions[0, 2] + off) / positions[0, 2])
    for joint in order:
        parent = parents[joint]
        length = lengths[joint]
        bone = positions[joint] - positions[parent]
        word = 1.0 / spreads[joint] ** 2
        if seen[joint] == 2 and _fits(positions[joint], measured[joint], out[parent], length):
            bone[2] = measured[joint] - out[parent, 2]
            word = _trust(measured[joint])
        # The word of the network, or of depth, and that of the frame before, each by its weight.
        likely = (word * bone[2] + old * before[joint]) / (word + old)
        guess = out[parent, 2] + likely
        if length <= 0.0:
            out[joint] = positions[joint]
            if positions[joint, 2] < -0.1:
                out[joint] *= guess / positions[joint, 2]
            continue
        if seen[joint] != 2 or positions[joint, 2] > -0.1:
            # The image does not say where it is: the network's direction does.
            bone[2] = likely
            now = math.sqrt(bone[0] * bone[0] + bone[1] * bone[1] + bone[2] * bone[2])
            out[joint] = out[parent] + bone * (length / max(now, 1e-6))
            continue
        ray = positions[joint] / positions[joint, 2]
        z = out[parent, 2] + bone[2]  # of two places at that length, that on the side of the word
        for _ in range(8):  # Gauss-Newton on the distance alone
            bone = ray * z - out[parent]
            now = math.sqrt(bone[0] * bone[0] + bone[1] * bone[1] + bone[2] * bone[2])
            slope = (bone[0] * ray[0] + bone[1] * ray[1] + bone[2] * ray[2]) / max(now, 1e-6)
            slope /= LENGTH_SPREAD
            off = (now - length) / LENGTH_SPREAD
            step = ((word + old) * (z - guess) + off * slope) / (word + old + slope * slope)
            z -= min(max(step, -0.1), 0.1)
        out[joint] = ray * min(z, -0.1)


class BoneLengths:
    """One performer's bones. lengths: (20,) metres from each joint's parent; 0 while unknown."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Learn them anew."""
        self.lengths = np.zeros(JOINT_COUNT)
        self._samples = np.full((SAMPLES, JOINT_COUNT), np.nan)
        self._count = 0
        self._time = self._learnt = -math.inf
        self._watched = 0.0
        self._before = np.zeros(JOINT_COUNT)

    @property
    def learned(self) -> bool:
        """Whether they are held by now."""
        return self._watched >= LEARN_SECONDS

    def __call__(
        self,
        positions: Floats,
        states: NDArray[np.uint8],
        time: float,
        *,
        size: float = 1.0,
        measured: Floats = _NOTHING,
    ) -> Floats:
        """The joints with each bone at its length: (20, 3) metres from the lens, x right, y up, z
        from the scene to the camera. states: (20,). time: capture time, s.

        size: how many times larger than the network thought the performer was found to be; what is
        learned is learned in the network's size, so that a size found later changes nothing else.
        measured: (20,) z as depth says, metres; NaN where it says nothing.
        """
        since = time - self._learnt
        if not 0.0 <= since < SAMPLE_STEP:
            self._learnt = time
            off = np.nan_to_num(measured - positions[:, 2], nan=np.inf)
            scale = np.where(np.abs(off) < FITS, measured / positions[:, 2], 1.0)
            self._learn(positions * scale[:, None] / size, states, min(max(since, 0.0), 0.1))
        step = time - self._time
        self._time = time
        wander = WANDER * math.sqrt(max(step, LEAST_STEP)) if 0.0 <= step <= GAP else math.inf
        out = np.empty((JOINT_COUNT, 3))
        lengths = self.lengths * size
        _hold(
            *(positions, states, lengths, _SPREADS, measured, self._before, wander),
            *(_PARENTS, _ORDER, out),
        )
        out[Joint.SPINE] = out[0] + _SPINE * (out[Joint.SHOULDER_CENTER] - out[0])
        self._before = out[:, 2] - out[_PARENTS, 2]
        self._before[0] = out[0, 2] - positions[0, 2]
        return out

    def _learn(self, positions: Floats, states: NDArray[np.uint8], step: float) -> None:
        tracked = states == TrackingState.TRACKED
        bones = np.linalg.norm(positions - positions[_PARENTS], axis=1)
        self._samples[self._count % SAMPLES] = np.where(tracked & tracked[_PARENTS], bones, np.nan)
        self._count += 1
        if self.learned and self._count % SAMPLES:
            return
        enough = np.isfinite(self._samples).sum(axis=0) >= LEAST_SAMPLES
        medians = np.zeros(JOINT_COUNT)
        medians[enough] = np.nanmedian(self._samples[:, enough], axis=0)
        lengths = _proportioned(_even(medians))
        if not self.learned:
            self.lengths = lengths
            if enough[[Joint.SHOULDER_CENTER, Joint.ELBOW_LEFT, Joint.ELBOW_RIGHT]].any():
                self._watched += step
        elif _is_another(self.lengths, lengths):
            self.lengths = lengths
        else:  # what was never seen before is learned when it is
            self.lengths = np.where(self.lengths > 0.0, self.lengths, lengths)


def _even(lengths: Floats) -> Floats:
    """Left and right alike: their mean, or the one that is known."""
    other = lengths[list(OTHER_SIDE)]
    both = (lengths > 0.0) & (other > 0.0)
    return np.where(both, 0.5 * (lengths + other), np.maximum(lengths, other))


def _proportioned(lengths: Floats) -> Floats:
    """Lengths a good way towards the usual ones of somebody of that size, and none out of reach."""
    usual = np.zeros(JOINT_COUNT)
    for joint, share in _USUAL.items():
        usual[joint] = usual[OTHER_SIDE[joint]] = share
    known = (lengths > 0.0) & (usual > 0.15)  # the long ones say how large somebody is
    if not known.any():
        return lengths
    usual *= float(np.median(lengths[known] / usual[known]))
    both = (lengths > 0.0) & (usual > 0.0)
    own = np.clip(lengths, usual / _STRANGEST, usual * _STRANGEST)
    mixed = (
        np.where(both, own, 1.0) ** (1.0 - USUAL_SHARE) * np.where(both, usual, 1.0) ** USUAL_SHARE
    )
    return np.where(both, mixed, lengths)


def _is_another(held: Floats, lengths: Floats) -> bool:
    both = (held > 0.0) & (lengths > 0.0)
    if both.sum() < 4:
        return False
    return bool(abs(np.median(lengths[both] / held[both]) - 1.0) > ANOTHER)
