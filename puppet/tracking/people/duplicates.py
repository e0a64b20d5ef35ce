"""One body found twice: two sets of landmarks that lie on the same person."""

from __future__ import annotations

from typing import Final

import numpy as np

from puppet.tracking.people.blazepose import Landmarks

#: Shoulders, elbows, wrists, hips, knees, ankles: left, and the same on the right.
_LEFT: Final = [11, 13, 15, 23, 25, 27]
_RIGHT: Final = [12, 14, 16, 24, 26, 28]
BODY: Final = _LEFT + _RIGHT
_EXCHANGED: Final = _RIGHT + _LEFT
#: Two people never have half of their joints so near to each other, in sides of the region.
SAME_BODY: Final = 0.06
#: A newcomer of whom so much lies on somebody known may be a part of them, in whatever pose.
PART_OF_IT: Final = 0.5


def apart(one: Landmarks, other: Landmarks) -> float:
    """How far two bodies are from being one: the median distance of their joints in the image, in
    sides of the smaller region. Whether left and right are exchanged does not matter."""
    a, b = one.pixels[BODY], other.pixels
    median = min(
        float(np.median(np.linalg.norm(a - b[order], axis=1))) for order in (BODY, _EXCHANGED)
    )
    return median / min(one.extent, other.extent)


def same_body(one: Landmarks, other: Landmarks) -> bool:
    """Whether the two lie on one person."""
    return apart(one, other) < SAME_BODY


def part_of(newcomer: Landmarks, known: Landmarks) -> bool:
    """Whether the newcomer may be no more than a bad look at somebody known: more than half of the
    one's box or the other's is common to both."""
    boxes = [
        np.stack([one.pixels[BODY].min(axis=0), one.pixels[BODY].max(axis=0)])
        for one in (newcomer, known)
    ]
    sides = np.minimum(boxes[0][1], boxes[1][1]) - np.maximum(boxes[0][0], boxes[1][0])
    common = float(np.prod(np.maximum(sides, 0.0)))
    areas = [float(np.prod(box[1] - box[0])) for box in boxes]
    return common > PART_OF_IT * min(areas)
