"""What tests of inverse kinematics do over and over: pose, solve, and look how far off it is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from puppet.armature import Armature
from puppet.kernel import Floats, frozen
from puppet.pose import Goal, Intent, Pose, rest_pose
from puppet.rotation import IDENTITY, exp, multiply
from puppet.solvers.damped_jacobian import DampedJacobian
from tests.ik_workloads import tips_of


def chain(bones: int, length: float = 1.0) -> Armature:
    """A root that does not turn, and a straight chain along +X from the origin."""
    step = length / bones
    offsets = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]] + [[step, 0.0, 0.0]] * (bones - 1)
    return Armature.build(
        "chain",
        [f"b{bone}" for bone in range(bones + 1)],
        list(range(-1, bones)),
        offsets,
        tips=[[0.0, 0.0, 0.0]] + [[step, 0.0, 0.0]] * bones,
    )


def tree(seed: int) -> Armature:
    """A random armature, of creature-like depth."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(6, 25))
    parents = [-1] + [int(rng.integers(max(0, bone - 3), bone)) for bone in range(1, count)]
    names = [f"b{bone}" for bone in range(count)]
    return Armature.build("tree", names, parents, rng.normal(size=(count, 3)))


def turned(armature: Armature, seed: int, most: float) -> Pose:
    """A pose whose bones are turned from rest, about `most` rad each; the root stays."""
    turns = np.random.default_rng(seed).normal(size=(len(armature), 3)) * most / math.sqrt(3.0)
    turns[armature.parents < 0] = 0.0
    bones = [multiply(q, exp(turn)) for q, turn in zip(armature.rotations, turns, strict=True)]
    return Pose(np.zeros(3), IDENTITY.copy(), np.array(bones))


def solved(solver: DampedJacobian, goals: Floats) -> Pose:
    wishes = [Goal(bone, goal) for bone, goal in zip(solver.effectors, goals, strict=True)]
    return solver(Intent(rest_pose(solver.armature), tuple(wishes)))


def misses(solver: DampedJacobian, pose: Pose, goals: Floats) -> Floats:
    """(E,) how far tips are from their goals, as shares of their reach."""
    tips = tips_of(solver.armature, pose, solver.effectors)
    distances = np.linalg.norm(tips - goals, axis=1)
    return np.asarray(distances / np.maximum(solver.reaches, 1e-12))


def from_base(solver: DampedJacobian, goals: Floats) -> Floats:
    """(E,) how far goals are from the first bone that moves an effector, as shares of its reach."""
    armature, distances = solver.armature, []
    for effector, goal in zip(solver.effectors, goals, strict=True):
        bone = effector
        while armature.parents[armature.parents[bone]] >= 0:
            bone = armature.parents[bone]
        distances.append(np.linalg.norm(goal - armature.rest[0][bone]))
    return np.asarray(np.array(distances) / np.maximum(solver.reaches, 1e-12))


def jerk(values: Floats) -> Floats:
    """(frames - 3, ...) lengths of third differences of (frames, ..., 3)."""
    return np.asarray(np.linalg.norm(np.diff(values, 3, axis=0), axis=-1))


def limited(armature: Armature, seed: int) -> Armature:
    """Cones, boxes, hinges and bones with two axes, at random."""
    rng = np.random.default_rng(seed)
    count = len(armature)
    lower, upper = -rng.uniform(0.0, 1.0, (count, 3)), rng.uniform(0.0, 1.5, (count, 3))
    kept = rng.random((count, 3)) < rng.choice([0.0, 0.3, 0.6, 1.0], (count, 1))
    lower[~kept & (rng.random((count, 1)) < 0.5)] = 0.0
    upper[lower == 0.0] = 0.0
    open_bones = rng.random(count) < 0.3
    lower[open_bones], upper[open_bones] = -np.inf, np.inf
    limits = np.where(rng.random(count) < 0.5, rng.uniform(0.1, 1.5, count), np.inf)
    return replace(armature, lower=frozen(lower), upper=frozen(upper), limits=frozen(limits))
