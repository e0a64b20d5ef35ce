"""Poses, what a mapping asks for, and forward kinematics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from puppet.armature import Armature
from puppet.kernel import Floats, Ints, kernel
from puppet.rotation import IDENTITY, multiply, rotate
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
def _forward(
    parents: Ints,
    offsets: Floats,
    translation: Floats,
    rotation: Floats,
    bones: Floats,
    positions: Floats,
    rotations: Floats,
) -> None:
    for bone in range(len(parents)):
        parent = parents[bone]
        if parent < 0:
            positions[bone] = translation + rotate(rotation, offsets[bone])
            rotations[bone] = multiply(rotation, bones[bone])
        else:
            positions[bone] = positions[parent] + rotate(rotations[parent], offsets[bone])
            rotations[bone] = multiply(rotations[parent], bones[bone])


def forward_kinematics(armature: Armature, pose: Pose) -> tuple[Floats, Floats]:
    """Bone origins (B, 3) in metres and world_from_bone rotations (B, 4), both in the world."""
    count = len(armature)
    positions, rotations = np.empty((count, 3)), np.empty((count, 4))
    _forward(
        armature.parents,
        armature.offsets,
        pose.translation,
        pose.rotation,
        pose.bones,
        positions,
        rotations,
    )
    return positions, rotations
