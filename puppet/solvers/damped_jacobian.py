"""Inverse kinematics of a whole armature at once: damped least squares on its end effectors.

Each iteration asks which small turns of the bones would move all tips to where they should be, as
a linear problem (`normal_equations.py`). What makes it steady enough to be looked at:

* it always starts from the pose that the mapping gave, and remembers nothing: no drift;
* it always does the same number of iterations: to stop at a tolerance is to jitter about it;
* the tips are led to their goals in even steps, round the point that they hang on, so that every
  problem is nearly linear and a far goal is reached by the same way as the near ones beside it;
* the damping is counted in the problem's own size and grows with the errors: what cannot be
  reached does not thrash, and a puppet a hundred times as large turns alike;
* what is out of reach is asked for less (`reach.py`), and a chain that is straight is bent a
  little to a side of its own before it is asked to fold (`straight_chains.py`);
* where turns would pass their limits, the bones are made stiff in that direction, the more the
  further, and all are asked again; so a limit is felt gradually, and nothing jumps where it begins.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from puppet.armature import Armature
from puppet.errors import PuppetError
from puppet.kernel import Floats, Ints, frozen, kernel
from puppet.pose import Intent, Pose, place_bones
from puppet.rotation import (
    IDENTITY,
    conjugate,
    exp,
    log,
    multiply,
    rotate,
    shortest,
    swing,
)
from puppet.solvers.effector_paths import EffectorPaths
from puppet.solvers.joint_limits import BOUNDED, FREE, Bounds, clamp, clamp_bones
from puppet.solvers.normal_equations import (
    assemble,
    fill_columns,
    fill_steps,
    solve,
    stiffen,
    turn_axes,
)
from puppet.solvers.reach import EASY, soft_distance
from puppet.solvers.straight_chains import bend_straight_chains, distance

#: The share of the iterations that lead the tips on their way; the others bring them to rest.
_LEADING = 0.75
#: Damping, as a share of the mean of J Jᵀ's diagonal: always, and for errors as large as the reach.
_DAMPING, _ERROR_DAMPING = 1e-3, 1.0
#: Radians. All turns of one iteration together (root of the sum of squares) stay below.
_MOST = 3.0
#: Radians. A bone that would pass its limit by as much is half as easy to turn in that direction.
_GIVE = 0.02

_ORIGIN = frozen(np.zeros(3))


@kernel
def _place(
    parents: Ints,
    offsets: Floats,
    rests: Floats,
    ends: Floats,
    kinds: Ints,
    active: Ints,
    effectors: Ints,
    origin: Floats,
    upright: Floats,
    turns: Floats,
    bones: Floats,
    origins: Floats,
    frames: Floats,
    tips: Floats,
) -> None:
    """Forward kinematics, in the armature's frame; bounded bones are as `turns`, (B, 3), says."""
    for bone in active:
        if kinds[bone] == BOUNDED:
            bones[bone] = multiply(rests[bone], exp(turns[bone]))
    place_bones(parents, offsets, origin, upright, bones, origins, frames)
    for e in range(len(effectors)):
        tips[e] = origins[effectors[e]] + rotate(frames[effectors[e]], ends[effectors[e]])


@kernel
def _turn_free_bone(above: Floats, step: Floats, bone: Floats) -> None:
    """Turn `bone`, (4,) parent_from_bone, by `step`, (3,) rad in the armature's frame, in place.

    above: (4,) armature_from_parent. In scalars, because this is where most of the time would go.
    """
    px, py, pz, pw = -above[0], -above[1], -above[2], above[3]
    sx, sy, sz = step[0], step[1], step[2]
    tx, ty, tz = 2.0 * (py * sz - pz * sy), 2.0 * (pz * sx - px * sz), 2.0 * (px * sy - py * sx)
    x = sx + pw * tx + py * tz - pz * ty
    y = sy + pw * ty + pz * tx - px * tz
    z = sz + pw * tz + px * ty - py * tx
    angle = math.sqrt(x * x + y * y + z * z)
    factor = math.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    x, y, z, w = x * factor, y * factor, z * factor, math.cos(0.5 * angle)
    bx, by, bz, bw = bone[0], bone[1], bone[2], bone[3]
    nx = w * bx + x * bw + y * bz - z * by
    ny = w * by - x * bz + y * bw + z * bx
    nz = w * bz + x * by - y * bx + z * bw
    nw = w * bw - x * bx - y * by - z * bz
    length = math.sqrt(nx * nx + ny * ny + nz * nz + nw * nw)
    bone[0], bone[1], bone[2], bone[3] = nx / length, ny / length, nz / length, nw / length


@kernel
def _stiffen_at_limits(
    active: Ints,
    kinds: Ints,
    lower: Floats,
    upper: Floats,
    limits: Floats,
    turns: Floats,
    steps: Floats,
    stiffness: Floats,
) -> bool:
    """Fill `stiffness`, (B, 3), from how far steps would pass a limit. Whether any would."""
    some = False
    for bone in active:
        if kinds[bone] != BOUNDED:
            continue
        wanted = turns[bone] + steps[bone]
        there = wanted.copy()
        stiffness[bone] = 0.0
        if clamp(there, lower[bone], upper[bone], limits[bone]):
            beyond = distance(wanted, there)
            rigid = 1.0 - math.sqrt(_GIVE / (_GIVE + beyond))
            stiffness[bone] = (wanted - there) * (math.sqrt(rigid) / beyond)
            some = True
    return some


@kernel
def _solve_for_steps(
    starts: Ints,
    path: Ints,
    kinds: Ints,
    columns: Floats,
    scale: Floats,
    errors: Floats,
    damping: float,
    system: Floats,
    steps: Floats,
) -> None:
    """Fill `steps`, (B, 3) rad, with turns that take away `errors`, (3E,) m; uses `system` up."""
    forces = errors.copy()
    solve(system, damping, forces)
    fill_steps(starts, path, kinds, columns, scale, forces, steps)
    # Less is done where all the turns together would be too much for a linear answer.
    steps *= 1.0 / math.sqrt(1.0 + np.sum(steps**2) / _MOST**2)


@kernel
def _before(befores: Ints, weights: Floats, e: int) -> int:
    """The effector that `e` hangs on: the nearest on its path that has a goal; -1 for none."""
    before = int(befores[e])
    while before >= 0 and weights[before] == 0.0:
        before = int(befores[before])
    return before


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
    mobile: Ints,
    active: Ints,
    effectors: Ints,
    starts: Ints,
    path: Ints,
    shared: Ints,
    reaches: Floats,
    bend_axes: Floats,
    befores: Ints,
    order: Ints,
    origin: Floats,
    upright: Floats,
    wishes: Floats,
    weights: Floats,
    iterations: int,
    bones: Floats,
) -> None:
    """Turn `bones`, (B, 4) parent_from_bone, so that the tips come to `wishes`, (E, 3) metres."""
    count, tip_count = len(parents), len(effectors)
    origins, frames, tips = np.empty((count, 3)), np.empty((count, 4)), np.empty((tip_count, 3))
    turns, steps, axes = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3, 3))
    stiffness, columns = np.zeros((count, 3)), np.zeros((len(path), 3, 3))
    system, errors = np.empty((3 * tip_count, 3 * tip_count)), np.empty(3 * tip_count)
    scale, total_weight = np.sqrt(weights), np.sum(weights)
    clamp_bones(rests, lower, upper, limits, kinds, bones)
    if total_weight == 0.0:
        return
    for bone in active:
        if kinds[bone] == BOUNDED:
            turns[bone] = log(shortest(multiply(conjugate(rests[bone]), bones[bone])))
    place_bones(parents, offsets, origin, upright, bones, origins, frames)
    for e in range(tip_count):
        tips[e] = origins[effectors[e]] + rotate(frames[effectors[e]], ends[effectors[e]])

    # Goals that are out of reach come nearer; then each is seen from the anchor of its effector.
    goals, anchors, anchor_goals = wishes.copy(), np.zeros((tip_count, 3)), np.zeros((tip_count, 3))
    firsts = np.zeros(tip_count, np.int32)
    for e in order:
        if weights[e] == 0.0:
            continue
        base = origins[path[starts[e]]]
        far = distance(wishes[e], base)
        easy = max(EASY * reaches[e], min(distance(tips[e], base), reaches[e]))
        if far > easy:
            goals[e] = base + (wishes[e] - base) * (soft_distance(far, reaches[e], easy) / far)
        before = _before(befores, weights, e)
        firsts[e] = starts[e]
        anchors[e], anchor_goals[e] = base, base
        if before >= 0:
            firsts[e] += starts[before + 1] - starts[before]
            anchors[e], anchor_goals[e] = tips[before], goals[before]

    bends = np.zeros((len(path), 3))
    bend_straight_chains(
        starts,
        path,
        firsts,
        bend_axes,
        reaches,
        weights,
        anchors,
        anchor_goals,
        tips,
        goals,
        origins,
        bends,
    )
    for k in range(len(path)):
        bone = path[k]
        if kinds[bone] == FREE:
            bones[bone] = multiply(bones[bone], exp(bends[k]))
        else:
            turns[bone] += bends[k]
            clamp(turns[bone], lower[bone], upper[bone], limits[bone])

    led, arms, swings = goals.copy(), np.zeros((tip_count, 3)), np.zeros((tip_count, 3))
    growth = np.zeros(tip_count)
    for iteration in range(iterations):
        _place(
            parents,
            offsets,
            rests,
            ends,
            kinds,
            active,
            effectors,
            origin,
            upright,
            turns,
            bones,
            origins,
            frames,
            tips,
        )
        way = min((iteration + 1) / (_LEADING * iterations), 1.0)
        for e in order:
            if weights[e] == 0.0:
                continue
            before = _before(befores, weights, e)
            if iteration == 0:
                arms[e] = tips[e] - (tips[before] if before >= 0 else anchors[e])
                wanted = goals[e] - anchor_goals[e]
                swings[e] = log(swing(arms[e], wanted))
                length = math.sqrt(np.sum(arms[e] ** 2))
                growth[e] = math.sqrt(np.sum(wanted**2)) / max(length, 1e-12) - 1.0
            anchor = led[before] if before >= 0 else anchors[e]
            led[e] = goals[e]
            if way < 1.0:
                led[e] = anchor + rotate(exp(way * swings[e]), arms[e]) * (1.0 + way * growth[e])

        for bone in active:
            if kinds[bone] == BOUNDED:
                turn_axes(multiply(frames[parents[bone]], rests[bone]), turns[bone], axes[bone])
        fill_columns(starts, path, kinds, mobile, origins, axes, tips, columns)
        assemble(starts, path, shared, kinds, columns, scale, system)
        size, miss = 0.0, 0.0
        for e in range(tip_count):
            for i in range(3):
                error = scale[e] * (led[e, i] - tips[e, i])
                errors[3 * e + i] = error
                size += system[3 * e + i, 3 * e + i] / (3.0 * total_weight)
                miss += (error / max(reaches[e], 1e-12)) ** 2
        damping = size * (_DAMPING + _ERROR_DAMPING * miss) + 1e-30
        _solve_for_steps(starts, path, kinds, columns, scale, errors, damping, system, steps)
        if _stiffen_at_limits(active, kinds, lower, upper, limits, turns, steps, stiffness):
            stiffen(path, stiffness, columns, False)
            assemble(starts, path, shared, kinds, columns, scale, system)
            _solve_for_steps(starts, path, kinds, columns, scale, errors, damping, system, steps)
            stiffen(path, stiffness, steps.reshape((count, 3, 1)), True)
        for bone in active:
            if kinds[bone] == FREE:
                _turn_free_bone(frames[parents[bone]], steps[bone], bones[bone])
            else:
                turns[bone] += steps[bone]
                clamp(turns[bone], lower[bone], upper[bone], limits[bone])
    for bone in active:
        if kinds[bone] == BOUNDED:
            bones[bone] = multiply(rests[bone], exp(turns[bone]))


class DampedJacobian:
    """A solver: turns the bones of `armature` so that the tips of `effectors` come to their goals.

    A goal is a position of the bone's tip in the armature's frame, so the root transform has no
    part in it; a goal's rotation is not looked at. Roots keep the base pose's rotation, bones that
    slide or are fixed do not turn, and all others stay within their limits. A goal out of reach,
    or two that contradict each other, are met as well as can be. Goals that are not finite do not
    count. Several goals of one bone count as their weighted mean.

    effectors: bones, by index. reaches: (E,) metres, how far each tip can be from its path's base.
    iterations: always as many; 16 lead from the rest pose to any goal in reach.
    """

    def __init__(self, armature: Armature, effectors: Sequence[int], iterations: int = 16) -> None:
        self.armature = armature
        self.effectors = tuple(int(effector) for effector in effectors)
        self.iterations = iterations
        bounds = Bounds.of(armature)
        paths = EffectorPaths.of(armature, self.effectors, bounds)
        self.reaches = paths.reaches
        self._constants = (
            armature.parents,
            armature.offsets,
            armature.rotations,
            armature.tips,
            bounds.lower,
            bounds.upper,
            bounds.limits,
            frozen(np.where(armature.parents < 0, FREE, bounds.kinds), np.int32),
            frozen(bounds.upper > bounds.lower, np.int32),
            frozen(np.unique(paths.bones), np.int32),
            paths.effectors,
            paths.starts,
            paths.bones,
            paths.shared,
            paths.reaches,
            paths.bends,
            paths.befores,
            paths.order,
            _ORIGIN,
            IDENTITY,
        )

    def __call__(self, intent: Intent) -> Pose:
        """The pose nearest to the goals, found from the intent's base pose and from nothing else.

        Raises PuppetError for a goal of a bone that is not one of the effectors.
        """
        bones = np.array(intent.base.bones, float, order="C")
        positions, weights = self._wishes(intent)
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
            effector = self.effectors.index(goal.bone)
            usable = self.reaches[effector] > 0.0 and 0.0 < goal.weight < math.inf
            if usable and np.isfinite(goal.position).all():
                weights[effector] += goal.weight
                share = goal.weight / weights[effector]
                positions[effector] += (goal.position - positions[effector]) * share
        return positions, weights / max(float(weights.max(initial=0.0)), 1e-300)
