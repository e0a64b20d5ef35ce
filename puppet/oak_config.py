"""The part of a show that says what an OAK camera does on the device itself."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

#: Pixels along a side, as the device's encoders and its depth want them.
Width = Annotated[int, Meta(ge=320, le=3840, multiple_of=32)]
Height = Annotated[int, Meta(ge=180, le=2160, multiple_of=2)]
#: Of what a light can give; 0 is off.
Intensity = Annotated[float, Meta(ge=0.0, le=1.0)]


class OakConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Settings of an OAK, table ``[source.oak]``. Whatever a device does not have is left out.

    width, height: of the colour image, pixels; a whole number of times 32, and of 2. rate: shots a
        second; if depth cannot keep up, shots come as fast as depth does.
    depth: off gives colour alone. mono_width, mono_height: of the pair of images from which depth
        is found; finer is surer at a distance, and slower.
    confidence: 0 to 255 as depthai counts, the less the surer and the sparser; None leaves it to
        depthai. extended: sees half as near, and takes time. subpixel: finer steps at a distance.
    left_right_check: drops what only one of the pair sees; depth in the view of the colour image
        needs it on an RVC2 device.
    laser: the dot projector that gives bare walls and plain clothes a texture; None is half of
        what it can where there is one. flood: infrared light, for depth in the dark.
    imu: the device's sense of up is used. Turn it off for a device whose own calibration is wrong.
    """

    width: Width = 1280
    height: Height = 720
    rate: Annotated[float, Meta(ge=1.0, le=120.0)] = 30.0
    depth: bool = True
    mono_width: Annotated[int, Meta(ge=160, le=3840, multiple_of=16)] = 640
    mono_height: Annotated[int, Meta(ge=120, le=2160, multiple_of=2)] = 400
    confidence: Annotated[int, Meta(ge=0, le=255)] | None = None
    extended: bool = False
    subpixel: bool = True
    left_right_check: bool = True
    laser: Intensity | None = None
    flood: Intensity | None = None
    imu: bool = True
