"""Building smooth surfaces: splines, lofted tubes, turned shapes, thin sheets, and cutting them.

Metres, +Y up. Every surface is closed or meant to be seen from one side, and winds so that its
triangles face outwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

Floats = NDArray[np.float64]
Triangles = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A triangle mesh.

    positions, normals: (V, 3). params: (V, 2) where each vertex is on the surface, in the terms of
    whatever built it (along and around for a tube, root to edge and across for a sheet), so that
    colours and weights can be told by it. triangles: (T, 3).
    """

    positions: Floats
    normals: Floats
    params: Floats
    triangles: Triangles

    def moved(self, offset: ArrayLike) -> Surface:
        """The surface somewhere else. offset: (3,)"""
        return replace(self, positions=self.positions + np.asarray(offset, float))

    def mirrored(self) -> Surface:
        """The surface on the other side of the plane x = 0."""
        flip = np.array([-1.0, 1.0, 1.0])
        return Surface(
            self.positions * flip, self.normals * flip, self.params, self.triangles[:, ::-1]
        )

    def cut(self, values: ArrayLike) -> tuple[Surface, Surface]:
        """Cut along ``values == 0``, linear in each triangle. values: (V,)

        Returns the part where the values are positive, and the rest. Both keep the normals, so the
        cut is a change of colour and not an edge.
        """
        value = np.asarray(values, float)
        return _clipped(self, value), _clipped(self, -value)


def merged(surfaces: Sequence[Surface]) -> Surface:
    """Several surfaces as one; their normals stay apart."""
    first = np.cumsum([0, *(len(surface.positions) for surface in surfaces[:-1])])
    return Surface(
        np.concatenate([surface.positions for surface in surfaces]),
        np.concatenate([surface.normals for surface in surfaces]),
        np.concatenate([surface.params for surface in surfaces]),
        np.concatenate([s.triangles + start for s, start in zip(surfaces, first, strict=True)]),
    )


def spline(points: ArrayLike, count: int, *, closed: bool = False) -> Floats:
    """`count` points along a smooth curve through `points`, evenly spaced. (N, D) -> (count, D)"""
    p = np.asarray(points, float)
    if closed:
        p = np.vstack([p, p[:1]])
    knots = np.concatenate([[0.0], np.cumsum(np.sqrt(np.linalg.norm(np.diff(p, axis=0), axis=1)))])
    curve = CubicSpline(knots, p, bc_type="periodic" if closed else "natural")
    fine = curve(np.linspace(0.0, knots[-1], 64 * len(p)))
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
    even = np.linspace(0.0, length[-1], count + 1 if closed else count)[:count]
    return np.stack([np.interp(even, length, column) for column in fine.T], axis=1)


def smoothstep(x: ArrayLike, low: float, high: float) -> Floats:
    """0 below `low`, 1 above `high`, and smooth between."""
    t = np.clip((np.asarray(x, float) - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def grid(points: ArrayLike, *, around: bool = False, params: ArrayLike | None = None) -> Surface:
    """A surface through (U, V, 3) points; `around` closes it along V.

    Seen from outside, V runs anticlockwise around the direction of U. Rows that shrink to a point
    become poles. Without `params` they run from 0 to 1 along U and along V.
    """
    p = np.asarray(points, float)
    rows, columns = p.shape[:2]
    if params is None:
        u = np.linspace(0.0, 1.0, rows)
        v = np.linspace(0.0, 1.0, columns + (1 if around else 0))[:columns]
        params = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1)
    index = np.arange(rows * columns).reshape(rows, columns)
    if around:
        index = np.concatenate([index, index[:, :1]], axis=1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.concatenate(
        [np.stack([a, d, b], axis=-1).reshape(-1, 3), np.stack([b, d, c], axis=-1).reshape(-1, 3)]
    )
    return _smooth(p.reshape(-1, 3), np.asarray(params, float).reshape(-1, 2), triangles)


def tube(
    spine: ArrayLike,
    across: ArrayLike,
    upward: ArrayLike,
    *,
    up: ArrayLike = (0.0, 1.0, 0.0),
    sides: int = 24,
    roundness: float = 2.0,
) -> Surface:
    """A loft of ellipses along `spine` (U, 3).

    across, upward: (U,) or a number, the half-axes square to `up` and along it. roundness: 2 for
    ellipses, more for boxier sections. End rows with half-axes of 0 close it.
    """
    p = np.asarray(spine, float)
    along = np.gradient(p, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    right = np.cross(np.broadcast_to(np.asarray(up, float), p.shape), along)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    over = np.cross(along, right)
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    c, s = np.cos(angle), np.sin(angle)
    power = 2.0 / roundness
    c, s = np.sign(c) * np.abs(c) ** power, np.sign(s) * np.abs(s) ** power
    a = np.broadcast_to(np.asarray(across, float), len(p))[:, None, None]
    b = np.broadcast_to(np.asarray(upward, float), len(p))[:, None, None]
    rings = (
        p[:, None] + a * c[None, :, None] * right[:, None] + b * s[None, :, None] * over[:, None]
    )
    return grid(rings, around=True)


def turned(
    profile: Sequence[tuple[float, float]],
    *,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    axis: ArrayLike = (0.0, 1.0, 0.0),
    sides: int = 32,
    crease: float = 35.0,
) -> Surface:
    """A shape from the lathe: (radius, height) pairs turned around `axis` from `origin`.

    The profile runs so that the outside is on its right (upwards along the outside of a vase).
    Bends of more than `crease` degrees stay sharp edges.
    """
    p = np.asarray(profile, float)
    y = np.asarray(axis, float) / np.linalg.norm(np.asarray(axis, float))
    x = np.cross(y, (0.0, 0.0, 1.0) if abs(y[2]) < 0.9 else (1.0, 0.0, 0.0))
    x /= np.linalg.norm(x)
    z = np.cross(x, y)
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = np.cos(angle)[:, None] * z + np.sin(angle)[:, None] * x
    points = np.asarray(origin, float) + p[:, 0, None, None] * ring + p[:, 1, None, None] * y
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    v = np.linspace(0.0, 1.0, sides, endpoint=False)
    params = np.stack(np.meshgrid(length / length[-1], v, indexing="ij"), axis=-1)
    steps = np.diff(p, axis=0)
    heading = np.degrees(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    corners = [i + 1 for i, bend in enumerate(np.abs(np.diff(heading))) if bend > crease]
    bounds = [0, *corners, len(p) - 1]
    return merged(
        [
            grid(points[a : b + 1], around=True, params=params[a : b + 1])
            for a, b in pairwise(bounds)
        ]
    )


def ball(
    centre: ArrayLike,
    radius: float | ArrayLike,
    *,
    axis: ArrayLike = (0.0, 1.0, 0.0),
    rings: int = 14,
    sides: int = 22,
) -> Surface:
    """A sphere, or an ellipsoid with three half-axes along x, y and z.

    Its first parameter is the angle from the pole at `axis`, 0 there and 1 at the other end.
    """
    angle = np.linspace(np.pi, 0.0, rings)
    shape = turned(
        [(float(np.sin(a)), float(np.cos(a))) for a in angle],
        axis=axis,
        sides=sides,
        crease=180.0,
    )
    size = np.broadcast_to(np.asarray(radius, float), 3)
    normals = shape.positions / size
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    polar = np.arccos(
        np.clip(shape.positions @ (np.asarray(axis, float) / np.linalg.norm(axis)), -1.0, 1.0)
    )
    params = np.stack([polar / np.pi, shape.params[:, 1]], axis=1)
    return Surface(
        shape.positions * size + np.asarray(centre, float), normals, params, shape.triangles
    )


def sheet(points: ArrayLike, thickness: ArrayLike, *, rim: float = 0.012) -> Surface:
    """A thin body around a middle surface (U, V, 3), such as a fin or a wing, with a round rim.

    thickness: metres from face to face, a number or (U, V). rim: metres over which it is rounded
    off along all four borders. Its parameters are those of the grid, 0 to 1.
    """
    p = np.asarray(points, float)
    rows, columns = p.shape[:2]
    normal = np.cross(np.gradient(p, axis=1), np.gradient(p, axis=0))
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    normal = np.where(length > 1e-12, normal / np.maximum(length, 1e-12), 0.0)
    border = np.concatenate([p[0], p[-1], p[:, 0], p[:, -1]])
    distance = np.linalg.norm(p.reshape(-1, 1, 3) - border, axis=2).min(axis=1)
    inside = np.clip(distance.reshape(rows, columns) / rim, 0.0, 1.0)
    half = 0.5 * np.broadcast_to(np.asarray(thickness, float), (rows, columns))
    half = half * np.sqrt(1.0 - (1.0 - inside) ** 2)
    front = grid(p + half[..., None] * normal)
    back = grid(p - half[..., None] * normal)
    both = merged([front, replace(back, triangles=back.triangles[:, ::-1])])
    return _smooth(both.positions, both.params, both.triangles)


def spot(surface: Surface, centre: ArrayLike, half: ArrayLike) -> Floats:
    """Where each vertex is in an ellipsoid: -1 in its centre, 0 on its rim, more outside. -> (V,)

    half: metres, its half-axes along x, y and z.
    """
    offset = (surface.positions - np.asarray(centre, float)) / np.asarray(half, float)
    return np.asarray(np.sqrt((offset**2).sum(axis=1)) - 1.0)


def edge_distance(surface: Surface, outline: ArrayLike) -> Floats:
    """Metres from each vertex to the nearest of the points of `outline` (N, 3). -> (V,)"""
    gaps = surface.positions[:, None] - np.asarray(outline, float)
    return np.asarray(np.linalg.norm(gaps, axis=2).min(axis=1))


def _smooth(positions: Floats, params: Floats, triangles: Triangles) -> Surface:
    """Normals from the faces around each place, by area; vertices at one place share theirs."""
    corners = positions[triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(faces, axis=1)
    kept = area > 1e-12
    triangles, faces = triangles[kept], faces[kept]
    _, place = np.unique(np.round(positions, 7), axis=0, return_inverse=True)
    place = place.reshape(-1)
    sums = np.zeros((len(positions), 3))
    for corner in range(3):
        np.add.at(sums, place[triangles[:, corner]], faces)
    sums = sums[place]
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    normals = np.where(length > 1e-15, sums / np.maximum(length, 1e-15), (0.0, 1.0, 0.0))
    return Surface(positions, normals, params, triangles)


def _clipped(surface: Surface, value: Floats) -> Surface:
    """The part of the surface where `value` is positive."""
    above = value > 0.0
    count = above[surface.triangles].sum(axis=1)
    triangles = [surface.triangles[count == 3]]
    columns = [surface.positions, surface.normals, surface.params]
    data = np.concatenate(columns, axis=1)
    extra: list[Floats] = []
    crossings: dict[tuple[int, int], int] = {}

    def crossing(a: int, b: int) -> int:
        key = (a, b) if a < b else (b, a)
        if key not in crossings:
            low, high = key
            t = value[low] / (value[low] - value[high])
            crossings[key] = len(data) + len(extra)
            extra.append(data[low] + t * (data[high] - data[low]))
        return crossings[key]

    pieces: list[tuple[int, int, int]] = []
    for triangle, inside in zip(surface.triangles, count, strict=True):
        if inside in (0, 3):
            continue
        lonely = int(np.flatnonzero(above[triangle] == (inside == 1))[0])
        a, b, c = (int(triangle[(lonely + k) % 3]) for k in range(3))
        ab, ca = crossing(a, b), crossing(a, c)
        if inside == 1:
            pieces.append((a, ab, ca))
        else:
            pieces += [(ab, b, c), (ab, c, ca)]
    triangles.append(np.array(pieces, np.int64).reshape(-1, 3))
    data = np.concatenate([data, np.array(extra).reshape(-1, data.shape[1])])
    used, renumbered = np.unique(np.concatenate(triangles), return_inverse=True)
    data = data[used]
    normals: NDArray[Any] = data[:, 3:6]
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Surface(data[:, :3], normals, data[:, 6:8], renumbered.reshape(-1, 3))
