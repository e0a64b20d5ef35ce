"""From a camera's shots to skeletons in the stage frame, on files, and on a real clip."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from puppet.errors import UnavailableError
from puppet.kernel import Floats
from puppet.skeleton import Joint
from puppet.tracking.cameras.camera import Shot
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.people.models import PoseModels
from puppet.tracking.people.people import People, Seen
from puppet.tracking.source import Source, Watchful
from puppet.tracking.takes.take import Take, read_take
from puppet.tracking.watcher import Watcher
from tests.cameras import First
from tests.moments import frames_of
from tests.pose_models import clip_or_skip, models_or_skip
from tests.test_video_file import write_video

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


@pytest.fixture
def nobody_seen(monkeypatch: pytest.MonkeyPatch) -> list[Shot]:
    """No network: nobody is found. Gives the shots that would have been looked at."""
    shots: list[Shot] = []

    class Blind(People):
        def __init__(self, *_: object, **__: object) -> None:
            """Needs no models."""
            self.reset()

        def look(self, shot: Shot) -> list[Seen]:
            shots.append(shot)
            return []

    monkeypatch.setattr("puppet.tracking.watcher.People", Blind)
    return shots


def test_models_that_cannot_be_loaded_are_named(tmp_path: Path) -> None:
    camera = VideoFile(write_video(tmp_path / "clip.mp4", "mpeg4", 3))
    with pytest.raises(UnavailableError, match="puppet models"):
        Watcher(camera, NO_MODELS)


def test_where_nobody_is_there_are_empty_moments_at_the_shots_times(
    tmp_path: Path, nobody_seen: list[Shot]
) -> None:
    camera = VideoFile(write_video(tmp_path / "clip.mp4", "mpeg4", 20))
    source: Source = Watcher(camera, NO_MODELS)
    for _ in range(2):
        nobody_seen.clear()
        moments = list(source)
        assert len(source) == len(moments) == len(nobody_seen) == 20
        assert not any(moment.present for moment in moments)
        assert [moment.sequence for moment in moments] == list(range(20))
        assert [moment.time for moment in moments] == [shot.time for shot in nobody_seen]
    info = source.info
    assert (info.name, info.kind, info.rate, info.live) == ("clip.mp4", "video", 25.0, False)
    assert isinstance(source, Watchful)
    assert source.milliseconds["camera_ms"] > 0.0
    source.close()
    source.close()


@pytest.mark.usefixtures("nobody_seen")
def test_what_was_wrong_with_the_camera_s_file_is_passed_on(tmp_path: Path) -> None:
    path = write_video(tmp_path / "cut.avi", "mjpeg", 40)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    source = Watcher(VideoFile(path), NO_MODELS)
    assert 10 < len(list(source)) < 30
    assert "cut.avi is cut off" in source.warnings[0]


def test_the_recorded_take_is_what_the_tracker_makes_of_the_clip() -> None:
    models, clip = models_or_skip(), clip_or_skip()
    camera = VideoFile(clip, up=CLIP_UP, focal=CLIP_FOCAL)
    source = Watcher(camera, models)
    moments = list(source)
    take = read_take(STREAMS / "balance_cam01.mcap")
    assert len(moments) == len(take) == len(source) == 100
    pairs = [
        (one.frames[0].positions, other.frames[0].positions)
        for one, other in zip(moments, take, strict=True)
        if one.present and other.present
    ]
    assert len(pairs) > 90
    apart = np.array([found - recorded for found, recorded in pairs])
    # Other processors round otherwise, and the region that is followed lets that grow.
    assert np.abs(apart).mean() < 0.01
    assert np.abs(apart).max() < 0.10


def test_without_a_calibration_he_still_stands_on_the_floor() -> None:
    models, clip = models_or_skip(), clip_or_skip()
    moments = list(Watcher(First(VideoFile(clip), 50), models))
    frames = [moment.frames[0] for moment in moments if moment.present]
    assert len(frames) > 45
    first = frames[0].positions
    feet = np.array([frame.positions[[Joint.FOOT_LEFT, Joint.FOOT_RIGHT], 1] for frame in frames])
    assert abs(np.median(feet[:30].min(axis=1))) < 0.06
    up = first[Joint.HEAD] - first[[Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT]].mean(axis=0)
    assert math.degrees(math.acos(up[1] / float(np.linalg.norm(up)))) < 12.0
    assert 1.4 < first[Joint.HEAD, 1] < 1.8


def taken(camera: str) -> Take:
    take = read_take(STREAMS / f"balance_{camera}.mcap")
    assert not take.warnings
    assert take.info.licence.startswith("BSD-3-Clause")
    np.testing.assert_allclose([moment.time for moment in take], np.arange(100) / 60, atol=2e-6)
    return take


def recorded(camera: str) -> tuple[Floats, Floats]:
    """Positions (T, 20, 3) and times (T,) of the moments in which he is seen, by one number."""
    moments = [moment for moment in taken(camera) if moment.present]
    assert len(moments) > 90
    (performer,) = {frame.performer for moment in moments for frame in moment.frames}
    frames = frames_of(moments, performer)
    return np.array([f.positions for f in frames]), np.array([f.time for f in frames])


def in_room(camera: str, positions: Floats) -> Floats:
    """(T, 20, 3) stage frame -> the clips' room, whose z is up; heights above the floor stay."""
    place, (right, image_up) = CAMERAS[camera]
    back = np.cross(right, image_up)
    z = np.array([back[0], back[1], 0.0])
    z /= np.linalg.norm(z)
    axes = np.array([[-z[1], z[0], 0.0], [0.0, 0.0, 1.0], z])
    return np.asarray(positions @ axes + (*place, 0.0))


def test_four_cameras_agree_on_where_he_is_and_how_he_stands() -> None:
    seen = {camera: recorded(camera) for camera in CAMERAS}
    # Moments in which all of them see him.
    common = set.intersection(*({round(60 * time) for time in times} for _, times in seen.values()))
    bodies = np.array(
        [
            in_room(camera, positions[[round(60 * time) in common for time in times]])
            for camera, (positions, times) in seen.items()
        ]
    )
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
    positions, _ = recorded(camera)
    across = positions[:, Joint.SHOULDER_LEFT] - positions[:, Joint.SHOULDER_RIGHT]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    assert np.sum(across[1:] * across[:-1], axis=1).min() > 0.8
    assert np.linalg.norm(np.diff(positions[:, :4], axis=0), axis=-1).max() < 0.15
