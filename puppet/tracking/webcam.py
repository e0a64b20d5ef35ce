"""A webcam, through OpenCV."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, Final

import cv2

from puppet.errors import UnavailableError
from puppet.tracking.camera import CameraInfo, Shot
from puppet.tracking.video_file import nominal_rate

#: What a webcam is asked for; it may do something else.
WEBCAM_SIZE: Final = (1280, 720)
WEBCAM_RATE: Final = 30.0


class Webcam:
    """Shots of a webcam, stamped with the monotonic clock. It is a `Camera`.

    When it is unplugged, the shots end.
    """

    def __init__(self, index: int) -> None:
        """Raises UnavailableError for a webcam that is not there, or that somebody else uses."""
        self._capture, rate = _open(index)
        self.info: Final = CameraInfo(f"webcam:{index}", "webcam", rate, live=True)
        self.warnings: tuple[str, ...] = ()
        self.trouble = ""

    def __len__(self) -> int:
        return 0

    def __iter__(self) -> Iterator[Shot]:
        sequence = 0
        while self._capture.grab():
            now = time.monotonic()
            decoded, image = self._capture.retrieve()
            if not decoded:
                break
            yield Shot(now, sequence, image)
            sequence += 1

    def close(self) -> None:
        """Let go of the device. May be called twice."""
        self._capture.release()


def _open(index: int) -> tuple[Any, float]:
    """A capture of the webcam, and its nominal rate, frames a second."""
    capture = cv2.VideoCapture(index)
    if capture.isOpened():
        width, height = WEBCAM_SIZE
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        capture.set(cv2.CAP_PROP_FPS, WEBCAM_RATE)
        # The newest image is the one that counts.
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        if capture.grab():
            return capture, nominal_rate(capture)
    capture.release()
    raise UnavailableError(
        "this webcam does not answer",
        where=f"webcam:{index}",
        hint="see whether it is plugged in, is free, and may be used by this user "
        f"(on Linux: /dev/video{index}); takes and `rehearsal` need no camera",
    )
