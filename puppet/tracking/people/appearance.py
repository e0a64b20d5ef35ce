"""What somebody wears, as a camera sees it: by it two performers are told apart."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.tracking.cameras.camera import Image
from puppet.tracking.people.blazepose import Landmarks

#: Torso, thighs, shins.
PARTS: Final = 3
#: Of the way across the torso and along a limb, where it is looked at.
_ACROSS: Final = np.linspace(0.15, 0.85, 6)
_ALONG: Final = np.linspace(0.1, 0.9, 9)[:, None]
#: A part of which fewer points are in the image is not seen, ...
LEAST_POINTS: Final = 6
#: ... nor one whose ends are hidden.
LEAST_VISIBILITY: Final = 0.3
#: Light and shadow change lightness more than hue: it counts for less.
_WEIGHTS: Final = np.array([0.5, 1.0, 1.0])


def torso_points(pixels: Floats) -> Floats:
    """(33, 2) landmarks -> (36, 2) points spread over the torso."""
    u, v = (part.reshape(-1, 1) for part in np.meshgrid(_ACROSS, _ACROSS))
    top = (1.0 - u) * pixels[11] + u * pixels[12]
    bottom = (1.0 - u) * pixels[23] + u * pixels[24]
    return np.asarray((1.0 - v) * top + v * bottom)


def colours(image: Image, landmarks: Landmarks) -> Floats:
    """(3, 3): the median colour of torso, thighs and shins, CIE L*a*b*; NaN for what is not seen.

    The median passes over arms before the body, belts and stripes.
    """
    pixels, visibility = landmarks.pixels, landmarks.visibility
    places = (
        (torso_points(pixels), (11, 12, 23, 24)),
        (np.vstack([_line(pixels, 23, 25), _line(pixels, 24, 26)]), (23, 24, 25, 26)),
        (np.vstack([_line(pixels, 25, 27), _line(pixels, 26, 28)]), (25, 26, 27, 28)),
    )
    found = np.full((PARTS, 3), np.nan)
    for part, (points, ends) in enumerate(places):
        at = inside(points, *image.shape[:2])
        if len(at) < LEAST_POINTS or visibility[list(ends)].mean() < LEAST_VISIBILITY:
            continue
        patch = image[at[:, 1], at[:, 0]].astype(np.float32) / np.float32(255.0)
        lab = cv2.cvtColor(patch[None], cv2.COLOR_BGR2LAB)
        found[part] = np.median(lab[0], axis=0)
    return found


def difference(one: Floats, other: Floats) -> float:
    """How unlike two appearances are, CIE76 ΔE on average over the parts that both show; the same
    clothes have under 8 as a rule, different ones over 20. NaN if nothing can be compared."""
    steps = np.linalg.norm((one - other) * _WEIGHTS, axis=-1).reshape(-1)
    seen = steps[np.isfinite(steps)]
    return float(np.sqrt(np.mean(seen**2))) if len(seen) else float("nan")


def light(image: Image) -> Floats:
    """(3,): the mean colour of the image, CIE L*a*b*, of a pixel in some hundred."""
    every = max(1, min(image.shape[:2]) // 40)
    some = np.ascontiguousarray(image[::every, ::every]).astype(np.float32) / np.float32(255.0)
    return np.asarray(cv2.cvtColor(some, cv2.COLOR_BGR2LAB).mean(axis=(0, 1)), float)


def inside(points: Floats, height: int, width: int) -> NDArray[np.intp]:
    """(N, 2) pixels -> (M, 2), rounded, those that are in the image."""
    at = np.rint(np.clip(np.nan_to_num(points, nan=-1.0), -1.0, 1e6)).astype(np.intp)
    return at[((at >= 0) & (at < (width, height))).all(axis=1)]


def _line(pixels: Floats, start: int, end: int) -> Floats:
    return np.asarray(pixels[start] + (pixels[end] - pixels[start]) * _ALONG)
