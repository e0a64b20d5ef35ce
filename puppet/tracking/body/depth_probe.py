"""What a depth image says of landmarks: how far away the body is there.

A landmark lies inside the body and depth is measured at its skin; at an edge half of what is seen
there is the wall behind. So the nearer part of a small window counts, a little is added, and what
fits nobody is not believed.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from puppet.kernel import Floats, frozen, kernel
from puppet.tracking.cameras.camera import Depth, Image

#: Metres from the skin to the joint inside, of an adult: ears to the middle of the head, shoulders,
#: elbows, wrists, hands, hips, knees, ankles and feet.
INSETS: Final = frozen(
    [*[0.07] * 11, *[0.07] * 2, *[0.04] * 2, *[0.03] * 2, *[0.02] * 6]
    + [*[0.11] * 2, *[0.06] * 2, *[0.04] * 2, *[0.03] * 4]
)
#: Metres between which a measurement can be somebody.
NEAREST, FARTHEST = 0.3, 12.0
#: Nobody is flat to so many metres: then the sensor is stuck.
FLAT: Final = 0.02
#: The window's half side, as a part of the region's; and the least, pixels of the depth image.
REACH: Final = 0.012
LEAST_REACH: Final = 2
#: A window of which less than this is known says nothing.
KNOWN: Final = 0.2


@kernel
def _probe(
    depth: Depth, points: Floats, reach: int, nearest: float, farthest: float, out: Floats
) -> None:
    """Fill `out`, (N,) metres: the median of what is known around each point; NaN for nothing."""
    height, width = depth.shape
    window = np.empty((2 * reach + 1) ** 2)
    for index in range(len(points)):
        out[index] = np.nan
        # A point that is no number, or far out, must not become an index.
        if not (-1.0 < points[index, 0] < width and -1.0 < points[index, 1] < height):
            continue
        column, row = round(points[index, 0]), round(points[index, 1])
        count = 0
        for y in range(max(row - reach, 0), min(row + reach + 1, height)):
            for x in range(max(column - reach, 0), min(column + reach + 1, width)):
                metres = 0.001 * depth[y, x]
                if nearest < metres < farthest:
                    window[count] = metres
                    count += 1
        if count >= KNOWN * len(window):
            out[index] = np.median(window[:count])


def depths_at(depth: Depth, colour: Image, pixels: Floats, side: float) -> Floats:
    """(33,) metres along the lens's axis to what is inside of the skin at each landmark; NaN if
    that is not known.

    pixels: (33, 2) in the colour image, of the same view as the depth. side: of the performer's
    region, pixels of the colour image.
    """
    out = np.empty(len(pixels))
    factor = depth.shape[1] / colour.shape[1]
    reach = max(LEAST_REACH, round(REACH * side * factor))
    points = (pixels + 0.5) * factor - 0.5
    _probe(np.ascontiguousarray(depth), points, min(reach, 40), NEAREST, FARTHEST, out)
    if not np.isfinite(out).any() or np.nanmax(out) - np.nanmin(out) < FLAT:
        out[:] = np.nan
    return np.asarray(out + INSETS)
