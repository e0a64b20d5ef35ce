"""What is kept of a calibration, and what happens when it is of something else."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.errors import BadFileError, UnavailableError
from puppet.formats.calibration_file import (
    CalibrationFile,
    CameraRow,
    LensRow,
    StanceRow,
    backup_path,
    calibration_path,
    read_calibration,
    swap_with_backup,
    write_calibration,
)
from puppet.kernel import Floats
from puppet.mapping.stance import UPRIGHT, stance_of
from puppet.skeleton import Joint
from puppet.tracking.calibration.calibration import (
    CameraCalibration,
    calibration_of,
    stance_in,
    stance_row,
)
from puppet.tracking.calibration.stage_frame import StageFromCamera, at_mark, joints_of, mark_of
from puppet.tracking.cameras.camera import CameraInfo

ROW = CameraRow(
    device="oak:14442C10D13EABCE00",
    width=1280,
    height=720,
    rotation=(0.0, 0.0, 0.0, 1.0),
    translation=(0.1, 1.2, 2.5),
    floor="depth",
    origin='the performer\'s "mark"',
    when="2026-11-25 08:00",
    quality="±3 mm",
    lens=LensRow(900.0, 901.0, 640.0, 360.0),
)

numbers = st.floats(-10.0, 10.0)
turns = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1)


def standing(turn: float = 0.0, place: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Floats:
    points = np.array([UPRIGHT[joint] for joint in Joint])
    return np.asarray(Rotation.from_euler("y", turn).apply(points) + place)


def saved(path: Path) -> str:
    file = CalibrationFile().with_camera(ROW).with_stance(stance_row(stance_of(standing()), "T"))
    write_calibration(path, file)
    return path.read_text()


def test_it_lies_beside_the_show() -> None:
    assert calibration_path(Path("a/demo.toml")) == Path("a/demo.stage.toml")


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "show.stage.toml"
    saved(path)
    file = read_calibration(path)
    assert file.camera(ROW.device) == ROW
    stance = stance_in(file)
    assert stance is not None
    np.testing.assert_allclose(joints_of(stance), standing(), atol=1e-6)


def test_no_file_is_no_calibration(tmp_path: Path) -> None:
    assert read_calibration(tmp_path / "none.stage.toml") == CalibrationFile()


@given(turns, st.tuples(numbers, numbers, numbers))
def test_a_place_comes_back_from_numbers(
    quaternion: tuple[float, float, float, float], shift: tuple[float, float, float]
) -> None:
    frame = StageFromCamera.of(quaternion, shift)
    again = StageFromCamera.of(frame.quaternion.tolist(), frame.shift)
    points = np.array([[0.3, -0.2, -2.0], [1.0, 0.5, -4.0]])
    np.testing.assert_allclose(again.to_stage(points), frame.to_stage(points), atol=1e-9)
    np.testing.assert_allclose(frame.to_camera(frame.to_stage(points)), points, atol=1e-9)


@given(numbers, numbers, st.floats(-3.1, 3.1), turns)
def test_who_stands_on_the_mark_is_at_the_origin_and_faces_front(
    x: float, z: float, heading: float, quaternion: tuple[float, float, float, float]
) -> None:
    before = StageFromCamera.of(quaternion, (0.5, 1.5, 2.0))
    body = standing(heading, (x, 0.0, z))
    after = before.with_mark(*mark_of(body))
    found = after.to_stage(before.to_camera(body))
    np.testing.assert_allclose(found, standing(), atol=1e-6)
    stance = at_mark(stance_of(body), *mark_of(body))
    np.testing.assert_allclose(joints_of(stance), standing(), atol=1e-6)
    assert stance.heading == pytest.approx(0.0, abs=1e-6)


def test_another_camera_s_calibration_is_reported_and_not_used() -> None:
    file = CalibrationFile().with_camera(ROW)
    found, why = calibration_of(file, CameraInfo("webcam:0", "webcam", 30.0))
    assert found is None
    assert "webcam:0" in why
    assert ROW.device in why
    assert "not used" in why


def test_a_recording_knows_the_camera_that_made_it() -> None:
    file = CalibrationFile().with_camera(ROW)
    found, why = calibration_of(file, CameraInfo("night.mcap", "raw", 30.0, device=ROW.device))
    assert found is not None
    assert not why
    assert found.stage_from_camera is not None
    np.testing.assert_allclose(found.stage_from_camera.shift, ROW.translation)
    assert found.lens is not None
    assert found.lens.focal_y == 901.0


def test_without_any_calibration_there_is_nothing_to_report() -> None:
    info = CameraInfo("webcam:0", "webcam", 30.0)
    assert calibration_of(CalibrationFile(), info) == (None, "")


def test_images_of_another_size_are_told_apart() -> None:
    calibration = CameraCalibration.of(ROW)
    assert calibration.misfit(1280, 720) == ""
    assert "1280×720" in calibration.misfit(720, 1280)
    assert "640×480" in calibration.misfit(640, 480)


def test_a_camera_is_replaced_and_others_stay() -> None:
    other = CameraRow("webcam:0", 640, 480, (0.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0))
    file = CalibrationFile().with_camera(ROW).with_camera(other)
    moved = CameraRow(ROW.device, 1280, 720, (0.0, 1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    file = file.with_camera(moved)
    assert file.camera(ROW.device) == moved
    assert file.camera("webcam:0") == other
    assert len(file.cameras) == 2


def test_the_one_before_is_kept_and_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "show.stage.toml"
    write_calibration(path, CalibrationFile().with_camera(ROW))
    assert not backup_path(path).exists()
    write_calibration(path, CalibrationFile())
    assert swap_with_backup(path).camera(ROW.device) == ROW
    assert read_calibration(path).camera(ROW.device) == ROW
    swap_with_backup(path)
    assert read_calibration(path) == CalibrationFile()


def test_without_one_before_there_is_nothing_to_undo(tmp_path: Path) -> None:
    path = tmp_path / "show.stage.toml"
    saved(path)
    with pytest.raises(BadFileError, match="no calibration before"):
        swap_with_backup(path)


def test_a_file_that_cannot_be_replaced_stays_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "gone" / "show.stage.toml"
    with pytest.raises(UnavailableError, match="cannot be saved"):
        write_calibration(path, CalibrationFile())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("old", "new", "what", "where"),
    [
        ("[end]", "", "cut off", "stage.toml"),
        ("version = 1", "version = 9", "another version", "stage.toml"),
        ("version = 1\n", "", "another version", "stage.toml"),
        ("width = 1280", "width = 0", "expected `int` >= 1", "cameras[0].width"),
        ("width = 1280", 'width = "wide"', "expected `int`", "cameras[0].width"),
        ("width = 1280", "width = 1280\nbreadth = 3", "unknown field", "cameras[0]"),
        ("[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0, 0.5]", "length 1", "cameras[0].rotation"),
        ("[0.1, 1.2, 2.5]", "[0.1, nan, 2.5]", "not a place", "cameras[0].translation"),
        ("focal_x = 900.0", "focal_x = 0.0", "no such lens", "cameras[0].lens"),
        ("\nhead = ", "\nhat = ", "joints", "stance.joints"),
        ("\nhead = [0.0, 1.65", "\nhead = [inf, 1.65", "not a place", "stance.joints.head"),
        ('kind = "T"', 'kind = "X"', "invalid enum value", "stance.kind"),
        ("[[cameras]]", "[[cameras", "TOML", "stage.toml"),
    ],
)
def test_a_file_that_makes_no_sense_says_where(
    tmp_path: Path, old: str, new: str, what: str, where: str
) -> None:
    path = tmp_path / "show.stage.toml"
    text = saved(path)
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(BadFileError, match=re.escape(what)) as caught:
        read_calibration(path)
    assert where in str(caught.value.where)
    assert "puppet calibrate" in str(caught.value)


@given(st.integers(0, 1500))
def test_a_file_that_was_cut_off_anywhere_is_no_calibration(
    tmp_path_factory: pytest.TempPathFactory, length: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "cut.stage.toml"
    text = saved(path)
    path.write_text(text[: min(length, text.index("[end]") + len("[end"))])
    with pytest.raises(BadFileError):
        read_calibration(path)


def test_a_camera_twice_is_told(tmp_path: Path) -> None:
    path = tmp_path / "show.stage.toml"
    write_calibration(path, CalibrationFile(cameras=(ROW, ROW)))
    with pytest.raises(BadFileError, match="twice"):
        read_calibration(path)


def test_the_stance_row_names_every_joint() -> None:
    row: StanceRow = stance_row(stance_of(standing()), "I", "now")
    assert next(iter(row.joints)) == "hip_center"
    assert row.joints["head"] == pytest.approx((0.0, 1.65, 0.0))
