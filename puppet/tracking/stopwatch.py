"""Where the time of a step goes: for operators and benchmarks, never for the result."""

from __future__ import annotations

import time
from typing import Final

#: How much of each new duration goes into the mean that is shown.
SHARE: Final = 0.05


class Stopwatch:
    """Running means of the milliseconds that named stages take.

    Call `start`, and `lap` with the stage's name at the end of each stage.
    """

    def __init__(self) -> None:
        self.milliseconds: dict[str, float] = {}
        self._since = 0.0

    def start(self) -> None:
        """A step begins, or goes on after a pause that is nobody's."""
        self._since = time.perf_counter()

    def lap(self, stage: str) -> None:
        """What passed since the last call was that stage."""
        now = time.perf_counter()
        spent = 1000.0 * (now - self._since)
        self._since = now
        mean = self.milliseconds.get(stage, spent)
        self.milliseconds[stage] = mean + SHARE * (spent - mean)
