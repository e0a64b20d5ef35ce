"""The damped Jacobian: what it reaches, and how it behaves where it cannot."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.errors import PuppetError
from puppet.kernel import Floats, frozen
from puppet.pose import Goal, Intent, Pose, forward_kinematics, rest_pose
from puppet.rotation import exp
from puppet.solvers.damped_jacobian import DampedJacobian
from tests.armatures import armatures, quaternions
from tests.ik_trials import chain, from_base, jerk, misses, solved, tree, turned
from tests.ik_workloads import WORKLOADS, creature, snake, tips_of

EVERY_WORKLOAD = pytest.mark.parametrize("name", WORKLOADS)
SEEDS = st.integers(0, 2**32 - 1)


# What it reaches


@given(armature=armatures(), seed=SEEDS)
def test_a_tip_comes_to_where_a_pose_had_it(armature: Armature, seed: int) -> None:
    effector = int(np.argmax(armature.depths))
    solver = DampedJacobian(armature, [effector])
    goals = tips_of(armature, turned(armature, seed, 0.8), solver.effectors)
    if solver.reaches[0] > 0.0 and from_base(solver, goals)[0] < 0.9:
        assert misses(solver, solved(solver, goals), goals)[0] < 0.01


def test_several_tips_come_to_where_a_pose_had_them() -> None:
    reached = []
    for seed in range(300):
        armature = tree(seed)
        leaves = [bone for bone in range(1, len(armature)) if not armature.children[bone]]
        solver = DampedJacobian(armature, leaves[:4])
        goals = tips_of(armature, turned(armature, seed, 0.8), solver.effectors)
        if (from_base(solver, goals) < 0.9).all():
            reached.append(misses(solver, solved(solver, goals), goals).max() < 0.01)
    assert len(reached) > 50
    assert np.mean(reached) > 0.95


@EVERY_WORKLOAD
def test_the_workloads_are_met_within_one_percent_of_reach_at_every_frame(name: str) -> None:
    workload = WORKLOADS[name]()
    solver = DampedJacobian(workload.armature, workload.effectors)
    for goals in workload.goals(120, step=7):
        assert misses(solver, solved(solver, goals), goals).max() < 0.01


@pytest.mark.parametrize("bones", [2, 3, 12, 60])
@given(seed=SEEDS)
def test_a_straight_chain_reaches_far_goals_from_rest(bones: int, seed: int) -> None:
    direction = np.random.default_rng(seed).normal(size=3)
    direction /= np.linalg.norm(direction)
    tip = np.array([1.0, 0.0, 0.0])
    goal = tip + 0.7 * direction
    solver = DampedJacobian(chain(bones), [bones])
    if 0.3 < np.linalg.norm(goal) < 0.9:
        assert misses(solver, solved(solver, goal[None]), goal[None])[0] < 0.01


def test_a_snake_raises_its_head_by_a_metre() -> None:
    workload = snake()
    solver = DampedJacobian(workload.armature, workload.effectors[1:])
    goals = tips_of(workload.armature, rest_pose(workload.armature), solver.effectors)
    goals = goals + [0.0, 1.0, -0.6]
    assert misses(solver, solved(solver, goals), goals)[0] < 0.001


@pytest.mark.parametrize("bones", [2, 3, 12, 60])
def test_a_straight_chain_folds_although_nothing_says_to_which_side(bones: int) -> None:
    solver = DampedJacobian(chain(bones), [bones])
    for distance in (0.4, 0.6, 0.85):
        goals = np.array([[distance, 0.0, 0.0]])
        assert misses(solver, solved(solver, goals), goals)[0] < 0.01


def test_a_folding_chain_stays_on_its_side_when_its_goal_wobbles() -> None:
    solver = DampedJacobian(chain(3), [3])
    poses = [
        solved(solver, np.array([[0.6, 0.1 * math.cos(angle), 0.1 * math.sin(angle)]])).bones
        for angle in np.linspace(0.0, 2.0 * math.pi, 100)
    ]
    assert np.abs(np.diff(poses, axis=0)).max() < 0.02


# What it keeps


@given(armature=armatures(), seed=SEEDS)
def test_goals_where_the_tips_are_keep_the_base_pose(armature: Armature, seed: int) -> None:
    leaves = [bone for bone in range(len(armature)) if not armature.children[bone]][:4]
    base = turned(armature, seed, 1.0)
    tips = tips_of(armature, base, tuple(leaves))
    goals = tuple(Goal(bone, tip) for bone, tip in zip(leaves, tips, strict=True))
    pose = DampedJacobian(armature, leaves)(Intent(base, goals))
    assert np.allclose(pose.bones, base.bones, atol=1e-9)


def test_a_straight_chain_keeps_straight_for_goals_straight_ahead() -> None:
    solver = DampedJacobian(chain(12), [12])
    for distance in (1.0, 1.5, 100.0):
        pose = solved(solver, np.array([[distance, 0.0, 0.0]]))
        assert np.allclose(pose.bones, rest_pose(solver.armature).bones, atol=1e-6)


@EVERY_WORKLOAD
def test_the_root_transform_has_no_part_in_it(name: str) -> None:
    workload = WORKLOADS[name]()
    solver = DampedJacobian(workload.armature, workload.effectors)
    goals = workload.goals(2, step=80)[1]
    intent = workload.intent(goals)
    expected = solver(intent)
    rng = np.random.default_rng(1)
    for scale in (0.0, 0.1, 1.0, 10.0, 1e3, 1e6):
        turn = exp(rng.normal(size=3) * 2.0)
        base = Pose(rng.normal(size=3) * scale, turn, intent.base.bones)
        pose = solver(Intent(base, intent.goals))
        assert np.array_equal(pose.bones, expected.bones)
        assert np.array_equal(pose.translation, base.translation)
        assert np.array_equal(pose.rotation, base.rotation)


@EVERY_WORKLOAD
def test_a_puppet_of_any_size_turns_alike(name: str) -> None:
    workload = WORKLOADS[name]()
    small = workload.armature
    large = replace(small, offsets=frozen(small.offsets * 100), tips=frozen(small.tips * 100))
    goals = workload.goals(2, step=80)[1]
    expected = solved(DampedJacobian(small, workload.effectors), goals)
    pose = solved(DampedJacobian(large, workload.effectors), goals * 100)
    assert np.allclose(pose.bones, expected.bones, atol=1e-7)


@given(armature=armatures(), seed=SEEDS)
def test_roots_and_bones_that_move_no_effector_stay(armature: Armature, seed: int) -> None:
    base = turned(armature, seed, 1.0)
    effector = len(armature) // 2
    pose = DampedJacobian(armature, [effector])(Intent(base, (Goal(effector, np.ones(3)),)))
    path = set()
    bone = effector
    while armature.parents[bone] >= 0:
        path.add(bone)
        bone = int(armature.parents[bone])
    still = [bone for bone in range(len(armature)) if bone not in path]
    assert np.array_equal(pose.bones[still], base.bones[still])


def test_bones_that_slide_or_are_fixed_do_not_turn() -> None:
    free = chain(6)
    armature = replace(free, movements=("turn", "turn", "fixed", "turn", "slide", "turn", "turn"))
    solver = DampedJacobian(armature, [6])
    goals = np.array([[0.3, 0.5, 0.1]])
    pose = solved(solver, goals)
    assert np.array_equal(pose.bones[[2, 4]], armature.rotations[[2, 4]])
    assert misses(solver, pose, goals)[0] < 0.01


def test_it_remembers_nothing_and_is_the_same_every_time() -> None:
    workload = creature()
    solver = DampedJacobian(workload.armature, workload.effectors)
    one, other = workload.goals(2, step=50)
    first = solved(solver, one)
    solved(solver, other)
    again = solved(solver, one)
    fresh = solved(DampedJacobian(workload.armature, workload.effectors), one)
    assert np.array_equal(first.bones, again.bones)
    assert np.array_equal(first.bones, fresh.bones)


def test_the_intent_is_not_written_to() -> None:
    workload = creature()
    intent = workload.intent(workload.goals(2, step=50)[1])
    before = intent.base.bones.copy()
    DampedJacobian(workload.armature, workload.effectors)(intent)
    assert np.array_equal(intent.base.bones, before)


# Weights


def rival_goals(left: float, right: float) -> Floats:
    """Where two tips of a fork end that are asked to be far apart. (2, 3)"""
    names, parents = ["root", "stem", "left", "right"], [-1, 0, 1, 1]
    offsets = np.array([[0, 0, 0], [0, 0, 0], [0, 0.5, 0], [0, 0.5, 0]])
    tips = np.array([[0, 0, 0], [0, 0.5, 0], [-0.1, 0.3, 0], [0.1, 0.3, 0]])
    armature = Armature.build("fork", names, parents, offsets, tips=tips)
    goals = (
        Goal(2, np.array([-0.7, 0.2, 0]), weight=left),
        Goal(3, np.array([0.7, 0.2, 0]), weight=right),
    )
    pose = DampedJacobian(armature, [2, 3])(Intent(rest_pose(armature), goals))
    return tips_of(armature, pose, (2, 3)) - [goal.position for goal in goals]


def test_of_two_rivals_the_heavier_one_is_nearer_to_its_goal() -> None:
    even, uneven = (np.linalg.norm(rival_goals(*weights), axis=1) for weights in ((1, 1), (8, 1)))
    assert even[0] == pytest.approx(even[1], rel=0.02)
    assert uneven[0] < 0.8 * even[0]
    assert uneven[1] > even[1]


def test_only_the_ratio_of_weights_counts() -> None:
    assert np.allclose(rival_goals(8, 2), rival_goals(4, 1), atol=1e-12)


def test_a_goal_without_weight_is_no_goal() -> None:
    workload = creature()
    solver = DampedJacobian(workload.armature, workload.effectors)
    goals = workload.intent(workload.goals(2, step=50)[1]).goals
    base = rest_pose(workload.armature)
    one = solver(Intent(base, goals[1:]))
    other = solver(Intent(base, (replace(goals[0], weight=0.0), *goals[1:])))
    assert np.array_equal(one.bones, other.bones)


def test_two_goals_of_one_bone_are_their_weighted_mean() -> None:
    solver, base = DampedJacobian(chain(6), [6]), rest_pose(chain(6))
    a, b = np.array([0.3, 0.5, 0.0]), np.array([0.7, 0.1, 0.2])
    both = solver(Intent(base, (Goal(6, a, weight=3.0), Goal(6, b, weight=1.0))))
    mean = solver(Intent(base, (Goal(6, 0.75 * a + 0.25 * b),)))
    assert np.allclose(both.bones, mean.bones, atol=1e-9)


# Where it cannot reach


@given(armature=armatures(), seed=SEEDS, far=st.floats(1.0, 1e6))
def test_goals_out_of_reach_give_a_finite_pose(armature: Armature, seed: int, far: float) -> None:
    rng = np.random.default_rng(seed)
    leaves = [bone for bone in range(len(armature)) if not armature.children[bone]][:4]
    goals = tuple(Goal(bone, rng.normal(size=3) * far) for bone in leaves)
    pose = DampedJacobian(armature, leaves)(Intent(rest_pose(armature), goals))
    assert np.allclose(np.linalg.norm(pose.bones, axis=1), 1.0, atol=1e-9)


@given(direction=quaternions(), far=st.floats(2.0, 1e4))
def test_a_chain_stretches_out_to_a_goal_beyond_reach(direction: Floats, far: float) -> None:
    along = direction[:3] / np.linalg.norm(direction[:3])
    if along[0] < -0.95:
        return  # right behind the chain every way round is as good as another
    solver = DampedJacobian(chain(12), [12])
    tip = tips_of(solver.armature, solved(solver, far * along[None]), (12,))[0]
    assert np.linalg.norm(tip) > 0.96
    assert tip @ along / np.linalg.norm(tip) > 0.999


@pytest.mark.parametrize("out_of_reach", [1.0, 1.2, 3.0])
@EVERY_WORKLOAD
def test_the_puppet_moves_as_smoothly_as_its_goals(name: str, out_of_reach: float) -> None:
    workload = WORKLOADS[name]()
    solver = DampedJacobian(workload.armature, workload.effectors)
    middle = workload.armature.rest[0].mean(axis=0)
    goals = middle + (workload.goals(300) - middle) * out_of_reach
    poses = [solved(solver, each) for each in goals]
    bones = np.array([forward_kinematics(workload.armature, pose)[0] for pose in poses])
    assert jerk(bones).mean() < 1.5 * jerk(goals).mean()
    assert jerk(bones).max() < 3.0 * jerk(goals).max()


def test_goals_that_are_not_finite_do_not_count() -> None:
    solver, base = DampedJacobian(chain(6), [3, 6]), rest_pose(chain(6))
    good = Goal(6, np.array([0.3, 0.5, 0.0]))
    expected = solver(Intent(base, (good,)))
    for bad in (np.full(3, np.nan), np.array([np.inf, 0.0, 0.0])):
        pose = solver(Intent(base, (Goal(3, bad), good)))
        assert np.array_equal(pose.bones, expected.bones)


def test_without_goals_the_base_pose_comes_back() -> None:
    base = turned(chain(6), 1, 0.5)
    assert np.array_equal(DampedJacobian(chain(6), [6])(Intent(base)).bones, base.bones)


@pytest.mark.parametrize("effectors", [[7], [-1], [2, 2]])
def test_effectors_must_be_bones_and_come_once(effectors: list[int]) -> None:
    with pytest.raises(PuppetError, match="chain: an end effector"):
        DampedJacobian(chain(6), effectors)


def test_a_goal_for_another_bone_is_an_error_that_names_the_effectors() -> None:
    intent = Intent(rest_pose(chain(6)), (Goal(2, np.zeros(3)),))
    with pytest.raises(PuppetError, match=r"(?s)not an end effector.*b6.*b2"):
        DampedJacobian(chain(6), [6])(intent)


# Compiled and plain


def test_compiled_and_plain_give_the_same() -> None:
    script = (
        "from puppet.solvers.damped_jacobian import DampedJacobian\n"
        "from tests.ik_trials import limited\n"
        "from tests.ik_workloads import creature\n"
        "w = creature()\n"
        "a = limited(w.armature, 3)\n"
        "p = DampedJacobian(a, w.effectors)(w.intent(w.goals(2, step=50)[1]))\n"
        "print(p.bones.tobytes().hex())\n"
    )
    out = [
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "NUMBA_DISABLE_JIT": plain},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for plain in ("0", "1")
    ]
    compiled, plain = (np.frombuffer(bytes.fromhex(text)) for text in out)
    assert np.abs(compiled - plain).max() < 1e-9
