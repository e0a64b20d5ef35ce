"""How fresh the pictures are."""

from __future__ import annotations

from collections import deque

import numpy as np

#: How many pictures the percentiles are taken over.
MEMORY = 20_000


class Latency:
    """Frame rate, and seconds from the tracker's publication to the finished picture."""

    def __init__(self) -> None:
        self._seconds: deque[float] = deque(maxlen=MEMORY)
        self._drawn: deque[float] = deque(maxlen=90)

    def drawn(self, now: float, latency: float | None) -> None:
        """A picture was finished at `now`; `latency` is None for one without a fresh frame."""
        self._drawn.append(now)
        if latency is not None:
            self._seconds.append(latency)

    @property
    def fps(self) -> float:
        """Pictures a second, over the last few."""
        if len(self._drawn) < 2:
            return 0.0
        return (len(self._drawn) - 1) / max(self._drawn[-1] - self._drawn[0], 1e-6)

    @property
    def recent(self) -> float | None:
        """Median of the last half second or so."""
        count = len(self._seconds)
        latest = [self._seconds[i] for i in range(max(0, count - 30), count)]
        return float(np.median(latest)) if latest else None

    def percentile(self, share: float) -> float:
        """Seconds below which `share` per cent of the pictures are."""
        return float(np.percentile(np.array(self._seconds), share)) if self._seconds else 0.0
