"""The floor in a depth image: the lowest large plane that lies about level (RANSAC, least squares).

A plane is linear in the image if one looks at the inverse of depth, and so is the noise of stereo
cameras even: that is what is fitted. Walls are not level, and a table has something below it. The
same image gives the same plane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.tracking.cameras.camera import Depth
from puppet.tracking.cameras.intrinsics import Intrinsics

#: Metres that depth is believed in.
NEAREST, FARTHEST = 0.3, 10.0
#: About so many points of an image are looked at, and so many planes are tried.
POINTS: Final = 4000
TRIES: Final = 300
#: The corners of a try are so near to each other, as a share of the image.
NEIGHBOURS: Final = 0.25
#: The inverse of depth may be off by so many times its noise; at least, and at most, by so many
#: 1/m. 0.01 is 1 cm at a metre and 9 cm at three.
DEVIATIONS: Final = 2.5
TOLERANCES: Final = (0.002, 0.015)
#: A level plane has at least this share of the points, and so many square metres; and at most so
#: many points below it for each of its own.
LEAST_SHARE: Final = 0.03
LEAST_AREA: Final = 0.3
MOST_BELOW: Final = 0.5
#: So many planes are told apart; level ones are parallel within so many radians.
PLANES: Final = 4
PARALLEL: Final = math.radians(12.0)
#: Metres between a lens and the floor below it.
HEIGHTS: Final = (0.15, 8.0)
#: Square metres of floor that are enough to be sure.
ENOUGH: Final = 1.5
#: Metres up and down within which points count as on the floor, for each metre that is seen of it,
#: that are little enough to be sure.
SURE: Final = 0.045
#: Radians between up and the floor's normal: for an up that was measured, for one that was learnt
#: from people, and for the camera's own, which is a guess.
MEASURED_WITHIN: Final = math.radians(12.0)
LEARNT_WITHIN: Final = math.radians(25.0)
GUESSED_WITHIN: Final = math.radians(60.0)


@dataclass(frozen=True, slots=True, eq=False)
class FloorPlane:
    """The plane ``normal · p + height = 0`` in the camera's axes (x right, y up, z to the camera).

    normal: (3,) unit vector, up. height: metres from the floor up to the lens. share: of the known
    points, how many lie on it. area: square metres that are seen of it. spread: 1/m, how far the
    inverse depths of its points are from it (RMS). confidence: 0..1.
    """

    normal: Floats
    height: float
    share: float
    area: float
    spread: float
    confidence: float


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """A grid over the image: rays (h, w, 3) in the camera's axes, 1 m away along the lens's axis;
    inverse depths (h, w), 1/m, and where they are known (h, w). pixel: square metres that a pixel
    of the grid covers 1 m away. tolerance: 1/m, what the noise of inverse depths allows."""

    rays: Floats
    inverse: Floats
    known: NDArray[np.bool_]
    pixel: float
    tolerance: float


def find_floor(
    depth: Depth, lens: Intrinsics, up: Floats | None = None, within: float | None = None
) -> FloorPlane | None:
    """The floor, or None where nothing large lies about level.

    depth: (h, w) millimetres. lens: of this very image. up: (3,) about up, in the camera's axes,
    any length; the camera's own if it is None. within: radians between up and the floor's normal;
    None is as wide as fits a measured up, or a guessed one.
    """
    if within is None:
        within = GUESSED_WITHIN if up is None else MEASURED_WITHIN
    points = _points(depth, lens)
    prior = np.array([0.0, 1.0, 0.0]) if up is None else up / np.linalg.norm(up)
    planes = _level_planes(points, prior, math.cos(within))
    if not planes:
        return None
    largest = max(planes, key=lambda plane: plane.share)
    level = [plane for plane in planes if plane.normal @ largest.normal > math.cos(PARALLEL)]
    return max(level, key=lambda plane: plane.height)


def _points(depth: Depth, lens: Intrinsics) -> _Points:
    step = max(1, math.ceil(math.sqrt(depth.size / POINTS)))
    rows = np.arange(step // 2, depth.shape[0], step)
    columns = np.arange(step // 2, depth.shape[1], step)
    away = depth[np.ix_(rows, columns)] / 1000.0
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2).astype(float)
    rays = np.column_stack([lens.rays(pixels), np.ones(len(pixels))]) * (1.0, -1.0, -1.0)
    known = (away > NEAREST) & (away < FARTHEST)
    inverse = 1.0 / np.where(known, away, 1.0)
    pixel = step * step / (lens.focal_x * lens.focal_y)
    return _Points(rays.reshape(*away.shape, 3), inverse, known, pixel, _tolerance(inverse, known))


def _tolerance(inverse: Floats, known: NDArray[np.bool_]) -> float:
    """From how far points are off the line between their neighbours: of a plane, only by noise."""
    whole = known[:, :-2] & known[:, 1:-1] & known[:, 2:]
    bends = (inverse[:, :-2] - 2.0 * inverse[:, 1:-1] + inverse[:, 2:])[whole]
    noise = 1.4826 * float(np.median(np.abs(bends))) / math.sqrt(6.0) if len(bends) else 0.0
    return min(max(DEVIATIONS * noise, TOLERANCES[0]), TOLERANCES[1])


def _level_planes(points: _Points, prior: Floats, cosine: float) -> list[FloorPlane]:
    """Planes about square to `prior`, each without the points of those before it.

    A plane is (3,) here: minus its normal by its height. Its product with a ray is the inverse
    depth at which the ray meets it.
    """
    random, tolerance = np.random.default_rng(0), points.tolerance
    tries = _level(_tries(points, random), prior, cosine)[:TRIES]
    rays, inverse = points.rays[points.known], points.inverse[points.known]
    free = np.ones(len(rays), bool)
    off = np.abs(tries @ rays.T - inverse)
    found: list[FloorPlane] = []
    for _ in range(PLANES if len(tries) else 0):
        counts = ((off < tolerance) & free).sum(axis=1)
        plane = tries[int(counts.argmax())]
        if counts.max() < LEAST_SHARE * len(rays):
            break
        for _ in range(4):
            on = free & (np.abs(rays @ plane - inverse) < tolerance)
            plane = np.linalg.lstsq(rays[on], inverse[on], rcond=None)[0]
        apart = inverse - rays @ plane
        on = free & (np.abs(apart) < tolerance)
        below = float((apart < -3.0 * tolerance).sum()) / max(int(on.sum()), 1)
        free &= np.abs(apart) > 3.0 * tolerance
        lies_level = len(_level(plane[None], prior, cosine)) > 0
        if not lies_level or on.sum() < 10 or below > MOST_BELOW:
            continue
        measured = _measured(plane, rays[on], apart[on], points, below)
        if measured.share > LEAST_SHARE and measured.area > LEAST_AREA:
            found.append(measured)
    return found


def _tries(points: _Points, random: np.random.Generator) -> Floats:
    """Planes (N, 3) through three points of the image that are near to each other."""
    known = np.argwhere(points.known)
    if len(known) < 100:
        return np.empty((0, 3))
    shape = np.array(points.known.shape)
    first = known[random.integers(len(known), size=6 * TRIES)]
    reach = np.maximum(1, (NEIGHBOURS * shape).astype(int))
    others = first[:, None] + random.integers(-reach, reach + 1, size=(len(first), 2, 2))
    corners = np.concatenate([first[:, None], np.clip(others, 0, shape - 1)], axis=1)
    rows, columns = corners[..., 0], corners[..., 1]
    rays = points.rays[rows, columns]
    good = points.known[rows, columns].all(axis=1) & (np.abs(np.linalg.det(rays)) > 1e-4)
    inverse = points.inverse[rows, columns][good]
    return np.asarray(np.linalg.solve(rays[good], inverse[..., None])[..., 0])


def _level(planes: Floats, prior: Floats, cosine: float) -> Floats:
    """Those of planes (N, 3) that face up, and lie where a floor can be."""
    lengths = np.maximum(np.linalg.norm(planes, axis=1), 1e-12)
    upright = -(planes @ prior) > cosine * lengths
    there = (1.0 / lengths > HEIGHTS[0]) & (1.0 / lengths < HEIGHTS[1])
    return np.asarray(planes[upright & there])


def _measured(
    plane: Floats, rays: Floats, apart: Floats, points: _Points, below: float
) -> FloorPlane:
    """What a plane (3,) is worth, by its own points: rays (N, 3), and 1/m by which they are off."""
    length = float(np.linalg.norm(plane))
    normal, height = -plane / length, 1.0 / length
    # A pixel covers the more the farther away and the slanter the plane is.
    slant = np.maximum(-(rays @ normal), 0.05)
    area = float((points.pixel * height * height / slant**3).sum())
    spread = float(np.sqrt(np.mean(apart * apart))) if len(apart) else 0.0
    # Where two planes meet, a third can lie across: then its points are spread over all of the
    # tolerance instead of about the middle of it.
    across = (1.0 / math.sqrt(3.0) - spread / points.tolerance) / (1.0 / math.sqrt(3.0) - 0.45)
    # How far up and down a point of it can be and still counts as on it, and how far it goes.
    unsure = points.tolerance * height * height / max(float(np.median(slant)), 0.05)
    places = rays * (height / slant)[:, None]
    extents = np.sqrt(12.0 * np.maximum(np.linalg.eigvalsh(np.cov(places.T)), 1e-6))
    confidence = (
        min(1.0, area / ENOUGH)
        * (1.0 - below / MOST_BELOW)
        * min(max(across, 0.0), 1.0)
        * min(1.0, SURE * float(extents[1]) / unsure)
    )
    share = len(rays) / max(int(points.known.sum()), 1)
    return FloorPlane(normal, height, share, area, spread, confidence)
