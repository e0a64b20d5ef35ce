"""Where several cameras together take a performer's body to be, and who sees somebody else."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from puppet.kernel import Bytes, Floats, Ints, frozen, kernel
from puppet.skeleton import Joint
from puppet.tracking.fusion.memory import Fused, Lenses
from puppet.tracking.fusion.weight import INFERRED, add, distance, solve, weigh

#: Metres: cameras that see a body further apart do not see the same one.
BODY_DISAGREE: Final = 0.6
#: By these a body's place is told.
TRUNK: Final[Ints] = frozen(
    [
        Joint.HIP_CENTER,
        Joint.SPINE,
        Joint.SHOULDER_CENTER,
        Joint.SHOULDER_LEFT,
        Joint.SHOULDER_RIGHT,
        Joint.HIP_LEFT,
        Joint.HIP_RIGHT,
    ],
    np.int32,
)


@kernel
def agree_on_body(
    goes_on: bool,
    trunk: Ints,
    places: Floats,
    errors: Floats,
    states: Bytes,
    lenses: Lenses,
    m: Fused,
    shifts: Floats,
) -> None:
    """Fill in `shifts` (K, 3): by how much the whole body lies beside in each camera, metres.

    A camera in which it lies elsewhere altogether sees somebody else: its states become 0.
    places (K, 20, 3), errors and states (K, 20): the joints now. goes_on: whether `m` tells where
    they were.
    """
    slots = len(places)
    first, cameras = -1, 0
    for slot in range(slots):
        if states[slot].any():
            cameras += 1
            if first < 0:
                first = slot
    if cameras < 2:
        return
    # Against where the joints were, which is the same for all cameras.
    past, known = (m.positions, m.states) if goes_on else (places[first], states[first])
    past, known = past.copy(), known.copy()
    away = np.zeros((slots, 3))
    middle = np.zeros((slots, 3))
    found, guess = np.zeros(slots), np.zeros(slots)
    for slot in range(slots):
        for joint in trunk:
            if states[slot, joint] == 0 or known[joint] == 0:
                continue
            share = 1.0 if states[slot, joint] == 2 else 1.0 / (INFERRED * INFERRED)
            for axis in range(3):
                away[slot, axis] += share * (places[slot, joint, axis] - past[joint, axis])
                middle[slot, axis] += share * places[slot, joint, axis]
            guess[slot] += share * errors[slot, joint]
            found[slot] += share
        if found[slot] > 0.0:
            away[slot] /= found[slot]
            middle[slot] /= found[slot]
            guess[slot] /= found[slot]
    _leave_strangers(away, found, states)
    weight, total, centre = np.zeros(6), np.zeros(9), np.zeros(3)
    for slot in range(slots):
        if found[slot] > 0.0:
            across = math.sqrt(lenses.body_across[slot] ** 2 + guess[slot] ** 2)
            along = math.sqrt(lenses.body_along[slot] ** 2 + guess[slot] ** 2)
            placed = lenses.known[slot] > 0
            weigh(middle[slot], lenses.places[slot], placed, across, along, weight)
            add(total, weight, away[slot])
    if total[0] > 0.0:
        solve(total, centre)
    for slot in range(slots):
        if found[slot] > 0.0:
            shifts[slot] = away[slot] - centre


@kernel
def _leave_strangers(away: Floats, found: Floats, states: Bytes) -> None:
    """As long as cameras lie too far apart: leave out the one that is furthest from the past."""
    slots = len(found)
    nowhere = np.zeros(3)
    while True:
        furthest, most, apart = -1, -1.0, 0.0
        for slot in range(slots):
            if found[slot] > 0.0:
                own = distance(away[slot], nowhere)
                if own > most:
                    furthest, most = slot, own
                for other in range(slot):
                    if found[other] > 0.0:
                        apart = max(apart, distance(away[slot], away[other]))
        if apart <= BODY_DISAGREE:
            return
        found[furthest] = 0.0
        states[furthest] = 0
