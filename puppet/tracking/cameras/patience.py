"""Calls into libraries that may take for ever."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Generic, TypeVar

R = TypeVar("R")


class OverdueError(Exception):
    """The call is not over yet. It goes on."""


class Patient(Generic[R]):
    """A call that is made in a thread of its own, which does not keep the program from ending."""

    def __init__(
        self, call: Callable[[], R], unwanted: Callable[[R], None] = lambda _result: None
    ) -> None:
        """Begins the call.

        unwanted: called with a result that nobody waited for any more.
        """
        self._call = call
        self._unwanted = unwanted
        self._lock = threading.Lock()
        self._done = threading.Event()
        self._given_up = False
        self._result: list[R] = []
        self._error: BaseException | None = None
        threading.Thread(target=self._run, daemon=True).start()

    @property
    def done(self) -> bool:
        """Whether the call is over."""
        return self._done.is_set()

    def result(
        self, seconds: float, never_mind: threading.Event | None = None, glance: float = 0.1
    ) -> R | None:
        """What the call returns; None once `never_mind` is set. Raises what the call raises.

        Raises OverdueError after so many seconds; it may be asked for again later.
        never_mind: looked at every `glance` seconds; the result is unwanted then.
        """
        until = time.monotonic() + seconds
        while not self._done.wait(min(glance, max(until - time.monotonic(), 0.0))):
            if never_mind is not None and never_mind.is_set():
                self.give_up()
                return None
            if time.monotonic() >= until:
                raise OverdueError
        if self._error is not None:
            raise self._error
        return self._result.pop() if self._result else None

    def give_up(self) -> None:
        """The result is unwanted, whether it is there or still to come."""
        with self._lock:
            self._given_up = True
            late = self._result.copy()
            self._result.clear()
        for result in late:
            self._unwanted(result)

    def _run(self) -> None:
        try:
            result = self._call()
        except BaseException as error:
            self._error = error
        else:
            with self._lock:
                if not self._given_up:
                    self._result.append(result)
                    self._done.set()
                    return
            self._unwanted(result)
        self._done.set()
