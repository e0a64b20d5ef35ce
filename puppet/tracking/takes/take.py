"""Takes: recorded performances in MCAP, written and read. The format is in docs/formats.md.

JSON messages with a JSON schema, so that any MCAP tool can open a take. Chunks are closed every
half second of capture time: what a crash can lose is bounded by that.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Final, Self, cast

import msgspec
import numpy as np
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from mcap.writer import CompressionType, Writer

from puppet import __version__
from puppet.errors import BadFileError
from puppet.skeleton import JOINT_COUNT, JOINT_NAMES, Moment, SkeletonFrame, nobody
from puppet.tracking.cameras.raw_format import METADATA_NAME as RAW_METADATA
from puppet.tracking.cameras.raw_format import metadata_of
from puppet.tracking.source import SourceInfo

FORMAT_VERSION: Final = 1
TOPIC: Final = "/skeleton"
SCHEMA_NAME: Final = "puppet.SkeletonFrame"
METADATA_NAME: Final = "puppet.take"
MCAP_MAGIC: Final = b"\x89MCAP0\r\n"
CHUNK_SECONDS: Final = 0.5
#: What a frame takes as JSON, roughly.
FRAME_BYTES: Final = 640
#: No honest take has a record larger than this; a small file can otherwise claim gigabytes.
RECORD_LIMIT: Final = 64 * 1024 * 1024
NANOSECONDS: Final = 1_000_000_000

SCHEMA: Final[dict[str, Any]] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": SCHEMA_NAME,
    "description": "One performer at one instant; performers of the same instant follow each other "
    "with the same time. Stage frame: right-handed, +Y up, facing +Z.",
    "type": "object",
    "required": ["time", "sequence", "performer", "positions", "states"],
    "properties": {
        "time": {"type": "number", "description": "capture time, seconds"},
        "sequence": {"type": "integer", "minimum": 0},
        "performer": {"type": "integer", "minimum": 0},
        "positions": {
            "type": "array",
            "description": f"metres, joints in the order {' '.join(JOINT_NAMES)}",
            "minItems": JOINT_COUNT,
            "maxItems": JOINT_COUNT,
            "items": {
                "type": "array",
                "minItems": 3,
                "maxItems": 3,
                "items": {"type": "number"},
            },
        },
        "states": {
            "type": "array",
            "description": "0 not tracked, 1 inferred, 2 tracked",
            "minItems": JOINT_COUNT,
            "maxItems": JOINT_COUNT,
            "items": {"enum": [0, 1, 2]},
        },
    },
}


class _Message(msgspec.Struct, forbid_unknown_fields=False):
    time: float
    sequence: int
    performer: int
    positions: list[tuple[float, float, float]]
    states: list[int]


class TakeWriter:
    """Writes one take; use it as a context manager, so that the file is finished in any case."""

    def __init__(self, path: Path, info: SourceInfo) -> None:
        self.path = path
        self._file: BinaryIO = path.open("wb")
        # The library closes a chunk by size only: about half a second of frames.
        chunk_size = int(max(info.rate, 1.0) * CHUNK_SECONDS * FRAME_BYTES)
        self._writer = Writer(self._file, chunk_size=chunk_size, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library=f"puppet {__version__}")
        schema = self._writer.register_schema(
            name=SCHEMA_NAME, encoding="jsonschema", data=json.dumps(SCHEMA).encode()
        )
        self._channel = self._writer.register_channel(
            topic=TOPIC, message_encoding="json", schema_id=schema
        )
        self._writer.add_metadata(METADATA_NAME, _metadata(info))
        self._flushed = 0.0
        self._encoder = msgspec.json.Encoder()

    def write(self, moment: Moment) -> None:
        """Append a moment. Positions are kept to a tenth of a millimetre."""
        for frame in moment.frames or (nobody(moment.time, moment.sequence),):
            self._write(frame)
        if abs(moment.time - self._flushed) >= CHUNK_SECONDS:
            self._flushed = moment.time
            self._file.flush()

    def _write(self, frame: SkeletonFrame) -> None:
        message = _Message(
            time=round(float(frame.time), 6),
            sequence=frame.sequence,
            performer=frame.performer,
            positions=[
                (round(x, 4), round(y, 4), round(z, 4)) for x, y, z in frame.positions.tolist()
            ],
            states=frame.states.tolist(),
        )
        stamp = max(0, round(frame.time * NANOSECONDS))
        self._writer.add_message(
            channel_id=self._channel,
            log_time=stamp,
            publish_time=stamp,
            sequence=frame.sequence & 0xFFFFFFFF,
            data=self._encoder.encode(message),
        )

    def close(self) -> None:
        """Finish the file: summary, index and footer. May be called twice."""
        if not self._file.closed:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _metadata(info: SourceInfo) -> dict[str, str]:
    return {
        "format_version": str(FORMAT_VERSION),
        "source": info.name,
        "kind": info.kind,
        "rate": f"{info.rate:g}",
        "synthetic": "true" if info.synthetic else "false",
        "joints": " ".join(JOINT_NAMES),
        "units": "metres, seconds",
        "frame": "right-handed, +Y up, the performer faces +Z",
        "floor": "" if info.floor is None else " ".join(f"{value:.6g}" for value in info.floor),
        "note": info.note,
        "licence": info.licence,
    }


@dataclass(frozen=True, slots=True, eq=False)
class Take:
    """A recorded performance, wholly in memory. It is a source that never waits.

    warnings: what was wrong with the file and how much of it is here nevertheless.
    """

    info: SourceInfo
    moments: tuple[Moment, ...]
    warnings: tuple[str, ...] = ()

    @property
    def trouble(self) -> str:
        return ""

    def __len__(self) -> int:
        return len(self.moments)

    def __iter__(self) -> Iterator[Moment]:
        return iter(self.moments)

    def close(self) -> None:
        """Nothing to let go of."""

    def thinned(self, rate: float) -> Take:
        """The take with at most `rate` moments a second, evenly picked."""
        kept: list[Moment] = []
        for moment in self.moments:
            # Half a frame of tolerance, so that 60 a second become 30 and not 20.
            if not kept or moment.time - kept[-1].time >= 1.0 / rate - 0.5 / self.info.rate:
                kept.append(moment.at(moment.time, len(kept)))
        return replace(
            self, moments=tuple(kept), info=replace(self.info, rate=min(rate, self.info.rate))
        )

    @property
    def duration(self) -> float:
        """Seconds from the first moment to the last."""
        return self.moments[-1].time - self.moments[0].time if self.moments else 0.0


def write_take(path: Path, info: SourceInfo, moments: Iterable[Moment]) -> int:
    """Write a whole take; returns how many moments it has."""
    count = 0
    with TakeWriter(path, info) as writer:
        for count, moment in enumerate(moments, start=1):  # noqa: B007
            writer.write(moment)
    return count


def moments_of(frames: Iterable[SkeletonFrame]) -> Iterator[Moment]:
    """Frames in capture order as moments: those of one time and sequence number belong together.

    Raises ValueError if a performer is in one moment twice.
    """
    together: list[SkeletonFrame] = []
    for frame in frames:
        if together and (frame.time, frame.sequence) != (together[0].time, together[0].sequence):
            yield _moment(together)
            together = []
        together.append(frame)
    if together:
        yield _moment(together)


def _moment(frames: list[SkeletonFrame]) -> Moment:
    present = tuple(frame for frame in frames if frame.present)
    return Moment(frames[0].time, frames[0].sequence, present)


def read_take(path: Path) -> Take:
    """Read a take. A file that was cut off gives the frames it still has, with a warning.

    Raises BadFileError for a file that is missing, empty, foreign, of another format version, or
    has a message that is not a skeleton.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            magic = file.read(len(MCAP_MAGIC))
            if size == 0:
                raise BadFileError("the take is empty", where=path, found="0 bytes")
            if magic != MCAP_MAGIC:
                raise BadFileError(
                    "this is not a take",
                    where=path,
                    expected="an MCAP file, as `puppet record` and `puppet import` write it",
                    found=f"a file that begins with {magic!r}",
                    hint="`puppet import` turns Kinect and BVH recordings into takes",
                )
            return _read(path, file)
    except OSError as error:
        raise BadFileError(
            "the take cannot be opened", where=path, found=error.strerror or str(error)
        ) from None


def _read(path: Path, file: BinaryIO) -> Take:
    # Metadata comes before the frames, so it is there even when the end is not.
    metadata = _metadata_in(path, file)
    file.seek(0)
    reader = NonSeekingReader(file, record_size_limit=RECORD_LIMIT, validate_crcs=True)
    decoder = msgspec.json.Decoder(_Message)
    frames: list[SkeletonFrame] = []
    warnings: list[str] = []
    try:
        for _, channel, message in reader.iter_messages(log_time_order=False):
            if channel.topic == TOPIC:
                frames.append(_frame(decoder, message.data, f"{path}: frame {len(frames)}"))
    except (McapError, struct.error, EOFError, ValueError, _ZSTD_ERROR) as error:
        if isinstance(error, BadFileError):
            raise
        warnings.append(
            f"{path.name} is cut off or damaged ({error or type(error).__name__}); "
            f"its first {len(frames)} frames are used"
        )
    try:
        moments = tuple(moments_of(frames))
    except ValueError as error:
        raise BadFileError("the take contradicts itself", where=path, found=str(error)) from None
    return Take(_info(path, metadata), moments, tuple(warnings))


def _metadata_in(path: Path, file: BinaryIO) -> dict[str, str]:
    records = metadata_of(file, METADATA_NAME, RAW_METADATA)
    if METADATA_NAME in records:
        return records[METADATA_NAME]
    raw = RAW_METADATA in records
    raise BadFileError(
        "this is a raw recording, not a take" if raw else "this MCAP file is not a take",
        where=path,
        expected=f"a metadata record named {METADATA_NAME}",
        found=RAW_METADATA if raw else ", ".join(sorted(records)) or "none",
        hint="it has pictures and no skeletons; `puppet record --source` makes a take of it"
        if raw
        else "`puppet record` and `puppet import` write takes",
    )


def _frame(decoder: msgspec.json.Decoder[_Message], data: bytes, where: str) -> SkeletonFrame:
    try:
        message = decoder.decode(data)
    except msgspec.DecodeError as error:
        raise BadFileError("a message is not a skeleton", where=where, found=str(error)) from None
    positions = np.array(message.positions, float)
    states = np.array(message.states)
    if positions.shape != (JOINT_COUNT, 3) or states.shape != (JOINT_COUNT,):
        raise BadFileError(
            "a skeleton has the wrong number of joints",
            where=where,
            expected=f"{JOINT_COUNT} positions and states",
            found=f"{len(message.positions)} and {len(message.states)}",
        )
    if not (np.isfinite(positions).all() and np.isin(states, (0, 1, 2)).all()):
        raise BadFileError(
            "a skeleton has values that are not possible",
            where=where,
            expected="finite positions and states 0, 1 or 2",
        )
    return SkeletonFrame(
        message.time, message.sequence, message.performer, positions, states.astype(np.uint8)
    )


def _info(path: Path, metadata: dict[str, str]) -> SourceInfo:
    version = metadata.get("format_version", "")
    if version != str(FORMAT_VERSION):
        raise BadFileError(
            "this take is of another format version",
            where=path,
            expected=str(FORMAT_VERSION),
            found=version or "none",
            hint="record or import it again with this version of puppet",
        )
    try:
        floor = tuple(float(word) for word in metadata.get("floor", "").split())
        rate = float(metadata.get("rate", "30"))
    except ValueError as error:
        raise BadFileError("the take's metadata is damaged", where=path, found=str(error)) from None
    return SourceInfo(
        name=metadata.get("source", path.name),
        kind=metadata.get("kind", "take"),
        rate=rate,
        synthetic=metadata.get("synthetic") == "true",
        floor=floor if len(floor) == 4 else None,
        note=metadata.get("note", ""),
        licence=metadata.get("licence", ""),
    )


def _zstd_error() -> type[Exception]:
    import zstandard

    return cast("type[Exception]", zstandard.ZstdError)


_ZSTD_ERROR = _zstd_error()
