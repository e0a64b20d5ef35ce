"""People who stand before a camera: their landmarks and their picture, without a network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from puppet.kernel import Floats
from puppet.tracking.cameras.camera import Image
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.people.blazepose import LANDMARK_COUNT, Landmarks, Region

WIDTH, HEIGHT = 640, 360
LENS = Intrinsics.assumed(WIDTH, HEIGHT, 420.0)
#: Metres from the middle of the hips, camera axes, facing the camera: the left is on the right.
SIDE = {
    2: (0.03, -0.68, -0.1),
    7: (0.08, -0.66, 0.0),
    9: (0.03, -0.6, -0.1),
    11: (0.18, -0.5, 0.0),
    13: (0.24, -0.22, 0.0),
    15: (0.27, 0.04, -0.05),
    17: (0.28, 0.12, -0.05),
    19: (0.27, 0.14, -0.07),
    21: (0.25, 0.1, -0.08),
    23: (0.1, 0.0, 0.0),
    25: (0.11, 0.42, -0.02),
    27: (0.11, 0.84, 0.03),
    29: (0.11, 0.88, 0.06),
    31: (0.12, 0.9, -0.1),
}


def _template() -> Floats:
    world = np.zeros((LANDMARK_COUNT, 3))
    world[0] = (0.0, -0.65, -0.12)
    for left, place in SIDE.items():
        pairs = ((1, 4), (2, 5), (3, 6)) if left == 2 else ((left, left + 1),)
        for a, b in pairs:
            world[a], world[b] = place, np.multiply(place, (-1.0, 1.0, 1.0))
    return world


WORLD = _template()


@dataclass(frozen=True)
class Figure:
    """Somebody in certain clothes (BGR: top, trousers), hips at a place, metres before the lens."""

    place: tuple[float, float, float]
    clothes: tuple[tuple[int, int, int], tuple[int, int, int]] = ((40, 40, 200), (60, 20, 20))

    def landmarks(self, region: Region | None = None) -> Landmarks:
        pixels = LENS.pixels(WORLD + self.place)
        hips = pixels[[23, 24]].mean(axis=0)
        head = np.array([hips[0], LENS.pixels(np.array([self.place]) + (0.0, -0.95, 0.0))[0, 1]])
        following = Region.around(hips, head)
        ones = np.ones(LANDMARK_COUNT)
        return Landmarks(
            pixels,
            WORLD.copy(),
            ones,
            ones,
            1.0,
            following if region is None else region,
            following,
        )


def picture(figures: Sequence[Figure]) -> Image:
    """What the camera sees of them: the nearer before the farther."""
    image = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    for figure in sorted(figures, key=lambda one: -one.place[2]):
        points = np.rint(figure.landmarks().pixels).astype(np.int32)
        width = max(1, round(0.16 * LENS.focal_x / figure.place[2]))
        top, trousers = figure.clothes
        for side in (0, 1):
            for a, b in ((23, 25), (25, 27)):
                start, end = points[a + side].tolist(), points[b + side].tolist()
                cv2.line(image, start, end, trousers, width)
        cv2.fillPoly(image, [points[[11, 12, 24, 23]]], top)
        cv2.line(image, points[11].tolist(), points[12].tolist(), top, width)
    return image
