"""Inverse kinematics of three puppets against SciPy and against plain NumPy.

    python -m benchmarks.inverse_kinematics

The workloads are those of `tests/ik_workloads.py`: a creature of 25 bones with five goals, a snake
of 60 with two, an ostrich of 23 with three; every solver starts at rest in every frame. SciPy
minimizes the same distances over all rotation vectors with `least_squares`; NumPy takes the same
steps as the puppet's solver, with a dense J, a dense product and `numpy.linalg.solve`. Rounds
alternate and the median counts; accuracy and smoothness stand beside the time, because each of the
three can be had for the others.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from puppet.kernel import Floats
from puppet.pose import Pose, forward_kinematics
from puppet.solvers.damped_jacobian import DampedJacobian
from tests.ik_workloads import WORKLOADS, Workload, tips_of

ROUNDS = 5
#: Frames of the motion, and every how manyth of them a reference solves: it is too slow for all.
FRAMES, SPARSE = 240, 40
ITERATIONS = 16
#: Goals (E, 3) -> tips and then all bones' origins, (E + B, 3).
Way = Callable[[Floats], Floats]


class Dense:
    """J as a matrix over all bones, for the references. Angles are turns after the rest pose."""

    def __init__(self, workload: Workload) -> None:
        self.armature, self.effectors = workload.armature, workload.effectors
        self.rest = Rotation.from_quat(np.array(self.armature.rotations))
        self.turning = np.flatnonzero(self.armature.parents >= 0)
        self.moves = np.zeros((len(self.effectors), len(self.armature)), bool)
        for e, effector in enumerate(self.effectors):
            bone = effector
            while self.armature.parents[bone] >= 0:
                self.moves[e, bone] = True
                bone = int(self.armature.parents[bone])

    def place(self, local: Rotation) -> tuple[Floats, Floats, Floats]:
        """Bone origins (B, 3), armature_from_bone (B, 4) and tips (E, 3)."""
        pose = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), local.as_quat())
        origins, frames = forward_kinematics(self.armature, pose)
        return origins, frames, tips_of(self.armature, pose, self.effectors)

    def jacobian(self, origins: Floats, tips: Floats) -> Floats:
        """(3E, 3B): how tips move as bones turn about the armature's axes."""
        arms = np.where(self.moves[..., None], tips[:, None] - origins[None], 0.0)
        x, y, z = np.moveaxis(arms, -1, 0)
        nothing = np.zeros_like(x)
        rows = np.array([[nothing, z, -y], [-z, nothing, x], [y, -x, nothing]])
        return rows.transpose(2, 0, 3, 1).reshape(3 * len(tips), -1)


def numpy_dls(workload: Workload, reaches: Floats) -> Way:
    """The same update with dense matrices, led to the goals along straight lines."""
    dense = Dense(workload)

    def solve(goals: Floats) -> Floats:
        local = dense.rest
        origins, frames, tips = dense.place(local)
        first = tips
        for iteration in range(ITERATIONS):
            led = first + (goals - first) * min((iteration + 1) / (0.75 * ITERATIONS), 1.0)
            errors = led - tips
            j = dense.jacobian(origins, tips)
            square = j @ j.T
            miss = float(np.sum((errors / reaches[:, None]) ** 2))
            damping = np.trace(square) / len(square) * (1e-3 + miss)
            forces = np.linalg.solve(square + damping * np.eye(len(square)), errors.ravel())
            steps = (j.T @ forces).reshape(-1, 3)
            parents = np.maximum(dense.armature.parents, 0)
            inner = Rotation.from_quat(frames[parents]).inv().apply(steps)
            local = Rotation.from_rotvec(inner) * local
            origins, frames, tips = dense.place(local)
        return np.vstack([tips, origins])

    return solve


def scipy_least_squares(workload: Workload) -> Way:
    """Trust region over rotation vectors after rest, with J by its own differences."""
    dense = Dense(workload)

    def place(angles: Floats) -> Floats:
        turns = np.zeros((len(dense.armature), 3))
        turns[dense.turning] = angles.reshape(-1, 3)
        origins, _, tips = dense.place(dense.rest * Rotation.from_rotvec(turns))
        return np.vstack([tips, origins])

    def solve(goals: Floats) -> Floats:
        start = np.zeros(3 * len(dense.turning))

        def errors(angles: Floats) -> Floats:
            return (place(angles)[: len(goals)] - goals).ravel()

        return place(least_squares(errors, start, xtol=1e-6).x)

    return solve


def ours(workload: Workload, solver: DampedJacobian) -> Way:
    def solve(goals: Floats) -> Floats:
        pose = solver(workload.intent(goals))
        origins, _ = forward_kinematics(workload.armature, pose)
        return np.vstack([tips_of(workload.armature, pose, workload.effectors), origins])

    return solve


def jerk(values: Floats) -> float:
    return float(np.linalg.norm(np.diff(values, 3, axis=0), axis=-1).mean())


def seconds(way: Way, goals: Floats) -> float:
    started = time.perf_counter()
    for each in goals:
        way(each)
    return (time.perf_counter() - started) / len(goals)


def compare(name: str) -> bool:
    """Print a workload's rows. Whether the puppet's solver was within one percent of reach."""
    workload = WORKLOADS[name]()
    solver = DampedJacobian(workload.armature, workload.effectors, ITERATIONS)
    goals = workload.goals(FRAMES)
    sparse = goals[SPARSE // 2 :: SPARSE]
    intents = [workload.intent(each) for each in goals]
    ways: dict[str, Way] = {
        "NumPy, dense, same steps": numpy_dls(workload, np.array(solver.reaches)),
        "SciPy, least_squares": scipy_least_squares(workload),
    }
    answers = {"puppet": ours(workload, solver), **ways}
    misses: dict[str, float] = {}
    jerks: dict[str, str] = {}
    for label, way in answers.items():
        wished = sparse if label.startswith("SciPy") else goals
        points = np.array([way(each) for each in wished])
        apart = np.linalg.norm(points[:, : len(solver.reaches)] - wished, axis=-1)
        misses[label] = float((apart / solver.reaches).max())
        smooth = f"{jerk(points) / jerk(wished):.2f} × the goals'"
        jerks[label] = smooth if len(wished) == FRAMES else "not measured"
    times: dict[str, list[float]] = {label: [] for label in answers}
    for _ in range(ROUNDS):
        started = time.perf_counter()
        for intent in intents:
            solver(intent)
        times["puppet"].append((time.perf_counter() - started) / len(intents))
        for label, way in ways.items():
            times[label].append(seconds(way, sparse[:1] if label.startswith("SciPy") else sparse))
    fastest = statistics.median(times["puppet"])
    bones, count = len(workload.armature), len(workload.effectors)
    print(f"{name}: {bones} bones, {count} goals, median of {ROUNDS} alternating rounds")
    for label, values in times.items():
        median = statistics.median(values)
        print(
            f"  {label:<26} {1e6 * median:12.0f} µs {median / fastest:8.1f} ×"
            f"   worst miss {100 * misses[label]:8.3f} % of reach"
            f"   jerk {jerks[label]}"
        )
    return bool(misses["puppet"] < 0.01)


def main() -> None:
    met = [compare(name) for name in WORKLOADS]
    if not all(met):
        print("puppet's solver does not reach its goals")
        sys.exit(1)


if __name__ == "__main__":
    main()
