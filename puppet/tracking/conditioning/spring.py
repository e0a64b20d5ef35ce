"""Critical damping in closed form: the quickest way to a goal that starts and ends without a jolt.

x(t) = goal + (x0 - goal + (v0 + w (x0 - goal)) t) exp(-w t). From rest its slope begins at 0, is
steepest at w t = 1, where it is w / e of the way a second, and the same steps, however many, end at
the same place.
"""

from __future__ import annotations

import math
from typing import Final

from puppet.kernel import Floats, kernel

#: Half of the way from rest is gone at w t = this.
HALF: Final = 1.6783469900166605


@kernel
def rate_of(half_life: float) -> float:
    """The rate w, 1/s, at which half of the way from rest is gone after `half_life` seconds."""
    return HALF / max(half_life, 1e-3)


@kernel
def gentle(rate: float, way: float, fastest: float) -> float:
    """The rate, or less, so that over such a way from rest nothing is faster than `fastest`."""
    return min(rate, math.e * fastest / way) if way > 1e-9 else rate


@kernel
def damped(
    value: float, velocity: float, goal: float, rate: float, dt: float
) -> tuple[float, float]:
    """Value and velocity `dt` seconds later."""
    away = value - goal
    push = velocity + rate * away
    left = math.exp(-rate * dt)
    return goal + (away + push * dt) * left, (velocity - rate * push * dt) * left


@kernel
def ease_off(offset: Floats, velocity: Floats, rate: float, dt: float) -> None:
    """Let an offset (3,) and its velocity (3,) go to zero, in place."""
    for axis in range(3):
        offset[axis], velocity[axis] = damped(offset[axis], velocity[axis], 0.0, rate, dt)
