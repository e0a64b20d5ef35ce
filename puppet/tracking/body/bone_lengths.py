"""The performer's bones keep their lengths: learned over the first seconds, and then held.

The network gives each frame a body of its own. The median of what is seen of a bone, left and right
alike and a good way towards usual proportions, is what it is from then on.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.skeleton import JOINT_COUNT, OTHER_SIDE, Joint, TrackingState
from puppet.tracking.body.bone_hold import FITS, NOTHING, PARENTS, BoneHold

#: Seconds of seen bones after which their lengths are held.
LEARN_SECONDS: Final = 3.0
#: Samples that are kept of a bone; more often than 30 times a second tells nothing new.
SAMPLES: Final = 90
SAMPLE_STEP: Final = 1.0 / 30.0
#: Samples from which a median is believed.
LEAST_SAMPLES: Final = 8
#: Somebody whose bones are this much longer or shorter for a whole memory is somebody else.
ANOTHER: Final = 0.2
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
        self._hold = BoneHold()

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
        measured: Floats = NOTHING,
    ) -> Floats:
        """The joints with each bone at its length: (20, 3) metres from the lens, x right, y up, z
        from the scene to the camera. states: (20,). time: capture time, s.

        size: how many times larger than the network thought the performer was found to be; what is
        learned is learned in the network's size, so that a size found later changes nothing else.
        measured: (20,) z as depth says, metres; NaN where it says nothing.
        """
        step = time - self._time
        if not 0.0 <= step < SAMPLE_STEP:
            self._time = time
            off = np.nan_to_num(measured - positions[:, 2], nan=np.inf)
            scale = np.where(np.abs(off) < FITS, measured / positions[:, 2], 1.0)
            self._learn(positions * scale[:, None] / size, states, min(max(step, 0.0), 0.1))
        return self._hold(positions, states, self.lengths * size, time, measured)

    def _learn(self, positions: Floats, states: NDArray[np.uint8], step: float) -> None:
        tracked = states == TrackingState.TRACKED
        bones = np.linalg.norm(positions - positions[PARENTS], axis=1)
        bones[Joint.HIP_CENTER] = np.nan  # it hangs on nothing
        self._samples[self._count % SAMPLES] = np.where(tracked & tracked[PARENTS], bones, np.nan)
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
