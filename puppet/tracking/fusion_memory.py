"""What fusion remembers of one performer, as flat arrays that its kernels work on.

Each camera has a slot: a row of the arrays in `Seen`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from puppet.kernel import Bytes, Floats, Ints
from puppet.skeleton import JOINT_COUNT


class Seen(NamedTuple):
    """What each camera saw last. Metres in the stage frame, seconds on the fused clock.

    positions, velocities (K, 20, 3). states (K, 20). times (K,), NaN where a camera does not see
    the performer. offsets (K, 20, 3): by how much each lay beside the fused joint when that was
    given last; felt (K, 20): whether that is known.
    """

    positions: Floats
    velocities: Floats
    states: Bytes
    times: Floats
    offsets: Floats
    felt: Bytes


class Fused(NamedTuple):
    """What was given last. positions, velocities (20, 3), states (20,).

    rest, resting (20, 3): by how much each joint is still beside where it belongs, and how fast
    that changes. quarrel (20,): seconds since cameras disagree about a joint. time (1,), NaN before
    the first.
    """

    positions: Floats
    velocities: Floats
    states: Bytes
    rest: Floats
    resting: Floats
    quarrel: Floats
    time: Floats


class Lenses(NamedTuple):
    """The cameras. places (K, 3) metres, stage frame. known (K,): whether that is so. across, along
    (K,): standard deviations of a joint, metres; body_across, body_along (K,): of a whole body."""

    places: Floats
    known: Ints
    across: Floats
    along: Floats
    body_across: Floats
    body_along: Floats


def unseen(slots: int) -> Seen:
    """No camera has seen the performer."""
    return Seen(
        np.zeros((slots, JOINT_COUNT, 3)),
        np.zeros((slots, JOINT_COUNT, 3)),
        np.zeros((slots, JOINT_COUNT), np.uint8),
        np.full(slots, np.nan),
        np.zeros((slots, JOINT_COUNT, 3)),
        np.zeros((slots, JOINT_COUNT), np.uint8),
    )


def not_fused() -> Fused:
    """Nothing was given yet."""
    joints = (JOINT_COUNT, 3)
    return Fused(
        np.zeros(joints),
        np.zeros(joints),
        np.zeros(JOINT_COUNT, np.uint8),
        np.zeros(joints),
        np.zeros(joints),
        np.zeros(JOINT_COUNT),
        np.full(1, np.nan),
    )


def with_slots(seen: Seen, slots: int) -> Seen:
    """The same with more slots."""
    more = unseen(slots)
    for slot in range(len(seen.times)):
        copy_slot(slot, seen, more)
        more.felt[slot] = seen.felt[slot]
    return more


def copy_slot(slot: int, source: Seen, target: Seen) -> None:
    """Let `target` know what a camera saw; how that lies to what it made is another matter."""
    target.positions[slot] = source.positions[slot]
    target.velocities[slot] = source.velocities[slot]
    target.states[slot] = source.states[slot]
    target.times[slot] = source.times[slot]
    target.offsets[slot] = source.offsets[slot]
    target.felt[slot] = 0
