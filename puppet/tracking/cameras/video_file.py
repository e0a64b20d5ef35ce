"""A video file, through PyAV and the FFmpeg in it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import av
import cv2
import numpy as np
from numpy.typing import ArrayLike

from puppet.errors import BadFileError
from puppet.tracking.cameras.camera import CameraInfo, Image, Shot
from puppet.tracking.cameras.intrinsics import Intrinsics

#: Rates outside of this are nonsense that some files give.
RATES: Final = (0.1, 1000.0)
DEFAULT_RATE: Final = 30.0
#: A file whose last part, larger than this, cannot be decoded is said to be cut off.
MISSING_PART: Final = 0.02
#: A file that begins with so many bytes of nothing but ASCII text is not a video.
TEXT_BYTES: Final = 1024
#: What a video says of turning it, degrees anticlockwise, and how OpenCV does it.
TURNS: Final = {
    90: cv2.ROTATE_90_COUNTERCLOCKWISE,
    180: cv2.ROTATE_180,
    270: cv2.ROTATE_90_CLOCKWISE,
}


class VideoFile:
    """Shots of a video file, with its own time stamps. It is a `Camera`.

    It can be gone through again and again, with the same result each time. All images have the size
    of the first; what comes in another size later is fitted into it, with black borders.
    """

    def __init__(
        self, path: str | Path, *, up: ArrayLike | None = None, focal: float | None = None
    ) -> None:
        """up: (3,) the direction of up in the image: x right, y down, z away; any length.

        focal: focal length, pixels. None where it is not known.

        Raises BadFileError for a file that is missing, not a video, or has no picture.
        """
        self._path = Path(path)
        self._up = None if up is None else np.asarray(up, float)
        self._focal = focal
        rate, self._count = _examine(self._path)
        self.info: Final = CameraInfo(self._path.name, "video", rate)
        self.warnings: tuple[str, ...] = ()
        self.trouble = ""

    def __len__(self) -> int:
        """How many shots the file says that it has; 0 if it does not say."""
        return self._count

    def __iter__(self) -> Iterator[Shot]:
        self.warnings = ()
        last, sequence = -1.0, 0
        size: tuple[int, int] | None = None
        came_in: tuple[int, int] | None = None
        lens: Intrinsics | None = None
        damage: list[str] = []
        with av.open(str(self._path), metadata_errors="replace") as container:
            start = container.streams.video[0].start_time or 0
            for frame in _frames(container, damage):
                image = _image(frame)
                height, width = image.shape[:2]
                if size is None:
                    size = came_in = width, height
                    if self._focal is not None:
                        lens = Intrinsics.assumed(width, height, self._focal)
                elif (width, height) != came_in:
                    came_in = width, height
                    self._warn(
                        f"{self._path.name} goes on with {width}×{height} pixels at frame "
                        f"{sequence}; they are fitted into {size[0]}×{size[1]}"
                    )
                image = _fitted(image, *size)
                stamp = _time(frame, start)
                if not (math.isfinite(stamp) and stamp > last):
                    # No stamp, or one that runs backwards: the nominal rate has to do.
                    stamp = 0.0 if last < 0.0 else last + 1.0 / self.info.rate
                last = stamp
                yield Shot(stamp, sequence, image, intrinsics=lens, up=self._up)
                sequence += 1
        if sequence < self._count * (1.0 - MISSING_PART):
            self._warn(
                f"{self._path.name} is cut off or damaged; its first {sequence} frames of "
                f"{self._count} are used"
            )
        elif damage:
            self._warn(
                f"{self._path.name} is damaged ({damage[0]}); the {sequence} frames that could be "
                "decoded are used"
            )

    def close(self) -> None:
        """Nothing to let go of: the file is open only while it is gone through."""

    def _warn(self, warning: str) -> None:
        self.warnings = (*self.warnings, warning)


def _examine(path: Path) -> tuple[float, int]:
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
    found = f"a file that begins with {start[:12]!r}"
    # FFmpeg makes a picture of any text.
    if not _is_text(start):
        try:
            with av.open(str(path), metadata_errors="replace") as container:
                # Only a frame that comes out shows that the file can be read.
                if next(_frames(container, []), None) is not None:
                    return _rate_and_count(container)
                streams = ", ".join(stream.type for stream in container.streams) or "no streams"
                found = f"no picture in it; it has: {streams}"
        except (av.FFmpegError, ValueError) as error:
            found += f" ({_reason(error)})"
    raise BadFileError(
        "no video can be read from this file",
        where=path,
        expected="a video file that FFmpeg can decode (mp4, mov, mkv, avi, webm ...)",
        found=found,
        hint="a recording that was cut off before it was finished may lack its index",
    )


def _is_text(start: bytes) -> bool:
    return all(byte in b"\t\n\f\r\x1b" or 32 <= byte < 127 for byte in start)


def _rate_and_count(container: Any) -> tuple[float, int]:
    stream = container.streams.video[0]
    rate = float(stream.average_rate or stream.guessed_rate or 0.0)
    if not RATES[0] <= rate <= RATES[1]:
        rate = DEFAULT_RATE
    count = int(stream.frames)
    if count <= 0 and stream.duration is not None:
        count = round(float(stream.duration * stream.time_base) * rate)
    elif count <= 0 and container.duration is not None:
        count = round(container.duration / av.time_base * rate)
    return rate, max(count, 0)


def _frames(container: Any, damage: list[str]) -> Iterator[Any]:
    """The frames of the first video stream that can be decoded. What is wrong with the others, or
    ends the file early, is added to `damage`."""
    if not container.streams.video:
        return
    stream = container.streams.video[0]
    stream.thread_type = "AUTO"
    packets = container.demux(stream)
    while True:
        try:
            packet = next(packets)
        except StopIteration:
            return
        except av.FFmpegError as error:
            damage.append(_reason(error))
            return
        try:
            yield from packet.decode()
        except av.FFmpegError as error:
            damage.append(_reason(error))


def _time(frame: Any, start: int) -> float:
    """Seconds from the beginning; NaN if the file does not say. start: in the frame's own unit."""
    if frame.pts is None or frame.time_base is None:
        return math.nan
    return float((frame.pts - start) * frame.time_base)


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def _image(frame: Any) -> Image:
    """(height, width, 3) BGR, upright."""
    image: Image = frame.to_ndarray(format="bgr24")
    turn = TURNS.get(round(frame.rotation) % 360)
    return image if turn is None else np.asarray(cv2.rotate(image, turn), np.uint8)


def _fitted(image: Image, width: int, height: int) -> Image:
    """The image with its proportions, as large as it can be, in the middle of a size."""
    rows, columns = image.shape[:2]
    if (columns, rows) == (width, height):
        return image
    factor = min(width / columns, height / rows)
    inner = max(round(columns * factor), 1), max(round(rows * factor), 1)
    left, top = (width - inner[0]) // 2, (height - inner[1]) // 2
    fitted = np.zeros((height, width, 3), np.uint8)
    fitted[top : top + inner[1], left : left + inner[0]] = cv2.resize(
        image, inner, interpolation=cv2.INTER_AREA if factor < 1.0 else cv2.INTER_LINEAR
    )
    return fitted
