"""Poses, what a mapping asks for, and forward kinematics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from puppet.armature import Armature
from puppet.kernel import Floats, Ints, kernel
from puppet.rotation import IDENTITY
from puppet.skeleton import SkeletonFrame


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """An armature at one instant.

    translation: (3,) metres, world_from_armature.
    rotation: (4,) xyzw, world_from_armature.
    bones: (B, 4) xyzw, parent_from_bone.
    """

    translation: Floats
    rotation: Floats
    bones: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Goal:
    """Where a bone should go: a wish, which may be out of reach.

    position: (3,) metres, armature frame. rotation: (4,) armature_from_bone, or None for any.
    weight: how much it counts against other goals. why: what asked for it, for people.
    """

    bone: int
    position: Floats
    rotation: Floats | None = None
    weight: float = 1.0
    why: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Intent:
    """What a mapping asks of an armature: a base pose, and goals for a solver to reach from it."""

    base: Pose
    goals: tuple[Goal, ...] = ()


#: A builder of any kind (by graph, by name, by context) returns one of these.
Mapping = Callable[[SkeletonFrame], Intent]


def rest_pose(armature: Armature) -> Pose:
    """The armature as modelled, at the origin of the world."""
    return Pose(np.zeros(3), IDENTITY.copy(), armature.rotations.copy())


@kernel
def place_bones(
    parents: Ints,
    offsets: Floats,
    translation: Floats,
    rotation: Floats,
    bones: Floats,
    positions: Floats,
    rotations: Floats,
) -> None:
    """`forward_kinematics` as a kernel: fills (B, 3) positions and (B, 4) rotations."""
    # Written out in scalars: a small array for each product would cost more than the product.
    for bone in range(len(parents)):
        parent = parents[bone]
        if parent < 0:
            x, y, z, w = rotation[0], rotation[1], rotation[2], rotation[3]
            px, py, pz = translation[0], translation[1], translation[2]
        else:
            x, y, z, w = (
                rotations[parent, 0],
                rotations[parent, 1],
                rotations[parent, 2],
                rotations[parent, 3],
            )
            px, py, pz = positions[parent, 0], positions[parent, 1], positions[parent, 2]
        ox, oy, oz = offsets[bone, 0], offsets[bone, 1], offsets[bone, 2]
        tx, ty, tz = 2.0 * (y * oz - z * oy), 2.0 * (z * ox - x * oz), 2.0 * (x * oy - y * ox)
        positions[bone, 0] = px + ox + w * tx + y * tz - z * ty
        positions[bone, 1] = py + oy + w * ty + z * tx - x * tz
        positions[bone, 2] = pz + oz + w * tz + x * ty - y * tx
        bx, by, bz, bw = bones[bone, 0], bones[bone, 1], bones[bone, 2], bones[bone, 3]
        rotations[bone, 0] = w * bx + x * bw + y * bz - z * by
        rotations[bone, 1] = w * by - x * bz + y * bw + z * bx
        rotations[bone, 2] = w * bz + x * by - y * bx + z * bw
        rotations[bone, 3] = w * bw - x * bx - y * by - z * bz


def forward_kinematics(armature: Armature, pose: Pose) -> tuple[Floats, Floats]:
    """Bone origins (B, 3) in metres and world_from_bone rotations (B, 4), both in the world."""
    count = len(armature)
    positions, rotations = np.empty((count, 3)), np.empty((count, 4))
    place_bones(
        armature.parents,
        armature.offsets,
        pose.translation,
        pose.rotation,
        pose.bones,
        positions,
        rotations,
    )
    return positions, rotations
