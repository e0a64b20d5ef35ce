"""Goals with a rotation: heads stay level and feet flat while the chain behind them reaches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.pose import Goal, Intent, forward_kinematics, rest_pose
from puppet.rotation import exp, multiply, rotate
from puppet.solvers.damped_jacobian import DampedJacobian
from puppet.solvers.oriented_tips import OrientedTips

SEEDS = st.integers(0, 2**32 - 1)


def neck(bones: int = 6) -> Armature:
    """A curved chain on a root, with a head at its end."""
    names = ["root", *(f"neck{i}" for i in range(bones)), "head"]
    offsets = [[0.0, 0.1, 0.02 * i] for i in range(len(names))]
    return Armature.build("neck", names, [i - 1 for i in range(len(names))], offsets)


def head_of(armature: Armature, bones: Floats) -> tuple[Floats, Floats]:
    """Where the head's tip is, and how the head is turned."""
    pose = rest_pose(armature)
    head = len(armature) - 1
    positions, rotations = forward_kinematics(
        armature, type(pose)(pose.translation, pose.rotation, bones)
    )
    return positions[head] + rotate(rotations[head], armature.tips[head]), rotations[head]


@given(seed=SEEDS)
def test_the_tip_is_where_and_how_a_pose_had_it(seed: int) -> None:
    armature = neck()
    head = len(armature) - 1
    rng = np.random.default_rng(seed)
    bones = np.array([multiply(q, exp(rng.normal(size=3) * 0.25)) for q in armature.rotations])
    bones[0] = armature.rotations[0]
    goal, wanted = head_of(armature, bones)
    start = goal - rotate(wanted, armature.tips[head])
    if np.linalg.norm(start - armature.rest[0][1]) > 0.85 * 0.6:
        return  # nearly stretched: a little of that is not asked for
    pose = OrientedTips(armature, [head], [head])(
        Intent(rest_pose(armature), (Goal(head, goal, wanted),))
    )
    tip, turned = head_of(armature, pose.bones)
    assert np.linalg.norm(tip - goal) < 0.01 * armature.size
    assert abs(float(turned @ wanted)) > 1.0 - 1e-9


def test_without_a_rotation_it_is_the_plain_solver() -> None:
    armature = neck()
    head = len(armature) - 1
    goal = Goal(head, armature.rest_tips[head] + [0.1, -0.1, 0.05])
    intent = Intent(rest_pose(armature), (goal,))
    plain = DampedJacobian(armature, [head])(intent)
    assert OrientedTips(armature, [head])(intent).bones.tobytes() == plain.bones.tobytes()


def test_a_head_on_a_bone_that_cannot_turn_is_led_by_its_tip_alone() -> None:
    for bones in (1, 2):
        armature = neck(bones)
        parent = len(armature) - 2
        held = armature.holding([parent])
        assert not OrientedTips(held, [len(armature) - 1], [len(armature) - 1]).oriented
    assert not OrientedTips(neck(0), [1], [1]).oriented  # its parent is the root


def test_two_heads_on_one_neck_do_not_both_lead_it() -> None:
    armature = Armature.build(
        "hydra",
        ["root", "neck1", "neck2", "head1", "head2"],
        [-1, 0, 1, 2, 2],
        np.array([[0, 0, 0], [0, 0.2, 0], [0, 0.2, 0.02], [0.1, 0.2, 0], [-0.1, 0.2, 0]]),
    )
    solver = OrientedTips(armature, [3, 4], [3, 4])
    assert list(solver.oriented) == [3]
    goals = tuple(Goal(bone, armature.rest_tips[bone], armature.rest[1][bone]) for bone in (3, 4))
    pose = solver(Intent(rest_pose(armature), goals))
    np.testing.assert_allclose(pose.bones, armature.rotations, atol=1e-6)


@pytest.mark.parametrize("turn", [0.0, 0.7, 3.0])
def test_goals_at_rest_leave_the_armature_at_rest_whatever_its_axes(turn: float) -> None:
    armature = neck()
    spun = [multiply(exp(np.array([0.3, turn, 0.1])), q) for q in armature.rotations]
    armature = Armature.build(
        "n", armature.names, armature.parents.tolist(), armature.offsets, spun
    )
    head = len(armature) - 1
    goal = Goal(head, armature.rest_tips[head], armature.rest[1][head])
    pose = OrientedTips(armature, [head], [head])(Intent(rest_pose(armature), (goal,)))
    np.testing.assert_allclose(np.abs((pose.bones * armature.rotations).sum(axis=1)), 1.0)
