"""Inverse kinematics of a whole armature at once: damped least squares on its end effectors.

Each iteration asks which small turns of the bones would move all tips to their goals, as a linear
problem: ``(J Jᵀ + λ) y = e`` with the errors e of the tips, then ``Jᵀ y`` are the turns. J Jᵀ is
never built from J: a ball joint at distance r from one tip and t from another adds the block
``(r·t) I − t rᵀ``, so that it is a sum over what two paths share.

What makes it steady enough to be looked at:

* it always starts from the pose that the mapping gave, and remembers nothing: no drift;
* it always does the same number of iterations: to stop at a tolerance is to jitter about it;
* the damping λ is counted in J Jᵀ's own size and grows with the errors: far goals are approached
  in steps that the linear problem can answer for, and what cannot be reached does not thrash;
* what is out of reach is asked for less (`reach.py`);
* a turn that would pass a limit ends on it, and the other bones are asked again with that known.
  Both answers are the same just where a limit begins to matter, so nothing jumps there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from puppet.armature import Armature
from puppet.errors import PuppetError
from puppet.kernel import Floats, Ints, kernel
from puppet.pose import Intent, Pose, _forward
from puppet.rotation import IDENTITY, conjugate, exp, log, multiply, normalized, rotate, shortest
from puppet.solvers.effector_paths import EffectorPaths
from puppet.solvers.joint_limits import BOUNDED, FREE, Bounds, clamp, clamp_bones
from puppet.solvers.reach import EASY, soft_distance

#: Damping, as a share of the mean of J Jᵀ's diagonal: always, and for errors as large as the reach.
_DAMPING, _ERROR_DAMPING = 1e-3, 3.0
#: Radians. All turns of one iteration together (root of the sum of squares) stay below.
_MOST = 1.0
#: Radians, by how much in all a straight chain is bent that shall fold to nothing.
_BEND = 1.5

_ORIGIN = np.zeros(3)
_ORIGIN.setflags(write=False)


@kernel
def _tips(effectors: Ints, ends: Floats, origins: Floats, frames: Floats, tips: Floats) -> None:
    for e in range(len(effectors)):
        bone = effectors[e]
        tips[e] = origins[bone] + rotate(frames[bone], ends[bone])


@kernel
def _turn_axes(above: Floats, vector: Floats, axes: Floats) -> None:
    """How a bone turns as its rotation vector's components grow: axes (3, 3), a row for each."""
    angle2 = vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2
    if angle2 < 1e-8:
        first, second = 0.5, 1.0 / 6.0
    else:
        angle = math.sqrt(angle2)
        first = (1.0 - math.cos(angle)) / angle2
        second = (angle - math.sin(angle)) / (angle2 * angle)
    for i in range(3):
        unit = np.zeros(3)
        unit[i] = 1.0
        once = np.cross(vector, unit)
        axes[i] = rotate(above, unit + first * once + second * np.cross(vector, once))


@kernel
def _columns(
    starts: Ints,
    path: Ints,
    kinds: Ints,
    lower: Floats,
    upper: Floats,
    origins: Floats,
    axes: Floats,
    tips: Floats,
    columns: Floats,
) -> None:
    """For each bone of each path the arm from it to the tip, or how its axes move the tip."""
    for e in range(len(tips)):
        for k in range(starts[e], starts[e + 1]):
            bone = path[k]
            arm = tips[e] - origins[bone]
            if kinds[bone] == FREE:
                columns[k, 0] = arm
                continue
            for i in range(3):
                if upper[bone, i] > lower[bone, i]:
                    columns[k, i] = np.cross(axes[bone, i], arm)
                else:
                    columns[k, i] = 0.0


@kernel
def _assemble(
    starts: Ints,
    path: Ints,
    shared: Ints,
    kinds: Ints,
    stopped: Ints,
    columns: Floats,
    scale: Floats,
    system: Floats,
) -> None:
    """The lower triangle of J Jᵀ, without the bones that are stopped. (3E, 3E)"""
    for e in range(len(scale)):
        for f in range(e + 1):
            block = np.zeros((3, 3))
            for step in range(shared[e, f]):
                a, b = starts[e] + step, starts[f] + step
                bone = path[a]
                if stopped[bone]:
                    continue
                if kinds[bone] == FREE:
                    dot = 0.0
                    for i in range(3):
                        dot += columns[a, 0, i] * columns[b, 0, i]
                        for j in range(3):
                            block[i, j] -= columns[b, 0, i] * columns[a, 0, j]
                    for i in range(3):
                        block[i, i] += dot
                else:
                    for axis in range(3):
                        for i in range(3):
                            for j in range(3):
                                block[i, j] += columns[a, axis, i] * columns[b, axis, j]
            for i in range(3):
                for j in range(3):
                    system[3 * e + i, 3 * f + j] = scale[e] * scale[f] * block[i, j]


@kernel
def _solve(system: Floats, damping: float, values: Floats) -> None:
    """Cholesky of the lower triangle of `system` + damping; `values` become the solution."""
    count = len(values)
    for j in range(count):
        total = system[j, j] + damping
        for k in range(j):
            total -= system[j, k] ** 2
        system[j, j] = math.sqrt(total)
        for i in range(j + 1, count):
            total = system[i, j]
            for k in range(j):
                total -= system[i, k] * system[j, k]
            system[i, j] = total / system[j, j]
    for i in range(count):
        total = values[i]
        for k in range(i):
            total -= system[i, k] * values[k]
        values[i] = total / system[i, i]
    for i in range(count - 1, -1, -1):
        total = values[i]
        for k in range(i + 1, count):
            total -= system[k, i] * values[k]
        values[i] = total / system[i, i]


@kernel
def _steps(
    starts: Ints,
    path: Ints,
    kinds: Ints,
    stopped: Ints,
    columns: Floats,
    scale: Floats,
    forces: Floats,
    steps: Floats,
) -> None:
    """Jᵀ y: each bone's turn, about the armature's axes if it is free, else about its own."""
    for k in range(len(path)):
        if not stopped[path[k]]:
            steps[path[k]] = 0.0
    for e in range(len(scale)):
        y = forces[3 * e : 3 * e + 3] * scale[e]
        for k in range(starts[e], starts[e + 1]):
            bone = path[k]
            if stopped[bone]:
                continue
            if kinds[bone] == FREE:
                steps[bone] += np.cross(columns[k, 0], y)
            else:
                for i in range(3):
                    steps[bone, i] += np.dot(columns[k, i], y)


@kernel
def _stop_at_limits(
    active: Ints,
    kinds: Ints,
    lower: Floats,
    upper: Floats,
    limits: Floats,
    turns: Floats,
    steps: Floats,
    stopped: Ints,
) -> bool:
    """Shorten the steps that would pass a limit; those bones are stopped. Whether there are any."""
    some = False
    for k in range(len(active)):
        bone = active[k]
        if kinds[bone] == BOUNDED:
            there = turns[bone] + steps[bone]
            if clamp(there, lower[bone], upper[bone], limits[bone]):
                steps[bone] = there - turns[bone]
                stopped[bone] = 1
                some = True
    return some


@kernel
def _without_stopped(
    starts: Ints,
    path: Ints,
    stopped: Ints,
    columns: Floats,
    scale: Floats,
    steps: Floats,
    errors: Floats,
) -> None:
    """Take from the errors what the stopped bones' steps make good."""
    for e in range(len(scale)):
        for k in range(starts[e], starts[e + 1]):
            if stopped[path[k]]:
                for axis in range(3):
                    for i in range(3):
                        moved = steps[path[k], axis] * columns[k, axis, i]
                        errors[3 * e + i] -= scale[e] * moved


@kernel
def _bend_straight_chains(
    starts: Ints,
    path: Ints,
    bends: Floats,
    bases: Ints,
    reaches: Floats,
    kinds: Ints,
    goals: Floats,
    scale: Floats,
    origins: Floats,
    tips: Floats,
    turns: Floats,
    bones: Floats,
) -> None:
    for e in range(len(scale)):
        if scale[e] == 0.0:
            continue
        base = origins[bases[e]]
        now = np.linalg.norm(tips[e] - base)
        wanted = np.linalg.norm(goals[e] - base)
        straight = min(max(10.0 * now / reaches[e] - 9.0, 0.0), 1.0)
        fold = max(1.0 - wanted / max(now, 1e-12), 0.0)
        angle = _BEND * straight * fold / (starts[e + 1] - starts[e])
        for k in range(starts[e], starts[e + 1]):
            bone = path[k]
            if kinds[bone] == FREE:
                bones[bone] = multiply(bones[bone], exp(angle * bends[k]))
            else:
                turns[bone] += angle * bends[k]


@kernel
def _reach_for(
    parents: Ints,
    offsets: Floats,
    rests: Floats,
    ends: Floats,
    lower: Floats,
    upper: Floats,
    limits: Floats,
    kinds: Ints,
    active: Ints,
    effectors: Ints,
    bases: Ints,
    starts: Ints,
    path: Ints,
    shared: Ints,
    reaches: Floats,
    bends: Floats,
    origin: Floats,
    upright: Floats,
    wishes: Floats,
    weights: Floats,
    iterations: int,
    bones: Floats,
) -> None:
    """Turn `bones`, (B, 4) parent_from_bone, so that the tips come to `wishes`, (E, 3)."""
    count, tip_count = len(parents), len(effectors)
    origins, frames, tips = np.empty((count, 3)), np.empty((count, 4)), np.empty((tip_count, 3))
    turns, steps, axes = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3, 3))
    columns = np.zeros((len(path), 3, 3))
    system, errors = np.empty((3 * tip_count, 3 * tip_count)), np.empty(3 * tip_count)
    goals, scale = wishes.copy(), np.sqrt(weights)
    clamp_bones(rests, lower, upper, limits, kinds, bones)
    for k in range(len(active)):
        bone = active[k]
        if kinds[bone] == BOUNDED:
            turns[bone] = log(shortest(multiply(conjugate(rests[bone]), bones[bone])))
    _forward(parents, offsets, origin, upright, bones, origins, frames)
    _tips(effectors, ends, origins, frames, tips)
    for e in range(tip_count):
        if scale[e] > 0.0:
            base = origins[bases[e]]
            far = np.linalg.norm(wishes[e] - base)
            start = max(EASY * reaches[e], min(np.linalg.norm(tips[e] - base), reaches[e]))
            if far > start:
                goals[e] = base + (wishes[e] - base) * (soft_distance(far, reaches[e], start) / far)
    _bend_straight_chains(
        starts, path, bends, bases, reaches, kinds, goals, scale, origins, tips, turns, bones
    )
    for _ in range(iterations):
        for k in range(len(active)):
            bone = active[k]
            if kinds[bone] == BOUNDED:
                clamp(turns[bone], lower[bone], upper[bone], limits[bone])
                bones[bone] = multiply(rests[bone], exp(turns[bone]))
        _forward(parents, offsets, origin, upright, bones, origins, frames)
        _tips(effectors, ends, origins, frames, tips)
        for k in range(len(active)):
            bone = active[k]
            if kinds[bone] == BOUNDED:
                _turn_axes(multiply(frames[parents[bone]], rests[bone]), turns[bone], axes[bone])
        _columns(starts, path, kinds, lower, upper, origins, axes, tips, columns)
        stopped = np.zeros(count, np.int32)
        _assemble(starts, path, shared, kinds, stopped, columns, scale, system)
        size, miss = 0.0, 0.0
        for e in range(tip_count):
            for i in range(3):
                errors[3 * e + i] = scale[e] * (goals[e, i] - tips[e, i])
                size += system[3 * e + i, 3 * e + i]
                if scale[e] > 0.0:
                    miss += (errors[3 * e + i] / reaches[e]) ** 2
        size /= 3.0 * max(weights.sum(), 1e-12)
        damping = size * (_DAMPING + _ERROR_DAMPING * miss) + 1e-30
        forces = errors.copy()
        _solve(system, damping, forces)
        _steps(starts, path, kinds, stopped, columns, scale, forces, steps)
        # Less is asked for where all the turns together would be too much for a linear answer.
        less = 1.0 / math.sqrt(1.0 + np.sum(steps**2) / _MOST**2)
        steps *= less
        if _stop_at_limits(active, kinds, lower, upper, limits, turns, steps, stopped):
            errors *= less
            _without_stopped(starts, path, stopped, columns, scale, steps, errors)
            _assemble(starts, path, shared, kinds, stopped, columns, scale, system)
            _solve(system, damping, errors)
            _steps(starts, path, kinds, stopped, columns, scale, errors, steps)
        for k in range(len(active)):
            bone = active[k]
            if kinds[bone] == FREE:
                inner = rotate(conjugate(frames[parents[bone]]), steps[bone])
                bones[bone] = normalized(multiply(exp(inner), bones[bone]))
            else:
                turns[bone] += steps[bone]
    for k in range(len(active)):
        bone = active[k]
        if kinds[bone] == BOUNDED:
            clamp(turns[bone], lower[bone], upper[bone], limits[bone])
            bones[bone] = multiply(rests[bone], exp(turns[bone]))


class DampedJacobian:
    """A solver: turns the bones of `armature` so that the tips of `effectors` come to their goals.

    A goal is a position of the bone's tip in the armature's frame, so the root transform has no
    part in it; a goal's rotation is not looked at. Roots keep the base pose's rotation, bones that
    slide or are fixed do not turn, and all others stay within their limits. A goal out of reach,
    or two that contradict each other, are met as well as can be. Goals that are not finite do not
    count. Several goals of one bone count as their weighted mean.
    """

    def __init__(self, armature: Armature, effectors: Sequence[int], iterations: int = 16) -> None:
        self.armature = armature
        self.effectors = tuple(int(effector) for effector in effectors)
        self.iterations = iterations
        bounds = Bounds.of(armature)
        paths = EffectorPaths.of(armature, self.effectors, bounds)
        self.reaches = paths.reaches
        roots = armature.parents < 0
        kinds = np.where(roots, FREE, bounds.kinds).astype(np.int32)
        kinds.setflags(write=False)
        active = np.unique(paths.bones).astype(np.int32)
        active.setflags(write=False)
        self._constants = (
            armature.parents,
            armature.offsets,
            armature.rotations,
            armature.tips,
            bounds.lower,
            bounds.upper,
            bounds.limits,
            kinds,
            active,
            paths.effectors,
            paths.bases,
            paths.starts,
            paths.bones,
            paths.shared,
            paths.reaches,
            paths.bends,
            _ORIGIN,
            IDENTITY,
        )

    def __call__(self, intent: Intent) -> Pose:
        """The pose nearest to the goals, found from the intent's base pose and from nothing else.

        Raises PuppetError for a goal of a bone that is not one of the effectors.
        """
        bones = np.array(intent.base.bones, float, order="C")
        positions, weights = self._wishes(intent)
        if weights.any():
            _reach_for(*self._constants, positions, weights, self.iterations, bones)
        return Pose(intent.base.translation, intent.base.rotation, bones)

    def _wishes(self, intent: Intent) -> tuple[Floats, Floats]:
        """Goal positions (E, 3) and weights (E,), the heaviest 1; without a goal 0."""
        positions, weights = np.zeros((len(self.effectors), 3)), np.zeros(len(self.effectors))
        for goal in intent.goals:
            if goal.bone not in self.effectors:
                names = self.armature.names
                raise PuppetError(
                    "a goal for a bone that is not an end effector",
                    where=self.armature.name,
                    expected=f"one of {', '.join(names[bone] for bone in self.effectors)}",
                    found=names[goal.bone] if 0 <= goal.bone < len(names) else str(goal.bone),
                )
            position = np.asarray(goal.position, float)
            effector = self.effectors.index(goal.bone)
            usable = goal.weight > 0.0 and math.isfinite(goal.weight) and self.reaches[effector] > 0
            if usable and np.isfinite(position).all():
                weights[effector] += goal.weight
                share = goal.weight / weights[effector]
                positions[effector] += (position - positions[effector]) * share
        return positions, weights / max(float(weights.max(initial=0.0)), 1e-300)
