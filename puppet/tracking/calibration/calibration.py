"""What a saved calibration says of a camera, and whether it is of this camera at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from puppet.formats.calibration_file import CalibrationFile, CameraRow, Kind, LensRow, StanceRow
from puppet.mapping.stance import Stance, stance_of
from puppet.skeleton import JOINT_NAMES
from puppet.tracking.calibration.stage_frame import StageFromCamera, joints_of
from puppet.tracking.cameras.camera import CameraInfo
from puppet.tracking.cameras.intrinsics import Intrinsics


@dataclass(frozen=True, slots=True, eq=False)
class CameraCalibration:
    """Where a camera stands; None if that is to be learnt. width, height: pixels of the images that
    it holds for. lens: theirs; None if it was not known."""

    stage_from_camera: StageFromCamera | None
    width: int
    height: int
    lens: Intrinsics | None = None

    @classmethod
    def of(cls, row: CameraRow) -> CameraCalibration:
        """What the file says."""
        lens = None if row.lens is None else Intrinsics(*_numbers(row.lens))
        frame = StageFromCamera.of(row.rotation, row.translation)
        return cls(frame, row.width, row.height, lens)

    def misfit(self, width: int, height: int) -> str:
        """Why it cannot be used for images of this size, as a sentence; empty if it can."""
        if (width, height) == (self.width, self.height):
            return ""
        return (
            f"the stage calibration is of images of {self.width}×{self.height} pixels and these "
            f"have {width}×{height}: it is not used (`puppet calibrate` makes another)"
        )


def device_of(info: CameraInfo) -> str:
    """What a calibration knows a camera by."""
    return info.device or info.name


def calibration_of(file: CalibrationFile, info: CameraInfo) -> tuple[CameraCalibration | None, str]:
    """The calibration of a camera, and a sentence for people if there are only others'."""
    row = file.camera(device_of(info))
    if row is not None:
        return CameraCalibration.of(row), ""
    if not file.cameras:
        return None, ""
    others = ", ".join(other.device for other in file.cameras)
    return None, (
        f"the stage calibration is another camera's ({others}), not that of {device_of(info)}: "
        "it is not used (`puppet calibrate` makes one)"
    )


def lens_row(lens: Intrinsics | None) -> LensRow | None:
    """A lens for the file."""
    if lens is None:
        return None
    return LensRow(lens.focal_x, lens.focal_y, lens.centre_x, lens.centre_y)


def stance_row(stance: Stance, kind: Kind, when: str = "") -> StanceRow:
    """A neutral stance for the file."""
    x, y, z = joints_of(stance).T.tolist()
    return StanceRow(kind, dict(zip(JOINT_NAMES, zip(x, y, z, strict=True), strict=True)), when)


def stance_in(file: CalibrationFile) -> Stance | None:
    """The neutral stance that the file keeps."""
    if file.stance is None:
        return None
    return stance_of(np.array([file.stance.joints[name] for name in JOINT_NAMES]))


def _numbers(lens: LensRow) -> tuple[float, float, float, float]:
    return lens.focal_x, lens.focal_y, lens.centre_x, lens.centre_y
