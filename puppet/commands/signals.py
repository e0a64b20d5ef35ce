"""Ending a process in good order: on Ctrl-C, on request, and when its supervisor has died."""

from __future__ import annotations

import os
import signal
import threading

from puppet.net.run import SUPERVISOR


def stop_event() -> threading.Event:
    """An event that is set when this process should end. A second Ctrl-C ends it at once."""
    stop = threading.Event()

    def handle(_number: int, _frame: object) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    signal.signal(signal.SIGINT, handle)
    signal.signal(signal.SIGTERM, handle)
    supervisor = os.environ.get(SUPERVISOR)
    if supervisor and supervisor.isdigit():
        threading.Thread(target=_watch, args=(int(supervisor), stop), daemon=True).start()
    return stop


def _watch(supervisor: int, stop: threading.Event) -> None:
    while not stop.wait(0.5):
        if os.getppid() != supervisor:
            stop.set()
