"""How a process says that it is well: counters and gauges on the bus, twice a second."""

from __future__ import annotations

import os
import threading
from collections import Counter
from collections.abc import Callable

from puppet.net.bus import Bus
from puppet.net.messages import HealthMessage, encode

PERIOD = 0.5


class Health:
    """Publishes a process's state from a thread of its own, so that a stuck loop shows as such.

    counters: count events with ``health.counters["frames_in"] += 1``. gauges: set freely.
    """

    def __init__(self, bus: Bus, role: str, look: Callable[[Health], None] | None = None) -> None:
        """look: called before each publication, to bring the figures up to date."""
        self.counters: Counter[str] = Counter()
        self.gauges: dict[str, float] = {}
        self.state = "waiting"
        self.note = ""
        self._look = look
        self._role = role
        self._publish = bus.publisher(f"health/{role}")
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="health", daemon=True)
        self._thread.start()

    def tell(self) -> None:
        """Publish now."""
        if self._look is not None:
            self._look(self)
        self._publish(
            encode(
                HealthMessage(
                    role=self._role,
                    pid=os.getpid(),
                    state=self.state,
                    counters=dict(self.counters),
                    gauges=dict(self.gauges),
                    note=self.note,
                )
            )
        )

    def close(self, state: str = "ended") -> None:
        """Say a last word and stop."""
        self._stop.set()
        self._thread.join()
        self.state = state
        self.tell()

    def _run(self) -> None:
        while not self._stop.wait(PERIOD):
            self.tell()
