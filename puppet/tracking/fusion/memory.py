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
    the performer. anchors (K, 20, 3): where joints were when the fused ones were given last, if
    `steady` (K, 20) says that they have been seen since.
    """

    positions: Floats
    velocities: Floats
    states: Bytes
    times: Floats
    anchors: Floats
    steady: Bytes


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
        positions=np.zeros((slots, JOINT_COUNT, 3)),
        velocities=np.zeros((slots, JOINT_COUNT, 3)),
        states=np.zeros((slots, JOINT_COUNT), np.uint8),
        times=np.full(slots, np.nan),
        anchors=np.zeros((slots, JOINT_COUNT, 3)),
        steady=np.zeros((slots, JOINT_COUNT), np.uint8),
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
    return more


def copy_slot(slot: int, source: Seen, target: Seen) -> None:
    """Let `target` know what a camera saw."""
    target.positions[slot] = source.positions[slot]
    target.velocities[slot] = source.velocities[slot]
    target.states[slot] = source.states[slot]
    target.times[slot] = source.times[slot]
    target.anchors[slot] = source.anchors[slot]
    target.steady[slot] = source.steady[slot]
