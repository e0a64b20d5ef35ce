"""An OAK depth camera that may be unplugged, may hang, and comes back."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Final

from puppet.errors import UnavailableError
from puppet.oak_config import OakConfig
from puppet.tracking.cameras.camera import CameraInfo, Shot
from puppet.tracking.cameras.gravity import Gravity
from puppet.tracking.cameras.oak_device import open_oak
from puppet.tracking.cameras.oak_listing import OakFound, OakMissingError, choose_oak, list_oaks
from puppet.tracking.cameras.oak_numbering import Numbering
from puppet.tracking.cameras.oak_stream import OakLostError, OakShot, OakStream
from puppet.tracking.cameras.patience import OverdueError, Patient

#: Seconds before each try to open a device again; the last goes on for ever.
PAUSES: Final = (0.5, 1.0, 2.0, 5.0, 10.0)
#: A device that gives no shot for so many seconds, and ten shots, hangs.
SILENCE: Final = 3.0
SILENT_SHOTS: Final = 10.0
#: Booting a device takes at most so many seconds, letting go of one hardly more.
BOOTING: Final = 25.0
CLOSING: Final = 5.0
#: The first shot waits so many seconds for the sense of up.
FINDING_UP: Final = 2.0
#: How often a wait looks whether the camera was closed meanwhile, seconds.
GLANCE: Final = 0.1

Lister = Callable[[], Sequence[OakFound]]
Opener = Callable[[OakFound, OakConfig], OakStream]


class OakCamera:
    """Shots of an OAK, stamped with the host's monotonic clock. It is a `Camera`.

    Once it gave shots, it never ends by itself: whatever happens to the device is said by `trouble`
    until shots come again, from the same device.
    """

    def __init__(
        self,
        wanted: str = "",
        config: OakConfig | None = None,
        *,
        lister: Lister = list_oaks,
        opener: Opener = open_oak,
        pauses: Sequence[float] = PAUSES,
        silence: float = SILENCE,
    ) -> None:
        """wanted: an id or a name; the first free one if empty.

        Raises UnavailableError for a device that is missing, in use or broken.
        """
        self._config = config or OakConfig()
        self._lister, self._opener = lister, opener
        self._pauses = pauses
        self._silence = silence + SILENT_SHOTS / self._config.rate
        self._over = threading.Event()
        self._trouble = ""
        self._warnings: list[str] = []
        self._numbering = Numbering(self._config.rate)
        self._gravity = Gravity()
        self._tries = 0
        self._opening: Patient[OakStream] | None = None
        self._stream: OakStream | None = None
        self._id = wanted
        try:
            self._stream = self._open()
        except UnavailableError:
            self.close()
            raise
        assert self._stream is not None
        self.info: Final = CameraInfo(
            f"oak:{self._id}",
            "oak",
            self._config.rate,
            live=True,
            device=self._id,
            note=self._stream.product,
        )

    @property
    def trouble(self) -> str:
        return self._trouble

    @property
    def warnings(self) -> tuple[str, ...]:
        return tuple(self._warnings)

    def __len__(self) -> int:
        return 0

    def __iter__(self) -> Iterator[Shot]:
        while not self._over.is_set():
            stream = self._stream or self._again()
            if stream is None:
                continue
            try:
                yield from self._shots(stream)
            finally:
                self._let_go()

    def close(self) -> None:
        """Let go of the device. May be called twice, and from another thread."""
        self._over.set()
        opening = self._opening
        if opening is not None:
            opening.give_up()
        self._let_go()

    def _shots(self, stream: OakStream) -> Iterator[Shot]:
        """Shots until the device is lost, or hangs."""
        self._numbering.restart()
        self._note(stream.warnings)
        opened = heard = time.monotonic()
        while not self._over.is_set():
            try:
                got = stream.shot(GLANCE)
            except OakLostError:
                if not self._over.is_set():
                    self._say("was unplugged, or lost its power")
                return
            for moment, acceleration in stream.readings():
                self._gravity.observe(moment, acceleration)
            now = time.monotonic()
            if got is None:
                if now - heard > self._silence:
                    self._say(f"gives no pictures since {now - heard:.0f} s")
                    return
                continue
            if stream.knows_up and self._gravity.up is None and now - opened < FINDING_UP:
                heard = now
                continue
            shot = self._numbered(got, now)
            if shot is None:
                continue
            self._trouble, self._tries = "", 0
            self._note(got.warnings)
            yield shot
            # What was done with the shot is not the device's time.
            heard = time.monotonic()

    def _numbered(self, got: OakShot, now: float) -> Shot | None:
        numbers = self._numbering.number(got.time, got.sequence, now)
        if numbers is None:
            return None
        return Shot(*numbers, got.colour, got.depth, got.intrinsics, self._gravity.up)

    def _again(self) -> OakStream | None:
        """One try to open the device again, after a pause; None if it failed."""
        pause = self._pauses[min(self._tries, len(self._pauses) - 1)]
        self._tries += 1
        if self._over.wait(pause):
            return None
        try:
            self._stream = self._open()
        except OakMissingError:
            self._say("is not plugged in")
        except UnavailableError as error:
            self._say(f"cannot be used: {error.what}")
        # It was closed while the device booted.
        if self._over.is_set():
            self._let_go()
        return self._stream

    def _open(self) -> OakStream | None:
        """Find the device and boot it; None if the camera is closed meanwhile.

        A boot that hangs cannot be stopped; until it is over, no other is begun.
        """
        if self._opening is None:
            self._opening = Patient(self._found_and_opened, OakStream.close)
        try:
            stream = self._opening.result(BOOTING, self._over, GLANCE)
        except OverdueError as overdue:
            raise UnavailableError(
                "this OAK does not start",
                where=f"oak:{self._id}",
                found=f"no answer within {BOOTING:.0f} s",
                hint="unplug it, wait for five seconds, plug it in again",
            ) from overdue
        except BaseException:
            self._opening = None
            raise
        self._opening = None
        return stream

    def _found_and_opened(self) -> OakStream:
        oak = choose_oak(self._id, self._lister())
        # From here on it is this device, whichever was asked for.
        self._id = oak.id or oak.name
        return self._opener(oak, self._config)

    def _let_go(self) -> None:
        stream, self._stream = self._stream, None
        if stream is not None:
            with suppress(OverdueError):
                Patient(stream.close).result(CLOSING)

    def _say(self, what: str) -> None:
        self._trouble = f"the camera oak:{self._id} {what}; it is looked for again and again"

    def _note(self, warnings: Sequence[str]) -> None:
        self._warnings += [warning for warning in warnings if warning not in self._warnings]
