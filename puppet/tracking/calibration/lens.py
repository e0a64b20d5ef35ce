"""Measuring a lens: the board is shown to a camera in many places and directions (Zhang 2000)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from puppet.errors import PuppetError
from puppet.kernel import Floats
from puppet.tracking.calibration.board import BoardFinder, BoardSight
from puppet.tracking.cameras.camera import Image
from puppet.tracking.cameras.intrinsics import Intrinsics

#: So many views are taken, and so many are needed at least.
VIEWS: Final = 16
LEAST: Final = 6
#: Views differ by this part of the image's width at least (mean over the corners).
APART: Final = 0.06
#: So many corners of squares have to be seen in a view.
CORNERS: Final = 6
#: A focal length outside of this range, in widths of the image, is a mistake.
FOCALS: Final = (0.3, 6.0)
#: And one that is so unsure, as a part of itself, is none.
MOST_UNSURE: Final = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class FoundLens:
    """A lens as it was measured. error: pixels (RMS). unsure: pixels, one standard deviation of the
    focal length. views: how many."""

    lens: Intrinsics
    error: float
    unsure: float
    views: int

    @property
    def quality(self) -> str:
        """One sentence for people."""
        return (
            f"focal length {self.lens.focal_x:.0f} ±{self.unsure:.0f} px from {self.views} views, "
            f"{self.error:.2f} px off"
        )


class LensWatch:
    """Gathers views of the board that differ from each other. progress: 0..1."""

    def __init__(self) -> None:
        self._finder = BoardFinder()
        self._views: list[BoardSight] = []
        self._size = (0, 0)

    @property
    def progress(self) -> float:
        """0..1, of the views that are wanted."""
        return min(1.0, len(self._views) / VIEWS)

    def look(self, image: Image) -> bool:
        """Take an image in. True if it is another view."""
        height, width = image.shape[:2]
        self._size = (width, height)
        sight = self._finder.find(image)
        if sight is None or sum(n < 100 for n in sight.corners) < CORNERS:
            return False
        if any(_apart(sight, view) < APART * width for view in self._views):
            return False
        self._views.append(sight)
        return True

    def lens(self) -> FoundLens:
        """The lens, from all views so far. Raises PuppetError if they do not tell it."""
        return measure_lens(self._views, *self._size)


def measure_lens(views: Sequence[BoardSight], width: int, height: int) -> FoundLens:
    """The lens of a camera that saw these views, in images of this size, pixels.

    Its bend is fitted as well, so that it does not spoil the focal length, and then left out.
    Raises PuppetError, in words for people, if the views do not tell it.
    """
    if len(views) < LEAST:
        raise PuppetError(
            "the lens cannot be measured yet",
            expected=f"{LEAST} views of the board or more, in different places and directions",
            found=str(len(views)),
            hint="tilt the board to all sides, and bring it into the corners of the picture",
        )
    points, pixels = [], []
    for view in views:
        numbers = sorted(n for n in view.corners if n < 100)
        points.append(view.points(numbers).astype(np.float32))
        pixels.append(np.array([view.corners[n] for n in numbers], np.float32)[:, None])
    start = Intrinsics.assumed(width, height)
    matrix = np.array(
        [[start.focal_x, 0, start.centre_x], [0, start.focal_y, start.centre_y], [0, 0, 1.0]]
    )
    flags = (
        cv2.CALIB_USE_INTRINSIC_GUESS
        | cv2.CALIB_FIX_ASPECT_RATIO
        | cv2.CALIB_ZERO_TANGENT_DIST
        | cv2.CALIB_FIX_K2
        | cv2.CALIB_FIX_K3
    )
    error, found, _, _, _, spread, *_ = cv2.calibrateCameraExtended(
        points, pixels, (width, height), matrix, np.zeros(5), flags=flags
    )
    found = np.asarray(found, float)
    lens = Intrinsics(*(float(found[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2))))
    unsure = float(np.ravel(spread)[:2].max())  # of the two that are one, one is free
    inside = 0.0 < lens.centre_x < width and 0.0 < lens.centre_y < height
    if (
        not inside
        or not FOCALS[0] < lens.focal_x / width < FOCALS[1]
        or unsure > 0.1 * lens.focal_x
    ):
        raise PuppetError(
            "the views of the board do not tell the lens",
            expected="views that differ: tilted to all sides, near and far",
            found=f"a focal length of {lens.focal_x:.0f} ±{unsure:.0f} pixels",
            hint="tilt the board more (30° and more) and bring it nearer",
        )
    return FoundLens(lens, float(error), unsure, len(views))


def _apart(a: BoardSight, b: BoardSight) -> float:
    """Pixels (mean) between the same corners in two views."""
    both = [n for n in a.corners if n in b.corners]
    if a.board != b.board or not both:
        return float("inf")
    differences: Floats = np.array([a.corners[n] - b.corners[n] for n in both])
    return float(np.linalg.norm(differences, axis=1).mean())
