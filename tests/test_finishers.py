"""Finishers: transitions and the limit of turning."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.pose import Pose
from puppet.solvers.transition import Transition, blend
from puppet.solvers.turn_limit import TurnLimit


def pose(seed: int) -> Pose:
    turned = Rotation.random(6, random_state=seed).as_quat()
    return Pose(np.full(3, float(seed)), turned[0].copy(), turned[1:].copy())


def apart(a: Pose, b: Pose) -> float:
    """Radians, the greatest turn of a bone between two poses."""
    return float(
        (Rotation.from_quat(a.bones) * Rotation.from_quat(b.bones).inv()).magnitude().max()
    )


def test_a_transition_starts_where_it_was_and_ends_where_it_should() -> None:
    finish = Transition(seconds=0.5)
    finish(pose(1), 0.0)
    finish.start()
    shown = [finish(pose(2), 1 / 60) for _ in range(40)]
    assert apart(shown[0], pose(1)) < 0.05
    assert apart(shown[-1], pose(2)) < 1e-9
    steps = [apart(a, b) for a, b in pairwise(shown)]
    assert max(steps) < 2.0 * apart(pose(1), pose(2)) / 30


def test_without_a_start_a_transition_does_nothing() -> None:
    finish = Transition()
    finish(pose(1), 0.0)
    assert apart(finish(pose(2), 1 / 60), pose(2)) < 1e-12


@given(st.integers(0, 99), st.integers(0, 99), st.floats(0, 1))
def test_a_blend_lies_between(a: int, b: int, share: float) -> None:
    between = blend(pose(a), pose(b), share)
    assert apart(between, pose(a)) <= apart(pose(b), pose(a)) + 1e-9
    np.testing.assert_allclose(np.linalg.norm(between.bones, axis=1), 1.0)


@given(st.integers(0, 99), st.integers(0, 99), st.floats(0.001, 0.1))
def test_no_bone_turns_faster_than_the_limit_and_all_arrive(a: int, b: int, dt: float) -> None:
    limit = TurnLimit(fastest=math.radians(720))
    before = limit(pose(a), dt)
    for _ in range(math.ceil(math.pi / (limit.fastest * dt)) + 1):
        now = limit(pose(b), dt)
        assert apart(now, before) <= limit.fastest * dt + 1e-6
        before = now
    assert apart(before, pose(b)) < 1e-6


def test_slow_turning_goes_through_untouched() -> None:
    limit = TurnLimit()
    first = pose(1)
    limit(first, 0.0)
    slow = Rotation.from_euler("y", 5, degrees=True)
    after = Pose(
        first.translation, first.rotation, (slow * Rotation.from_quat(first.bones)).as_quat()
    )
    assert limit(after, 1 / 60).bones.tobytes() == after.bones.tobytes()


@pytest.mark.parametrize("finisher", [Transition(), TurnLimit()])
def test_after_a_reset_the_past_is_forgotten(finisher: Transition | TurnLimit) -> None:
    finisher(pose(1), 0.0)
    finisher.reset()
    assert apart(finisher(pose(2), 1 / 60), pose(2)) < 1e-12
