"""Something to see for an armature that has no skin: rods for its bones, balls for its joints.

Every vertex follows one bone alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.mesh import Material, Mesh

_BONE: Final = Material("bone", (0.86, 0.78, 0.62, 1.0), roughness=0.55)
_JOINT: Final = Material("joint", (0.80, 0.30, 0.16, 1.0), roughness=0.45)

#: The outline of a rod: how far along, and how thick there, as a part of its thickest.
_OUTLINE: Final = np.array([(0.0, 0.45), (0.06, 0.8), (0.16, 1.0), (0.32, 0.9), (1.0, 0.38)])
#: A rod's thickness as a part of its length, and its least and most as parts of the armature.
_THICK: Final = 0.11
_THINNEST, _THICKEST = 0.009, 0.03
#: A ball is so much larger than the thickest rod that meets in it.
_BALL: Final = 0.82
#: Rods shorter than this part of the armature are not drawn.
_SHORTEST: Final = 2e-3
#: With more bones than this, each is drawn with fewer corners.
_MANY: Final = 400


def bone_meshes(armature: Armature) -> tuple[Mesh, ...]:
    """Meshes in the armature's frame at rest: rods to children and tips, balls at joints."""
    size = armature.size or 1.0
    sides = 12 if len(armature) <= _MANY else 5
    origins, tips = armature.rest[0], armature.rest_tips
    rods, balls = _Shape(), _Shape()
    widest = np.full(len(armature), _THINNEST * size)
    for bone, children in enumerate(armature.children):
        ends = [(origins[child], child) for child in children] or [(tips[bone], -1)]
        for end, child in ends:
            along = end - origins[bone]
            length = float(np.linalg.norm(along))
            if length < _SHORTEST * size:
                continue
            radius = float(np.clip(_THICK * length, _THINNEST * size, _THICKEST * size))
            widest[bone] = max(widest[bone], radius)
            if child >= 0:
                widest[child] = max(widest[child], 0.6 * radius)
            rods.add(*_rod(origins[bone], along, radius, sides), bone)
            if child < 0:
                rods.add(*_ball(end, 0.42 * radius, sides), bone)
    for bone, radius in enumerate(widest):
        balls.add(*_ball(origins[bone], _BALL * radius, sides), bone)
    return tuple(
        shape.mesh(material) for shape, material in ((rods, _BONE), (balls, _JOINT)) if shape.bones
    )


@dataclass(slots=True)
class _Shape:
    """Surfaces of one material, as they are put together."""

    points: list[Floats] = field(default_factory=list)
    normals: list[Floats] = field(default_factory=list)
    triangles: list[NDArray[np.int64]] = field(default_factory=list)
    bones: list[NDArray[np.int64]] = field(default_factory=list)
    count: int = 0

    def add(self, points: Floats, normals: Floats, triangles: NDArray[np.int64], bone: int) -> None:
        self.points.append(points)
        self.normals.append(normals)
        self.triangles.append(triangles + self.count)
        self.bones.append(np.full(len(points), bone))
        self.count += len(points)

    def mesh(self, material: Material) -> Mesh:
        bones = np.zeros((self.count, 4), np.uint16)
        bones[:, 0] = np.concatenate(self.bones)
        weights = np.zeros((self.count, 4), np.float32)
        weights[:, 0] = 1.0
        return Mesh(
            positions=np.concatenate(self.points).astype(np.float32),
            normals=np.concatenate(self.normals).astype(np.float32),
            uvs=np.zeros((self.count, 2), np.float32),
            bones=bones,
            weights=weights,
            triangles=np.concatenate(self.triangles).astype(np.uint32),
            material=material,
        )


def _rod(
    start: Floats, along: Floats, radius: float, sides: int
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """A turned rod, open where the balls sit: (V, 3) points, (V, 3) normals, (T, 3) triangles."""
    length = float(np.linalg.norm(along))
    heights, radii = _OUTLINE[:, 0] * length, _OUTLINE[:, 1] * radius
    slopes = np.gradient(radii, heights)
    return _turned(start, along / length, heights, radii, slopes, sides)


def _ball(centre: Floats, radius: float, sides: int) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """A ball: (V, 3) points, (V, 3) normals, (T, 3) triangles."""
    angles = np.linspace(0.04, np.pi - 0.04, max(5, sides // 2 + 1))
    heights, radii = -radius * np.cos(angles), radius * np.sin(angles)
    slopes = -heights / radii
    return _turned(centre, np.array([0.0, 1.0, 0.0]), heights, radii, slopes, sides)


def _turned(
    start: Floats, axis: Floats, heights: Floats, radii: Floats, slopes: Floats, sides: int
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """The surface of an outline turned about an axis.

    heights: (R,) along the unit `axis` from `start`; radii: (R,) there; slopes: (R,) their change
    with height.
    """
    square = np.eye(3)[int(np.argmin(np.abs(axis)))]
    u = np.cross(axis, square)
    u /= np.linalg.norm(u)
    angles = np.arange(sides) * (2.0 * np.pi / sides)
    out = np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * np.cross(axis, u)  # (S, 3)
    points = start + heights[:, None, None] * axis + radii[:, None, None] * out
    normals = out - slopes[:, None, None] * axis
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    ring, side = np.meshgrid(np.arange(len(heights) - 1), np.arange(sides), indexing="ij")
    corner, beside = ring * sides + side, ring * sides + (side + 1) % sides
    lower = np.stack([corner, beside, beside + sides], axis=-1)
    upper = np.stack([corner, beside + sides, corner + sides], axis=-1)
    triangles = np.concatenate([lower, upper]).reshape(-1, 3)
    return points.reshape(-1, 3), normals.reshape(-1, 3), triangles
