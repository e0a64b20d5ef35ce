"""One camera's clock, as the stage hears it: how it lies to the stage's own, and when it jumps.

Nobody can know the way of a message, but the quickest ways are nearly equal: so the offset is the
least difference between arrival and capture that was heard lately. Where that difference is no
more than a tracker takes for its work, both clocks are one: this machine's.
"""

from __future__ import annotations

from collections import deque
from enum import Enum, auto
from typing import Final

#: Seconds from capture to arrival within which a camera is taken to have this machine's clock.
SHARED: Final = 0.25
#: By how much the least difference rises with each second, so that clocks may drift. Quartz clocks
#: drift by a third of it at the most.
LEAK: Final = 3e-4
#: Of so many differences the second least counts: one wrong stamp must not set the clock.
RECENT: Final = 8
#: A difference that is less or more by so many seconds says that a clock was set, or stood still;
#: more only if that goes on for a while, for a message may be late.
JUMP: Final = 1.0
LINGERS: Final = 0.5
#: Seconds of nothing but moments older than the newest: then the clock began anew.
BEGUN_ANEW: Final = 0.25
#: The share of a new interval or lag in their means.
_MEAN: Final = 0.1


class Heard(Enum):
    """What a moment is to those before it."""

    NEXT = auto()
    #: Older than one that came before: not to be used.
    LATE = auto()
    #: The clock was set or stood still; the camera still knows its performers.
    JUMPED = auto()
    #: The clock began anew, and the camera's numbers with it.
    RESTARTED = auto()


class CameraClock:
    """Offset, rate and lag of one camera. Seconds; `arrived` is the stage's monotonic clock.

    time: of the newest moment, its own clock. heard: when that came. count: moments since the clock
    began. interval: mean between moments. lag: how old moments are when they come, in the mean.
    """

    def __init__(self) -> None:
        self.interval = 0.0
        self.lag = 0.0
        self._begin()

    def _begin(self) -> None:
        self.time = self.heard = 0.0
        self.count = 0
        self._least = 0.0
        self._recent: deque[float] = deque(maxlen=RECENT)
        self._late_since: float | None = None
        self._slow_since: float | None = None

    @property
    def shared(self) -> bool:
        """Whether it is this machine's clock."""
        return 0.0 <= self._least < SHARED

    @property
    def delay(self) -> float:
        """The least difference between arrival and capture."""
        return self._least

    def hear(self, time: float, arrived: float) -> Heard:
        """Take in that a moment of `time` came."""
        difference = arrived - time
        heard = self._compare(time, arrived) if self.count else Heard.NEXT
        if heard is Heard.LATE:
            return heard
        if heard is not Heard.NEXT:
            self._begin()
        if self.count:
            step = time - self.time
            self.interval = (
                step
                if self.count == 1
                else self.interval + _MEAN * (min(step, 4.0 * self.interval) - self.interval)
            )
            self._least += LEAK * max(0.0, arrived - self.heard)
        self._recent.append(difference)
        lowest = sorted(self._recent)
        if len(lowest) < RECENT:
            self._least = lowest[0]
        else:
            self._least = min(self._least, lowest[1])
        self.time, self.heard = time, arrived
        self.count += 1
        return heard

    def mean_lag(self, lag: float) -> None:
        """Take in how old the newest moment was when it came."""
        self.lag = lag if self.count <= 1 else self.lag + _MEAN * (lag - self.lag)

    def _compare(self, time: float, arrived: float) -> Heard:
        difference = arrived - time
        if time <= self.time:
            if self._late_since is None:
                self._late_since = arrived
            lately = arrived - self._late_since < BEGUN_ANEW
            return Heard.LATE if lately else Heard.RESTARTED
        self._late_since = None
        if difference < self._least - JUMP:
            return Heard.JUMPED
        if difference < self._least + JUMP:
            self._slow_since = None
        elif self._slow_since is None:
            self._slow_since = arrived
        elif arrived - self._slow_since > LINGERS:
            return Heard.JUMPED
        return Heard.NEXT
