"""Prediction: a little ahead of what is seen, to hide how long the way to the stage takes.

A joint is put where it will be if it goes on. Of the velocity now, that of the last moment, and the
one to come if it brakes on as it does, the least counts, and nothing if they are opposed (minmod,
Roe 1986), so that who stops or turns back is hardly carried on; and never further than a limit.
"""

from __future__ import annotations

from typing import Final

from puppet.kernel import Floats, kernel
from puppet.tracking.conditioning.one_euro import blend
from puppet.tracking.conditioning.rows import length_of

#: Half-life of the velocity of the last moment, seconds.
PACE_HALF_LIFE: Final = 0.04
#: How much of its change since the last moment a velocity is expected to change further.
BRAKING: Final = 2.0
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
        agreed = _least(_least(now, pace[axis]), now + BRAKING * (now - pace[axis]))
        lead[axis] += (agreed * seconds - lead[axis]) * quick


@kernel
def _least(a: float, b: float) -> float:
    """The one that is nearer to zero; 0 if they are opposed."""
    if a * b <= 0.0:
        return 0.0
    return a if abs(a) < abs(b) else b


@kernel
def bounded(lead: Floats, most: float) -> Floats:
    """(3,) the lead, but no longer than `most` metres."""
    length = length_of(lead)
    return lead * (most / length) if length > most else lead * 1.0
