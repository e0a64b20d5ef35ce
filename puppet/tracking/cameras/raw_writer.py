"""Writes raw recordings: what a camera saw, before anybody looked for people in it.

Chunks are closed every half second of capture time: what a crash can lose is bounded by that.
"""

from __future__ import annotations

import json
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Literal, Self

import cv2
import msgspec
import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema

from puppet import __version__
from puppet.errors import UnavailableError
from puppet.tracking.cameras.camera import CameraInfo, Depth, Image, Shot
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.cameras.raw_format import (
    CALIBRATION,
    CHUNK_LIMIT,
    CHUNK_SECONDS,
    COLOUR,
    DEPTH,
    FORMAT_VERSION,
    FRAME_ID,
    METADATA_NAME,
    NANOSECONDS,
    SHOT,
    SHOT_SCHEMA,
    SHOT_SCHEMA_NAME,
    ShotMessage,
)
from puppet.tracking.cameras.shot_check import depth_error, lens_error

ColourCoding = Literal["jpeg", "png"]
JPEG_QUALITY: Final = 90
#: Of 0 to 9; more takes several times as long and saves little.
PNG_LEVEL: Final = 1
#: Depth comes in steps, which PNG's filters only blur: without them it takes half the time.
DEPTH_FILTER: Final = (cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE)


class RawWriter:
    """Writes one raw recording; use it as a context manager, so that it is finished in any case."""

    def __init__(self, path: Path, info: CameraInfo, colour: ColourCoding = "jpeg") -> None:
        """colour: "jpeg" loses a little, "png" nothing, in a file several times as large."""
        self.path = path
        self._camera = info.name
        self._colour: ColourCoding = colour
        self._file: BinaryIO = path.open("wb")
        # Images are compressed already.
        self._writer = Writer(self._file, chunk_size=CHUNK_LIMIT, compression=CompressionType.NONE)
        self._writer.start(profile="", library=f"puppet {__version__}")
        image = register_schema(self._writer, CompressedImage)
        calibration = register_schema(self._writer, CameraCalibration)
        shot = self._writer.register_schema(
            name=SHOT_SCHEMA_NAME,
            encoding=SchemaEncoding.JSONSchema,
            data=json.dumps(SHOT_SCHEMA).encode(),
        )
        proto = MessageEncoding.Protobuf
        self._channels = {
            topic: self._writer.register_channel(topic, encoding, schema)
            for topic, encoding, schema in (
                (SHOT, MessageEncoding.JSON, shot),
                (CALIBRATION, proto, calibration),
                (DEPTH, proto, image),
                (COLOUR, proto, image),
            )
        }
        self._writer.add_metadata(METADATA_NAME, _metadata(info))
        self._chunk_began: float | None = None

    @property
    def size(self) -> int:
        """Bytes that are in the file already."""
        return self._file.tell()

    def write(self, shot: Shot) -> None:
        """Append a shot.

        Raises UnavailableError for one that could not be replayed: its depth or its lens cannot be
        those of its image.
        """
        self._check(shot)
        if self._chunk_began is None:
            self._chunk_began = shot.time
        elif shot.time - self._chunk_began >= CHUNK_SECONDS:
            self._writer.flush()  # type: ignore[no-untyped-call]
            self._chunk_began = shot.time
        up = None if shot.up is None else (float(shot.up[0]), float(shot.up[1]), float(shot.up[2]))
        message = ShotMessage(float(shot.time), int(shot.sequence), up)
        self._add(SHOT, shot, msgspec.json.encode(message))
        stamp = Timestamp()
        stamp.FromNanoseconds(_nanoseconds(shot))
        height, width = shot.colour.shape[:2]
        if shot.intrinsics is not None:
            lens = _calibration(stamp, shot.intrinsics, width, height)
            self._add_message(CALIBRATION, shot, lens)
        if shot.depth is not None:
            self._add_message(DEPTH, shot, _image(stamp, "png", shot.depth))
        # What has its colour image is whole.
        self._add_message(COLOUR, shot, _image(stamp, self._colour, shot.colour))

    def _check(self, shot: Shot) -> None:
        height, width = shot.colour.shape[:2]
        lens, depth = shot.intrinsics, shot.depth
        for what, wrong in (
            ("calibration", "" if lens is None else lens_error(lens, width, height)),
            ("depth", "" if depth is None else depth_error(depth, width, height)),
        ):
            if wrong:
                raise UnavailableError(
                    f"the camera's {what} cannot be that of its image",
                    where=f"{self._camera}: shot {shot.sequence}",
                    found=wrong,
                )

    def _add_message(self, topic: str, shot: Shot, message: Message) -> None:
        self._add(topic, shot, message.SerializeToString())

    def _add(self, topic: str, shot: Shot, data: bytes) -> None:
        stamp = _nanoseconds(shot)
        self._writer.add_message(
            channel_id=self._channels[topic],
            log_time=stamp,
            publish_time=stamp,
            sequence=shot.sequence & 0xFFFFFFFF,
            data=data,
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


def _metadata(info: CameraInfo) -> dict[str, str]:
    return {
        "format_version": str(FORMAT_VERSION),
        "camera": info.name,
        "kind": info.kind,
        "device": info.device,
        "rate": f"{info.rate:g}",
        "units": "seconds, pixels; depth in millimetres along the lens's axis, 0 where not known",
        "axes": "x right, y down, z away",
        "note": info.note,
        "licence": info.licence,
    }


def _nanoseconds(shot: Shot) -> int:
    return max(0, round(shot.time * NANOSECONDS))


def _image(stamp: Timestamp, coding: ColourCoding, image: Image | Depth) -> CompressedImage:
    if coding == "jpeg":
        done, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    else:
        filters = DEPTH_FILTER if image.ndim == 2 else ()
        options = [cv2.IMWRITE_PNG_COMPRESSION, PNG_LEVEL, *filters]
        done, data = cv2.imencode(".png", image, options)
    if not done:
        raise ValueError(f"an image of {image.shape} {image.dtype} cannot be written as {coding}")
    return CompressedImage(
        timestamp=stamp, frame_id=FRAME_ID, data=np.asarray(data).tobytes(), format=coding
    )


def _calibration(stamp: Timestamp, lens: Intrinsics, width: int, height: int) -> CameraCalibration:
    fx, fy, cx, cy = lens.focal_x, lens.focal_y, lens.centre_x, lens.centre_y
    return CameraCalibration(
        timestamp=stamp,
        frame_id=FRAME_ID,
        width=width,
        height=height,
        distortion_model="plumb_bob",
        D=[0.0] * 5,
        K=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )
