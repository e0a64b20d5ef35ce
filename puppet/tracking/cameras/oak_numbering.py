"""One time and one count over all the lives of a device that comes and goes."""

from __future__ import annotations

import math
from typing import Final

#: A capture time may be this much older than its arrival, seconds, and two shots more.
OLDEST: Final = 1.0


class Numbering:
    """Times and sequence numbers that grow for ever, though a replugged device counts from zero."""

    def __init__(self, rate: float) -> None:
        """rate: nominal shots a second; says how many shots an outage cost."""
        self._rate = rate
        self._time = -math.inf
        self._sequence = -1
        self._theirs: int | None = None

    def restart(self) -> None:
        """From here on, the device counts anew."""
        self._theirs = None

    def number(self, time: float, sequence: int, now: float) -> tuple[float, int] | None:
        """Time and sequence of a shot; None if it is not later than the one before.

        time: when the device says that it was captured, seconds on the host's monotonic clock.
        sequence: as the device counts. now: seconds on the same clock.
        """
        # A clock that is not set yet says anything; a shot is never from the future.
        if not now - OLDEST - 2.0 / self._rate <= time <= now:
            time = now
        if time <= self._time:
            return None
        if self._theirs is not None and sequence > self._theirs:
            passed = sequence - self._theirs
        elif self._sequence < 0:
            passed = 1
        else:
            passed = max(1, round((time - self._time) * self._rate))
        self._time, self._theirs = time, sequence
        self._sequence += passed
        return time, self._sequence
