"""A source that watches a person in a video file or before a webcam, with one camera."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import ArrayLike

from puppet.errors import BadFileError, UnavailableError
from puppet.kernel import Floats
from puppet.skeleton import SkeletonFrame, nobody
from puppet.tracking.blazepose import BlazePose, Image, Landmarks
from puppet.tracking.level import Level
from puppet.tracking.lift import Intrinsics, Lift
from puppet.tracking.models import PoseModels
from puppet.tracking.sides import Sides
from puppet.tracking.source import Plane, SourceInfo

# OpenCV and the FFmpeg in it write to stderr what is told here in an error of our own. FFmpeg reads
# the variable only once, before the first capture of the process.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)

WEBCAM_PREFIX: Final = "webcam:"
#: What a webcam is asked for; it may do something else.
WEBCAM_SIZE: Final = (1280, 720)
WEBCAM_RATE: Final = 30.0
#: Rates outside of this are nonsense that some files and drivers give.
RATES: Final = (1.0, 1000.0)
DEFAULT_RATE: Final = 30.0
#: A file is levelled by so many seconds of its first performer; only then do frames come out.
LEVEL_SECONDS: Final = 1.0
#: A file whose last part, larger than this, cannot be decoded is said to be cut off.
MISSING_PART: Final = 0.02
#: A file that begins with so many bytes of nothing but ASCII text is not a video.
TEXT_BYTES: Final = 1024
FLOOR: Final[Plane] = (0.0, 1.0, 0.0, 0.0)


class VideoSource:
    """Skeleton frames of one person in a video file, or before a webcam. It is a `Source`.

    Frames in which nobody is seen are there, too, and empty. A file's frames carry its own time
    stamps, a webcam's the monotonic clock. A file can be gone through again and again, with the
    same result each time; a webcam that is unplugged ends the frames.
    """

    def __init__(
        self,
        path_or_index: str | Path | int,
        *,
        models: PoseModels,
        up: ArrayLike | None = None,
        focal: float | None = None,
        floor: float | None = None,
    ) -> None:
        """path_or_index: a file, or the number of a webcam, also as ``webcam:0``.

        up: (3,) the direction of up in the camera's image: x right, y down, z away; any length.
        focal: focal length, pixels. floor: metres from the floor up to the camera. What is None
        is guessed (focal) or learnt from the performer (up, floor).

        Raises BadFileError for a file that is missing or not a video, UnavailableError for a
        webcam that is not there or models that cannot be loaded.
        """
        self.warnings: tuple[str, ...] = ()
        self._up = None if up is None else np.asarray(up, float) * (1.0, -1.0, -1.0)
        self._focal, self._floor = focal, floor
        self._path: Path | None = None
        self._webcam: Any = None
        self._count = 0
        index = _webcam_index(path_or_index)
        if index is None:
            self._path = Path(path_or_index)  # type: ignore[arg-type]  # an int is an index
            rate, self._count = _examine_file(self._path)
            self._info = SourceInfo(self._path.name, "video", rate, floor=FLOOR)
        else:
            self._webcam, rate = _open_webcam(index)
            name = f"{WEBCAM_PREFIX}{index}"
            self._info = SourceInfo(name, "webcam", rate, live=True, floor=FLOOR)
        try:
            self._pose = BlazePose(models)
        except UnavailableError:
            self.close()
            raise

    @property
    def info(self) -> SourceInfo:
        return self._info

    def __len__(self) -> int:
        """How many frames the file says that it has; 0 for a webcam, or if it does not say."""
        return self._count

    def __iter__(self) -> Iterator[SkeletonFrame]:
        self._pose.reset()
        follower = _Follower(self._pose, self._focal)
        level = Level(self._up, self._floor)
        if self._path is None:
            return self._live_frames(follower, level)
        return self._file_frames(follower, level, self._path)

    def close(self) -> None:
        """Let go of the file or webcam. May be called twice."""
        if self._webcam is not None:
            self._webcam.release()

    def _live_frames(self, follower: _Follower, level: Level) -> Iterator[SkeletonFrame]:
        sequence = 0
        while self._webcam.grab():
            now = time.monotonic()
            decoded, image = self._webcam.retrieve()
            if not decoded:
                break
            frame = follower.frame(image, now, sequence)
            if frame.present:
                level.observe(frame.positions, frame.states)
            yield _levelled(frame, level)
            sequence += 1

    def _file_frames(
        self, follower: _Follower, level: Level, path: Path
    ) -> Iterator[SkeletonFrame]:
        """Nothing before the first performer needs levelling; from there on frames wait until
        enough has been seen of them, and the level stays as it is then."""
        waiting: list[SkeletonFrame] = []
        settled = False
        sequence = 0
        for stamp, image in self._file_images(path):
            frame = follower.frame(image, stamp, sequence)
            sequence += 1
            if settled or not (waiting or frame.present):
                yield _levelled(frame, level)
                continue
            waiting.append(frame)
            if frame.present:
                level.observe(frame.positions, frame.states)
            if stamp - waiting[0].time >= LEVEL_SECONDS:
                level.settle()
                settled = True
                for waited in waiting:
                    yield _levelled(waited, level)
                waiting.clear()
        level.settle()
        for waited in waiting:
            yield _levelled(waited, level)
        self.warnings = ()
        if sequence < self._count * (1.0 - MISSING_PART):
            self.warnings = (
                f"{path.name} is cut off or damaged; its first {sequence} frames of "
                f"{self._count} are used",
            )

    def _file_images(self, path: Path) -> Iterator[tuple[float, Image]]:
        """Capture time (s) and image of each frame that can be decoded."""
        capture, last = _open_file(path), -1.0
        try:
            while True:
                decoded, image = capture.read()
                if not decoded:
                    return
                stamp = float(capture.get(cv2.CAP_PROP_POS_MSEC)) / 1000.0
                if not (math.isfinite(stamp) and stamp > last):
                    # No stamp, or one that runs backwards: the nominal rate has to do.
                    stamp = 0.0 if last < 0.0 else last + 1.0 / self._info.rate
                last = stamp
                yield stamp, image
        finally:
            capture.release()


class _Follower:
    """Images of one camera -> frames in its own axes, not levelled yet."""

    def __init__(self, pose: BlazePose, focal: float | None) -> None:
        self._pose = pose
        self._focal = focal
        self._sides = Sides()
        self._lift: Lift | None = None
        self._size = (0, 0)

    def frame(self, image: Image, stamp: float, sequence: int) -> SkeletonFrame:
        height, width = image.shape[:2]
        if self._lift is None or self._size != (width, height):
            self._size = (width, height)
            self._lift = Lift(Intrinsics.assumed(width, height, self._focal), width, height)
        seen = self._pose.track(image)
        if seen is None:
            self._sides.reset()
            self._lift.reset()
            return nobody(stamp, sequence)
        first = seen

        def look_again(turn: float) -> Landmarks | None:
            return self._pose.look(image, first.region.turned(turn))

        seen = self._sides.keep(seen, stamp, look_again)
        positions, states = self._lift.joints(seen, stamp)
        return SkeletonFrame(stamp, sequence, 0, positions, states)


def _levelled(frame: SkeletonFrame, level: Level) -> SkeletonFrame:
    if not frame.present:
        return nobody(frame.time, frame.sequence, frame.performer)
    positions: Floats = level.to_stage(frame.positions)
    return SkeletonFrame(frame.time, frame.sequence, frame.performer, positions, frame.states)


def _webcam_index(path_or_index: str | Path | int) -> int | None:
    """The number of the webcam that is meant, or None if it is a file."""
    if isinstance(path_or_index, int):
        return path_or_index
    text = str(path_or_index)
    if not text.startswith(WEBCAM_PREFIX):
        return None
    number = text.removeprefix(WEBCAM_PREFIX)
    if not (number.isascii() and number.isdigit()):
        raise UnavailableError(
            "there is no such webcam", where=text, expected="a number, as in webcam:0", found=number
        )
    return int(number)


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
            return _rate(capture), int(count) if 0.0 < count < 1e9 else 0
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


def _open_webcam(index: int) -> tuple[Any, float]:
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
            return capture, _rate(capture)
    capture.release()
    raise UnavailableError(
        "this webcam does not answer",
        where=f"{WEBCAM_PREFIX}{index}",
        hint="see whether it is plugged in, is free, and may be used by this user "
        f"(on Linux: /dev/video{index}); takes and `rehearsal` need no camera",
    )


def _rate(capture: Any) -> float:
    rate = float(capture.get(cv2.CAP_PROP_FPS))
    return rate if RATES[0] <= rate <= RATES[1] else DEFAULT_RATE
