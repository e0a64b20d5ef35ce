"""A webcam, through OpenCV."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any, Final

import cv2

from puppet.tracking.cameras.camera import CameraInfo, Shot
from puppet.tracking.cameras.webcam_refusal import Refusal, refusal

# OpenCV writes to stderr what is told here in an error of our own.
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)

#: What a webcam is asked for; it may do something else.
WEBCAM_SIZE: Final = (1280, 720)
WEBCAM_RATE: Final = 30.0
#: Rates outside of this are nonsense that some drivers give.
RATES: Final = (1.0, 1000.0)


class Webcam:
    """Shots of a webcam, stamped with the monotonic clock. It is a `Camera`.

    When it is unplugged, the shots end.
    """

    def __init__(self, index: int) -> None:
        """Raises UnavailableError for a webcam that is not there, or that somebody else uses."""
        self._capture, rate = _open(index)
        self._using = threading.Lock()
        self._over = threading.Event()
        self.info: Final = CameraInfo(f"webcam:{index}", "webcam", rate, live=True)
        self.warnings: tuple[str, ...] = ()
        self.trouble = ""

    def __len__(self) -> int:
        return 0

    def __iter__(self) -> Iterator[Shot]:
        sequence = 0
        while (shot := self._next(sequence)) is not None:
            yield shot
            sequence += 1
        self.close()

    def close(self) -> None:
        """Let go of the device. May be called twice, and from another thread.

        While an image is waited for, it is let go of when that comes or fails to come.
        """
        self._over.set()
        if self._using.acquire(blocking=False):
            self._capture.release()
            self._using.release()

    def _next(self, sequence: int) -> Shot | None:
        with self._using:
            if not self._over.is_set() and self._capture.grab():
                now = time.monotonic()
                decoded, image = self._capture.retrieve()
                if decoded:
                    return Shot(now, sequence, image)
        return None


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
            rate = float(capture.get(cv2.CAP_PROP_FPS))
            return capture, rate if RATES[0] <= rate <= RATES[1] else WEBCAM_RATE
    capture.release()
    why = refusal(index) or Refusal(
        "does not answer", "see whether it is plugged in, is free, and may be used by this user"
    )
    raise why.error(index)
