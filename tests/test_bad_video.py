"""Videos that are no good, or strange: corrupt, cut off, of two sizes, empty, slow, quick, black.

A show goes on with what there is of them; what was wrong is said.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from puppet.errors import BadFileError
from puppet.skeleton import Moment
from puppet.tracking.cameras.camera import Camera, CameraInfo, Image, Shot
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.cameras.raw_recording import RawRecording
from puppet.tracking.cameras.raw_writer import RawWriter
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.people.models import PoseModels
from puppet.tracking.watcher import Watcher
from tests.cameras import Shots
from tests.pose_models import clip_or_skip, models_or_skip
from tests.test_video_file import picture, write_video

#: FFmpeg's containers and what is in them here.
KINDS = {"avi": "mjpeg", "mkv": "libx264", "ts": "mpeg2video"}


@pytest.fixture(scope="module")
def models() -> PoseModels:
    return models_or_skip()


@pytest.fixture(scope="module")
def performer() -> list[Image]:
    """A man who balances on one leg, 480×854, 20 a second."""
    shots = islice(VideoFile(clip_or_skip()), 0, 90, 3)
    return [
        np.asarray(cv2.resize(shot.colour, (480, 854), interpolation=cv2.INTER_AREA), np.uint8)
        for shot in shots
    ]


def watched(camera: Camera, models: PoseModels) -> list[Moment]:
    moments = list(Watcher(camera, models))
    for moment in moments:
        for frame in moment.frames:
            assert np.isfinite(frame.positions).all()
    return moments


def heights(moments: list[Moment]) -> list[float]:
    """From the lowest joint to the highest of each performer, metres."""
    return [
        float(np.ptp(frame.positions[frame.states > 0, 1]))
        for moment in moments
        for frame in moment.frames
    ]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("part", [0.3, 0.7])
def test_a_truncated_video_gives_what_it_has_with_a_warning(
    tmp_path: Path, kind: str, part: float, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_video(tmp_path / f"cut.{kind}", KINDS[kind], 50)
    path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
    capfd.readouterr()
    camera = VideoFile(path)
    shots = list(camera)
    assert 50 * part - 20 < len(shots) < 50 * part + 12
    assert shots[0].colour[:35].mean() > 240
    # A transport stream does not say how long it ought to be.
    if kind != "ts":
        assert f"cut.{kind} is cut off or damaged" in camera.warnings[0]
        assert f"its first {len(shots)} frames" in camera.warnings[0]
    assert capfd.readouterr() == ("", "")


@given(seed=st.integers(0, 10_000), kind=st.sampled_from(sorted(KINDS)), holes=st.integers(1, 30))
@settings(max_examples=25)
def test_a_corrupt_video_never_breaks_anything(
    tmp_path_factory: pytest.TempPathFactory, seed: int, kind: str, holes: int
) -> None:
    folder = tmp_path_factory.getbasetemp() / "corrupt"
    folder.mkdir(exist_ok=True)
    whole = folder / f"whole.{kind}"
    if not whole.exists():
        write_video(whole, KINDS[kind], 30)
    random = np.random.default_rng(seed)
    data = bytearray(whole.read_bytes())
    for start in random.integers(0, len(data) - 40, holes):
        data[start : start + 40] = random.bytes(40)
    path = folder / f"corrupt.{kind}"
    path.write_bytes(data)
    try:
        camera = VideoFile(path)
    except BadFileError as error:
        assert f"corrupt.{kind}" in str(error)  # noqa: PT017
        return
    shots = list(camera)
    assert shots
    assert len({shot.colour.shape for shot in shots}) == 1
    times = [shot.time for shot in shots]
    assert all(math.isfinite(time) and time >= 0.0 for time in times)
    assert all(earlier < later for earlier, later in pairwise(times))
    assert [shot.sequence for shot in shots] == list(range(len(shots)))


def test_damage_in_the_middle_is_said_and_what_follows_is_used(tmp_path: Path) -> None:
    path = write_video(tmp_path / "torn.avi", "mjpeg", 100)
    data = bytearray(path.read_bytes())
    # The JPEG of one frame becomes noise.
    start = data.index(b"\xff\xd8", len(data) // 2)
    data[start : start + 3000] = np.random.default_rng(0).bytes(3000)
    path.write_bytes(data)
    camera = VideoFile(path)
    shots = list(camera)
    assert 98 <= len(shots) < 100
    assert "torn.avi is damaged" in camera.warnings[0]
    assert f"the {len(shots)} frames" in camera.warnings[0]


@pytest.mark.parametrize("name", ["empty.mp4", "empty.avi", "empty.mkv", "empty.mov"])
def test_a_video_without_a_frame_is_refused(tmp_path: Path, name: str) -> None:
    path = write_video(tmp_path / name, "mjpeg" if name.endswith("avi") else "mpeg4", [])
    with pytest.raises(BadFileError, match=rf"{name}: (no video can be read|the video is empty)"):
        VideoFile(path)


def ball(size: tuple[int, int]) -> Image:
    width, height = size
    image = np.zeros((height, width, 3), np.uint8)
    cv2.circle(image, (width // 2, height // 2), min(size) // 3, (255, 255, 255), -1)
    return image


@pytest.mark.parametrize(
    ("suffix", "codec", "second"),
    [
        ("h264", "libx264", (640, 360)),
        ("ts", "libx264", (640, 360)),
        ("mjpeg", "mjpeg", (180, 320)),
        ("mpg", "mpeg2video", (640, 480)),
    ],
)
def test_a_video_that_changes_its_size_keeps_the_first_and_its_proportions(
    tmp_path: Path, suffix: str, codec: str, second: tuple[int, int]
) -> None:
    path = tmp_path / f"two.{suffix}"
    parts = []
    for size in ((320, 240), second):
        part = write_video(tmp_path / f"part.{suffix}", codec, [ball(size)] * 10)
        parts.append(part.read_bytes())
    path.write_bytes(b"".join(parts))
    camera = VideoFile(path)
    shots = list(camera)
    assert 18 <= len(shots) <= 20
    for shot in shots:
        assert shot.colour.shape == (240, 320, 3)
        rows, columns = np.nonzero(shot.colour[..., 0] > 128)
        assert np.ptp(columns) == pytest.approx(np.ptp(rows), abs=4)
        assert columns.mean() == pytest.approx(159.5, abs=3)
        assert rows.mean() == pytest.approx(119.5, abs=3)
    times = np.array([shot.time for shot in shots])
    # The second part's clock begins anew; the show's goes on.
    np.testing.assert_allclose(np.diff(times), 0.04, atol=0.01)
    assert len(camera.warnings) == 1
    assert f"goes on with {second[0]}×{second[1]} pixels at frame" in camera.warnings[0]


@pytest.mark.parametrize(("rate", "every"), [(1.0, 10), (240.0, 1)])
def test_one_frame_a_second_and_240_are_as_good_as_any(
    tmp_path: Path, models: PoseModels, performer: list[Image], rate: float, every: int
) -> None:
    images = performer[:30:every]
    path = write_video(tmp_path / "odd.avi", "ffv1", images, rate=rate)
    camera = VideoFile(path)
    assert camera.info.rate == rate
    moments = watched(camera, models)
    np.testing.assert_allclose([m.time for m in moments], np.arange(len(images)) / rate, atol=1e-4)
    there = [moment for moment in moments if moment.present]
    assert there
    # One man, and his size.
    assert len({frame.performer for moment in there for frame in moment.frames}) == 1
    assert all(1.1 < height < 2.1 for height in heights(there))


def test_a_black_video_has_nobody_in_it(tmp_path: Path, models: PoseModels) -> None:
    black = [np.zeros((240, 320, 3), np.uint8)] * 12
    moments = watched(VideoFile(write_video(tmp_path / "black.mp4", "libx264", black)), models)
    assert len(moments) == 12
    assert not any(moment.present for moment in moments)


def test_who_is_hidden_by_black_frames_comes_back_as_themselves(
    tmp_path: Path, models: PoseModels, performer: list[Image]
) -> None:
    images = [image.copy() for image in performer[:24]]
    for image in images[10:16]:
        image[:] = 0
    moments = watched(
        VideoFile(write_video(tmp_path / "gap.avi", "ffv1", images, rate=20.0)), models
    )
    assert not any(moment.present for moment in moments[10:16])
    assert moments[9].present
    assert moments[23].present
    assert len({frame.performer for moment in moments for frame in moment.frames}) == 1


def shots_of(images: list[Image], lens: Intrinsics) -> Iterator[Shot]:
    for i, image in enumerate(images):
        yield Shot(i / 20, i, image, intrinsics=lens)


def test_depth_that_is_zero_everywhere_changes_nothing(
    tmp_path: Path, models: PoseModels, performer: list[Image]
) -> None:
    lens = Intrinsics.assumed(480, 854, 760.0)
    path = tmp_path / "zero.raw.mcap"
    with RawWriter(path, CameraInfo("oak:1", "oak", 20.0), "png") as writer:
        for shot in shots_of(performer[:8], lens):
            writer.write(replace(shot, depth=np.zeros((427, 240), np.uint16)))
    recording = RawRecording(path)
    assert all(shot.depth is not None and not shot.depth.any() for shot in recording)
    blind = watched(recording, models)
    without = watched(Shots(shots_of(performer[:8], lens)), models)
    assert any(moment.present for moment in without)
    for one, other in zip(blind, without, strict=True):
        for frame, same in zip(one.frames, other.frames, strict=True):
            np.testing.assert_array_equal(frame.positions, same.positions)
            np.testing.assert_array_equal(frame.states, same.states)


@pytest.mark.parametrize(
    "lens",
    [
        Intrinsics(150.0, 150.0, 239.5, 426.5),  # sees 141°
        Intrinsics(2400.0, 2400.0, 239.5, 426.5),  # sees 20°
        Intrinsics(760.0, 760.0, 5.0, 850.0),  # looks out of a corner
        Intrinsics(760.0, 1500.0, 239.5, 426.5),  # squeezes
    ],
)
def test_a_wrong_lens_puts_people_elsewhere_and_leaves_them_people(
    models: PoseModels, performer: list[Image], lens: Intrinsics
) -> None:
    moments = watched(Shots(shots_of(performer[:6], lens)), models)
    assert moments[-1].present
    assert all(0.8 < height < 2.3 for height in heights(moments))


@pytest.mark.parametrize("focal", [1e-3, 20.0, 2e4, 1e7])
def test_a_lens_that_cannot_be_breaks_nothing(
    models: PoseModels, performer: list[Image], focal: float
) -> None:
    lens = Intrinsics(focal, focal, 239.5, 426.5)
    assert len(watched(Shots(shots_of(performer[:4], lens)), models)) == 4


def test_a_still_picture_is_a_video_of_one_frame(tmp_path: Path) -> None:
    path = tmp_path / "still.png"
    cv2.imwrite(str(path), picture())
    (shot,) = VideoFile(path)
    np.testing.assert_array_equal(shot.colour, picture())
    assert shot.time == 0.0
