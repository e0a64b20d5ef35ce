"""What makes a face: eyes that look somewhere, and lines drawn on the skin."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cast.puppet_glb import Paint, PuppetFile
from cast.surface import Floats, Surface, ball, spline, tube

EYE = Paint("eye", "#ffffff", 0.18)
PUPIL = Paint("pupil", "#16161c", 0.12)
SPARK = Paint("spark", "#ffffff", 0.2, glow=0.9)


def eye(
    puppet: PuppetFile,
    bone: str,
    centre: Floats,
    radius: float,
    gaze: Floats,
    iris: Paint,
    *,
    wide: tuple[float, float] = (43.0, 31.0),
    spark: tuple[float, float] = (10.0, 17.0),
) -> None:
    """An eyeball that looks along `gaze`, with a highlight.

    wide: degrees from the middle of the gaze to the rims of iris and pupil. spark: degrees by
    which the highlight is off the gaze, outwards and up.
    """
    white = ball(centre, radius, axis=gaze, rings=12, sides=18)
    white, dark = white.cut(white.params[:, 0] * 180.0 - wide[0])
    puppet.add(white, EYE, bone)
    ring, pupil = dark.cut(dark.params[:, 0] * 180.0 - wide[1])
    puppet.add(ring, iris, bone)
    puppet.add(pupil, PUPIL, bone)
    outwards = spark[0] * (1.0 if centre[0] > 0.0 else -1.0)
    glint = centre + 0.925676 * radius * towards(gaze, outwards, spark[1])
    puppet.add(ball(glint, 0.182432 * radius, rings=6, sides=10), SPARK, bone)


def towards(gaze: Floats, yaw: float, pitch: float) -> Floats:
    """`gaze` turned by degrees towards +X and upwards."""
    right = np.cross((0.0, 1.0, 0.0), gaze)
    right /= np.linalg.norm(right)
    up = np.cross(gaze, right)
    way = gaze + np.tan(np.radians(yaw)) * right + np.tan(np.radians(pitch)) * up
    return np.asarray(way / np.linalg.norm(way))


def stroke(
    points: ArrayLike,
    width: float,
    *,
    up: ArrayLike = (0.0, 0.0, 1.0),
    count: int = 12,
    sides: int = 6,
) -> Surface:
    """A line of the brush through `points` (N, 3), `width` thick in the middle, with soft ends."""
    path = spline(points, count)
    thick = 0.5 * width * np.sin(np.linspace(0.0, np.pi, count)) ** 0.35
    thick[[0, -1]] = 0.0
    return tube(path, thick, thick, up=up, sides=sides)
