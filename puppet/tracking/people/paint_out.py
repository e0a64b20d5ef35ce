"""Painting people out of a picture, so that a network that finds one finds the next."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

import cv2
import numpy as np

from puppet.kernel import Floats
from puppet.tracking.cameras.camera import Image

#: A grey that no network takes for anything.
PAINT: Final = (128, 128, 128)
#: Landmarks between which there is flesh. The head comes extra.
LIMBS: Final = (
    *((11, 13), (13, 15), (15, 19), (11, 23), (23, 25), (25, 27), (27, 31)),
    *((12, 14), (14, 16), (16, 20), (12, 24), (24, 26), (26, 28), (28, 32)),
)
TORSO: Final = (11, 12, 24, 23)
HEAD: Final = tuple(range(11))
#: Thickness of limbs and radius of the head, in sides of the body's region.
LIMB_WIDTH: Final = 0.07
HEAD_RADIUS: Final = 0.09
#: Pixels along a side of the map on which it is seen what is covered.
MAP_SIDE: Final = 64
#: Beyond it, pixels are not drawn; OpenCV's own arithmetic ends at 2^15.
FAR: Final = 10_000.0


def paint_out(
    picture: Image, bodies: Iterable[tuple[Floats, float]], picture_from_image: Floats
) -> None:
    """Cover bodies in `picture`, in place.

    bodies: of each, its landmarks (33, 2) and the side of its region, pixels of the image.
    picture_from_image: (2, 3), takes (x, y, 1) in the image to pixels of the picture.
    """
    scale = float(np.sqrt(abs(np.linalg.det(picture_from_image[:, :2]))))
    for pixels, side in bodies:
        placed = pixels @ picture_from_image[:, :2].T + picture_from_image[:, 2]
        if not (np.isfinite(placed).all() and np.abs(placed).max() < FAR):
            continue
        head = placed[list(HEAD)].mean(axis=0)
        neck = placed[list(TORSO[:2])].mean(axis=0)
        points = np.rint(placed).astype(int)
        width = max(1, round(LIMB_WIDTH * side * scale))
        cv2.fillPoly(picture, [points[list(TORSO)].astype(np.int32)], PAINT)
        for start, end in LIMBS:
            cv2.line(picture, points[start].tolist(), points[end].tolist(), PAINT, width)
        middle = np.rint(head).astype(int).tolist()
        cv2.line(picture, middle, np.rint(neck).astype(int).tolist(), PAINT, width)
        cv2.circle(picture, middle, max(1, round(HEAD_RADIUS * side * scale)), PAINT, -1)


def covered(points: Floats, bodies: Sequence[tuple[Floats, float]]) -> float:
    """The share of the points (N, 2), pixels of the image, that `paint_out` covers."""
    low, high = points.min(axis=0), points.max(axis=0)
    scale = (MAP_SIDE - 1.0) / max(float((high - low).max()), 1.0)
    to_map = np.column_stack([np.eye(2) * scale, -low * scale])
    picture = np.zeros((MAP_SIDE, MAP_SIDE, 3), np.uint8)
    paint_out(picture, bodies, to_map)
    columns, rows = np.rint((points - low) * scale).astype(int).T
    return float(np.mean(picture[rows, columns, 0] > 0))
