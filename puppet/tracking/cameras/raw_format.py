"""What a raw recording is made of: topics, schemas and metadata. The format is in docs/formats.md.

Images and calibrations are Foxglove's own protobuf messages, so that Foxglove and other MCAP tools
show them.
"""

from __future__ import annotations

import contextlib
import struct
from pathlib import Path
from typing import Any, BinaryIO, Final

import msgspec
from mcap.exceptions import McapError
from mcap.records import Metadata
from mcap.stream_reader import StreamReader

FORMAT_VERSION: Final = 1
METADATA_NAME: Final = "puppet.raw"
SHOT: Final = "/shot"
COLOUR: Final = "/colour"
DEPTH: Final = "/depth"
CALIBRATION: Final = "/calibration"
SHOT_SCHEMA_NAME: Final = "puppet.Shot"
#: What Foxglove knows the lens by.
FRAME_ID: Final = "camera"
CHUNK_SECONDS: Final = 0.5
#: However large the images are, a chunk is closed when it has so many bytes.
CHUNK_LIMIT: Final = 16 * 1024 * 1024
#: No honest recording has a record larger than this; a small file can otherwise claim gigabytes.
RECORD_LIMIT: Final = 64 * 1024 * 1024
NANOSECONDS: Final = 1_000_000_000

SHOT_SCHEMA: Final[dict[str, Any]] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": SHOT_SCHEMA_NAME,
    "description": "One instant of a camera; its image, depth and calibration have its log time "
    "and sequence number.",
    "type": "object",
    "required": ["time", "sequence"],
    "properties": {
        "time": {"type": "number", "description": "capture time, seconds"},
        "sequence": {"type": "integer", "minimum": 0, "description": "a gap is a lost shot"},
        "up": {
            "description": "the direction of up in the image: x right, y down, z away",
            "anyOf": [
                {"type": "null"},
                {
                    "type": "array",
                    "minItems": 3,
                    "maxItems": 3,
                    "items": {"type": "number"},
                },
            ],
        },
    },
}


class ShotMessage(msgspec.Struct, forbid_unknown_fields=False):
    """A message of `/shot`."""

    time: float
    sequence: int
    up: tuple[float, float, float] | None = None


def is_raw(path: Path) -> bool:
    """Whether a file is a raw recording, cut off or not. Reads no further than its metadata.

    What cannot be read is none; opening it as what it was given for says why.
    """
    with contextlib.suppress(OSError), path.open("rb") as file:
        return METADATA_NAME in metadata_of(file, METADATA_NAME)
    return False


def metadata_of(file: BinaryIO, *names: str) -> dict[str, dict[str, str]]:
    """Metadata records of an MCAP file by name, up to the first that has one of `names`.

    What is cut off or is no MCAP file gives those that it has before that.
    """
    found: dict[str, dict[str, str]] = {}
    # struct.error: the end comes in the middle of a record. ValueError: text that is none.
    with contextlib.suppress(McapError, struct.error, EOFError, ValueError):
        file.seek(0)
        reader = StreamReader(file, emit_chunks=True, record_size_limit=RECORD_LIMIT)
        for record in reader.records:
            if isinstance(record, Metadata):
                found[record.name] = record.metadata
                if record.name in names:
                    break
    return found
