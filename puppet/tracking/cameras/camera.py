"""What every camera is: an iterable of shots, each an image with what is known of its depth.

A camera file, a webcam, an OAK and a raw recording all give the same `Shot`, so everything above
them (`watcher.py`) is the same code, live or replayed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.tracking.cameras.intrinsics import Intrinsics

#: (height, width, 3) BGR, as OpenCV gives it.
Image = NDArray[np.uint8]
#: (h, w) millimetres along the lens's axis, uint16; 0 where it is not known.
Depth = NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """What a camera sees at one instant.

    time: capture time, seconds on the camera's own clock; it never runs backwards.
    sequence: counts the camera's shots; a gap is one that was lost.
    colour: the image. depth: of the same view through the same lens, though it may have fewer
        pixels; None if the camera has none.
    intrinsics: the lens of `colour`; None if it is not known.
    up: (3,) the direction of up in the image's axes (x right, y down, z away), any length, from an
        IMU or a calibration; None if it is not known.
    """

    time: float
    sequence: int
    colour: Image
    depth: Depth | None = None
    intrinsics: Intrinsics | None = None
    up: Floats | None = None


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """What a camera says of itself.

    name: for people, "webcam:0", "cam01.mp4", "oak:14442C10D13EABCE00". kind: "video", "webcam",
    "oak", "raw". rate: nominal shots a second. live: shots come in real time and cannot be asked
    for again. device: what a calibration knows the camera by; the name if it is empty.
    """

    name: str
    kind: str
    rate: float
    live: bool = False
    device: str = ""
    note: str = ""
    licence: str = ""


class Camera(Protocol):
    """Shots in capture order. A live camera blocks until its next shot; others never wait."""

    @property
    def info(self) -> CameraInfo: ...

    @property
    def trouble(self) -> str:
        """What keeps it from giving shots now, as a sentence for people; empty if all is well.

        May be read from another thread.
        """
        ...

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was wrong and could be lived with; complete when the shots are over."""
        ...

    def __len__(self) -> int:
        """How many shots there are; 0 if that cannot be known."""
        ...

    def __iter__(self) -> Iterator[Shot]: ...

    def close(self) -> None:
        """Let go of the device or file. May be called twice, and from another thread while the next
        shot is waited for: then the shots end."""
        ...
