"""What becomes of a joint that cameras see at different places: somebody is wrong."""

from __future__ import annotations

import math
from typing import Final

from puppet.kernel import Bytes, Floats, kernel
from puppet.tracking.fusion.memory import Lenses

#: Metres: cameras that see a joint further apart do not see the same.
DISAGREE: Final = 0.35
#: So much of what lies along a line of sight counts, where depth is not measured.
DEPTH_COUNTS: Final = 0.4
#: Of two that disagree, the one that lies this much nearer to where the joint was is right, m; but
#: for no longer than this, s.
CLEARLY: Final = 0.12
QUARREL: Final = 0.5


@kernel
def leave_outliers(
    joint: int, expected: Floats, there: bool, places: Floats, states: Bytes, lenses: Lenses
) -> tuple[bool, bool]:
    """Leave out cameras that see a joint elsewhere than the others: their states become 0.

    Of three or more, those that the others contradict; of two, the one that lies further from where
    the joint is expected, (3,), if it was there. What is inferred cannot contradict what is
    tracked. -> whether two disagree, and whether it is unclear who is right.
    """
    slots = len(places)
    best = 0
    for slot in range(slots):
        best = max(best, states[slot, joint])
    quarrel = unclear = False
    while best > 0:
        apart, left = 0.0, 0
        worst, most, second = -1, -1.0, -1.0
        for slot in range(slots):
            if states[slot, joint] != best:
                continue
            left += 1
            misfit = _misfit(slot, slot, places[slot, joint], expected, lenses) if there else 0.0
            for other in range(slots):
                if other != slot and states[other, joint] == best:
                    between = _misfit(
                        slot, other, places[slot, joint], places[other, joint], lenses
                    )
                    misfit += between
                    apart = max(apart, between)
            if misfit > most:
                worst, most, second = slot, misfit, most
            else:
                second = max(second, misfit)
        if apart <= DISAGREE:
            break
        if left == 2:
            quarrel, unclear = True, not there or most - second < CLEARLY
        states[worst, joint] = 0
    for slot in range(slots):
        if 0 < states[slot, joint] < best:
            nearest = 1e9
            for other in range(slots):
                if states[other, joint] == best:
                    nearest = min(
                        nearest,
                        _misfit(slot, other, places[slot, joint], places[other, joint], lenses),
                    )
            if nearest > DISAGREE:
                states[slot, joint] = 0
    return quarrel, unclear


@kernel
def _misfit(slot: int, other: int, a: Floats, b: Floats, lenses: Lenses) -> float:
    """Metres between two places (3,) that two cameras see, as far as these can tell."""
    between = a - b
    for index in range(2):
        camera = slot if index == 0 else other
        if lenses.known[camera] == 0 or (index == 1 and other == slot):
            continue
        sight = a - lenses.places[camera]
        square = (sight * sight).sum()
        counts = max(DEPTH_COUNTS, lenses.across[camera] / lenses.along[camera])
        if square > 1e-9 and counts < 1.0:
            between -= (1.0 - counts) * ((between * sight).sum() / square) * sight
    return math.sqrt((between * between).sum())
