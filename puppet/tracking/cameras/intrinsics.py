"""A lens: how pixels of an image and directions before the camera belong together."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from puppet.kernel import Floats

#: Degrees along an image's longer side where nothing is known of the lens; phones and webcams
#: have 55 to 80. A wrong guess moves the performer nearer or farther, and hardly bends the body.
ASSUMED_ANGLE: Final = 60.0


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A lens without distortion. All in pixels: focal lengths, and the middle of the image."""

    focal_x: float
    focal_y: float
    centre_x: float
    centre_y: float

    @classmethod
    def assumed(cls, width: int, height: int, focal: float | None = None) -> Intrinsics:
        """The lens of an image of which nothing but its size is known, or its focal length too."""
        if focal is None:
            focal = 0.5 * max(width, height) / math.tan(math.radians(0.5 * ASSUMED_ANGLE))
        return cls(focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))

    def rays(self, pixels: Floats) -> Floats:
        """(N, 2) pixels -> (N, 2), x and y of their lines of sight at a distance of 1 (z away)."""
        middle = (self.centre_x, self.centre_y)
        return np.asarray((pixels - middle) / (self.focal_x, self.focal_y))

    def pixels(self, points: Floats) -> Floats:
        """(N, 3) metres before the lens, x right, y down, z away -> (N, 2) pixels."""
        ahead = points[:, :2] / points[:, 2:]
        return np.asarray(ahead * (self.focal_x, self.focal_y) + (self.centre_x, self.centre_y))

    def resized(self, factor: float) -> Intrinsics:
        """The lens of the same image with `factor` times as many pixels along each side."""
        # Pixel centres are at whole numbers, so the image begins at -0.5.
        return Intrinsics(
            self.focal_x * factor,
            self.focal_y * factor,
            (self.centre_x + 0.5) * factor - 0.5,
            (self.centre_y + 0.5) * factor - 0.5,
        )
