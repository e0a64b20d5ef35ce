"""What comes from an OAK once its nodes run: colour with depth of the same instant, and gravity.

The nodes may as well be the host's own, so nothing here needs a device.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import timedelta
from typing import Final

import numpy as np

from puppet.kernel import Floats
from puppet.tracking.cameras.camera import Depth, Image
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.cameras.quiet_depthai import dai

#: Readings that may wait while a shot is being looked at; older ones are forgotten.
READINGS_KEPT: Final = 100
#: Widths to heights of colour and depth of one view differ by no more than this part.
SAME_SHAPE: Final = 0.02


class OakLostError(Exception):
    """The device went away while it was used. A state for people, not an error."""


@dataclass(frozen=True, slots=True)
class OakOutputs:
    """The ends of the nodes that a stream is made of.

    colour, depth: outputs of images; depth in millimetres in the view of colour, None without.
    imu: an output of accelerometer readings, None without. imu_to_camera: (3, 3), turns them into
        the axes of the colour image. product: what the device is sold as. warnings: for people.
    """

    colour: dai.Node.Output
    depth: dai.Node.Output | None = None
    imu: dai.Node.Output | None = None
    imu_to_camera: Floats | None = None
    product: str = ""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class OakShot:
    """One instant, as the device gave it.

    time: capture, seconds on the host's monotonic clock. sequence: as the device counts. colour:
    (h, w, 3) BGR. depth: (h, w) millimetres. intrinsics: of colour.
    """

    time: float
    sequence: int
    colour: Image
    depth: Depth | None
    intrinsics: Intrinsics | None
    warnings: tuple[str, ...] = field(default=())


class OakStream:
    """A pipeline that runs, and its newest shot.

    What nobody takes is replaced by what is newer. Colour without depth of its instant is left out.
    """

    def __init__(
        self,
        pipeline: dai.Pipeline,
        outputs: OakOutputs,
        rate: float,
        on_close: Callable[[], None] = lambda: None,
    ) -> None:
        """Starts the pipeline.

        rate: shots a second. on_close: lets go of the device; called once.
        """
        self.product: Final = outputs.product
        self.warnings: Final = outputs.warnings
        self._pipeline: dai.Pipeline | None = pipeline
        self._imu_to_camera = outputs.imu_to_camera
        self._on_close = on_close
        self._closing = threading.Lock()
        # On the host, so that pairing costs the device nothing, and is the same without one.
        sync = pipeline.create(dai.node.Sync)
        sync.setRunOnHost(True)
        sync.setSyncThreshold(timedelta(seconds=0.5 / rate))
        outputs.colour.link(sync.inputs["colour"])
        if outputs.depth is not None:
            outputs.depth.link(sync.inputs["depth"])
        self._shots = sync.out.createOutputQueue(maxSize=1, blocking=False)
        self._readings: dai.MessageQueue | None = None
        if outputs.imu is not None and outputs.imu_to_camera is not None:
            self._readings = outputs.imu.createOutputQueue(maxSize=READINGS_KEPT, blocking=False)
        pipeline.start()

    @property
    def knows_up(self) -> bool:
        """Whether there are readings of the accelerometer."""
        return self._readings is not None

    def shot(self, timeout: float) -> OakShot | None:
        """The newest shot that was not taken yet; waits up to `timeout` seconds for one.

        Raises OakLostError if there will be no more.
        """
        try:
            group = self._shots.get(timedelta(seconds=timeout))
        except (dai.MessageQueue.QueueException, RuntimeError) as error:
            raise OakLostError(str(error)) from error
        return shot_of(group) if isinstance(group, dai.MessageGroup) else None

    def readings(self) -> list[tuple[float, Floats]]:
        """What the accelerometer measured since the last call: times, seconds, and (3,) in the axes
        of the colour image (x right, y down, z away), m/s²."""
        if self._readings is None or self._imu_to_camera is None:
            return []
        try:
            messages = self._readings.tryGetAll()
        except (dai.MessageQueue.QueueException, RuntimeError):
            return []
        return [
            (
                packet.acceleroMeter.getTimestamp().total_seconds(),
                self._imu_to_camera
                @ (packet.acceleroMeter.x, packet.acceleroMeter.y, packet.acceleroMeter.z),
            )
            for message in messages
            if isinstance(message, dai.IMUData)
            for packet in message.packets
        ]

    def close(self) -> None:
        """Stop the pipeline and let go of the device. May be called twice, and from another thread
        while a shot is waited for; takes seconds with a device that hangs."""
        with self._closing:
            # Nodes must not outlive the interpreter, so nothing keeps them.
            pipeline, self._pipeline = self._pipeline, None
        if pipeline is None:
            return
        try:
            pipeline.stop()
            pipeline.wait()
        except RuntimeError:
            pass  # it is gone already
        finally:
            self._on_close()


def shot_of(group: dai.MessageGroup) -> OakShot | None:
    """A shot from messages of one instant; None if there is no image among them."""
    names = group.getMessageNames()
    frame = group["colour"] if "colour" in names else None
    if not isinstance(frame, dai.ImgFrame):
        return None
    colour = np.asarray(frame.getCvFrame())
    if colour.ndim == 2:  # a camera without colours
        colour = np.repeat(colour[:, :, None], 3, axis=2)
    depth: Depth | None = None
    warnings: list[str] = []
    behind = group["depth"] if "depth" in names else None
    if isinstance(behind, dai.ImgFrame):
        depth = np.asarray(behind.getFrame())
        warnings += _doubts(colour, depth, frame, behind)
        if depth.dtype != np.uint16 or not _same_shape(colour, depth):
            depth = None
    transformation = frame.getTransformation()
    intrinsics = intrinsics_of(transformation)
    if intrinsics is None:
        warnings.append("the device does not know its lens; its angle of view is assumed")
    elif any(transformation.getDistortionCoefficients()):
        warnings.append("the colour image is distorted; joints near its border are off")
    return OakShot(
        frame.getTimestamp().total_seconds(),
        frame.getSequenceNum(),
        colour,
        depth,
        intrinsics,
        tuple(warnings),
    )


def intrinsics_of(transformation: dai.ImgTransformation) -> Intrinsics | None:
    """The lens of an image; None if the device does not know it."""
    if not transformation.isValid():
        return None
    # depthai's stubs do not know what this returns: (3, 3).
    matrix: Floats = np.array(transformation.getIntrinsicMatrix(), np.float64)  # type: ignore[no-untyped-call]
    (focal_x, _, centre_x), (_, focal_y, centre_y) = matrix[:2]
    # depthai says 1 where nothing is known.
    if not np.isfinite(matrix).all() or min(focal_x, focal_y) <= 1.0:
        return None
    return Intrinsics(float(focal_x), float(focal_y), float(centre_x), float(centre_y))


def _same_shape(colour: Image, depth: Depth) -> bool:
    (height, width), (depth_height, depth_width) = colour.shape[:2], depth.shape[:2]
    if min(height, width, depth_height, depth_width) == 0 or depth.ndim != 2:
        return False
    ratio = (width * depth_height) / (height * depth_width)
    return bool(abs(ratio - 1.0) <= SAME_SHAPE)


def _doubts(
    colour: Image, depth: Depth, frame: dai.ImgFrame, behind: dai.ImgFrame
) -> tuple[str, ...]:
    """What speaks against depth being of the same view as colour."""
    if depth.dtype != np.uint16 or not _same_shape(colour, depth):
        return ("depth is not of the colour image's view, and is left out",)
    lens = intrinsics_of(frame.getTransformation())
    theirs = intrinsics_of(behind.getTransformation())
    if lens is None or theirs is None:
        return ()
    resized = theirs.resized(colour.shape[1] / depth.shape[1])
    if abs(resized.focal_x / lens.focal_x - 1.0) > SAME_SHAPE:
        return ("depth may not be of the colour image's view: their lenses differ",)
    return ()
