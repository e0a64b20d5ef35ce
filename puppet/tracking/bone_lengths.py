"""The performer's bones keep their lengths: learned over the first seconds, and then held.

Across the line of sight a camera sees well and along it badly. So a joint that is seen keeps its
place in the image, and its distance is moved until the bone is as long as it was learned to be:
the most likely place between the network's guess of the distance and the bone's length.
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
DEPTH_SPREAD: Final = 0.10
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


@kernel
def _hold(
    positions: Floats,
    seen: Bytes,
    lengths: Floats,
    spreads: Floats,
    parents: Ints,
    order: Ints,
    out: Floats,
) -> None:
    """Fill `out`, (20, 3), metres from the lens: each bone as long as `lengths` says, if > 0."""
    out[0] = positions[0]
    for joint in order:
        parent = parents[joint]
        length = lengths[joint]
        guess = out[parent, 2] + positions[joint, 2] - positions[parent, 2]
        if length <= 0.0:
            out[joint] = positions[joint]
            if positions[joint, 2] < -0.1:
                out[joint] *= guess / positions[joint, 2]
            continue
        if seen[joint] != 2 or positions[joint, 2] > -0.1:
            # The image does not say where it is: the network's direction does.
            bone = positions[joint] - positions[parent]
            now = math.sqrt(bone[0] * bone[0] + bone[1] * bone[1] + bone[2] * bone[2])
            out[joint] = out[parent] + bone * (length / max(now, 1e-6))
            continue
        ray = positions[joint] / positions[joint, 2]
        z, spread = guess, spreads[joint]
        for _ in range(8):  # Gauss-Newton on the distance alone
            bone = ray * z - out[parent]
            now = math.sqrt(bone[0] * bone[0] + bone[1] * bone[1] + bone[2] * bone[2])
            slope = (bone[0] * ray[0] + bone[1] * ray[1] + bone[2] * ray[2]) / max(now, 1e-6)
            slope /= LENGTH_SPREAD
            off = (now - length) / LENGTH_SPREAD
            away = (z - guess) / spread
            step = (away / spread + off * slope) / (1.0 / spread**2 + slope * slope)
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
        self._time = -math.inf
        self._watched = 0.0

    @property
    def learned(self) -> bool:
        """Whether they are held by now."""
        return self._watched >= LEARN_SECONDS

    def __call__(
        self, positions: Floats, states: NDArray[np.uint8], time: float, size: float = 1.0
    ) -> Floats:
        """The joints with each bone at its length: (20, 3) metres from the lens, x right, y up, z
        from the scene to the camera. states: (20,). time: capture time, s.

        size: how many times larger than the network thought the performer was found to be; what is
        learned is learned in the network's size, so that a size found later changes nothing else.
        """
        step = time - self._time
        if not 0.0 <= step < SAMPLE_STEP:
            self._time = time
            self._learn(positions / size, states, min(max(step, 0.0), 0.1))
        out = np.empty((JOINT_COUNT, 3))
        _hold(positions, states, self.lengths * size, _SPREADS, _PARENTS, _ORDER, out)
        out[Joint.SPINE] = out[0] + _SPINE * (out[Joint.SHOULDER_CENTER] - out[0])
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
    """No bone longer or shorter than a person's of that size can be."""
    usual = np.zeros(JOINT_COUNT)
    for joint, share in _USUAL.items():
        usual[joint] = usual[OTHER_SIDE[joint]] = share
    known = (lengths > 0.0) & (usual > 0.15)  # the long ones say how large somebody is
    if not known.any():
        return lengths
    usual *= float(np.median(lengths[known] / usual[known]))
    low, high = usual / _STRANGEST, usual * _STRANGEST
    return np.where((lengths > 0.0) & (usual > 0.0), np.clip(lengths, low, high), lengths)


def _is_another(held: Floats, lengths: Floats) -> bool:
    both = (held > 0.0) & (lengths > 0.0)
    if both.sum() < 4:
        return False
    return bool(abs(np.median(lengths[both] / held[both]) - 1.0) > ANOTHER)
