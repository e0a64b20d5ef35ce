"""One body found twice: two sets of landmarks that lie on the same person."""

from __future__ import annotations

from typing import Final

import numpy as np

from puppet.tracking.blazepose import Landmarks

#: Shoulders, elbows, wrists, hips, knees, ankles: left, and the same on the right.
_LEFT: Final = [11, 13, 15, 23, 25, 27]
_RIGHT: Final = [12, 14, 16, 24, 26, 28]
_BODY: Final = _LEFT + _RIGHT
_EXCHANGED: Final = _RIGHT + _LEFT
#: Two people never have half of their joints so near to each other, in sides of the region.
SAME_BODY: Final = 0.06


def apart(one: Landmarks, other: Landmarks) -> float:
    """How far two bodies are from being one: the median distance of their joints in the image, in
    sides of the smaller region. Whether left and right are exchanged does not matter."""
    a, b = one.pixels[_BODY], other.pixels
    median = min(
        float(np.median(np.linalg.norm(a - b[order], axis=1))) for order in (_BODY, _EXCHANGED)
    )
    return median / min(one.extent, other.extent)


def same_body(one: Landmarks, other: Landmarks) -> bool:
    """Whether the two lie on one person."""
    return apart(one, other) < SAME_BODY
