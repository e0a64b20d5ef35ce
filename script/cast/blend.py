"""Soft bodies: limbs that melt into one skin, with the bones that each part of it follows.

A limb is a signed distance, negative inside; a body is their smooth union. Metres, +Y up.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from cast.puppet_glb import along, other_side
from cast.surface import Floats, Surface, Triangles, smoothstep, spline

_SOLE = 0.016  # metres over which feet round off at the floor


@dataclass(frozen=True, slots=True, eq=False)
class Limb:
    """A round body along a curve.

    path: (N, 3), radii: (N,), metres. stretch: factors along x, y and z, about the path's middle.
    bones, joints, soft: what its skin follows, as `puppet_glb.along` takes it, in metres of path.
    melt: metres over which it flows into the limbs before it, and shares their skin.
    """

    path: Floats
    radii: Floats
    bones: tuple[str, ...]
    joints: tuple[float, ...] = ()
    soft: float = 0.04
    melt: float = 0.04
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def mirrored(self) -> Limb:
        """The limb on the other side of x = 0, with the bones of that side."""
        other = tuple(map(other_side, self.bones))
        return replace(self, path=self.path * (-1.0, 1.0, 1.0), bones=other)

    def jointed(self, *origins: ArrayLike) -> Limb:
        """The limb with its joints where it is closest to these points (3,) along it."""
        places = np.array([np.asarray(origin, float) for origin in origins])
        return replace(self, joints=tuple(float(x) for x in self.nearest(places)[1]))

    def nearest(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """The nearest place of the limb. points: (P, 3)

        Returns signed metres to it (P,), metres along the path where it is (P,), and which way is
        outwards (P, 3). Where the limb is stretched the distance is right to first order.
        """
        middle = 0.5 * (self.path.min(axis=0) + self.path.max(axis=0))
        scale = np.asarray(self.stretch)
        place = middle + (points - middle) / scale
        begin, way = self.path[:-1], np.diff(self.path, axis=0)
        square = np.maximum((way**2).sum(axis=1), 1e-18)
        t = np.clip((place @ way.T - (begin * way).sum(axis=1)) / square, 0.0, 1.0)
        gap = place[:, None] - begin - t[..., None] * way
        length = np.sqrt((gap**2).sum(axis=2))
        depth = length - self.radii[:-1] - t * np.diff(self.radii)
        row, best = np.arange(len(points)), depth.argmin(axis=1)
        outwards = gap[row, best] / np.maximum(length[row, best], 1e-12)[:, None] / scale
        steep = np.maximum(np.sqrt((outwards**2).sum(axis=1)), 1.0 / scale.max())
        step = np.sqrt(square)
        passed = np.concatenate([[0.0], np.cumsum(step)[:-1]]) + t * step
        return depth[row, best] / steep, passed[row, best], outwards / steep[:, None]


def limb(
    points: ArrayLike,
    radii: Sequence[float],
    bones: str | Sequence[str],
    *,
    joints: Sequence[float] = (),
    soft: float = 0.04,
    melt: float = 0.04,
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0),
    count: int = 16,
) -> Limb:
    """A limb along a smooth curve through `points` (N, 3), N radii thick."""
    thick = np.column_stack([np.asarray(points, float), radii])
    smooth = spline(thick, count)
    names = (bones,) if isinstance(bones, str) else tuple(bones)
    return Limb(smooth[:, :3], smooth[:, 3], names, tuple(joints), soft, melt, stretch)


def lump(centre: ArrayLike, half: ArrayLike, bone: str, *, melt: float = 0.04) -> Limb:
    """An ellipsoid with half-axes along x, y and z (a number or three)."""
    radius = np.broadcast_to(np.asarray(half, float), 3)
    small = float(radius.min())
    path = np.repeat(np.asarray(centre, float)[None], 2, axis=0)
    x, y, z = (float(r / small) for r in radius)
    return Limb(path, np.full(2, small), (bone,), melt=melt, stretch=(x, y, z))


@dataclass(frozen=True, slots=True)
class Blend:
    """The smooth union of limbs, in order. floor: flat soles; nothing reaches below y = 0."""

    limbs: tuple[Limb, ...]
    floor: bool = False

    def distance(self, points: Floats) -> Floats:
        """Metres to the skin, negative inside. (P, 3) -> (P,)"""
        return self.field(points)[0]

    def field(self, points: Floats) -> tuple[Floats, Floats]:
        """Metres to the skin, negative inside (P,), and which way is outwards (P, 3)."""
        first, *others = self.limbs
        depth, _, outwards = first.nearest(points)
        for part in others:
            mine, _, way = part.nearest(points)
            depth, share = _melted(depth, mine, part.melt)
            outwards = share[:, None] * outwards + (1.0 - share)[:, None] * way
        if self.floor:
            depth, share = _melted(-depth, points[:, 1], _SOLE)
            depth = -depth
            outwards = share[:, None] * outwards + np.outer(1.0 - share, (0.0, -1.0, 0.0))
        return depth, outwards

    def skin(self, cell: float, *, rounds: int = 3) -> Surface:
        """The surface, in triangles about `cell` metres wide."""
        reach = [np.array(s.stretch) * s.radii.max() + 2 * cell for s in self.limbs]
        low = np.min([s.path.min(axis=0) - r for s, r in zip(self.limbs, reach, strict=True)], 0)
        high = np.max([s.path.max(axis=0) + r for s, r in zip(self.limbs, reach, strict=True)], 0)
        positions, triangles = surface_nets(self.distance, low, high, cell)
        for _ in range(rounds):
            positions = _relaxed(positions, triangles)
            for _ in range(2):
                depth, outwards = self.field(positions)
                positions = positions - depth[:, None] * outwards
        # Differences over a third of a cell: what is finer cannot be drawn.
        steps = cell / 3.0 * np.eye(3)
        rise = [self.distance(positions + s) - self.distance(positions - s) for s in steps]
        normals = np.stack(rise, axis=1)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return Surface(positions, normals, np.zeros((len(positions), 2)), triangles)

    def weights(self, surface: Surface) -> dict[str, Floats]:
        """What each vertex follows: the bones of the limbs whose skin it is, or is closest to."""
        near = [part.nearest(surface.positions) for part in self.limbs]
        closest = reduce(np.minimum, [depth for depth, _, _ in near])
        total: dict[str, Floats] = {}
        for part, (depth, passed, _) in zip(self.limbs, near, strict=True):
            own = smoothstep(1.0 - (depth - closest) / part.melt, 0.0, 1.0)
            for bone, share in along(passed, part.bones, part.joints, part.soft).items():
                total[bone] = total.get(bone, np.zeros(len(depth))) + own * share
        return total

    def seen_from(self, points: ArrayLike, direction: ArrayLike, lift: float = 0.0) -> Floats:
        """Where rays from `points` (P, 3) first meet the skin, `lift` metres before it. (P, 3)

        direction: (3,) or (P, 3). Rays that miss stay where they come closest.
        """
        place = np.array(points, float)
        way = np.broadcast_to(np.asarray(direction, float), place.shape)
        way = way / np.linalg.norm(way, axis=1, keepdims=True)
        best, nearest = place.copy(), np.full(len(place), np.inf)
        for _ in range(48):
            depth = self.distance(place) - lift
            closer = np.abs(depth) < nearest
            best[closer], nearest[closer] = place[closer], np.abs(depth)[closer]
            place = place + 0.8 * depth[:, None] * way
        return best


def surface_nets(
    distance: Callable[[Floats], Floats], low: Floats, high: Floats, cell: float
) -> tuple[Floats, Triangles]:
    """Triangles around the places where `distance` is negative: one vertex in each cell it crosses.

    low, high: (3,) a box around it; the grid lies evenly about x = 0, so that what is symmetric
    stays so. Returns positions (V, 3) and triangles (T, 3), closed, seen from outside.
    """
    half = int(np.ceil(max(abs(low[0]), abs(high[0])) / cell))
    x = cell * (np.arange(2 * half) - (half - 0.5))
    y, z = (low[a] + cell * np.arange(int(np.ceil((high[a] - low[a]) / cell)) + 1) for a in (1, 2))
    nodes = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    shape = nodes.shape[:3]
    flat = nodes.reshape(-1, 3)
    value = np.concatenate([distance(part) for part in np.array_split(flat, len(flat) // 4096 + 1)])
    value = value.reshape(shape)
    inside = value < 0.0

    cells = tuple(n - 1 for n in shape)
    total, count = np.zeros((*cells, 3)), np.zeros(cells)
    crossed = []
    for axis in range(3):
        near, far = _ends(axis, shape)
        change = inside[near] != inside[far]
        crossed.append(change)
        t = value[near] / np.where(change, value[near] - value[far], 1.0)
        point = nodes[near] + t[..., None] * (nodes[far] - nodes[near])
        # Each edge borders the four cells around it.
        others = [a for a in range(3) if a != axis]
        for one in (0, 1):
            for two in (0, 1):
                part = [slice(None)] * 3
                part[others[0]] = slice(one, one + cells[others[0]])
                part[others[1]] = slice(two, two + cells[others[1]])
                here = change[tuple(part)]
                total += np.where(here[..., None], point[tuple(part)], 0.0)
                count += here
    used = count > 0
    number = np.full(cells, -1, np.int64)
    number[used] = np.arange(used.sum())
    positions = total[used] / count[used][:, None]

    triangles = []
    for axis, change in enumerate(crossed):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        place = np.argwhere(change)
        leaving = inside[_ends(axis, shape)[0]][change]
        around = []
        for a, b in ((1, 1), (0, 1), (0, 0), (1, 0)):
            at = place.copy()
            at[:, one] -= a
            at[:, two] -= b
            around.append(number[tuple(at.T)])
        quads = np.stack(around, axis=1)
        quads[~leaving] = quads[~leaving][:, ::-1]
        triangles.append(_split(quads, positions))
    return positions, np.concatenate(triangles)


def _ends(axis: int, shape: Sequence[int]) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Where the edges along `axis` begin, and where they end."""
    near, far = [slice(None)] * len(shape), [slice(None)] * len(shape)
    near[axis], far[axis] = slice(0, -1), slice(1, None)
    return tuple(near), tuple(far)


def _split(quads: Triangles, positions: Floats) -> Triangles:
    """Quads (Q, 4) cut along their shorter diagonals, and along the first where they are equal."""
    a, b, c, d = (positions[quads[:, k]] for k in range(4))
    first = np.linalg.norm(a - c, axis=1) <= np.linalg.norm(b - d, axis=1) + 1e-7
    one = np.where(first[:, None], quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    two = np.where(first[:, None], quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    return np.concatenate([one, two])


def _relaxed(positions: Floats, triangles: Triangles) -> Floats:
    """Every vertex half way to the middle of its neighbours."""
    total, count = np.zeros_like(positions), np.zeros(len(positions))
    for a, b in ((0, 1), (1, 2), (2, 0)):
        np.add.at(total, triangles[:, a], positions[triangles[:, b]])
        np.add.at(count, triangles[:, a], 1.0)
    return 0.5 * positions + 0.5 * total / np.maximum(count, 1.0)[:, None]


def _melted(a: Floats, b: Floats, width: float) -> tuple[Floats, Floats]:
    """The smaller of two, rounded where they differ by less than `width`; and how much `a` counts.

    Smooth to the second derivative. (P,), (P,) -> (P,), (P,)
    """
    near = np.maximum(width - np.abs(a - b), 0.0) / width
    other = 0.5 * near**2
    return np.minimum(a, b) - near**3 * width / 6.0, np.where(a < b, 1.0 - other, other)
