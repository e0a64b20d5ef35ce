"""Whether lens and depth can be those of an image: what another camera's calibration gives away."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from puppet.tracking.cameras.intrinsics import Intrinsics

#: Degrees along the longer side that cameras for people have; a webcam has 60, an OAK-D W 127.
ANGLES: Final = (20.0, 150.0)
#: And those that no lens without distortion has, through which people can be seen.
POSSIBLE_ANGLES: Final = (5.0, 160.0)
#: How far off the middle of the image a lens's axis may be, as a part of the image's side.
OFF_MIDDLE: Final = 0.15
#: Pixels are square; focal lengths differ by no more than this part.
OFF_SQUARE: Final = 0.1
#: Widths to heights of colour and depth of one view differ by no more than this part.
SAME_SHAPE: Final = 0.02


def lens_error(lens: Intrinsics, width: int, height: int) -> str:
    """Why this cannot be the lens of an image of so many pixels; empty if it can."""
    numbers = (lens.focal_x, lens.focal_y, lens.centre_x, lens.centre_y)
    if not all(map(math.isfinite, numbers)):
        return "it has values that are not numbers"
    if min(lens.focal_x, lens.focal_y) <= 0.0:
        return f"its focal lengths are {lens.focal_x:g} and {lens.focal_y:g} pixels"
    if not (-0.5 <= lens.centre_x <= width - 0.5 and -0.5 <= lens.centre_y <= height - 0.5):
        return (
            f"its axis meets the image at ({lens.centre_x:.0f}, {lens.centre_y:.0f}), outside of "
            f"{width}×{height} pixels"
        )
    angle = _angle(lens, width, height)
    if not POSSIBLE_ANGLES[0] <= angle <= POSSIBLE_ANGLES[1]:
        return f"it sees {angle:.1f}° along the longer side"
    return ""


def lens_doubt(lens: Intrinsics, width: int, height: int) -> str:
    """What is odd about a lens that is possible (see `lens_error`); empty if nothing is."""
    angle = _angle(lens, width, height)
    if not ANGLES[0] <= angle <= ANGLES[1]:
        return f"the lens sees {angle:.0f}° along the longer side"
    off_x = abs(lens.centre_x - 0.5 * (width - 1)) / width
    off_y = abs(lens.centre_y - 0.5 * (height - 1)) / height
    if max(off_x, off_y) > OFF_MIDDLE:
        return (
            f"the lens's axis meets the image at ({lens.centre_x:.0f}, {lens.centre_y:.0f}), far "
            f"off the middle of {width}×{height} pixels"
        )
    if abs(lens.focal_x / lens.focal_y - 1.0) > OFF_SQUARE:
        return f"the lens has focal lengths of {lens.focal_x:.0f} and {lens.focal_y:.0f} pixels"
    return ""


def depth_error(depth: NDArray[Any], width: int, height: int) -> str:
    """Why this cannot be the depth of an image of so many pixels; empty if it can."""
    if depth.dtype != np.uint16 or depth.ndim != 2:
        return f"it is {depth.shape} {depth.dtype}, and not one channel of 16 bits"
    rows, columns = depth.shape
    if min(rows, columns) == 0 or abs(width * rows / (height * columns) - 1.0) > SAME_SHAPE:
        return f"it has {columns}×{rows} pixels, another shape than {width}×{height}"
    return ""


def _angle(lens: Intrinsics, width: int, height: int) -> float:
    """Degrees along the longer side."""
    focal = lens.focal_x if width >= height else lens.focal_y
    return math.degrees(2.0 * math.atan(0.5 * max(width, height) / focal))
