"""Writing pictures on a thread of its own: a slow disk or encoder must not make a picture late."""

from __future__ import annotations

import queue
import threading

import numpy as np
from numpy.typing import NDArray

from puppet.errors import PuppetError
from puppet.render.output import Output

#: Pictures that may wait; when there are more, the newest is left out.
WAITING = 4


class BackgroundOutput:
    """Hands pictures on to another output, at most one every `every` seconds.

    left_out: pictures that came while too many were waiting.
    failure: why writing has stopped, if it has; the show goes on.
    """

    def __init__(self, output: Output, every: float = 0.0) -> None:
        self._output = output
        self._every = every
        self._due = -np.inf
        self.left_out = 0
        self.failure: PuppetError | None = None
        self._queue: queue.Queue[tuple[NDArray[np.uint8], float] | None] = queue.Queue(WAITING)
        self._thread = threading.Thread(target=self._run, name="pictures", daemon=True)
        self._thread.start()

    def wants(self, time: float) -> bool:
        """Whether a picture at `time` would be taken: reading it back costs, so ask first."""
        return self.failure is None and time >= self._due

    def write(self, image: NDArray[np.uint8], time: float) -> None:
        """Take a picture (height, width, 3), which must not be changed any more."""
        self._due = max(self._due + self._every, time + 0.5 * self._every)
        try:
            self._queue.put_nowait((image, time))
        except queue.Full:
            self.left_out += 1

    def close(self) -> None:
        """Wait until everything is written."""
        if self._thread.is_alive():
            self._queue.put(None)
            self._thread.join()

    def _run(self) -> None:
        while (item := self._queue.get()) is not None:
            if self.failure is None:
                try:
                    self._output.write(*item)
                except PuppetError as error:
                    self.failure = error
        try:
            self._output.close()
        except PuppetError as error:
            self.failure = self.failure or error
