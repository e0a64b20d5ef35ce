from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from puppet.errors import BadFileError, UnavailableError
from puppet.kernel import Floats
from puppet.skeleton import Joint
from puppet.tracking import video
from puppet.tracking.blazepose import BlazePose, Image
from puppet.tracking.models import PoseModels
from puppet.tracking.source import Source
from puppet.tracking.take import read_take
from puppet.tracking.video import VideoSource
from tests.pose_models import clip_or_skip, models_or_skip

STREAMS = Path(__file__).parent / "recorded_streams"
NO_MODELS = PoseModels(Path("no"), Path("no"), Path("no"))
#: Of the clips' four cameras, as their calibration has them: place in the room, metres (z up), and
#: the camera's axes in the room, as rows (x right, y up, z backwards).
CAMERAS = {
    "cam01": ((1.4602, -1.9092), ((0.5536, 0.8047, 0.2144), (-0.4345, 0.0595, 0.8987))),
    "cam02": ((2.5820, 0.7066), ((-0.1967, 0.9795, -0.0430), (-0.3148, -0.0215, 0.9489))),
    "cam03": ((-3.2169, 2.2312), ((-0.7406, -0.6704, -0.0447), (0.2525, -0.3393, 0.9061))),
    "cam04": ((-3.7587, -1.4157), ((0.2586, -0.8751, -0.4090), (0.4959, -0.2431, 0.8337))),
}
CLIP_UP, CLIP_FOCAL = (0.2144479, -0.8986921, -0.3825762), 1681.08


def write_video(path: Path, code: str, frames: int, rate: float = 25.0) -> Path:
    """Grey images of 320 × 240 with a bright bar at the top: nobody is there."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*code), rate, (320, 240))
    assert writer.isOpened()
    noise = np.random.default_rng(0)
    for _ in range(frames):
        image = noise.integers(90, 110, (240, 320, 3), np.uint8)
        image[:40] = 250
        writer.write(image)
    writer.release()
    return path


def turned_by_metadata(path: Path) -> None:
    """Ask players of this MP4 to turn it by 90° clockwise: the matrix of its track header."""
    data = bytearray(path.read_bytes())
    header = data.index(b"tkhd")
    # Version 0: after the type, 4 bytes of flags and 36 of times, layer and volume.
    fixed = 1 << 16
    matrix = struct.pack(">9i", 0, fixed, 0, -fixed, 0, 0, 240 * fixed, 0, 1 << 30)
    data[header + 44 : header + 80] = matrix
    path.write_bytes(data)


@pytest.fixture
def blind(monkeypatch: pytest.MonkeyPatch) -> list[Image]:
    """No network: nobody is seen. Gives the images that would have been looked at."""
    images: list[Image] = []

    class Blind(BlazePose):
        def __init__(self, models: PoseModels) -> None:
            """Needs no models."""

        def reset(self) -> None:
            """Follows nobody."""

        def track(self, image: Image) -> None:
            images.append(image)

    monkeypatch.setattr(video, "BlazePose", Blind)
    return images


@pytest.mark.parametrize("name", ["gone.mp4", "."])
def test_what_is_no_file_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(BadFileError, match="cannot be opened"):
        VideoSource(tmp_path / name, models=NO_MODELS)


@pytest.mark.parametrize("name", ["clip.mp4", "clip.txt", "clip.avi"])
@pytest.mark.parametrize("data", [b"", b"hello\n" * 100, bytes(5000), b"\x89MCAP0\r\n"])
def test_a_file_that_is_no_video_is_refused_in_silence(
    tmp_path: Path, name: str, data: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(BadFileError, match=name):
        VideoSource(path, models=NO_MODELS)
    assert capfd.readouterr() == ("", "")


def test_an_mp4_without_its_end_is_refused_in_silence(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_video(tmp_path / "cut.mp4", "mp4v", 30)
    capfd.readouterr()
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(BadFileError, match="cut off"):
        VideoSource(path, models=NO_MODELS)
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("blind")
def test_a_cut_off_file_gives_what_it_has_with_a_warning(tmp_path: Path) -> None:
    path = write_video(tmp_path / "cut.avi", "MJPG", 40)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    source = VideoSource(path, models=NO_MODELS)
    frames = list(source)
    assert 10 < len(frames) < 30
    assert "cut.avi is cut off" in source.warnings[0]


def test_models_that_cannot_be_loaded_are_named(tmp_path: Path) -> None:
    path = write_video(tmp_path / "clip.mp4", "mp4v", 3)
    with pytest.raises(UnavailableError, match="puppet models"):
        VideoSource(path, models=NO_MODELS)


@pytest.mark.usefixtures("blind")
@pytest.mark.parametrize(("code", "name"), [("mp4v", "clip.mp4"), ("MJPG", "clip.avi")])
def test_where_nobody_is_there_are_empty_frames_at_the_file_s_times(
    tmp_path: Path, code: str, name: str
) -> None:
    source: Source = VideoSource(write_video(tmp_path / name, code, 20), models=NO_MODELS)
    frames = list(source)
    assert len(source) == len(frames) == 20
    assert not any(frame.present for frame in frames)
    assert [frame.sequence for frame in frames] == list(range(20))
    np.testing.assert_allclose([frame.time for frame in frames], np.arange(20) / 25, atol=1e-6)
    assert (source.info.name, source.info.kind, source.info.rate) == (name, "video", 25.0)
    assert not source.info.live
    source.close()
    source.close()


def test_a_turned_video_is_seen_upright(tmp_path: Path, blind: list[Image]) -> None:
    path = write_video(tmp_path / "phone.mp4", "mp4v", 2)
    turned_by_metadata(path)
    list(VideoSource(path, models=NO_MODELS))
    assert blind[0].shape == (320, 240, 3)
    # The bar at the top is on the right after a quarter turn clockwise.
    assert blind[0][:, 210:].mean() > 200
    assert blind[0][:, :190].mean() < 150


def test_a_webcam_that_is_not_there_is_named(capfd: pytest.CaptureFixture[str]) -> None:
    for name in ("webcam:97", 97):
        with pytest.raises(UnavailableError, match="webcam:97"):
            VideoSource(name, models=NO_MODELS)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["webcam:", "webcam:front", "webcam:-1", "webcam:²"])
def test_a_webcam_has_a_number(name: str) -> None:
    with pytest.raises(UnavailableError, match="webcam:0"):
        VideoSource(name, models=NO_MODELS)


@pytest.mark.usefixtures("blind")
def test_a_webcam_is_live_until_it_is_unplugged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_video(tmp_path / "webcam.avi", "MJPG", 5)
    opened: list[Any] = []
    capture = cv2.VideoCapture

    def fake(_index: int) -> Any:
        opened.append(capture(str(path)))
        return opened[-1]

    monkeypatch.setattr(cv2, "VideoCapture", fake)
    source = VideoSource("webcam:0", models=NO_MODELS)
    frames = list(source)
    assert source.info.live
    assert (source.info.name, source.info.kind, len(source)) == ("webcam:0", "webcam", 0)
    assert len(frames) == 4  # the first image showed that it answers
    times = [frame.time for frame in frames]
    assert times == sorted(times)
    source.close()
    source.close()
    assert not opened[0].isOpened()


def test_the_recorded_take_is_what_the_tracker_makes_of_the_clip() -> None:
    models, clip = models_or_skip(), clip_or_skip()
    source = VideoSource(clip, models=models, up=CLIP_UP, focal=CLIP_FOCAL)
    frames = list(source)
    take = read_take(STREAMS / "balance_cam01.mcap")
    assert len(frames) == len(take) == len(source) == 100
    found = np.array([frame.positions for frame in frames])
    recorded = np.array([frame.positions for frame in take])
    # Other processors round otherwise, and the region that is followed lets that grow.
    assert np.abs(found - recorded).mean() < 0.01
    assert np.abs(found - recorded).max() < 0.10


def test_without_a_calibration_he_still_stands_on_the_floor() -> None:
    models, clip = models_or_skip(), clip_or_skip()
    frames = list(VideoSource(clip, models=models))
    assert all(frame.present for frame in frames)
    first = frames[0].positions
    feet = np.array([frame.positions[[Joint.FOOT_LEFT, Joint.FOOT_RIGHT], 1] for frame in frames])
    assert abs(np.median(feet[:30].min(axis=1))) < 0.06
    up = first[Joint.HEAD] - first[[Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT]].mean(axis=0)
    assert math.degrees(math.acos(up[1] / float(np.linalg.norm(up)))) < 12.0
    assert 1.4 < first[Joint.HEAD, 1] < 1.8


def recorded(camera: str) -> Floats:
    take = read_take(STREAMS / f"balance_{camera}.mcap")
    assert not take.warnings
    assert take.info.licence.startswith("BSD-3-Clause")
    assert all(frame.present for frame in take)
    np.testing.assert_allclose([frame.time for frame in take], np.arange(100) / 60, atol=2e-6)
    return np.array([frame.positions for frame in take])


def in_room(camera: str, positions: Floats) -> Floats:
    """(T, 20, 3) stage frame -> the clips' room, whose z is up; heights above the floor stay."""
    place, (right, image_up) = CAMERAS[camera]
    back = np.cross(right, image_up)
    z = np.array([back[0], back[1], 0.0])
    z /= np.linalg.norm(z)
    axes = np.array([[-z[1], z[0], 0.0], [0.0, 0.0, 1.0], z])
    return np.asarray(positions @ axes + (*place, 0.0))


def test_four_cameras_agree_on_where_he_is_and_how_he_stands() -> None:
    bodies = np.array([in_room(camera, recorded(camera)) for camera in CAMERAS])
    middle = bodies.mean(axis=0)
    hips = bodies[:, :, Joint.HIP_CENTER, :2]
    assert np.linalg.norm(hips - hips.mean(axis=0), axis=-1).max() < 0.35
    # Seen from the front and from behind, his left is on the same side.
    for left, right in (
        (Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT),
        (Joint.WRIST_LEFT, Joint.WRIST_RIGHT),
        (Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT),
    ):
        across = bodies[:, :, left] - bodies[:, :, right]
        mean = across.mean(axis=0)
        cosine = np.sum(across * mean, axis=-1) / (
            np.linalg.norm(across, axis=-1) * np.linalg.norm(mean, axis=-1)
        )
        apart = np.linalg.norm(mean, axis=-1) > 0.25
        assert np.median(cosine[:, apart]) > 0.85
    heights = middle[:, [Joint.FOOT_LEFT, Joint.FOOT_RIGHT], 2].min(axis=1)
    assert np.abs(heights).max() < 0.15


@pytest.mark.parametrize("camera", CAMERAS)
def test_nothing_flips_in_the_recorded_takes(camera: str) -> None:
    positions = recorded(camera)
    across = positions[:, Joint.SHOULDER_LEFT] - positions[:, Joint.SHOULDER_RIGHT]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    assert np.sum(across[1:] * across[:-1], axis=1).min() > 0.8
    assert np.linalg.norm(np.diff(positions[:, :4], axis=0), axis=-1).max() < 0.15
