"""Nothing of a grounded puppet is below the floor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.formats.armature_toml import load_puppet
from puppet.kernel import Floats
from puppet.mesh import Model
from puppet.pose import Pose, forward_kinematics, rest_pose
from puppet.rotation import IDENTITY, exp, multiply, rotate
from puppet.solvers.floor import Floor, FloorPoints, floor_points
from puppet.solvers.joint_limits import JointLimits
from tests.armatures import armatures

CAST = Path(__file__).resolve().parents[1] / "configs/armatures"
SEEDS = st.integers(0, 2**32 - 1)


def heights(armature: Armature, points: FloorPoints, pose: Pose) -> Floats:
    """(N,) metres above the floor of the world, by another way than the finisher's."""
    origins, frames = forward_kinematics(armature, pose)
    places = [
        origins[bone] + rotate(frames[bone], position)
        for bone, position in zip(points.bones, points.positions, strict=True)
    ]
    return np.array(places)[:, 1]


def some_pose(armature: Armature, seed: int, most: float) -> Pose:
    rng = np.random.default_rng(seed)
    turns = rng.normal(size=(len(armature), 3)) * most
    bones = [multiply(q, exp(turn)) for q, turn in zip(armature.rotations, turns, strict=True)]
    return Pose(rng.normal(size=3), exp(rng.normal(size=3)), np.array(bones))


@given(armature=armatures(), seed=SEEDS)
def test_no_point_is_below_the_floor_and_no_more_is_done_than_needed(
    armature: Armature, seed: int
) -> None:
    points = floor_points(Model(armature, ()))
    pose = some_pose(armature, seed, 1.0)
    shown = Floor(armature, points)(pose)
    before, after = heights(armature, points, pose), heights(armature, points, shown)
    assert after.min() == pytest.approx(max(before.min(), 0.0), abs=1e-9)
    assert np.array_equal(shown.translation[[0, 2]], pose.translation[[0, 2]])
    assert np.array_equal(shown.bones, pose.bones)
    assert np.array_equal(shown.rotation, pose.rotation)


@given(armature=armatures(), seed=SEEDS)
def test_a_puppet_in_the_air_is_not_pulled_down(armature: Armature, seed: int) -> None:
    points = floor_points(Model(armature, ()))
    low = some_pose(armature, seed, 1.0)
    lift = 0.1 - min(float(heights(armature, points, low).min()), 0.0)
    high = Pose(low.translation + [0.0, lift, 0.0], low.rotation, low.bones)
    assert Floor(armature, points)(high) is high


@given(armature=armatures(), seed=SEEDS)
def test_the_lift_follows_the_pose_without_a_jump(armature: Armature, seed: int) -> None:
    points = floor_points(Model(armature, ()))
    floor, pose = Floor(armature, points), some_pose(armature, seed, 1.0)
    turn = exp(np.array([1e-4, 0.0, 0.0]))
    near = Pose(pose.translation, multiply(turn, pose.rotation), pose.bones)
    size = float(np.linalg.norm(armature.offsets, axis=1).sum()) + armature.size
    moved = abs(floor(near).translation[1] - floor(pose).translation[1])
    assert moved <= 1e-4 * size


def test_without_a_skin_the_points_are_the_ends_of_the_bones() -> None:
    armature = Armature.build("two", ["a", "b"], [-1, 0], [[0, 1, 0], [0, 1, 0]])
    points = floor_points(Model(armature, ()))
    assert heights(armature, points, rest_pose(armature)) == pytest.approx([1.0, 2.0, 2.0, 3.0])


@pytest.mark.parametrize("name", ["dog", "ostrich", "snake"])
def test_the_skin_of_a_grounded_puppet_stays_above_the_floor(name: str) -> None:
    model = load_puppet(CAST / f"{name}.glb").model
    armature = model.armature
    floor, limits = Floor(armature, floor_points(model)), JointLimits(armature)
    skin = np.concatenate([mesh.positions for mesh in model.meshes]).astype(float)
    owners = np.concatenate(
        [mesh.bones[np.arange(len(mesh.bones)), mesh.weights.argmax(1)] for mesh in model.meshes]
    )
    origins, frames = armature.rest
    local = [
        rotate(np.array([*-frames[bone][:3], frames[bone][3]]), vertex - origins[bone])
        for bone, vertex in zip(owners, skin, strict=True)
    ]
    everything = FloorPoints(owners.astype(np.int32), np.array(local))
    assert len(floor_points(model).bones) <= 16 * len(armature)
    for seed in range(20):
        shown = floor(limits(Pose(np.zeros(3), IDENTITY, some_pose(armature, seed, 0.4).bones)))
        assert heights(armature, everything, shown).min() > -0.02 * model.height


def test_more_points_a_bone_come_nearer_to_its_skin() -> None:
    model = load_puppet(CAST / "dog.glb").model
    assert len(floor_points(model, per_bone=32).bones) > len(floor_points(model, 4).bones)
