"""Drawing over a camera's image: skeletons, the floor, and where the stage is.

Everything is given in the camera's axes (x to the right in the image, y up in it, z from the scene
to the camera; metres from the lens) and drawn into the image in place.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pictures
from PIL import ImageDraw, ImageFont

from puppet.kernel import Floats
from puppet.skeleton import JOINT_NAMES, JOINT_PARENTS, TrackingState
from puppet.tracking.cameras.camera import Image
from puppet.tracking.cameras.intrinsics import Intrinsics

#: BGR.
Colour = tuple[int, int, int]
LEFT: Final[Colour] = (60, 160, 255)  # orange
RIGHT: Final[Colour] = (255, 170, 60)  # blue
MIDDLE: Final[Colour] = (245, 245, 245)
OUTLINE: Final[Colour] = (25, 25, 25)
#: Nothing is drawn nearer to the lens than this, metres.
NEAR: Final = 0.05
#: Pixels of a line in an image whose longer side has 1000.
WIDTH: Final = 2.5
#: Fractions of a pixel that OpenCV takes, in bits.
_SHIFT: Final = 4


def draw_skeleton(
    image: Image,
    positions: Floats,
    states: NDArray[np.uint8],
    intrinsics: Intrinsics,
    colour: Colour | None = None,
) -> None:
    """A performer: tracked joints as discs, inferred ones as rings, what is not tracked not at all.

    positions: (20, 3) in the camera's axes. states: (20,). colour: of the bones; by default left is
    orange, right is blue and the middle is white.
    """
    width = line_width(image)
    seen = states != TrackingState.NOT_TRACKED
    sides = [_side(name) for name in JOINT_NAMES]
    bones = [
        (joint, parent)
        for joint, parent in enumerate(JOINT_PARENTS)
        if parent >= 0 and seen[joint] and seen[parent]
    ]
    for under in (True, False):  # a dark rim, so that it is seen before any background
        for joint, parent in bones:
            sure = min(states[joint], states[parent]) == TrackingState.TRACKED
            draw_path(
                image,
                positions[[parent, joint]],
                intrinsics,
                OUTLINE if under else colour or sides[joint],
                (width if sure else 0.5 * width) + (0.8 * width if under else 0.0),
            )
    ahead = np.flatnonzero(seen & (positions[:, 2] < -NEAR))
    for joint, (x, y) in zip(
        ahead.tolist(), pixels_of(positions[ahead], intrinsics).tolist(), strict=True
    ):
        if not _drawable(x, y):
            continue
        centre, radius = _fixed(x, y), _fixed(1.6 * width, 0.0)[0]
        tracked = states[joint] == TrackingState.TRACKED
        inside = (colour or sides[joint]) if tracked else OUTLINE
        rim = OUTLINE if tracked else (colour or sides[joint])
        cv2.circle(image, centre, radius, inside, -1, cv2.LINE_AA, _SHIFT)
        cv2.circle(image, centre, radius, rim, _pen(0.5 * width), cv2.LINE_AA, _SHIFT)


def draw_path(
    image: Image, points: Floats, intrinsics: Intrinsics, colour: Colour, width: float
) -> None:
    """A line through (N, 3) points, as far as it is before the lens. width: pixels."""
    for start, end in pairwise(points):
        if min(start[2], end[2]) > -NEAR:
            continue
        ends = [start, end]
        for i in (0, 1):
            if ends[i][2] > -NEAR:
                other = ends[1 - i]
                share = (-NEAR - other[2]) / (ends[i][2] - other[2])
                ends[i] = other + share * (ends[i] - other)
        (ax, ay), (bx, by) = pixels_of(np.stack(ends), intrinsics)
        if _drawable(ax, ay) and _drawable(bx, by):
            cv2.line(
                image, _fixed(ax, ay), _fixed(bx, by), colour, _pen(width), cv2.LINE_AA, _SHIFT
            )


def draw_caption(image: Image, lines: Sequence[str]) -> None:
    """Sentences on a dark band along the lower edge of the image."""
    height, width = image.shape[:2]
    size = max(12, round(max(height, width) / 45))
    font = ImageFont.load_default(size)
    rows = [row for text in lines for row in _wrapped(text, font, width - 1.4 * size)]
    band = min(height, round(size * (1.4 * len(rows) + 0.9)))
    image[height - band :] //= 4
    picture = Pictures.fromarray(image[height - band :, :, ::-1])
    draw = ImageDraw.Draw(picture)
    for row, text in enumerate(rows):
        draw.text((0.7 * size, size * (0.45 + 1.4 * row)), text, (255, 255, 255), font)
    image[height - band :] = np.asarray(picture)[:, :, ::-1]


def pixels_of(points: Floats, intrinsics: Intrinsics) -> Floats:
    """(N, 3) points before the lens, in the camera's axes -> (N, 2) pixels."""
    return intrinsics.pixels(points * (1.0, -1.0, -1.0))


def line_width(image: Image) -> float:
    """Pixels of an ordinary line in an image of this size."""
    height, width = image.shape[:2]
    return max(1.0, WIDTH * float(max(height, width)) / 1000.0)


def _wrapped(text: str, font: Any, width: float) -> list[str]:
    rows = [""]
    for word in text.split():
        longer = f"{rows[-1]} {word}".strip()
        if rows[-1] and font.getlength(longer) > width:
            rows.append(word)
        else:
            rows[-1] = longer
    return rows


def _side(joint: str) -> Colour:
    return LEFT if joint.endswith("left") else RIGHT if joint.endswith("right") else MIDDLE


def _drawable(x: float, y: float) -> bool:
    """OpenCV counts in 32 bits, some of them for fractions of a pixel."""
    return bool(np.isfinite((x, y)).all()) and max(abs(x), abs(y)) < 1e6


def _fixed(x: float, y: float) -> tuple[int, int]:
    return round(x * (1 << _SHIFT)), round(y * (1 << _SHIFT))


def _pen(width: float) -> int:
    return max(1, round(width))
