"""The linear problem inside the solver, against differences and NumPy."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.pose import Pose, forward_kinematics
from puppet.rotation import IDENTITY, conjugate, exp, log, multiply, rotate
from puppet.solvers.effector_paths import EffectorPaths
from puppet.solvers.joint_limits import BOUNDED, FREE, Bounds
from puppet.solvers.normal_equations import (
    assemble,
    fill_columns,
    fill_steps,
    solve,
    stiffen,
    turn_axes,
)
from tests.armatures import armatures

SEEDS = st.integers(0, 2**32 - 1)


@given(seed=SEEDS, size=st.sampled_from([0.0, 1e-6, 0.1, 1.0, 3.0]))
def test_turn_axes_are_the_derivative_of_the_turn(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    vector, axes = rng.normal(size=3), np.empty((3, 3))
    vector *= size / float(np.linalg.norm(vector))
    above = exp(rng.normal(size=3))
    turn_axes(above, vector, axes)
    for i in range(3):
        step = np.zeros(3)
        step[i] = 1e-5
        moved = multiply(exp(vector + step), conjugate(exp(vector - step)))
        assert np.allclose(axes[i], rotate(above, log(moved)) / 2e-5, atol=1e-6)


def tips_after(armature: Armature, effectors: list[int], turns: Floats) -> Floats:
    bones = [multiply(q, exp(turn)) for q, turn in zip(armature.rotations, turns, strict=True)]
    origins, frames = forward_kinematics(
        armature, Pose(np.zeros(3), IDENTITY.copy(), np.array(bones))
    )
    return np.array([origins[b] + rotate(frames[b], armature.tips[b]) for b in effectors])


@given(armature=armatures(most=10), seed=SEEDS)
def test_the_problem_is_that_of_the_tips_derivative(armature: Armature, seed: int) -> None:
    rng = np.random.default_rng(seed)
    leaves = [bone for bone in range(len(armature)) if not armature.children[bone]][:3]
    paths = EffectorPaths.of(armature, leaves, Bounds.of(armature))
    kinds = rng.choice([FREE, BOUNDED], len(armature)).astype(np.int32)
    turns, weights = rng.normal(size=(len(armature), 3)), rng.uniform(0.1, 1.0, len(leaves))
    bones = [multiply(q, exp(turn)) for q, turn in zip(armature.rotations, turns, strict=True)]
    origins, frames = forward_kinematics(
        armature, Pose(np.zeros(3), IDENTITY.copy(), np.array(bones))
    )
    tips = tips_after(armature, leaves, turns)

    # Differences. A bounded bone moves by its vector, a free one by a turn about the armature.
    derivative = np.zeros((len(leaves), 3, len(armature), 3))
    for bone in set(paths.bones):
        above = multiply(frames[armature.parents[bone]], armature.rotations[bone])
        for i in range(3):
            ends = []
            for sign in (1e-5, -1e-5):
                step = np.eye(3)[i] * sign
                changed = turns.copy()
                if kinds[bone] == BOUNDED:
                    changed[bone] += step
                else:
                    inner = rotate(conjugate(above), step)
                    changed[bone] = log(multiply(exp(inner), exp(turns[bone])))
                ends.append(tips_after(armature, leaves, changed))
            derivative[:, :, bone, i] = (ends[0] - ends[1]) / 2e-5
    scale = np.sqrt(weights)
    j = (derivative * scale[:, None, None, None]).reshape(3 * len(leaves), -1)

    axes, columns = np.zeros((len(armature), 3, 3)), np.zeros((len(paths.bones), 3, 3))
    for bone in set(paths.bones):
        above = multiply(frames[armature.parents[bone]], armature.rotations[bone])
        turn_axes(above, turns[bone], axes[bone])
    mobile = np.ones((len(armature), 3), np.int32)
    fill_columns(paths.starts, paths.bones, kinds, mobile, origins, axes, tips, columns)
    system = np.zeros((3 * len(leaves), 3 * len(leaves)))
    assemble(paths.starts, paths.bones, paths.shared, kinds, columns, scale, system)
    close = 1e-5 * max(1.0, float(np.abs(system).max()))
    assert np.allclose(np.tril(system), np.tril(j @ j.T), atol=close)

    forces, steps = rng.normal(size=3 * len(leaves)), np.zeros((len(armature), 3))
    fill_steps(paths.starts, paths.bones, kinds, columns, scale, forces, steps)
    assert np.allclose(steps.ravel(), j.T @ forces, atol=close)

    values = forces.copy()
    solve(system, 0.5, values)
    expected = np.linalg.solve(j @ j.T + 0.5 * np.eye(len(forces)), forces)
    assert np.allclose(values, expected, atol=1e-4)


@given(seed=SEEDS, length=st.floats(0.0, 1.0))
def test_a_stiff_bone_does_not_turn_that_way_and_turns_freely_across(
    seed: int, length: float
) -> None:
    rng = np.random.default_rng(seed)
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    across = np.cross(way, rng.normal(size=3))
    steps = np.array([way, across])[:, :, None].copy()
    stiffen(np.zeros(2, np.int32), np.array([way, way]) * length, steps, True)
    assert np.allclose(steps[0, :, 0], way * (1.0 - length**2))
    assert np.allclose(steps[1, :, 0], across)
