"""The damped Jacobian within joint limits: they always hold, are used, and nothing jumps there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.kernel import frozen
from puppet.pose import Goal, Intent
from puppet.solvers.damped_jacobian import DampedJacobian
from puppet.solvers.joint_limits import JointLimits
from tests.armatures import armatures
from tests.ik_trials import chain, from_base, limited, misses, solved, tree, turned
from tests.ik_workloads import creature, tips_of

SEEDS = st.integers(0, 2**32 - 1)


@given(armature=armatures(), seed=SEEDS, far=st.floats(0.1, 10.0))
def test_every_bone_is_within_its_limits(armature: Armature, seed: int, far: float) -> None:
    rng = np.random.default_rng(seed)
    armature = limited(armature, seed)
    leaves = [bone for bone in range(len(armature)) if not armature.children[bone]][:4]
    goals = tuple(Goal(bone, rng.normal(size=3) * far) for bone in leaves)
    pose = DampedJacobian(armature, leaves)(Intent(turned(armature, seed, 1.0), goals))
    within = JointLimits(armature)(pose)
    turning = armature.parents >= 0  # a root is the base pose's own
    assert np.allclose(pose.bones[turning], within.bones[turning], atol=1e-8)


def test_goals_that_can_be_met_within_limits_mostly_are() -> None:
    missed = []
    for seed in range(500):
        armature = limited(tree(seed), seed)
        leaves = [bone for bone in range(1, len(armature)) if not armature.children[bone]]
        solver = DampedJacobian(armature, leaves[:2])
        pose = JointLimits(armature)(turned(armature, seed, 0.8))
        goals = tips_of(armature, pose, solver.effectors)
        if (from_base(solver, goals) < 0.9).all():
            missed.append(misses(solver, solved(solver, goals), goals).max())
    assert len(missed) > 50

    assert np.mean(np.array(missed) < 0.01) > 0.85


def leg(knee_from: float, knee_to: float) -> Armature:
    """A straight leg down from a hip, 1 m long, whose knee is a hinge about X."""
    lower, upper = np.full((3, 3), -np.inf), np.full((3, 3), np.inf)
    lower[2], upper[2] = (knee_from, 0.0, 0.0), (knee_to, 0.0, 0.0)
    return Armature.build(
        "leg",
        ["hips", "thigh", "shin"],
        [-1, 0, 1],
        np.array([[0, 0, 0], [0, 0, 0], [0, -0.5, 0]]),
        tips=np.array([[0, 0, 0], [0, -0.5, 0], [0, -0.5, 0]]),
        lower=lower,
        upper=upper,
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_straight_knee_bends_the_way_its_range_says(sign: float) -> None:
    ends = sorted((0.0, sign * math.radians(150)))
    solver = DampedJacobian(leg(*ends), [2])
    for goal in ([0.0, -0.6, 0.0], [0.0, -0.6, 0.3], [0.0, -0.6, -0.3], [0.2, -0.5, 0.2]):
        goals = np.array([goal])
        pose = solved(solver, goals)
        assert misses(solver, pose, goals)[0] < 0.01
        assert sign * pose.bones[2, 0] > 0.2
        assert np.array_equal(pose.bones[2, 1:3], [0.0, 0.0])


def test_a_stiff_bone_leaves_its_share_to_the_others() -> None:
    free = chain(4)
    limits = np.array([np.inf, np.inf, 0.05, np.inf, np.inf])
    solver = DampedJacobian(replace(free, limits=frozen(limits)), [4])
    for goal in ([0.5, 0.5, 0.0], [0.2, 0.0, -0.7], [0.6, 0.0, 0.0]):
        goals = np.array([goal])
        assert misses(solver, solved(solver, goals), goals)[0] < 0.01


@pytest.mark.parametrize("limit", [0.35, 0.6, 1.0])
def test_limits_do_not_make_a_puppet_jump(limit: float) -> None:
    workload = creature()
    armature = replace(workload.armature, limits=frozen(np.full(25, limit)))
    solver = DampedJacobian(armature, workload.effectors)
    goals = workload.goals(300)
    tips = np.array([tips_of(armature, solved(solver, g), workload.effectors) for g in goals])
    steps, wished = (np.linalg.norm(np.diff(x, axis=0), axis=-1).max() for x in (tips, goals))
    assert steps < 1.2 * wished


def test_limits_are_reached_without_a_jump_however_closely_one_looks() -> None:
    workload = creature()
    armature = replace(workload.armature, limits=frozen(np.full(25, 0.35)))
    solver = DampedJacobian(armature, workload.effectors)
    start, end = workload.goals(2, step=180)[1], workload.goals(2, step=186)[1]
    ways = np.linspace(0.0, 1.0, 401)[:, None, None]
    poses = np.array([solved(solver, start + (end - start) * way).bones for way in ways])
    assert np.abs(np.diff(poses, axis=0)).max() < 0.02
