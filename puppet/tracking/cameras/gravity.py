"""Which way is up, from an accelerometer that may be shaken."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from puppet.kernel import Floats

#: Seconds until half of what is known comes from newer readings.
HALF_LIFE: Final = 1.0
#: A reading counts less the more its length differs from the usual: at this part of it, by e.
TOLERANCE: Final = 0.1
#: So many seconds of readings are needed before a direction is given.
SETTLING: Final = 0.25


class Gravity:
    """The direction of up from readings of an accelerometer.

    At rest it measures what holds it up against gravity, which is up. What shakes it averages out,
    and readings that are plainly longer or shorter than usual hardly count. The length is learnt,
    as accelerometers that nobody calibrated are off by up to a fifth.
    """

    def __init__(self, half_life: float = HALF_LIFE) -> None:
        """half_life: seconds."""
        self._half_life = half_life
        self._sum = np.zeros(3)
        self._weight = 0.0
        self._length = 0.0
        self._first = math.nan
        self._last = math.nan

    @property
    def up(self) -> Floats | None:
        """(3,) of length 1 in the axes of the readings; None until there were enough of them."""
        if not self._last - self._first >= SETTLING:
            return None
        length = float(np.linalg.norm(self._sum))
        return self._sum / length if length > 0.0 else None

    def observe(self, time: float, acceleration: Floats) -> None:
        """Take a reading.

        time: seconds; readings that are not later than the last one are left out.
        acceleration: (3,) any unit; one that is not finite, or zero, is left out.
        """
        length = float(np.linalg.norm(acceleration))
        if time <= self._last or not (math.isfinite(length) and length > 0.0):
            return
        if math.isnan(self._first):
            self._first, self._length = time, length
        else:
            fade = 0.5 ** ((time - self._last) / self._half_life)
            self._sum *= fade
            self._weight *= fade
        self._last = time
        off = (length / self._length - 1.0) / TOLERANCE
        weight = math.exp(-0.5 * off * off)
        self._sum += weight * acceleration / length
        self._weight += 1.0
        self._length += (length - self._length) / max(self._weight, 1.0)
