"""The thin layer that touches an OAK: from a device that was found to its running nodes.

colour ───────────────┬──────────────▶ colour, undistorted
left, right ─▶ stereo ┴─ aligned ────▶ depth, in colour's view, half as many pixels a side
imu ─────────────────────────────────▶ accelerometer
"""

from __future__ import annotations

from typing import Final

import numpy as np

from puppet.errors import UnavailableError
from puppet.kernel import Floats
from puppet.oak_config import OakConfig
from puppet.tracking.cameras.oak_listing import OakFound
from puppet.tracking.cameras.oak_stream import OakOutputs, OakStream
from puppet.tracking.cameras.quiet_depthai import dai

#: Readings of the accelerometer a second, and how many come in one message.
IMU_RATE: Final = 100
IMU_BATCH: Final = 5
#: Of the dot projector's power, where there is one and the show does not say.
LASER: Final = 0.5


def open_oak(oak: OakFound, config: OakConfig) -> OakStream:
    """Boot a device that was found, and start its nodes. Takes two to five seconds.

    Raises UnavailableError if it cannot be opened.
    """
    try:
        device = dai.Device(oak.info)
    except RuntimeError as error:
        raise _cannot_open(oak, error) from error
    try:
        # We come back by ourselves, with states for people.
        device.setMaxReconnectionAttempts(0)
        pipeline = dai.Pipeline(device)
        pipeline.setAutoCalibrationMode(dai.Pipeline.AutoCalibrationMode.OFF)
        pipeline.setStopOnDeviceLoss(True)
        outputs = device_outputs(pipeline, device, config)
        stream = OakStream(pipeline, outputs, config.rate, on_close=device.close)
        _lights(device, config)
    except RuntimeError as error:
        device.close()
        raise _cannot_open(oak, error) from error
    except UnavailableError:
        device.close()
        raise
    return stream


def device_outputs(pipeline: dai.Pipeline, device: dai.Device, config: OakConfig) -> OakOutputs:
    """Make a device's nodes.

    Raises UnavailableError if it has no camera.
    """
    calibration = _calibration(device)
    warnings: list[str] = []
    sockets = _sockets(device)
    if not sockets:
        raise UnavailableError("this OAK has no camera", where=f"oak:{device.getDeviceId()}")
    eye = sockets[0]
    cameras = {eye: pipeline.create(dai.node.Camera).build(eye)}
    colour = cameras[eye].requestOutput(
        (config.width, config.height),
        type=dai.ImgFrame.Type.NV12,  # half of what BGR needs of the cable
        fps=config.rate,
        enableUndistortion=True,
    )
    focus = None if calibration is None else calibrated_focus(calibration, eye)
    if focus is not None:
        # A lens that focuses by itself zooms a little; it was calibrated at this position.
        cameras[eye].initialControl.setManualFocus(focus)
    depth = None
    if config.depth:
        pairs = [pair for pair in device.getAvailableStereoPairs() if not pair.isVertical]
        if pairs:
            for socket in (pairs[0].left, pairs[0].right):
                if socket not in cameras:
                    cameras[socket] = pipeline.create(dai.node.Camera).build(socket)
            left, right = cameras[pairs[0].left], cameras[pairs[0].right]
            depth = _depth(pipeline, device, colour, left, right, config)
            if not config.left_right_check and device.getPlatform() == dai.Platform.RVC2:
                warnings.append("left_right_check stays on: depth in colour's view needs it")
        else:
            warnings.append("this OAK sees no depth: it has no calibrated pair of cameras")
    imu, turn = None, None
    if config.imu and device.getConnectedIMU() not in ("", "NONE"):
        turn = None if calibration is None else imu_turn(calibration, eye)
        if turn is None:
            warnings.append("the device's calibration does not say how its IMU is built in")
        else:
            imu = _accelerometer(pipeline)
    product = str(device.getProductName() or device.getDeviceName() or "OAK")
    return OakOutputs(
        colour,
        depth,
        imu,
        turn,
        f"{product}, {device.getPlatformAsString()}",
        tuple(warnings) + _missing_lights(device, config),
    )


def imu_turn(calibration: dai.CalibrationHandler, eye: dai.CameraBoardSocket) -> Floats | None:
    """(3, 3) from the IMU's axes to a camera's; None where the calibration does not have it."""
    try:
        matrix = np.asarray(calibration.getImuToCameraExtrinsics(eye), float)[:3, :3]
    except RuntimeError:
        return None
    proper = np.allclose(matrix @ matrix.T, np.eye(3), atol=0.01) and np.linalg.det(matrix) > 0.0
    return matrix if proper else None


def calibrated_focus(calibration: dai.CalibrationHandler, eye: dai.CameraBoardSocket) -> int | None:
    """The position of a lens, 1 to 254, at which a camera was calibrated; None if it is fixed."""
    try:
        position = calibration.getLensPosition(eye)
    except RuntimeError:
        return None
    return position if 0 < position < 255 else None


def depth_size(config: OakConfig) -> tuple[int, int]:
    """Width and height of depth, pixels: half of colour's, which a body's joints do not miss."""
    return config.width // 2, config.height // 2


def _depth(
    pipeline: dai.Pipeline,
    device: dai.Device,
    colour: dai.Node.Output,
    left: dai.node.Camera,
    right: dai.node.Camera,
    config: OakConfig,
) -> dai.Node.Output:
    """Depth in the view of colour."""
    size = (config.mono_width, config.mono_height)
    stereo = pipeline.create(dai.node.StereoDepth)
    stereo.build(
        left.requestOutput(size, fps=config.rate),
        right.requestOutput(size, fps=config.rate),
        presetMode=dai.node.StereoDepth.PresetMode.FAST_DENSITY,
    )
    stereo.setExtendedDisparity(config.extended)
    stereo.setSubpixel(config.subpixel)
    if config.confidence is not None:
        stereo.initialConfig.setConfidenceThreshold(config.confidence)
    if device.getPlatform() == dai.Platform.RVC2:
        stereo.setLeftRightCheck(True)
        stereo.setOutputSize(*depth_size(config))
        colour.link(stereo.inputAlignTo)
        return stereo.depth
    stereo.setLeftRightCheck(config.left_right_check)
    align = pipeline.create(dai.node.ImageAlign)
    align.setOutputSize(*depth_size(config))
    stereo.depth.link(align.input)
    colour.link(align.inputAlignTo)
    return align.outputAligned


def _accelerometer(pipeline: dai.Pipeline) -> dai.Node.Output:
    imu = pipeline.create(dai.node.IMU)
    imu.enableIMUSensor(dai.IMUSensor.ACCELEROMETER_RAW, IMU_RATE)
    imu.setBatchReportThreshold(IMU_BATCH)
    imu.setMaxBatchReports(2 * IMU_BATCH)
    return imu.out


def _sockets(device: dai.Device) -> list[dai.CameraBoardSocket]:
    """The device's cameras, those with colours first."""
    features = device.getConnectedCameraFeatures()
    plain = [one for one in features if dai.CameraSensorType.COLOR not in one.supportedTypes]
    return [one.socket for one in features if one not in plain] + [
        one.socket for one in plain if dai.CameraSensorType.MONO in one.supportedTypes
    ]


def _calibration(device: dai.Device) -> dai.CalibrationHandler | None:
    try:
        return device.readCalibration()
    except RuntimeError:
        return None


def _lights(device: dai.Device, config: OakConfig) -> None:
    """Set the dot projector and the flood light, where there are any."""
    if not device.getIrDrivers():
        return
    laser = config.laser if config.laser is not None else LASER if config.depth else 0.0
    device.setIrLaserDotProjectorIntensity(laser)
    device.setIrFloodLightIntensity(config.flood or 0.0)


def _missing_lights(device: dai.Device, config: OakConfig) -> tuple[str, ...]:
    if (config.laser or config.flood) and not device.getIrDrivers():
        return ("this OAK has no infrared lights; laser and flood do nothing",)
    return ()


def _cannot_open(oak: OakFound, error: Exception) -> UnavailableError:
    return UnavailableError(
        "this OAK could not be opened",
        where=f"oak:{oak.id or oak.name}",
        found=str(error),
        hint="unplug it, wait for five seconds, plug it in again; try another cable or port",
    )
