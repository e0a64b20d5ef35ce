"""Replays raw recordings: the shots of a camera as they were, so that all above is the live code.

A recording is read as it is gone through; no more than a chunk of it is ever in memory.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import BinaryIO, Final

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, SeekingReader

from puppet.errors import BadFileError
from puppet.tracking.cameras.camera import CameraInfo, Shot
from puppet.tracking.cameras.raw_format import (
    CALIBRATION,
    COLOUR,
    DEPTH,
    FORMAT_VERSION,
    METADATA_NAME,
    RECORD_LIMIT,
    SHOT,
    metadata_of,
)
from puppet.tracking.cameras.raw_shot import shot_of
from puppet.tracking.cameras.shot_check import lens_doubt
from puppet.tracking.takes.take import MCAP_MAGIC
from puppet.tracking.takes.take import METADATA_NAME as TAKE_METADATA

_DAMAGE: Final = (McapError, struct.error, EOFError, ValueError)


class RawRecording:
    """Shots of a raw recording. It is a `Camera`.

    It can be gone through again and again, with the same result each time: depth, lens, up, time
    and sequence numbers are those of the camera, bit for bit, and colour as its JPEG gives it.

    recorded: what the camera said of itself. info keeps its device, so that its calibration holds.
    """

    def __init__(self, path: str | Path) -> None:
        """Raises BadFileError for a file that is missing, empty, foreign, a take, of another format
        version, or without a shot that can be used."""
        self._path = Path(path)
        with self._open() as file:
            self.recorded: Final = _recorded(self._path, file)
            self._count = _count(file)
        recorded = self.recorded
        self.info: Final = CameraInfo(
            self._path.name,
            "raw",
            recorded.rate,
            device=recorded.device or recorded.name,
            note=recorded.note,
            licence=recorded.licence,
        )
        self.trouble = ""
        self.warnings: tuple[str, ...] = ()
        for _ in self:
            return
        raise BadFileError(
            "the raw recording has no shot",
            where=self._path,
            found="; ".join(self.warnings) or "only what describes the camera",
        )

    def __len__(self) -> int:
        """How many shots there are; 0 if the file was cut off."""
        return self._count

    def __iter__(self) -> Iterator[Shot]:
        self.warnings = ()
        damage: list[str] = []
        count, last = 0, -math.inf
        with self._open() as file:
            for topics in _by_instant(file, damage):
                # The end of the file came before the rest of it.
                if damage and COLOUR not in topics:
                    break
                where = f"{self._path}: shot {count}"
                shot = shot_of(topics, where)
                self._doubt(shot)
                if shot.time < last:
                    raise BadFileError(
                        "the time of a raw recording runs backwards",
                        where=where,
                        expected=f"{last:g} s or later",
                        found=f"{shot.time:g} s",
                    )
                count, last = count + 1, shot.time
                yield shot
        if damage:
            self._warn(
                f"{self._path.name} is cut off or damaged ({damage[0]}); its first {count} shots "
                "are used"
            )

    def close(self) -> None:
        """Nothing to let go of: the file is open only while it is gone through."""

    def _open(self) -> BinaryIO:
        try:
            return self._path.open("rb")
        except OSError as error:
            raise BadFileError(
                "the raw recording cannot be opened",
                where=self._path,
                found=error.strerror or str(error),
            ) from None

    def _doubt(self, shot: Shot) -> None:
        height, width = shot.colour.shape[:2]
        doubt = shot.intrinsics and lens_doubt(shot.intrinsics, width, height)
        if doubt:
            self._warn(
                f"{self._path.name}: {doubt}: is this the calibration of another camera? "
                "Distances may be wrong"
            )

    def _warn(self, warning: str) -> None:
        if warning not in self.warnings:
            self.warnings = (*self.warnings, warning)


def _recorded(path: Path, file: BinaryIO) -> CameraInfo:
    magic = file.read(len(MCAP_MAGIC))
    if not magic:
        raise BadFileError("the raw recording is empty", where=path, found="0 bytes")
    if magic != MCAP_MAGIC:
        raise BadFileError(
            "this is not a raw recording",
            where=path,
            expected="an MCAP file, as `puppet record --raw` writes it",
            found=f"a file that begins with {magic!r}",
        )
    records = metadata_of(file, METADATA_NAME, TAKE_METADATA)
    if METADATA_NAME not in records:
        take = TAKE_METADATA in records
        raise BadFileError(
            "this is a take, not a raw recording"
            if take
            else "this MCAP file is not a raw recording",
            where=path,
            expected=f"a metadata record named {METADATA_NAME}",
            found=TAKE_METADATA if take else ", ".join(sorted(records)) or "none",
            hint="a take has skeletons and no pictures: it is a source as it is"
            if take
            else "`puppet record --raw` writes raw recordings",
        )
    metadata = records[METADATA_NAME]
    version = metadata.get("format_version", "")
    if version != str(FORMAT_VERSION):
        raise BadFileError(
            "this raw recording is of another format version",
            where=path,
            expected=str(FORMAT_VERSION),
            found=version or "none",
            hint="record it again with this version of puppet",
        )
    try:
        rate = float(metadata.get("rate", "30"))
    except ValueError as error:
        raise BadFileError(
            "the raw recording's metadata is damaged", where=path, found=str(error)
        ) from None
    return CameraInfo(
        name=metadata.get("camera", path.name),
        kind=metadata.get("kind", "raw"),
        rate=rate if math.isfinite(rate) and rate > 0.0 else 30.0,
        device=metadata.get("device", ""),
        note=metadata.get("note", ""),
        licence=metadata.get("licence", ""),
    )


def _count(file: BinaryIO) -> int:
    """How many images the summary counts; 0 if there is none, as in a file that was cut off."""
    file.seek(0)
    try:
        summary = SeekingReader(file, record_size_limit=RECORD_LIMIT).get_summary()
    except (*_DAMAGE, OSError):  # OSError: there is less than a footer to seek to
        return 0
    if summary is None or summary.statistics is None:
        return 0
    counts = summary.statistics.channel_message_counts
    return sum(
        counts.get(number, 0)
        for number, channel in summary.channels.items()
        if channel.topic == COLOUR
    )


def _by_instant(file: BinaryIO, damage: list[str]) -> Iterator[dict[str, bytes]]:
    """Messages that belong together, by topic. Why the file ends early is added to `damage`."""
    messages = _messages(file, damage)
    for _, together in groupby(messages, key=lambda message: message[:2]):
        yield {topic: data for _, _, topic, data in together}


def _messages(file: BinaryIO, damage: list[str]) -> Iterator[tuple[int, int, str, bytes]]:
    """Log time, sequence, topic and data; what comes before the first damage."""
    reader = NonSeekingReader(file, record_size_limit=RECORD_LIMIT, validate_crcs=True)
    messages = reader.iter_messages(topics=(SHOT, COLOUR, DEPTH, CALIBRATION), log_time_order=False)
    while True:
        try:
            _, channel, message = next(messages)
        except StopIteration:
            return
        except _DAMAGE as error:
            damage.append(str(error) or type(error).__name__)
            return
        yield message.log_time, message.sequence, channel.topic, message.data
