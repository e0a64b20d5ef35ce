"""OAKs without a device: depthai's own pipelines, messages and queues, fed by nodes of the host."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.oak_config import OakConfig
from puppet.tracking.cameras.oak_listing import OakFound, found_oak
from puppet.tracking.cameras.oak_stream import OakOutputs, OakStream
from puppet.tracking.cameras.quiet_depthai import dai

SIZE = (128, 72)
LENS = ((100.0, 0.0, 64.0), (0.0, 101.0, 36.0), (0.0, 0.0, 1.0))
#: As an OAK-D stands on its foot: the IMU's x points down, y to the left, z away.
IMU_TO_CAMERA: Floats = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
UPRIGHT = (-9.81, 0.0, 0.0)
RATE = 100.0


def device_info(
    identity: str = "14442C10D13EABCE00",
    name: str = "1.2",
    state: str = "UNBOOTED",
    status: str = "SUCCESS",
    protocol: str = "USB_VSC",
    platform: str = "MYRIAD_X",
) -> dai.DeviceInfo:
    """A device as depthai lists it; the words are those of its enumerations."""
    return dai.DeviceInfo(
        name,
        identity,
        getattr(dai.XLinkDeviceState, f"X_LINK_{state}"),
        getattr(dai.XLinkProtocol, f"X_LINK_{protocol}"),
        getattr(dai.XLinkPlatform, f"X_LINK_{platform}"),
        getattr(dai.XLinkError_t, f"X_LINK_{status}"),
    )


def lens_of(
    size: tuple[int, int] = SIZE,
    matrix: Sequence[Sequence[float]] = LENS,
    distortion: Sequence[float] = (),
) -> dai.ImgTransformation:
    return dai.ImgTransformation(
        *size, [list(row) for row in matrix], dai.CameraModel.Perspective, list(distortion)
    )


def half(matrix: Sequence[Sequence[float]] = LENS) -> list[list[float]]:
    """The lens of the same image with half as many pixels a side."""
    return [[0.5 * value for value in row] for row in matrix[:2]] + [[0.0, 0.0, 1.0]]


def image_frame(
    image: NDArray[Any],
    kind: dai.ImgFrame.Type,
    moment: float,
    sequence: int,
    transformation: dai.ImgTransformation | None = None,
) -> dai.ImgFrame:
    frame = dai.ImgFrame()
    frame.setCvFrame(image, kind)
    frame.setTimestamp(timedelta(seconds=moment))
    frame.setTimestampDevice(timedelta(seconds=moment))
    frame.setSequenceNum(sequence)
    if transformation is not None:
        frame.setTransformation(transformation)
    return frame


@dataclass
class Script:
    """What a device does in one life.

    shots: so many, `pace` seconds apart; the device counts from `first`. behind: seconds that depth
    comes after colour. After the shots it hangs or is unplugged.
    """

    shots: int = 5
    then: Literal["hang", "unplug"] = "hang"
    pace: float = 0.02
    first: int = 0
    depth: bool = True
    imu: tuple[float, float, float] | None = UPRIGHT
    lens: dai.ImgTransformation = field(default_factory=lens_of)
    behind: float = 0.0
    lost_depths: frozenset[int] = frozenset()


class HostOak(dai.node.ThreadedHostNode):
    """Sends what a device would send."""

    def __init__(self, script: Script) -> None:
        super().__init__()
        self.script = script
        self.colour = self.createOutput("colour")
        self.depth = self.createOutput("depth")
        self.imu = self.createOutput("imu")

    def run(self) -> None:
        script = self.script
        width, height = SIZE
        # Long before the first shot, as a device whose IMU runs while its cameras start.
        now = time.monotonic()
        if script.imu is not None:
            self.imu.send(readings([(now + 0.01 * k - 1.0, script.imu) for k in range(100)]))
        for k in range(script.first, script.first + script.shots):
            if not self.isRunning():
                return
            now = time.monotonic()
            colour = np.full((height, width, 3), (k % 256, 100, 200), np.uint8)
            self.colour.send(image_frame(colour, dai.ImgFrame.Type.BGR888i, now, k, script.lens))
            if script.depth and k not in script.lost_depths:
                depth = np.full((height // 2, width // 2), 1000 + k, np.uint16)
                small = lens_of((width // 2, height // 2), half())
                then = now + script.behind
                self.depth.send(image_frame(depth, dai.ImgFrame.Type.RAW16, then, k, small))
            if script.imu is not None:
                self.imu.send(readings([(now, script.imu)]))
            time.sleep(script.pace)
        if script.then == "unplug":
            self.stopPipeline()
        while self.isRunning():
            time.sleep(0.005)


def readings(values: Sequence[tuple[float, Sequence[float]]]) -> dai.IMUData:
    """What an accelerometer measured: times, seconds, and (3,) m/s² in the IMU's own axes."""
    packets = []
    for moment, (x, y, z) in values:
        packet = dai.IMUPacket()
        report = packet.acceleroMeter
        report.x, report.y, report.z = x, y, z
        stamp = dai.Timestamp()
        stamp.sec, stamp.nsec = int(moment), int(1e9 * (moment % 1.0))
        report.timestamp = stamp
        packet.acceleroMeter = report
        packets.append(packet)
    data = dai.IMUData()
    data.packets = packets
    return data


def host_stream(script: Script, rate: float = RATE) -> OakStream:
    """A stream of a device that does what the script says."""
    pipeline = dai.Pipeline(False)
    oak = pipeline.create(HostOak, script)
    outputs = OakOutputs(
        oak.colour,
        oak.depth if script.depth else None,
        None if script.imu is None else oak.imu,
        None if script.imu is None else IMU_TO_CAMERA,
        "OAK-D, of the host",
    )
    return OakStream(pipeline, outputs, rate)


class Bus:
    """Where devices are plugged in: each opening is the next of its scripts.

    present: what is listed. The last script is used again and again. One that is an exception is
    raised by the opening.
    """

    def __init__(self, *scripts: Script | Exception, present: Sequence[OakFound] = ()) -> None:
        self.scripts = list(scripts)
        self.present = list(present) or [found_oak(device_info())]
        self.opened: list[str] = []
        self.listed = 0
        self.streams: list[OakStream] = []

    def lister(self) -> list[OakFound]:
        self.listed += 1
        return self.present

    def opener(self, oak: OakFound, config: OakConfig) -> OakStream:
        self.opened.append(oak.id)
        script = self.scripts.pop(0) if len(self.scripts) > 1 else self.scripts[0]
        if isinstance(script, Exception):
            raise script
        stream = host_stream(script, config.rate)
        self.streams.append(stream)
        return stream
