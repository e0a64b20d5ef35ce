"""One clock out of the clocks of successive trackers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from puppet.skeleton import Moment

#: Seconds of silence after which another tracker of the same camera is followed.
STREAM_SILENCE: Final = 1.0
#: Seconds at which a moment is joined to what went before it, where its own clock says nothing.
NOMINAL_STEP: Final = 1.0 / 30.0


@dataclass
class StreamGate:
    """Lets one tracker of a camera through: the one that started last, and an older one again when
    that has gone silent."""

    stream_ns: int = -1
    heard: float = -1e9

    def follows(self, stream_ns: int, now: float) -> bool:
        """Whether a moment of this stream is to be used, heard at `now` (monotonic seconds)."""
        if stream_ns < self.stream_ns and now - self.heard < STREAM_SILENCE:
            return False
        self.stream_ns, self.heard = stream_ns, now
        return True


class StageClock:
    """Joins successive streams to one clock that only runs forward.

    Within a stream the spacing of capture times is kept. Where a stream begins, or one has fallen
    behind what the stage went through by itself, it is joined a nominal step later.
    """

    def __init__(self) -> None:
        self._offset = 0.0
        self._stream: object = None

    def place(self, moment: Moment, stream: object, line_time: float | None) -> Moment:
        """The moment on the stage's clock. stream: tells one stream from another."""
        first, self._stream = stream != self._stream, stream
        if line_time is None:
            self._offset = 0.0
        elif first or moment.time + self._offset <= line_time:
            self._offset = line_time + NOMINAL_STEP - moment.time
        return moment.at(moment.time + self._offset, moment.sequence)
