"""The nodes that an OAK is given. The device is played; every name in it is depthai's own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np
import pytest

from puppet.errors import UnavailableError
from puppet.oak_config import OakConfig
from puppet.tracking.cameras.oak_device import calibrated_focus, device_outputs, imu_turn
from puppet.tracking.cameras.oak_stream import OakOutputs
from puppet.tracking.cameras.quiet_depthai import dai
from tests.oak_host import IMU_TO_CAMERA

A, B, C = (getattr(dai.CameraBoardSocket, f"CAM_{letter}") for letter in "ABC")


class Port:
    """An input or output of a node."""

    def __init__(self, node: Node, name: str) -> None:
        self.node, self.name = node, name

    def __str__(self) -> str:
        return f"{self.node.name}.{self.name}"

    def link(self, other: Port) -> None:
        self.node.graph.links.append((str(self), str(other)))


class Node:
    """A node of a class of depthai: it has what that has, and notes what is done with it."""

    def __init__(self, kind: type, graph: Graph, name: str) -> None:
        self.kind, self.graph, self.name = kind, graph, name
        self.calls: dict[str, tuple[Any, ...]] = {}
        # These are depthai's own, as no device is needed for them.
        self.configs = {"initialControl": dai.CameraControl(), "initialConfig": None}
        if kind is dai.node.StereoDepth:
            self.configs["initialConfig"] = cast(Any, dai.StereoDepthConfig())

    def __getattr__(self, name: str) -> Any:
        member = getattr(self.kind, name)  # raises for a name that depthai does not know
        if isinstance(member, property):
            return self.configs.get(name) or Port(self, name)

        def call(*arguments: Any, **options: Any) -> Any:
            self.calls[name] = (*arguments, options) if options else arguments
            if name == "requestOutput":
                return Port(self, "x".join(map(str, arguments[0])))
            if name == "build":
                if self.kind is dai.node.Camera:
                    self.name = f"{arguments[0].name}"
                for argument, side in zip(arguments, ("left", "right"), strict=False):
                    if isinstance(argument, Port):
                        argument.link(Port(self, side))
            return self

        return call


class Graph:
    """A pipeline that only notes what is made."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.links: list[tuple[str, str]] = []

    def create(self, kind: type) -> Node:
        self.nodes.append(Node(kind, self, kind.__name__))
        return self.nodes[-1]

    def node(self, name: str) -> Node:
        (found,) = [node for node in self.nodes if node.name == name]
        return found


class PlayedDevice:
    """What an OAK answers to the questions of `device_outputs`."""

    def __init__(
        self,
        platform: dai.Platform = dai.Platform.RVC2,
        colour: bool = True,
        pairs: tuple[tuple[Any, Any], ...] = ((B, C),),
        imu: str = "BNO086",
        lights: bool = False,
        calibration: dai.CalibrationHandler | None = None,
    ) -> None:
        self.platform, self.pairs, self.imu, self.lights = platform, pairs, imu, lights
        self.colour = colour
        self.calibration = calibration or calibration_with_imu()

    def getPlatform(self) -> dai.Platform:  # noqa: N802
        return self.platform

    def getPlatformAsString(self) -> str:  # noqa: N802
        return str(self.platform.name)

    def getProductName(self) -> str:  # noqa: N802
        return "OAK-D-PRO"

    def getDeviceId(self) -> str:  # noqa: N802
        return "14442C10D13EABCE00"

    def getConnectedIMU(self) -> str:  # noqa: N802
        return self.imu

    def getIrDrivers(self) -> list[tuple[str, int, int]]:  # noqa: N802
        return [("LM3644", 2, 99)] if self.lights else []

    def readCalibration(self) -> dai.CalibrationHandler:  # noqa: N802
        return self.calibration

    def getConnectedCameraFeatures(self) -> list[dai.CameraFeatures]:  # noqa: N802
        kinds = {B: dai.CameraSensorType.MONO, C: dai.CameraSensorType.MONO}
        if self.colour:
            kinds[A] = dai.CameraSensorType.COLOR
        features = []
        for socket, kind in kinds.items():
            feature = dai.CameraFeatures()
            feature.socket = socket
            feature.supportedTypes = [kind]
            features.append(feature)
        return features

    def getAvailableStereoPairs(self) -> list[dai.StereoPair]:  # noqa: N802
        found = []
        for left, right in self.pairs:
            pair = dai.StereoPair()
            pair.left, pair.right = left, right
            pair.isVertical = False
            found.append(pair)
        return found


def calibration_with_imu(rotation: Any = IMU_TO_CAMERA) -> dai.CalibrationHandler:
    calibration = dai.CalibrationHandler()
    lens = [[900.0, 0.0, 640.0], [0.0, 900.0, 360.0], [0.0, 0.0, 1.0]]
    calibration.setCameraIntrinsics(A, lens, dai.Size2f(1280, 720))
    calibration.setLensPosition(A, 130)
    calibration.setImuExtrinsics(A, IMU_TO_CAMERA.tolist(), [0, 0, 0], [0, 0, 0])
    # Its own setters refuse what a device may well have in its memory.
    data = calibration.eepromToJson()
    data["imuExtrinsics"]["rotationMatrix"] = np.asarray(rotation, float).tolist()
    return dai.CalibrationHandler.fromJson(data, False)


def made(device: PlayedDevice, config: OakConfig | None = None) -> tuple[Graph, OakOutputs]:
    graph = Graph()
    outputs = device_outputs(
        cast(dai.Pipeline, graph), cast(dai.Device, device), config or OakConfig()
    )
    return graph, outputs


def test_every_question_is_one_that_a_device_answers() -> None:
    asked = [name for name in vars(PlayedDevice) if not name.startswith("_")]
    assert [name for name in asked if not hasattr(dai.Device, name)] == []


def test_colour_is_undistorted_at_the_size_and_rate_of_the_show() -> None:
    config = OakConfig(width=640, height=360, rate=20.0)
    graph, outputs = made(PlayedDevice(), config)
    assert str(outputs.colour) == "CAM_A.640x360"
    options = graph.node("CAM_A").calls["requestOutput"][-1]
    assert options["enableUndistortion"] is True
    assert options["fps"] == 20.0


def test_rvc2_aligns_depth_to_colour_in_its_stereo_node() -> None:
    graph, outputs = made(PlayedDevice())
    assert str(outputs.depth) == "StereoDepth.depth"
    assert graph.links == [
        ("CAM_B.640x400", "StereoDepth.left"),
        ("CAM_C.640x400", "StereoDepth.right"),
        ("CAM_A.1280x720", "StereoDepth.inputAlignTo"),
    ]
    assert graph.node("StereoDepth").calls["setOutputSize"] == (640, 360)


def test_rvc4_aligns_depth_to_colour_in_a_node_of_its_own() -> None:
    graph, outputs = made(PlayedDevice(dai.Platform.RVC4))
    assert str(outputs.depth) == "ImageAlign.outputAligned"
    assert ("StereoDepth.depth", "ImageAlign.input") in graph.links
    assert ("CAM_A.1280x720", "ImageAlign.inputAlignTo") in graph.links
    assert graph.node("ImageAlign").calls["setOutputSize"] == (640, 360)


def test_the_shows_settings_of_depth_reach_the_device() -> None:
    config = OakConfig(
        confidence=77, extended=True, subpixel=False, mono_width=1280, mono_height=800
    )
    graph, _ = made(PlayedDevice(dai.Platform.RVC4), config)
    stereo = graph.node("StereoDepth")
    assert stereo.initialConfig.getConfidenceThreshold() == 77
    assert stereo.calls["setExtendedDisparity"] == (True,)
    assert stereo.calls["setSubpixel"] == (False,)
    assert ("CAM_B.1280x800", "StereoDepth.left") in graph.links


def test_left_right_check_stays_on_where_alignment_needs_it() -> None:
    config = OakConfig(left_right_check=False)
    graph, outputs = made(PlayedDevice(), config)
    assert graph.node("StereoDepth").calls["setLeftRightCheck"] == (True,)
    assert "left_right_check" in outputs.warnings[0]
    graph, outputs = made(PlayedDevice(dai.Platform.RVC4), config)
    assert graph.node("StereoDepth").calls["setLeftRightCheck"] == (False,)
    assert outputs.warnings == ()


def test_without_depth_there_is_one_camera() -> None:
    graph, outputs = made(PlayedDevice(), OakConfig(depth=False))
    assert outputs.depth is None
    assert [node.kind for node in graph.nodes] == [dai.node.Camera, dai.node.IMU]


def test_a_device_without_a_pair_gives_colour_and_says_so() -> None:
    _, outputs = made(PlayedDevice(pairs=()))
    assert outputs.depth is None
    assert "no depth" in outputs.warnings[0]


def test_a_camera_of_the_pair_may_be_the_one_that_is_looked_through() -> None:
    graph, outputs = made(PlayedDevice(colour=False))
    assert str(outputs.colour) == "CAM_B.1280x720"
    assert outputs.depth is not None
    assert [node.name for node in graph.nodes if node.kind is dai.node.Camera] == [
        "CAM_B",
        "CAM_C",
    ]


def test_a_device_without_cameras_is_an_error() -> None:
    device = PlayedDevice()
    device.getConnectedCameraFeatures = list  # type: ignore[method-assign]
    with pytest.raises(UnavailableError, match="no camera"):
        made(device)


def test_the_accelerometer_is_read_and_turned_into_the_cameras_axes() -> None:
    graph, outputs = made(PlayedDevice())
    assert str(outputs.imu) == "IMU.out"
    assert graph.node("IMU").calls["enableIMUSensor"][0] == dai.IMUSensor.ACCELEROMETER_RAW
    assert outputs.imu_to_camera is not None
    # An OAK-D on its foot measures (-9.81, 0, 0): its x points down. Up in an image is -y.
    np.testing.assert_allclose(outputs.imu_to_camera @ (-9.81, 0.0, 0.0), (0.0, -9.81, 0.0))


@pytest.mark.parametrize("rotation", [np.zeros((3, 3)), np.diag([1.0, 1.0, -1.0]), 2.0 * np.eye(3)])
def test_a_calibration_that_is_no_rotation_is_not_believed(rotation: Any) -> None:
    _, outputs = made(PlayedDevice(calibration=calibration_with_imu(rotation)))
    assert outputs.imu is None
    assert "IMU" in outputs.warnings[0]


def test_gravity_can_be_turned_off_and_may_not_be_there() -> None:
    for device, config in ((PlayedDevice(), OakConfig(imu=False)), (PlayedDevice(imu=""), None)):
        _, outputs = made(device, config)
        assert outputs.imu is None
        assert outputs.warnings == ()


def test_lights_that_are_not_there_are_missed_only_if_they_were_asked_for() -> None:
    assert made(PlayedDevice())[1].warnings == ()
    _, outputs = made(PlayedDevice(), OakConfig(laser=0.5))
    assert "no infrared lights" in outputs.warnings[0]
    assert made(PlayedDevice(lights=True), OakConfig(laser=0.5))[1].warnings == ()


def test_a_lens_stays_where_it_was_calibrated() -> None:
    graph, _ = made(PlayedDevice())
    assert graph.node("CAM_A").initialControl.getLensPosition() == 130
    assert calibrated_focus(dai.CalibrationHandler(), A) is None


def test_a_real_calibration_is_read(shared: Path) -> None:
    calibration = dai.CalibrationHandler(shared / "oak" / "calib.json")
    position = calibrated_focus(calibration, A)
    assert (
        position
        == msgspec.json.decode((shared / "oak" / "calib.json").read_bytes())["cameraData"][0][1][
            "lensPosition"
        ]
    )
    # Its IMU was never calibrated, as in many devices.
    assert imu_turn(calibration, A) is None


def test_a_device_that_goes_away_before_it_boots_is_an_error() -> None:
    code = (
        "from puppet.errors import UnavailableError\n"
        "from puppet.oak_config import OakConfig\n"
        "from puppet.tracking.cameras.oak_device import open_oak\n"
        "from puppet.tracking.cameras.oak_listing import found_oak\n"
        "from tests.oak_host import device_info\n"
        "try: open_oak(found_oak(device_info()), OakConfig())\n"
        "except UnavailableError as error: print(error)\n"
    )
    quick = {"DEPTHAI_BOOTUP_TIMEOUT": "100", "DEPTHAI_CONNECT_TIMEOUT": "100"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).resolve().parents[1],
        env=os.environ | quick,
        capture_output=True,
        text=True,
        check=True,
    )
    assert "this OAK could not be opened" in done.stdout
    assert done.stderr == ""
