"""A take played: looped, from end to end, sought and stepped, with the timing it was recorded at.

What is played is a pure function of what was asked; how fast is the caller's business (`delay`).
So a take gives the same moments bit for bit at any speed.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator
from typing import Literal, Self

from puppet.errors import BadShowError
from puppet.skeleton import Moment
from puppet.tracking.source import Source, SourceInfo
from puppet.tracking.takes.take import Take

#: What happens at the end of a take.
Repeat = Literal["once", "loop", "ping-pong"]


class Replay:
    """A take, played. It is a source itself; `seek`, `step` and `paused` steer it.

    Moments of the first pass are those of the take, untouched. From then on times and sequence
    numbers go on growing by the recorded spacing, whichever way the take runs; after a jump (the
    seam of a loop, `seek`, `step`) the next moment comes one nominal frame later.

    repeat: what happens at the end. speed: how much faster than recorded; it changes `delay` only.
    Both may be set at any time, as may `paused`.

    Raises BadShowError for a speed that is not a positive number.
    """

    def __init__(self, take: Take, *, repeat: Repeat = "once", speed: float = 1.0) -> None:
        self._moments = take.moments
        self._info = take.info
        self.repeat: Repeat = repeat
        self.paused = False
        self.speed = speed
        self._now = -1  # index of the moment that was given last
        self._forward = True
        self._last: Moment | None = None
        self._target: int | None = 0 if self._moments else None
        self._jumped = False
        # What is added to the recorded time and sequence number, or what they are taken from.
        self._time_base, self._sequence_base = 0.0, 0

    @classmethod
    def of(cls, source: Source, *, repeat: Repeat = "once", speed: float = 1.0) -> Self:
        """A replay of any source that ends: it is read to its end first."""
        take = source if isinstance(source, Take) else Take(source.info, tuple(source))
        return cls(take, repeat=repeat, speed=speed)

    @property
    def info(self) -> SourceInfo:
        return self._info

    @property
    def trouble(self) -> str:
        return ""

    @property
    def speed(self) -> float:
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        if not (math.isfinite(speed) and speed > 0.0):
            raise BadShowError(
                "this speed cannot be played", expected="a number above 0", found=f"{speed:g}"
            )
        self._speed = speed

    def __len__(self) -> int:
        return len(self._moments) if self.repeat == "once" else 0

    def close(self) -> None:
        """Nothing to let go of."""

    def __iter__(self) -> Iterator[Moment]:
        while (moment := self.advance()) is not None:
            yield moment

    @property
    def position(self) -> float:
        """Where in the take the moment is that was given last, s from its beginning."""
        return self._offset(max(self._now, 0)) if self._moments else 0.0

    @property
    def delay(self) -> float | None:
        """Wall-clock seconds from the moment given last to the next; None if there is none to wait
        for: paused, or over. The first moment is due at once.
        """
        if self.paused or self._target is None:
            return None
        if self._last is None:
            return 0.0
        return max(0.0, self._stamped(self._target)[0] - self._last.time) / self._speed

    def advance(self) -> Moment | None:
        """The next moment, paused or not; None when a take that is played once is over."""
        return None if self._target is None else self._give(self._target)

    def seek(self, seconds: float) -> None:
        """Go on with the first moment at or after `seconds` from the beginning of the take."""
        if self._moments:
            first = self._moments[0].time
            index = bisect_left(self._moments, seconds, key=lambda moment: moment.time - first)
            self._target = min(index, len(self._moments) - 1)
            self._jumped = self._last is not None

    def step(self, moments: int = 1) -> Moment | None:
        """The moment that many on in the take (back, if negative), and go on from there.

        A loop goes round; else it stops at the ends. None for an empty take.
        """
        if not self._moments:
            return None
        index = max(self._now, 0) + moments
        count = len(self._moments)
        index = index % count if self.repeat == "loop" else min(max(index, 0), count - 1)
        self._jumped = self._last is not None
        return self._give(index)

    def _offset(self, index: int) -> float:
        return self._moments[index].time - self._moments[0].time

    def _give(self, index: int) -> Moment:
        moment = self._moments[index]
        time, sequence, self._time_base, self._sequence_base = self._stamped(index)
        moment = moment.at(time, sequence)
        self._last, self._now, self._jumped = moment, index, False
        self._aim()
        return moment

    def _stamped(self, index: int) -> tuple[float, int, float, int]:
        """Time and sequence number of the moment when it comes next, and their bases."""
        moment, last = self._moments[index], self._last
        sign = 1 if self._forward else -1
        time_base, sequence_base = self._time_base, self._sequence_base
        time, sequence = time_base + sign * moment.time, sequence_base + sign * moment.sequence
        if last is not None and (self._jumped or time < last.time):
            time, sequence = last.time + 1.0 / max(self._info.rate, 1.0), last.sequence + 1
            time_base, sequence_base = time - sign * moment.time, sequence - sign * moment.sequence
        elif last is not None and sequence < last.sequence:
            sequence = last.sequence + 1
            sequence_base = sequence - sign * moment.sequence
        return time, sequence, time_base, sequence_base

    def _aim(self) -> None:
        """Decide which moment is next."""
        end = len(self._moments) - 1
        if self._now != (end if self._forward else 0):
            self._target = self._now + (1 if self._forward else -1)
        elif self.repeat == "once":
            self._target = None
        elif self.repeat == "loop" or end == 0:
            self._target, self._jumped = 0, True
        else:
            self._turn()
            self._target = self._now + (1 if self._forward else -1)

    def _turn(self) -> None:
        """Run the other way from here, so that the moment given last keeps its time."""
        assert self._last is not None
        self._forward = not self._forward
        sign, moment = (1 if self._forward else -1), self._moments[self._now]
        self._time_base = self._last.time - sign * moment.time
        self._sequence_base = self._last.sequence - sign * moment.sequence


def paced(replay: Replay) -> Iterator[tuple[float, Moment]]:
    """Moments with the wall-clock seconds, from the first one, at which each is due.

    For a process that waits: ``wait until start + due; publish(moment)``. Speed may change on the
    way. It ends when the take does, or when it is paused; start again to go on.
    """
    due = 0.0
    while (delay := replay.delay) is not None:
        due += delay
        moment = replay.advance()
        assert moment is not None
        yield due, moment
