"""What several cameras saw of one performer → one skeleton.

A body lies beside where it is by a few centimetres in each camera, all of it together, mostly along
the line of sight: cameras first agree about the body's place, and then about each joint on it. An
arm that one camera alone sees so stays on its shoulder.

Between two steps a joint goes the way on which the cameras that saw it both times agree; towards
where it belongs it is eased. So nothing jumps when a camera comes, goes, or changes its mind.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from puppet.kernel import Bytes, Floats, Ints, kernel
from puppet.skeleton import JOINT_COUNT
from puppet.tracking.conditioning.one_euro import blend
from puppet.tracking.conditioning.spring import ease_off, gentle, rate_of
from puppet.tracking.fusion.memory import Fused, Lenses, Seen
from puppet.tracking.fusion.outliers import QUARREL, leave_outliers
from puppet.tracking.fusion.place import agree_on_body
from puppet.tracking.fusion.weight import (
    INFERRED,
    MOVED_ON,
    add,
    distance,
    guess_error,
    solve,
    weigh,
)

#: Seconds after which what a camera saw is no longer used, and after which it is inferred.
STALE: Final = 0.25
OLD: Final = 0.15
#: Half-lives, s: of velocities, and of easing to where a joint belongs.
VELOCITY: Final = 0.05
EASE: Final = 0.15
#: Nothing is eased faster than this, m/s: the bound on what fusion adds to the cameras' own motion.
FASTEST: Final = 0.5
#: No joint is taken to be faster, m/s.
_FASTEST_JOINT: Final = 8.0
#: Metres, and m/s: nobody sees so little, and it is what rounding leaves.
_NOTHING: Final = 1e-9


@kernel
def take_in(
    slot: int, positions: Floats, states: Bytes, time: float, step: float, seen: Seen, m: Fused
) -> None:
    """Keep what a camera saw. step: seconds since what it saw before, by its own clock."""
    last, told = m.time[0], seen.times[slot]
    known = step > 1e-6 and step < STALE
    for joint in range(JOINT_COUNT):
        old, velocity = seen.positions[slot, joint], seen.velocities[slot, joint]
        if known and states[joint] > 0 and seen.states[slot, joint] > 0:
            first = not velocity.any()  # which is believed as it is
            velocity += (1.0 if first else blend(VELOCITY, step)) * (
                (positions[joint] - old) / step - velocity
            )
            speed = math.sqrt((velocity * velocity).sum())
            if speed > _FASTEST_JOINT:
                velocity *= _FASTEST_JOINT / speed
            if time <= last:
                seen.anchors[slot, joint] = positions[joint] + velocity * min(last - time, MOVED_ON)
            elif told <= last:
                share = (last - told) / (time - told)
                seen.anchors[slot, joint] = old + share * (positions[joint] - old)
        else:
            velocity[:] = 0.0
            seen.steady[slot, joint] = 0
        seen.positions[slot, joint] = positions[joint]
        seen.states[slot, joint] = states[joint]
    seen.times[slot] = time


@kernel
def fuse(time: float, trunk: Ints, seen: Seen, lenses: Lenses, m: Fused) -> None:
    """Go on to `time`, seconds: fill in positions and states of `m`. trunk: `fusion_body.TRUNK`."""
    slots = len(seen.times)
    places = np.zeros((slots, JOINT_COUNT, 3))
    errors = np.zeros((slots, JOINT_COUNT))
    states = np.zeros((slots, JOINT_COUNT), np.uint8)
    shifts = np.zeros((slots, 3))
    moved, middle = np.zeros(3), np.zeros(3)
    dt = time - m.time[0]
    goes_on = dt < STALE  # not after a pause, and not the first time: NaN
    _move_on(time, seen, places, errors, states)
    agree_on_body(goes_on, trunk, places, errors, states, lenses, m, shifts)
    on_body = places.copy()
    for slot in range(slots):
        on_body[slot] -= shifts[slot]
    for joint in range(JOINT_COUNT):
        there = goes_on and m.states[joint] > 0
        if there:
            moved[:] = m.positions[joint] + dt * m.velocities[joint]
        quarrel, unclear = leave_outliers(joint, moved, there, on_body, states, lenses)
        m.quarrel[joint] = m.quarrel[joint] + dt if quarrel and goes_on else 0.0
        state = _means(
            joint,
            time,
            there,
            places,
            on_body,
            errors,
            states,
            seen,
            lenses,
            m,
            moved,
            middle,
        )
        if (unclear or m.quarrel[joint] > QUARREL) and state == 2:
            state = 1
        m.states[joint] = state
        if state == 0:
            m.positions[joint] = 0.0
            m.velocities[joint] = 0.0
            continue
        if there:
            _ease(joint, moved, middle, dt, m)
        else:
            m.rest[joint] = 0.0
            m.resting[joint] = 0.0
            m.velocities[joint] = 0.0
        for axis in range(3):
            now = middle[axis] + m.rest[joint, axis]
            if there:
                speed = (now - m.positions[joint, axis]) / dt
                m.velocities[joint, axis] += blend(VELOCITY, dt) * (
                    speed - m.velocities[joint, axis]
                )
            m.positions[joint, axis] = now
    _set_anchors(time, places, seen)
    m.time[0] = time


@kernel
def _move_on(time: float, seen: Seen, places: Floats, errors: Floats, states: Bytes) -> None:
    """Where each camera's joints are at `time`, how wrong that may be, and their states."""
    for slot in range(len(seen.times)):
        age = time - seen.times[slot]
        if not abs(age) <= STALE:
            continue
        ahead = min(max(age, -MOVED_ON), MOVED_ON)
        for joint in range(JOINT_COUNT):
            velocity = seen.velocities[slot, joint]
            places[slot, joint] = seen.positions[slot, joint] + ahead * velocity
            errors[slot, joint] = guess_error(math.sqrt((velocity * velocity).sum()), age)
            states[slot, joint] = seen.states[slot, joint]


@kernel
def _set_anchors(time: float, places: Floats, seen: Seen) -> None:
    """From here on each camera's joints are followed further."""
    for slot in range(len(seen.times)):
        here = abs(time - seen.times[slot]) <= STALE
        for joint in range(JOINT_COUNT):
            seen.steady[slot, joint] = here and seen.states[slot, joint] > 0
        seen.anchors[slot] = places[slot]


@kernel
def _means(
    joint: int,
    time: float,
    there: bool,
    places: Floats,
    on_body: Floats,
    errors: Floats,
    states: Bytes,
    seen: Seen,
    lenses: Lenses,
    m: Fused,
    moved: Floats,
    middle: Floats,
) -> int:
    """Fill in where a joint has moved to and where it belongs, (3,), and say its state.

    It has moved as it did in those cameras that saw it before; if none did, as was expected.
    """
    weight, total, before = np.zeros(6), np.zeros(9), np.zeros(9)
    moving = np.zeros(3)
    best = used = felt = 0
    for slot in range(len(places)):
        state = states[slot, joint]
        if state == 0:
            continue
        place, guess = places[slot, joint], errors[slot, joint]
        worse = 1.0 if state == 2 else INFERRED
        across = math.sqrt((worse * lenses.across[slot]) ** 2 + guess * guess)
        along = math.sqrt((worse * lenses.along[slot]) ** 2 + guess * guess)
        weigh(place, lenses.places[slot], lenses.known[slot] > 0, across, along, weight)
        add(total, weight, on_body[slot, joint])
        middle[:] = on_body[slot, joint]  # bit for bit, if there is no other
        used += 1
        if there and seen.steady[slot, joint] > 0:
            moving[:] = m.positions[joint] + place - seen.anchors[slot, joint]
            add(before, weight, moving)
            felt += 1
        if state == 2 and abs(time - seen.times[slot]) > OLD:
            state = 1
        best = max(best, state)
    if used > 1:
        solve(total, middle)
    if felt == 1:
        moved[:] = moving
    elif felt > 1:
        solve(before, moved)
    return best


@kernel
def _ease(joint: int, moved: Floats, middle: Floats, dt: float, m: Fused) -> None:
    """Let the joint go from where it moved towards where it belongs."""
    rest, speed = m.rest[joint], m.resting[joint]
    start = moved - middle
    way, quick = math.sqrt((start * start).sum()), math.sqrt((speed * speed).sum())
    if way < _NOTHING and quick < _NOTHING:
        rest[:] = 0.0
        speed[:] = 0.0
        return
    rest[:] = start
    ease_off(rest, speed, gentle(rate_of(EASE), way, FASTEST), dt)
    step = distance(rest, start)
    if step > FASTEST * dt:
        rest[:] = start + FASTEST * dt / step * (rest - start)
        speed[:] = (rest - start) / dt
