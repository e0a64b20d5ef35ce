"""Prediction: a little ahead of what is seen, to hide how long the way to the stage takes.

A joint is put where it will be if it goes on. Its velocity counts only as far as the one now and
the one of the last moment agree (the lesser of both, nothing if they are opposed: minmod, Roe
1986), so that who stops or turns back is not carried on.
"""

from __future__ import annotations

import math
from typing import Final

from puppet.kernel import Floats, kernel
from puppet.tracking.one_euro import blend

#: Half-life of the velocity of the last moment, seconds.
PACE_HALF_LIFE: Final = 0.04
#: Half-life with which the lead itself is taken and given up, seconds.
LEAD_HALF_LIFE: Final = 0.015


@kernel
def lead_on(velocity: Floats, pace: Floats, lead: Floats, seconds: float, dt: float) -> None:
    """Bring the lead (3,) of a joint up to date, metres. velocity: (3,) m/s of what is filtered.

    pace: (3,) m/s, the velocity of the last moment, which is brought up to date, too.
    """
    quick, slow = blend(LEAD_HALF_LIFE, dt), blend(PACE_HALF_LIFE, dt)
    for axis in range(3):
        now = velocity[axis]
        pace[axis] += (now - pace[axis]) * slow
        agreed = 0.0
        if now * pace[axis] > 0.0:
            agreed = now if abs(now) < abs(pace[axis]) else pace[axis]
        lead[axis] += (agreed * seconds - lead[axis]) * quick


@kernel
def bounded(lead: Floats, most: float) -> Floats:
    """(3,) the lead, but no longer than `most` metres."""
    length = math.sqrt(lead[0] * lead[0] + lead[1] * lead[1] + lead[2] * lead[2])
    return lead * (most / length) if length > most else lead * 1.0
