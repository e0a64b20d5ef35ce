"""A video file, through OpenCV and the FFmpeg in it."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import ArrayLike

from puppet.errors import BadFileError
from puppet.tracking.camera import CameraInfo, Shot
from puppet.tracking.intrinsics import Intrinsics

# OpenCV and the FFmpeg in it write to stderr what is told here in an error of our own. FFmpeg reads
# the variable only once, before the first capture of the process.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)

#: Rates outside of this are nonsense that some files and drivers give.
RATES: Final = (1.0, 1000.0)
DEFAULT_RATE: Final = 30.0
#: A file whose last part, larger than this, cannot be decoded is said to be cut off.
MISSING_PART: Final = 0.02
#: A file that begins with so many bytes of nothing but ASCII text is not a video.
TEXT_BYTES: Final = 1024


class VideoFile:
    """Shots of a video file, with its own time stamps. It is a `Camera`.

    It can be gone through again and again, with the same result each time.
    """

    def __init__(
        self, path: str | Path, *, up: ArrayLike | None = None, focal: float | None = None
    ) -> None:
        """up: (3,) the direction of up in the image: x right, y down, z away; any length.

        focal: focal length, pixels. None where it is not known.

        Raises BadFileError for a file that is missing or not a video.
        """
        self._path = Path(path)
        self._up = None if up is None else np.asarray(up, float)
        self._focal = focal
        rate, self._count = _examine_file(self._path)
        self.info: Final = CameraInfo(self._path.name, "video", rate)
        self.warnings: tuple[str, ...] = ()
        self.trouble = ""

    def __len__(self) -> int:
        """How many shots the file says that it has; 0 if it does not say."""
        return self._count

    def __iter__(self) -> Iterator[Shot]:
        capture, last, sequence = _open_file(self._path), -1.0, 0
        self.warnings = ()
        try:
            while True:
                decoded, image = capture.read()
                if not decoded:
                    break
                stamp = float(capture.get(cv2.CAP_PROP_POS_MSEC)) / 1000.0
                if not (math.isfinite(stamp) and stamp > last):
                    # No stamp, or one that runs backwards: the nominal rate has to do.
                    stamp = 0.0 if last < 0.0 else last + 1.0 / self.info.rate
                last = stamp
                height, width = image.shape[:2]
                lens = None
                if self._focal is not None:
                    lens = Intrinsics.assumed(width, height, self._focal)
                yield Shot(stamp, sequence, image, intrinsics=lens, up=self._up)
                sequence += 1
        finally:
            capture.release()
        if sequence < self._count * (1.0 - MISSING_PART):
            self.warnings = (
                f"{self._path.name} is cut off or damaged; its first {sequence} frames of "
                f"{self._count} are used",
            )

    def close(self) -> None:
        """Nothing to let go of: the file is open only while it is gone through."""


def _open_file(path: Path) -> Any:
    """A capture of the file; it may not be open."""
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)
    return capture


def _examine_file(path: Path) -> tuple[float, int]:
    """Nominal rate, frames a second, and the number of frames that the file says it has, or 0."""
    try:
        with path.open("rb") as file:
            start = file.read(TEXT_BYTES)
    except OSError as error:
        raise BadFileError(
            "the video cannot be opened", where=path, found=error.strerror or str(error)
        ) from None
    if not start:
        raise BadFileError("the video is empty", where=path, found="0 bytes")
    capture = _open_file(path)
    try:
        # Only a frame that comes out shows that the file can be read; and FFmpeg makes a picture
        # of any text.
        if not _is_text(start) and capture.isOpened() and capture.read()[0]:
            count = float(capture.get(cv2.CAP_PROP_FRAME_COUNT))
            return nominal_rate(capture), int(count) if 0.0 < count < 1e9 else 0
    finally:
        capture.release()
    raise BadFileError(
        "no video can be read from this file",
        where=path,
        expected="a video file that FFmpeg can decode (mp4, mov, mkv, avi, webm ...)",
        found=f"a file that begins with {start[:12]!r}",
        hint="a recording that was cut off before it was finished may lack its index",
    )


def _is_text(start: bytes) -> bool:
    return all(byte in b"\t\n\f\r\x1b" or 32 <= byte < 127 for byte in start)


def nominal_rate(capture: Any) -> float:
    """Frames a second that an OpenCV capture says it has, if that can be."""
    rate = float(capture.get(cv2.CAP_PROP_FPS))
    return rate if RATES[0] <= rate <= RATES[1] else DEFAULT_RATE
