"""Limits: what is inside passes, what is outside comes back to the edge, and nothing jumps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.kernel import Floats, frozen
from puppet.pose import Pose, rest_pose
from puppet.rotation import IDENTITY, conjugate, exp, log, multiply, shortest
from puppet.solvers.joint_limits import JointLimits, clamp
from tests.armatures import armatures, quaternions

SEEDS = st.integers(0, 2**32 - 1)
ANGLES = st.floats(-3.0, 3.0)
TURNS = st.tuples(ANGLES, ANGLES, ANGLES).map(np.array)


def limited(armature: Armature, seed: int) -> Armature:
    """Every kind of limit: cones, boxes, hinges, none."""
    rng = np.random.default_rng(seed)
    count = len(armature)
    lower, upper = -rng.uniform(0.0, 1.5, (count, 3)), rng.uniform(0.0, 2.5, (count, 3))
    still = rng.random((count, 3)) < 0.4
    lower[still] = upper[still] = 0.0
    free = rng.random(count) < 0.4
    lower[free], upper[free] = -np.inf, np.inf
    limits = np.where(rng.random(count) < 0.5, rng.uniform(0.0, 2.0, count), np.inf)
    return replace(armature, lower=frozen(lower), upper=frozen(upper), limits=frozen(limits))


def posed(armature: Armature, seed: int) -> Pose:
    bones = np.random.default_rng(seed).normal(size=(len(armature), 4))
    return Pose(np.ones(3), IDENTITY, bones / np.linalg.norm(bones, axis=1, keepdims=True))


def turns_of(armature: Armature, pose: Pose) -> Floats:
    """(B, 3) rad, in the bones' rest frames."""
    return np.array(
        [
            log(shortest(multiply(conjugate(rest), bone)))
            for rest, bone in zip(armature.rotations, pose.bones, strict=True)
        ]
    )


@given(armature=armatures(), seed=SEEDS)
def test_no_bone_is_beyond_its_limits(armature: Armature, seed: int) -> None:
    armature = limited(armature, seed)
    turns = turns_of(armature, JointLimits(armature)(posed(armature, seed)))
    assert (turns >= armature.lower - 1e-6).all()
    assert (turns <= armature.upper + 1e-6).all()
    assert (np.linalg.norm(turns, axis=1) <= armature.limits + 1e-6).all()


@given(armature=armatures(), seed=SEEDS)
def test_a_pose_within_limits_passes_bit_for_bit(armature: Armature, seed: int) -> None:
    limits = JointLimits(limited(armature, seed))
    once = limits(posed(armature, seed))
    assert np.array_equal(limits(once).bones, once.bones)


@given(armature=armatures(), seed=SEEDS)
def test_bones_without_limits_pass_bit_for_bit(armature: Armature, seed: int) -> None:
    limits = np.full(len(armature), np.inf)
    limits[::2] = 0.2
    half = replace(armature, limits=frozen(limits))
    pose = posed(armature, seed)
    assert np.array_equal(JointLimits(half)(pose).bones[1::2], pose.bones[1::2])
    assert np.array_equal(JointLimits(armature)(pose).bones, pose.bones)


def test_the_rest_pose_and_the_root_transform_pass() -> None:
    armature = Armature.build("one", ["a"], [-1], np.zeros((1, 3)), limits=[0.1])
    pose = Pose(np.arange(3.0), np.array([1.0, 0.0, 0.0, 0.0]), rest_pose(armature).bones)
    shown = JointLimits(armature)(pose)
    assert shown.translation is pose.translation
    assert shown.rotation is pose.rotation
    assert np.array_equal(shown.bones, pose.bones)


@given(turn=quaternions())
def test_a_cone_keeps_the_axis_and_shortens_the_turn(turn: Floats) -> None:
    armature = Armature.build("one", ["a"], [-1], np.zeros((1, 3)), limits=[0.5])
    wished = log(shortest(turn))
    (shown,) = turns_of(armature, JointLimits(armature)(Pose(np.zeros(3), IDENTITY, turn[None])))
    expected = wished * min(1.0, 0.5 / float(np.linalg.norm(wished)))
    assert np.allclose(shown, expected, atol=1e-9)


def test_a_hinge_turns_about_its_axis_alone_and_between_its_stops() -> None:
    low, high = np.array([[0.0, -0.2, 0.0]]), np.array([[0.0, 1.0, 0.0]])
    armature = Armature.build("one", ["a"], [-1], np.zeros((1, 3)), lower=low, upper=high)
    for wished, shown in ((0.7, 0.7), (2.0, 1.0), (-1.0, -0.2)):
        bones = exp(np.array([0.3, wished, 0.0]))[None]
        turns = turns_of(armature, JointLimits(armature)(Pose(np.zeros(3), IDENTITY, bones)))
        assert np.allclose(turns, [[0.0, shown, 0.0]], atol=1e-9)


@pytest.mark.parametrize("movement", ["slide", "fixed"])
def test_a_bone_that_does_not_turn_is_at_rest(movement: str) -> None:
    free = Armature.build("one", ["a"], [-1], np.zeros((1, 3)))
    armature = replace(free, movements=(movement,))  # type: ignore[arg-type]
    pose = Pose(np.zeros(3), IDENTITY, exp(np.array([0.3, 0.2, 0.1]))[None])
    assert np.array_equal(JointLimits(armature)(pose).bones, armature.rotations)


@given(turn=TURNS, other=TURNS, seed=SEEDS)
def test_clamping_brings_turns_no_further_apart_than_a_little(
    turn: Floats, other: Floats, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    middle = rng.uniform(-0.3, 0.3, 3)
    lower, upper = middle - rng.uniform(0.0, 1.0, 3), middle + rng.uniform(0.0, 1.0, 3)
    limit = float(rng.uniform(0.6, 2.0))
    near = turn + 1e-4 * (other - turn)
    apart = np.linalg.norm(near - turn)
    clamp(turn, lower, upper, limit)
    clamp(near, lower, upper, limit)
    assert np.linalg.norm(near - turn) <= 10.0 * apart + 1e-8


@given(turn=TURNS, seed=SEEDS)
def test_box_and_cone_hold_together_even_for_a_box_beside_rest(turn: Floats, seed: int) -> None:
    rng = np.random.default_rng(seed)
    lower = rng.uniform(-1.0, 0.5, 3)
    upper = lower + rng.uniform(0.0, 1.0, 3)
    limit = float(np.linalg.norm(np.clip(0.0, lower, upper))) + float(rng.uniform(0.05, 1.0))
    clamp(turn, lower, upper, limit)
    assert (turn >= lower - 1e-8).all()
    assert (turn <= upper + 1e-8).all()
    assert np.linalg.norm(turn) <= limit + 1e-8


def test_stops_beyond_half_a_turn_are_no_stops() -> None:
    low, high = np.full((1, 3), -math.pi), np.full((1, 3), 4.0)
    armature = Armature.build("one", ["a"], [-1], np.zeros((1, 3)), lower=low, upper=high)
    pose = Pose(np.zeros(3), IDENTITY, exp(np.array([0.0, 3.1, 0.0]))[None])
    assert np.array_equal(JointLimits(armature)(pose).bones, pose.bones)


def test_where_box_and_cone_have_nothing_in_common_the_boxs_nearest_point_to_rest_counts() -> None:
    turn = np.array([2.0, 0.5, 0.0])
    clamp(turn, np.array([1.0, -1.0, 0.0]), np.array([1.5, 1.0, 0.0]), 0.3)
    assert np.array_equal(turn, [1.0, 0.0, 0.0])
