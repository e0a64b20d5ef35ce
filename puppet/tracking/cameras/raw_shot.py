"""A shot from the messages of a raw recording that belong to one instant."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import cv2
import msgspec
import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from puppet.errors import BadFileError
from puppet.tracking.cameras.camera import Depth, Image, Shot
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.cameras.raw_format import CALIBRATION, COLOUR, DEPTH, SHOT, ShotMessage
from puppet.tracking.cameras.shot_check import depth_error, lens_error

_decoder: Final = msgspec.json.Decoder(ShotMessage)


def shot_of(topics: Mapping[str, bytes], where: str) -> Shot:
    """topics: the messages by topic. where: the file and the place in it.

    Raises BadFileError for messages that are missing, are none, or contradict each other.
    """
    for topic in (SHOT, COLOUR):
        if topic not in topics:
            raise BadFileError(f"a shot has nothing on {topic}", where=where)
    message = _message(topics[SHOT], where)
    colour = _colour(topics[COLOUR], where)
    depth = _depth(topics[DEPTH], colour, where) if DEPTH in topics else None
    lens = _lens(topics[CALIBRATION], colour, where) if CALIBRATION in topics else None
    up = None if message.up is None else np.array(message.up)
    return Shot(message.time, message.sequence, colour, depth, lens, up)


def _message(data: bytes, where: str) -> ShotMessage:
    try:
        return _decoder.decode(data)
    except msgspec.DecodeError as error:
        raise BadFileError("a message is not a shot", where=where, found=str(error)) from None


def _decoded(data: bytes, flags: int, where: str) -> NDArray[Any]:
    try:
        message = CompressedImage.FromString(data)
    except DecodeError as error:
        raise BadFileError("a message is not an image", where=where, found=str(error)) from None
    image = None
    if message.data:
        image = cv2.imdecode(np.frombuffer(message.data, np.uint8), flags)
    if image is None:
        raise BadFileError(
            "an image cannot be decoded",
            where=where,
            expected="jpeg or png",
            found=f"{message.format or 'no format'}, {len(message.data)} bytes",
        )
    return np.asarray(image)


def _colour(data: bytes, where: str) -> Image:
    image: Image = _decoded(data, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION, where)
    return image


def _depth(data: bytes, colour: Image, where: str) -> Depth:
    depth: Depth = _decoded(data, cv2.IMREAD_UNCHANGED, where)
    height, width = colour.shape[:2]
    wrong = depth_error(depth, width, height)
    if wrong:
        raise BadFileError(
            "the depth of a shot cannot be that of its image", where=where, found=wrong
        )
    return depth


def _lens(data: bytes, colour: Image, where: str) -> Intrinsics:
    try:
        message = CameraCalibration.FromString(data)
    except DecodeError as error:
        raise BadFileError(
            "a message is not a calibration", where=where, found=str(error)
        ) from None
    height, width = colour.shape[:2]
    if (message.width, message.height) != (width, height):
        raise BadFileError(
            "the calibration of a shot is that of another camera, or of another resolution",
            where=where,
            expected=f"{width}×{height} pixels, as the image has",
            found=f"{message.width}×{message.height}",
        )
    if len(message.K) != 9:
        raise BadFileError(
            "a calibration has no camera matrix",
            where=where,
            expected="9 numbers",
            found=f"{len(message.K)}",
        )
    lens = Intrinsics(message.K[0], message.K[4], message.K[2], message.K[5])
    wrong = lens_error(lens, width, height)
    if wrong:
        raise BadFileError(
            "the calibration of a shot cannot be that of its camera", where=where, found=wrong
        )
    return lens
