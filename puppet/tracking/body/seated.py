"""People of whom only the upper body is seen: the trunk goes on below the shoulders.

At a table, or close to the camera, hips are guesses. Puppets need a trunk all the same; so it is
put where it would be, below the shoulders, and called inferred.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.skeleton import Joint, TrackingState

#: Metres from the hip centre to the shoulder centre, and half the hips' width, while the
#: performer's own are not known.
USUAL_TRUNK: Final = 0.49
USUAL_HIP: Final = 0.10
#: Parts of that way: where the spine lies, how far below the hip centre the hips are, and how far
#: above the shoulders their centre is.
_SPINE: Final = 0.18
_BELOW: Final = 0.12
_NECK: Final = 0.10
_HIPS: Final = [Joint.HIP_LEFT, Joint.HIP_RIGHT]
_LEGS: Final = [
    *(Joint.KNEE_LEFT, Joint.ANKLE_LEFT, Joint.FOOT_LEFT),
    *(Joint.KNEE_RIGHT, Joint.ANKLE_RIGHT, Joint.FOOT_RIGHT),
]
_TRUNK: Final = [Joint.HIP_CENTER, Joint.SPINE, *_HIPS]


def seated(
    positions: Floats, states: NDArray[np.uint8], up: Floats, lengths: Floats
) -> tuple[Floats, NDArray[np.uint8]]:
    """The joints of somebody whose legs do not count: these are not tracked, and hips that are not
    seen are put below the shoulders and inferred.

    positions: (20, 3) metres. states: (20,). up: (3,) unit vector in the same axes. lengths: (20,)
    metres from each joint's parent, of the trunk from the hip centre; 0 where not known.
    """
    states = states.copy()
    states[_LEGS] = TrackingState.NOT_TRACKED
    if (states[[Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT]] == TrackingState.NOT_TRACKED).any():
        return positions, states
    if (states[_HIPS] == TrackingState.TRACKED).all():
        return positions, states
    positions = positions.copy()
    trunk = float(lengths[Joint.SHOULDER_CENTER]) or USUAL_TRUNK
    width = float(lengths[Joint.HIP_LEFT]) or USUAL_HIP
    # Where the neck is was guessed from hips that nobody sees.
    shoulders = positions[[Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT]]
    neck = shoulders.mean(axis=0) + _NECK * trunk * up
    positions[Joint.SHOULDER_CENTER] = neck
    states[Joint.SHOULDER_CENTER] = states[[Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT]].min()
    across = positions[Joint.SHOULDER_LEFT] - positions[Joint.SHOULDER_RIGHT]
    across = across - up * float(across @ up)
    across /= max(float(np.linalg.norm(across)), 1e-6)
    hip = neck - trunk * up
    positions[Joint.HIP_CENTER] = hip
    positions[Joint.SPINE] = hip + _SPINE * trunk * up
    for joint, side in zip(_HIPS, (1.0, -1.0), strict=True):
        positions[joint] = hip - _BELOW * trunk * up + side * width * across
    states[_TRUNK] = TrackingState.INFERRED
    return positions, states
