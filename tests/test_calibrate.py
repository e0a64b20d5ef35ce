"""`puppet calibrate`, and what a show makes of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from puppet.cli import calibrate as _registered  # noqa: F401
from puppet.cli.options import app
from puppet.commands.calibrate import (
    calibrate_show,
    show_calibration,
    undo_calibration,
    write_board,
)
from puppet.commands.calibration_steps import Wishes
from puppet.errors import BadShowError, PuppetError
from puppet.formats.calibration_file import (
    CalibrationFile,
    CameraRow,
    calibration_path,
    read_calibration,
    write_calibration,
)
from puppet.kernel import Floats
from puppet.skeleton import Joint, Moment
from puppet.tracking.calibration.annotate import draw_skeleton
from puppet.tracking.calibration.annotate_stage import draw_floor, draw_stage
from puppet.tracking.calibration.calibrated import saved_stance, use_calibration
from puppet.tracking.calibration.lens import LensWatch, measure_lens
from puppet.tracking.calibration.level import Level
from puppet.tracking.calibration.on_mark import OnMark
from puppet.tracking.calibration.stage_frame import StageFromCamera, angle_between, joints_of
from puppet.tracking.cameras.camera import CameraInfo, Shot
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.open import open_source
from puppet.tracking.takes.rehearsal import Rehearsal
from puppet.tracking.watcher import Watcher
from tests.board_views import A4, LENS, LYING, camera_at, seen, view
from tests.pose_models import clip_or_skip, models_or_skip
from tests.test_floor_plane import LENS as DEPTH_LENS
from tests.test_floor_plane import room

REPOSITORY = Path(__file__).resolve().parents[1]


def write_show(folder: Path, *sources: Path) -> Path:
    lines = ['name = "Calibrated"']
    if len(sources) == 1:
        lines += ["[source]", f'path = "{sources[0]}"']
    for index, source in enumerate(sources if len(sources) > 1 else ()):
        lines += ["[[sources]]", f'name = "cam{index}"', f'path = "{source}"']
    fish = REPOSITORY / "configs/armatures/fish.glb"
    lines += ["[[puppets]]", 'name = "fish"', f'armature = "{fish}"']
    path = folder / "show.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def write_video(path: Path, images: Sequence[ArrayLike], rate: float = 15.0) -> Path:
    height, width = np.shape(images[0])[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), rate, (width, height))
    assert writer.isOpened()
    for image in images:
        writer.write(np.asarray(image, np.uint8))
    writer.release()
    return path


class Seen:
    """The rehearsal, as a camera at a known place on its stage sees it."""

    def __init__(
        self, stage_from_camera: StageFromCamera, mark: tuple[float, float, float]
    ) -> None:
        """mark: x and z, metres, and heading, radians, of whoever performs."""
        self.truth = stage_from_camera
        self._turn = Rotation.from_euler("y", mark[2])
        self._place = (mark[0], 0.0, mark[1])

    def moment(self, moment: Moment, noise: Floats) -> Moment:
        [frame] = moment.frames
        stage = self._turn.apply(np.array(frame.positions)) + self._place
        camera = self.truth.to_camera(np.asarray(stage)) + noise
        return Moment.of(type(frame)(frame.time, frame.sequence, 0, camera, frame.states))


@pytest.mark.parametrize("mark", [(0.0, 0.0, 0.0), (0.8, -0.5, 0.5), (-1.0, 0.3, -0.7)])
@pytest.mark.parametrize("known", [True, False])
def test_a_performer_who_stands_on_a_mark_says_where_the_camera_is(
    mark: tuple[float, float, float], known: bool
) -> None:
    truth = camera_at((0.6, 1.4, 3.0), (0.0, 0.9, 0.0), 0.1)
    room, random, wizard = Seen(truth, mark), np.random.default_rng(0), OnMark()
    level = Level(truth.up, 1.4) if known else Level()
    for moment in Rehearsal():
        wizard.step(room.moment(moment, random.normal(0.0, 0.004, (20, 3))), level)
        if wizard.stage is not None:
            break
    found = wizard.stage
    assert found is not None
    assert found.kind == "I"
    assert found.floor == ("a given height" if known else "feet")
    # The camera on the stage that the performer's mark makes.
    hip = next(iter(Rehearsal())).frames[0].positions[Joint.HIP_CENTER]
    expected = truth.with_mark(mark[0], mark[1], mark[2])
    turn, shift = (0.5, 0.03) if known else (3.0, 0.15)
    apart = Rotation.from_matrix(found.stage_from_camera.rotation @ expected.rotation.T)
    assert math.degrees(apart.magnitude()) < turn + 1.0
    assert np.linalg.norm(found.stage_from_camera.shift - expected.shift) < shift + 0.05
    assert found.stance is not None
    joints = joints_of(found.stance)
    np.testing.assert_allclose(joints[Joint.HIP_CENTER, [0, 2]], 0.0, atol=1e-6)
    assert joints[Joint.HIP_CENTER, 1] == pytest.approx(hip[1], abs=0.05)
    assert abs(found.stance.heading) < 1e-6


def test_standing_at_the_keyboard_does_not_count_while_one_walks_to_the_mark() -> None:
    room = Seen(camera_at((0.0, 1.4, 3.0), (0.0, 0.9, 0.0)), (0.0, 0.0, 0.0))
    hasty, patient = OnMark(), OnMark(walk=5.0)
    said = set()
    for moment in Rehearsal():
        if moment.time > 4.0:
            break
        there = room.moment(moment, np.zeros((20, 3)))
        hasty.step(there, Level(room.truth.up, 1.4))
        patient.step(there, Level(room.truth.up, 1.4))
        said.add(patient.saying)
    assert hasty.stage is not None
    assert patient.stage is None
    assert any("Walk to your mark" in text for text in said)


def test_a_recording_in_which_nobody_stands_still_has_a_mark_in_its_middle() -> None:
    room = Seen(camera_at((0.0, 1.4, 3.5), (0.0, 0.9, 0.0)), (0.5, 0.2, 0.0))
    wizard, level = OnMark(), Level(room.truth.up, 1.4)
    for moment in Rehearsal():
        if 8.0 < moment.time < 12.0 and moment.sequence % 2:  # it never rests for long enough
            wizard.step(room.moment(moment, np.full((20, 3), 0.2 * (moment.sequence % 4))), level)
    found = wizard.finish(level)
    assert found is not None
    assert found.stance is None
    assert "nobody stood still" in found.origin
    np.testing.assert_allclose(found.stage_from_camera.shift[[0, 2]], (-0.5, 3.3), atol=0.6)


def test_nobody_is_told_what_to_do() -> None:
    wizard = OnMark()
    wizard.step(Moment(0.0, 0), Level())
    assert "Step into the picture" in wizard.saying
    assert wizard.finish(Level()) is None


#: Of images whose lens nobody knows.
ASSUMED = Intrinsics.assumed(1280, 720)
FRONT = camera_at((0.1, 0.9, 1.1), (0.0, 0.0, 0.0))
SIDE = camera_at((1.2, 1.0, 0.5), (0.05, 0.0, 0.0), 0.3)


def board_video(path: Path, camera: StageFromCamera) -> Path:
    pose = view(camera, LYING, np.zeros(3))
    images = [seen(A4, *pose, seed=i, lens=ASSUMED) for i in range(3)]
    return write_video(path, images * 2)


def test_a_board_puts_two_cameras_on_one_stage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    models_or_skip()
    videos = [board_video(tmp_path / f"{name}.mp4", camera) for name, camera in (("a", FRONT), ("b", SIDE))]  # fmt: skip  # noqa: E501
    show = write_show(tmp_path, *videos)
    assert calibrate_show(show, Wishes(board=True)) == 0
    file = read_calibration(calibration_path(show))
    assert {row.device for row in file.cameras} == {"a.mp4", "b.mp4"}
    for name, truth in (("a.mp4", FRONT), ("b.mp4", SIDE)):
        row = file.camera(name)
        assert row is not None
        frame = StageFromCamera.of(row.rotation, row.translation)
        np.testing.assert_allclose(frame.shift, truth.shift, atol=0.015)
        turn = Rotation.from_matrix(frame.rotation @ truth.rotation.T).magnitude()
        assert math.degrees(turn) < 0.7
    said = capsys.readouterr().err
    assert "measure it with --lens" in said
    assert {path.name for path in (tmp_path / "show.stage").glob("*.png")} >= {
        "cam0-1-camera.png",
        "cam0-3-stage.png",
        "cam1-3-stage.png",
    }
    show_calibration(show)
    told = capsys.readouterr().out
    assert "a.mp4" in told
    assert "0.90 m above the floor" in told
    assert "in front" in told


def test_no_board_is_told_and_nothing_is_saved(tmp_path: Path) -> None:
    models_or_skip()
    video = write_video(tmp_path / "grey.mp4", [np.full((360, 640, 3), 128, np.uint8)] * 4)
    show = write_show(tmp_path, video)
    with pytest.raises(PuppetError, match="no board"):
        calibrate_show(show, Wishes(board=True))
    with pytest.raises(PuppetError, match="nobody was seen"):
        calibrate_show(show, Wishes())
    assert not calibration_path(show).exists()


def test_a_clip_of_a_person_is_calibrated_with_pictures_and_a_show_uses_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    models_or_skip()
    still = next(iter(VideoFile(clip_or_skip()))).colour
    video = write_video(tmp_path / "still.mp4", [cv2.resize(still, (540, 960))] * 65)
    show = write_show(tmp_path, video)
    assert calibrate_show(show, Wishes()) == 0
    said = capsys.readouterr().err
    assert "floor: from feet" in said
    assert "a performer, standing still" in said
    assert len(list((tmp_path / "show.stage").glob("*.png"))) == 4
    [row] = read_calibration(calibration_path(show)).cameras
    assert 1.0 < row.translation[1] < 2.2
    stance = saved_stance(show)
    assert stance is not None

    warned: list[str] = []
    source = open_source(str(video))
    assert use_calibration(source, show, warned.append)
    moments = [moment for moment, _ in zip(source, range(12), strict=False)]
    assert isinstance(source, Watcher)
    assert source.floor == "a saved calibration"
    frame = next(moment.frames[0] for moment in moments if moment.present)
    np.testing.assert_allclose(frame.positions[Joint.HIP_CENTER, [0, 2]], 0.0, atol=0.15)
    assert not warned
    assert not source.warnings
    source.close()

    # The same in another size is another camera's, or this one's set otherwise.
    small = write_video(tmp_path / "small.mp4", [cv2.resize(still, (270, 480))] * 10)
    small.replace(video)
    source = open_source(str(video))
    assert use_calibration(source, show, warned.append)
    assert isinstance(source, Watcher)
    list(source)
    assert any("540×960" in warning for warning in source.warnings)
    assert source.floor != "a saved calibration"
    source.close()


def test_a_recording_of_another_camera_is_levelled_as_if_there_were_no_calibration(
    tmp_path: Path,
) -> None:
    models_or_skip()
    video = write_video(tmp_path / "other.mp4", [np.full((360, 640, 3), 128, np.uint8)] * 4)
    show = write_show(tmp_path, video)
    row = CameraRow("webcam:0", 640, 360, (0.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0))
    write_calibration(calibration_path(show), CalibrationFile().with_camera(row))
    warned: list[str] = []
    source = open_source(str(video))
    assert not use_calibration(source, show, warned.append)
    assert len(warned) == 1
    assert "webcam:0" in warned[0]
    list(source)
    assert isinstance(source, Watcher)
    assert source.floor == "a guess"
    source.close()


class DepthCamera:
    """An empty room, before a depth camera without an IMU."""

    def __init__(self) -> None:
        self.info = CameraInfo("depth", "oak", 2.0)
        self.trouble = ""
        self.warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        return 0

    def __iter__(self) -> Iterator[Shot]:
        image = np.zeros((200, 320, 3), np.uint8)
        for i in range(6):
            depth, _ = room(1.3, -0.4, 0.1, seed=i)
            yield Shot(0.5 * i, i, image, depth, DEPTH_LENS)

    def close(self) -> None:
        """Nothing to let go of."""


def test_a_depth_camera_finds_its_floor_before_anybody_comes() -> None:
    watcher = Watcher(DepthCamera(), models_or_skip())
    assert watcher.floor == "nothing yet"
    list(watcher)
    assert watcher.floor == "depth"
    _, up = room(1.3, -0.4, 0.1)
    frame = watcher.level.stage_from_camera()
    assert math.degrees(angle_between(frame.up, up)) < 0.5
    assert frame.shift[1] == pytest.approx(1.3, abs=0.02)


def test_what_has_no_camera_cannot_be_calibrated(tmp_path: Path) -> None:
    show = write_show(tmp_path, Path("rehearsal"))
    with pytest.raises(BadShowError, match="no camera"):
        calibrate_show(show, Wishes())
    rehearsal = open_source("rehearsal")
    assert not use_calibration(rehearsal, show, pytest.fail)


def test_undo_brings_back_what_was_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    show = write_show(tmp_path, Path("rehearsal"))
    show_calibration(show)
    assert "nothing is calibrated" in capsys.readouterr().out
    row = CameraRow("webcam:7", 640, 480, (0.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0))
    write_calibration(calibration_path(show), CalibrationFile().with_camera(row))
    write_calibration(calibration_path(show), CalibrationFile())
    undo_calibration(show)
    assert "webcam:7" in capsys.readouterr().err
    assert read_calibration(calibration_path(show)).camera("webcam:7") == row


def test_the_command_line_asks_for_a_show_prints_a_board_and_shows_what_is_saved(
    tmp_path: Path,
) -> None:
    run = CliRunner().invoke
    with pytest.raises(BadShowError, match="which show"):
        run(app, ["calibrate"], catch_exceptions=False)
    board = tmp_path / "board.png"
    assert run(app, ["calibrate", "--print-board", str(board), "--paper", "a4"]).exit_code == 0
    assert board.exists()
    show = write_show(tmp_path, Path("rehearsal"))
    done = run(app, ["calibrate", str(show), "--show-saved"])
    assert done.exit_code == 0
    assert "nothing is calibrated" in done.output


def test_a_board_to_print_does_not_replace_a_file(tmp_path: Path) -> None:
    path = tmp_path / "board.pdf"
    write_board(path, "a4", overwrite=False)
    assert path.read_bytes().startswith(b"%PDF")
    with pytest.raises(BadShowError, match="already"):
        write_board(path, "a4", overwrite=False)
    write_board(path, "a3", overwrite=True)


def test_a_lens_is_measured_by_views_of_the_board() -> None:
    watch, random = LensWatch(), np.random.default_rng(5)
    for seed in range(60):
        tilt, around = random.uniform(0.2, 0.9), random.uniform(0.0, 2.0 * math.pi)
        turn = Rotation.from_rotvec(tilt * np.array([math.cos(around), math.sin(around), 0.0]))
        away = random.uniform(0.4, 1.0)
        across, up = random.uniform(-0.4, 0.4), random.uniform(-0.2, 0.2)
        shift = away * np.array([across, up, -1.0])
        watch.look(seen(A4, turn.as_matrix(), shift, seed=seed))
        if watch.progress >= 1.0:
            break
    found = watch.lens()
    assert found.lens.focal_x == pytest.approx(LENS.focal_x, rel=0.01)
    assert found.lens.centre_x == pytest.approx(LENS.centre_x, abs=8.0)
    assert found.lens.centre_y == pytest.approx(LENS.centre_y, abs=8.0)
    assert found.error < 0.2


def test_one_view_again_and_again_is_no_measurement() -> None:
    watch, pose = LensWatch(), view(FRONT, LYING, np.zeros(3))
    assert [watch.look(seen(A4, *pose, seed=i)) for i in range(3)] == [True, False, False]
    with pytest.raises(PuppetError, match="cannot be measured yet"):
        watch.lens()
    with pytest.raises(PuppetError, match="cannot be measured yet"):
        measure_lens([], 1280, 720)


def test_what_is_behind_the_lens_or_far_out_is_not_drawn() -> None:
    image = np.zeros((90, 160, 3), np.uint8)
    lens = Intrinsics.assumed(160, 90)
    states = np.full(20, 2, np.uint8)
    draw_skeleton(image, np.full((20, 3), 1.0), states, lens)
    draw_skeleton(image, np.full((20, 3), (1e9, 0.0, -0.06)), states, lens)
    draw_skeleton(image, np.full((20, 3), np.nan), states, lens)
    assert not image.any()
    upwards = StageFromCamera(np.eye(3), np.array([0.0, -1.0, 0.0]))
    draw_floor(image, upwards, lens)
    draw_stage(image, upwards, lens)


def test_a_skeleton_is_drawn_where_it_is_seen() -> None:
    image = np.zeros((200, 200, 3), np.uint8)
    lens = Intrinsics.assumed(200, 200)
    points = np.random.default_rng(0).uniform((-0.5, -0.5, -3.0), (0.5, 0.5, -2.0), (20, 3))
    states = np.full(20, 2, np.uint8)
    states[Joint.HAND_LEFT] = 0
    draw_skeleton(image, points, states, lens)
    pixels = lens.pixels(points * (1.0, -1.0, -1.0)).round().astype(int)
    lit = image[pixels[:, 1], pixels[:, 0]].any(axis=1)
    assert lit[states == 2].all()
