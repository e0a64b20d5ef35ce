"""Forward kinematics against SciPy, wherever the armature stands."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.pose import Pose, forward_kinematics, rest_pose
from tests.armatures import armatures, quaternions

#: The six ways an armature can stand (after ozz-animation's habit).
ROOTS = {
    "identity": (np.zeros(3), Rotation.identity()),
    "moved": (np.array([1.0, -2.0, 3.0]), Rotation.identity()),
    "turned": (np.zeros(3), Rotation.from_euler("y", 120, degrees=True)),
    "lying": (np.zeros(3), Rotation.from_euler("x", 90, degrees=True)),
    "upside down": (np.array([0.0, 5.0, 0.0]), Rotation.from_euler("z", 180, degrees=True)),
    "anyhow": (np.array([-3.0, 0.1, 20.0]), Rotation.from_rotvec([0.4, -2.0, 1.1])),
}


@pytest.mark.parametrize("root", ROOTS)
@given(armature=armatures(), seed=st.integers(0, 2**32 - 1))
def test_forward_kinematics_agrees_with_scipy(root: str, armature: Armature, seed: int) -> None:
    translation, turned = ROOTS[root]
    local = Rotation.random(len(armature), random_state=seed % 2**31)
    pose = Pose(translation.copy(), turned.as_quat(), local.as_quat().reshape(-1, 4))
    positions, rotations = forward_kinematics(armature, pose)
    world: list[Rotation] = []
    where: list[np.ndarray] = []
    for bone, parent in enumerate(armature.parents):
        above = turned if parent < 0 else world[parent]
        origin = translation if parent < 0 else where[parent]
        world.append(above * local[bone])
        where.append(origin + above.apply(armature.offsets[bone].copy()))
        assert (world[bone].inv() * Rotation.from_quat(rotations[bone])).magnitude() < 1e-9
    np.testing.assert_allclose(positions, where, atol=1e-9)


@given(armature=armatures(), turn=quaternions())
def test_turning_the_whole_turns_every_bone_alike(armature: Armature, turn: np.ndarray) -> None:
    rest = rest_pose(armature)
    before, _ = forward_kinematics(armature, rest)
    after, _ = forward_kinematics(armature, Pose(np.ones(3), turn, rest.bones))
    np.testing.assert_allclose(after, Rotation.from_quat(turn).apply(before) + 1.0, atol=1e-9)


@given(armature=armatures())
def test_the_rest_pose_is_where_the_armature_says_it_rests(armature: Armature) -> None:
    positions, rotations = forward_kinematics(armature, rest_pose(armature))
    np.testing.assert_allclose(positions, armature.rest[0], atol=1e-9)
    np.testing.assert_allclose(np.abs((rotations * armature.rest[1]).sum(axis=1)), 1.0, atol=1e-9)
