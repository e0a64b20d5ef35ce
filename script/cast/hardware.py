"""Parts of machines: rods, plates and springs. Metres."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from cast.surface import Floats, Surface, grid, merged, smoothstep, tube, turned


def rod(start: ArrayLike, end: ArrayLike, radius: float, *, sides: int = 8) -> Surface:
    """A straight rod with softly rounded ends."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    axis = (b - a) / np.linalg.norm(b - a)
    length = float(np.linalg.norm(b - a))
    soft = min(0.35 * radius, 0.2 * length)
    return turned(
        [
            (0.0, 0.0),
            (radius - soft, 0.0),
            (radius, soft),
            (radius, length - soft),
            (radius - soft, length),
            (0.0, length),
        ],
        origin=a,
        axis=axis,
        sides=sides,
    )


def plate(outline: ArrayLike, thickness: float, *, bevel: float = 0.003) -> Surface:
    """A flat plate with bevelled edges around z = 0. outline: (N, 2) anticlockwise, star-shaped."""
    flat = np.asarray(outline, float)
    middle = flat.mean(axis=0)
    inset = (
        middle + (flat - middle) * (1.0 - bevel / np.linalg.norm(flat - middle, axis=1))[:, None]
    )
    half = 0.5 * thickness

    def ring(points: Floats, z: float) -> Floats:
        return np.column_stack([points, np.full(len(points), z)])

    centre = np.broadcast_to(middle, flat.shape)
    rings = [ring(centre, -half), ring(inset, -half), ring(flat, bevel - half)]
    rings += [ring(flat, half - bevel), ring(inset, half), ring(centre, half)]
    return merged([grid(np.stack(pair), around=True) for pair in pairwise(rings)])


def stadium(a: ArrayLike, b: ArrayLike, at_a: float, at_b: float, count: int = 7) -> Floats:
    """The outline around two circles, in the plane: radius `at_a` around `a`, and `at_b` around b.

    (2,), (2,) -> (2 * count, 2), anticlockwise.
    """
    start, end = np.asarray(a, float), np.asarray(b, float)
    way = float(np.arctan2(*(end - start)[::-1]))
    lean = float(np.arcsin((at_a - at_b) / np.linalg.norm(end - start)))
    front = np.linspace(way - np.pi / 2 + lean, way + np.pi / 2 - lean, count)
    rear = np.linspace(way + np.pi / 2 - lean, way + 1.5 * np.pi + lean, count)
    return np.concatenate(
        [
            end + at_b * np.stack([np.cos(front), np.sin(front)], axis=1),
            start + at_a * np.stack([np.cos(rear), np.sin(rear)], axis=1),
        ]
    )


def spring(
    start: ArrayLike, end: ArrayLike, radius: float, wire: float, turns: int, *, per_turn: int = 7
) -> Surface:
    """A coil of wire from `start` to `end`, with its ends bent to the axis."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    axis = (b - a) / np.linalg.norm(b - a)
    x = np.cross(axis, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    z = np.cross(x, axis)
    t = np.linspace(0.0, 1.0, turns * per_turn + 1)
    angle = 2.0 * np.pi * turns * t
    swell = radius * np.sqrt(smoothstep(np.minimum(t, 1.0 - t), 0.0, 0.8 / turns))
    coil = a + t[:, None] * (b - a)
    coil = coil + swell[:, None] * (np.outer(np.cos(angle), x) + np.outer(np.sin(angle), z))
    thick = np.full(len(t), wire)
    thick[[0, -1]] = 0.0
    return tube(coil, thick, thick, up=axis, sides=3)
