"""The yaw of a body of which only a part may be seen."""

from __future__ import annotations

import math
from typing import Final

from puppet.kernel import Floats, kernel
from puppet.skeleton import Joint

_HIPS: Final = (int(Joint.HIP_LEFT), int(Joint.HIP_RIGHT))
_SHOULDERS: Final = (int(Joint.SHOULDER_LEFT), int(Joint.SHOULDER_RIGHT))
#: Hips or shoulders that are closer together than this, seen from above, tell nothing. Metres.
_NARROWEST: Final = 0.05


@kernel
def heading_by(positions: Floats, hips: bool, shoulders: bool) -> float:
    """Radians about +Y, 0 facing +Z, by the lines across; nan if they do not tell. (20, 3) ->"""
    across = along = 0.0
    for pair in range(2):
        if (hips, shoulders)[pair]:
            left, right = (_HIPS, _SHOULDERS)[pair]
            x = positions[left, 0] - positions[right, 0]
            z = positions[left, 2] - positions[right, 2]
            width = math.sqrt(x * x + z * z)
            if width > _NARROWEST:
                across += x / width
                along += z / width
    return math.atan2(-along, across) if abs(across) + abs(along) > 1e-3 else math.nan


@kernel
def between(start: float, end: float) -> float:
    """Radians from one heading to another, the shorter way; 0 where one is not known."""
    turn = end - start
    if math.isnan(turn):
        return 0.0
    return turn - 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)


@kernel
def yawed(v: Floats, angle: float) -> Floats:
    """(3,) turned by `angle` radians about +Y."""
    sine, cosine = math.sin(angle), math.cos(angle)
    out = v * 1.0
    out[0] = cosine * v[0] + sine * v[2]
    out[2] = cosine * v[2] - sine * v[0]
    return out
