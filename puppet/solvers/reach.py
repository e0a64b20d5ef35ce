"""Goals beyond reach: brought back softly, so that a limb stretches out and does not snap straight.

A chain that is almost straight turns fast for a little way of its tip, and at its full reach
infinitely fast. So the last part of the reach is never asked for whole: beyond `start` a goal's
distance is bent over, with the same slope there, towards `reach`, which it never passes.
"""

from __future__ import annotations

import math

from puppet.kernel import kernel

#: The share of its reach up to which a chain is asked for exactly what was wished.
EASY = 0.9


@kernel
def soft_distance(distance: float, reach: float, start: float) -> float:
    """How far away a goal is asked for that is wished at `distance`. All in metres, from the base.

    Up to `start` the distance itself; from there on it approaches `reach`, without a kink. Where
    `start` is not below `reach`, the distance is cut off there.
    """
    if distance <= start:
        return distance
    room = reach - start
    if room <= 0.0:
        return start
    return start + room * (1.0 - math.exp(-(distance - start) / room))
