"""Why a webcam cannot be opened, as far as Linux tells."""

from __future__ import annotations

import errno
import os
import struct
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from puppet.errors import UnavailableError

DEVICES: Final = Path("/dev")
PROCESSES: Final = Path("/proc")
#: `VIDIOC_REQBUFS` of videodev2.h, asked for no buffers: changes nothing, and is refused as busy
#: while somebody else has buffers, which is what using a webcam is.
REQUEST_BUFFERS: Final = 0xC0145608
NO_BUFFERS: Final = struct.pack("<5I", 0, 1, 1, 0, 0)  # count, video capture, memory mapped


@dataclass(frozen=True, slots=True)
class Refusal:
    """what: "is in use by another program". found: what shows it. hint: what to do."""

    what: str
    hint: str
    found: str | None = None

    def error(self, index: int) -> UnavailableError:
        """The refusal of `webcam:index`, to be raised."""
        return UnavailableError(
            f"this webcam {self.what}",
            where=f"webcam:{index}",
            found=self.found,
            hint=f"{self.hint}; takes and `rehearsal` need no camera",
        )


def check_webcam(index: int) -> None:
    """Raises UnavailableError if it can be told, without opening it, that it will be refused."""
    why = refusal(index)
    # One that is well is refused for no better reason than that nobody has asked it for pictures.
    if why is not None and why.what != "gives no pictures":
        raise why.error(index)


def refusal(index: int) -> Refusal | None:
    """What keeps `webcam:index` from being used; None if that cannot be told."""
    if not sys.platform.startswith("linux"):
        return None
    device = DEVICES / f"video{index}"
    if not device.exists():
        there = sorted(path.name for path in DEVICES.glob("video*"))
        return Refusal(
            "is not there",
            "plug it in, or choose another",
            f"no {device}; there are: {', '.join(there) or 'no webcams at all'}",
        )
    error = _error(device)
    # Some programs keep a webcam open that they do not use.
    programs = ", ".join(_users(device)) if error else ""
    if programs or error == errno.EBUSY:
        return Refusal("is in use by another program", "end that program", programs or None)
    if not os.access(device, os.R_OK | os.W_OK):
        return Refusal(
            "may not be used by this user",
            "put the user into the group that owns it (mostly `video`), and log in again",
            f"no access to {device}",
        )
    return Refusal("gives no pictures", f"see whether {device} is a camera; unplug it once")


def _error(device: Path) -> int:
    """The error number of asking for it; 0 if there is none."""
    import fcntl  # there is none on Windows

    try:
        handle = os.open(device, os.O_RDWR | os.O_NONBLOCK)
    except OSError as error:
        return error.errno or 0
    try:
        fcntl.ioctl(handle, REQUEST_BUFFERS, bytearray(NO_BUFFERS))
    except OSError as error:
        return error.errno or 0
    finally:
        os.close(handle)
    return 0


def _users(device: Path) -> Iterator[str]:
    """The other programs that have it open, as far as this user may know."""
    for process in PROCESSES.glob("[0-9]*"):
        if process.name == str(os.getpid()):
            continue
        with suppress(OSError):
            handles = process.joinpath("fd").iterdir()
            if any(_leads_to(handle, device) for handle in handles):
                name = process.joinpath("comm").read_text().strip()
                yield f"{name} (process {process.name})"


def _leads_to(handle: Path, device: Path) -> bool:
    try:
        return handle.readlink() == device
    except OSError:
        return False  # closed meanwhile
