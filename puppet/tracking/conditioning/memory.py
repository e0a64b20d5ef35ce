"""What conditioning remembers of one performer, as flat arrays that its kernels work on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from puppet.kernel import Floats, Ints
from puppet.skeleton import JOINT_COUNT

#: What has become of a joint in this frame: it is not there; it is where it cannot be and not
#: believed; it is where it was to be expected; it was not, and is there again.
LOST, DOUBTED, BELIEVED, FOUND = 0, 1, 2, 3


class Memory(NamedTuple):
    """Joints in rows, metres in the stage frame, seconds.

    Seen: believed (20, 3), where each was when it was last believed. unseen (20,), time since.
    lost (20,), time without it. status (20,), of this frame. trust (20,) 0..1, how freely it may
    move. gap (1,), whether nobody knows what happened since the frame before.

    Filtered: filtered (20, 3). velocity (20, 3) m/s on its anchor, smoothed. times (20,), how often
    it was filtered since it was found. ahead (20, 3), filtered, and predicted as the filter itself
    does. pace, lead (20, 3), of `prediction`. predicted (20, 3), with the lead.

    Shown: hung (20,), the joint that each hangs on among those that are there; -1 for none, -2 if
    it is itself not there. turn, turning (20, 3), a rotation vector and its velocity, by which it
    is still away from where its bone should point; stretch (20, 2), the logarithm of how much too
    long the bone is, and its velocity; shift, shifting (20, 3), metres, the same for what hangs on
    nothing; rate (20,) of all these. yaw (3,), of the whole body: angle, velocity, rate. framed
    (1,), whether hips or shoulders told the heading. shown (20, 3).

    Felt: influence (20, 2), value and velocity. home (4,): where the hip is at rest, and heading.
    """

    believed: Floats
    unseen: Floats
    lost: Floats
    status: Ints
    trust: Floats
    gap: Ints
    filtered: Floats
    velocity: Floats
    times: Ints
    ahead: Floats
    pace: Floats
    lead: Floats
    predicted: Floats
    hung: Ints
    turn: Floats
    turning: Floats
    stretch: Floats
    shift: Floats
    shifting: Floats
    rate: Floats
    yaw: Floats
    framed: Ints
    shown: Floats
    influence: Floats
    home: Floats


def empty() -> Memory:
    """Nobody was seen yet."""

    def each(*shape: int) -> Floats:
        return np.zeros((JOINT_COUNT, *shape))

    def counts(size: int = JOINT_COUNT) -> Ints:
        return np.zeros(size, np.int32)

    return Memory(
        believed=each(3),
        unseen=each(),
        lost=each(),
        status=counts(),
        trust=each(),
        gap=counts(1),
        filtered=each(3),
        velocity=each(3),
        times=counts(),
        ahead=each(3),
        pace=each(3),
        lead=each(3),
        predicted=each(3),
        hung=counts(),
        turn=each(3),
        turning=each(3),
        stretch=each(2),
        shift=each(3),
        shifting=each(3),
        rate=each(),
        yaw=np.zeros(3),
        framed=counts(1),
        shown=each(3),
        influence=each(2),
        home=np.zeros(4),
    )
