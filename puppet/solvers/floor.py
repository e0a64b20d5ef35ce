"""A finisher for puppets that stand on the floor: nothing of them is ever below it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from puppet.armature import Armature
from puppet.kernel import Floats, Ints, frozen, kernel
from puppet.mesh import Model
from puppet.pose import Pose, place_bones
from puppet.rotation import conjugate, rotate


@dataclass(frozen=True, slots=True, eq=False)
class FloorPoints:
    """Points of a puppet that may touch the floor.

    bones: (N,) the bone that each moves with. positions: (N, 3) metres, in that bone's frame.
    """

    bones: Ints
    positions: Floats


def floor_points(model: Model, per_bone: int = 16) -> FloorPoints:
    """The outermost points of each bone's skin, in `per_bone` directions.

    A vertex belongs to the bone that moves it most. Without a skin a bone's ends are its points.
    """
    armature = model.armature
    origins, frames = armature.rest
    homes = [conjugate(frame) for frame in frames]
    if not any(len(mesh.positions) for mesh in model.meshes):
        ends = np.stack([np.zeros_like(armature.tips), armature.tips], axis=1).reshape(-1, 3)
        return FloorPoints(frozen(np.repeat(np.arange(len(armature)), 2), np.int32), frozen(ends))
    skin = np.concatenate([np.asarray(mesh.positions, float) for mesh in model.meshes])
    owner = np.concatenate(
        [
            np.take_along_axis(mesh.bones, mesh.weights.argmax(axis=1)[:, None], axis=1)[:, 0]
            for mesh in model.meshes
        ]
    )
    directions = _directions(per_bone)
    bones: list[int] = []
    positions: list[Floats] = []
    for bone in np.unique(owner):
        its = skin[owner == bone]
        outermost = its[np.unique((its @ directions.T).argmax(axis=0))]
        bones += [int(bone)] * len(outermost)
        positions += [rotate(homes[bone], point - origins[bone]) for point in outermost]
    return FloorPoints(frozen(bones, np.int32), frozen(np.reshape(positions, (-1, 3))))


def _directions(count: int) -> Floats:
    """(count, 3) unit vectors, spread evenly over the sphere in a spiral; the first points down."""
    height = np.linspace(-1.0, 1.0, count) if count > 1 else np.array([-1.0])
    around = np.arange(count) * math.pi * (3.0 - math.sqrt(5.0))
    radius = np.sqrt(np.maximum(1.0 - height**2, 0.0))
    return np.stack([radius * np.cos(around), height, radius * np.sin(around)], axis=1)


@kernel
def _lowest(
    parents: Ints,
    offsets: Floats,
    point_bones: Ints,
    points: Floats,
    translation: Floats,
    rotation: Floats,
    bones: Floats,
) -> float:
    """The least height of all points in the world, metres; inf if there are none."""
    origins, frames = np.empty((len(parents), 3)), np.empty((len(parents), 4))
    place_bones(parents, offsets, translation, rotation, bones, origins, frames)
    lowest = np.inf
    for i in range(len(points)):
        bone = point_bones[i]
        x, y, z, w = frames[bone, 0], frames[bone, 1], frames[bone, 2], frames[bone, 3]
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        # The middle row of the rotation's matrix is all that a height needs.
        height = origins[bone, 1] + 2.0 * (x * y + w * z) * px
        height += (1.0 - 2.0 * (x * x + z * z)) * py + 2.0 * (y * z - w * x) * pz
        lowest = min(lowest, height)
    return lowest


class Floor:
    """A finisher: raises a puppet as far as its lowest point is below the floor, y = 0.

    It never lowers one, so that a puppet can jump. It has no memory, and the lift follows the pose
    without a jump, because the lowest point's height does.
    """

    def __init__(self, armature: Armature, points: FloorPoints) -> None:
        self._parents, self._offsets = armature.parents, armature.offsets
        self._points = points

    def __call__(self, pose: Pose) -> Pose:
        """The pose, raised if it has to be; one that is above the floor passes as it is."""
        lowest = _lowest(
            self._parents,
            self._offsets,
            self._points.bones,
            self._points.positions,
            np.array(pose.translation, float),
            np.array(pose.rotation, float),
            np.array(pose.bones, float, order="C"),
        )
        if not lowest < 0.0:
            return pose
        return Pose(pose.translation - np.array([0.0, lowest, 0.0]), pose.rotation, pose.bones)
