"""Video files as cameras: what comes out of them, and what is said of those that are no good."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from puppet.errors import BadFileError
from puppet.tracking.cameras.camera import Camera, Image
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.cameras.video_file import VideoFile
from tests.pose_models import clip_or_skip

SIZE = (320, 240)


def picture(size: tuple[int, int] = SIZE, seed: int = 0) -> Image:
    """Grey noise with a bright bar at the top: nobody is there."""
    width, height = size
    image = np.random.default_rng(seed).integers(90, 110, (height, width, 3), np.uint8)
    image[: height // 6] = 250
    return image


def write_video(
    path: Path,
    codec: str,
    images: Iterable[Image] | int,
    *,
    rate: float = 25.0,
    times: Sequence[float] | None = None,
    container: str | None = None,
) -> Path:
    """A video with a key frame at its beginning only. times: seconds; evenly if None."""
    if isinstance(images, int):
        images = [picture(seed=seed) for seed in range(images)]
    images = list(images)
    with av.open(str(path), "w", format=container) as output:
        stream = output.add_stream(codec, rate=Fraction(rate).limit_denominator(1000))
        assert isinstance(stream, av.VideoStream)
        height, width = images[0].shape[:2] if images else SIZE[::-1]
        stream.width, stream.height = width, height
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        even = 1 / Fraction(rate).limit_denominator(1000)
        tick = even if times is None else Fraction(1, 1000)
        stream.codec_context.time_base = tick
        for i, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(image, format="bgr24")
            frame.pts = i if times is None else round(1000 * times[i])
            frame.time_base = tick
            output.mux(stream.encode(frame))
        output.start_encoding()
        if images:
            output.mux(stream.encode())
    return path


def turned_by_metadata(path: Path, quarter: tuple[int, int, int, int]) -> None:
    """Ask players of this MP4 to turn it: the matrix of its track header."""
    data = bytearray(path.read_bytes())
    header = data.index(b"tkhd")
    # Version 0: after the type, 4 bytes of flags and 36 of times, layer and volume.
    a, b, c, d = (value << 16 for value in quarter)
    matrix = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    data[header + 44 : header + 80] = matrix
    path.write_bytes(data)


@pytest.mark.parametrize("name", ["gone.mp4", "."])
def test_what_is_no_file_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(BadFileError, match="cannot be opened"):
        VideoFile(tmp_path / name)


@pytest.mark.parametrize("name", ["clip.mp4", "clip.txt", "clip.avi"])
@pytest.mark.parametrize("data", [b"", b"hello\n" * 100, bytes(5000), b"\x89MCAP0\r\n"])
def test_a_file_that_is_no_video_is_refused_in_silence(
    tmp_path: Path, name: str, data: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(BadFileError, match=name):
        VideoFile(path)
    assert capfd.readouterr() == ("", "")


def test_an_mp4_without_its_end_is_refused_in_silence(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_video(tmp_path / "cut.mp4", "mpeg4", 30)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(BadFileError, match=r"cut off(.|\n)*index"):
        VideoFile(path)
    assert capfd.readouterr() == ("", "")


def test_sound_without_a_picture_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sound.mka"
    with av.open(str(path), "w") as output:
        stream = output.add_stream("pcm_s16le", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), "s16", "mono")
        frame.sample_rate = 8000
        output.mux(stream.encode(frame))
    with pytest.raises(BadFileError, match="no picture in it; it has: audio"):
        VideoFile(path)


@pytest.mark.parametrize(
    ("codec", "name"), [("mpeg4", "clip.mp4"), ("mjpeg", "clip.avi"), ("libx264", "clip.mkv")]
)
def test_shots_come_at_the_file_s_times_again_and_again(
    tmp_path: Path, codec: str, name: str
) -> None:
    camera: Camera = VideoFile(write_video(tmp_path / name, codec, 20))
    runs = [list(camera), list(camera)]
    for shots in runs:
        assert len(camera) == len(shots) == 20
        assert [shot.sequence for shot in shots] == list(range(20))
        np.testing.assert_allclose([shot.time for shot in shots], np.arange(20) / 25, atol=1e-3)
        assert shots[0].colour.shape == (240, 320, 3)
        assert shots[0].colour[:35].mean() > 240
        assert all(shot.depth is None and shot.intrinsics is None for shot in shots)
    for one, other in zip(*runs, strict=True):
        assert one.time == other.time
        np.testing.assert_array_equal(one.colour, other.colour)
    assert (camera.info.name, camera.info.kind, camera.info.rate) == (name, "video", 25.0)
    assert not camera.info.live
    assert not camera.warnings
    camera.close()
    camera.close()


def test_a_calibration_that_is_given_goes_with_the_shots(tmp_path: Path) -> None:
    path = write_video(tmp_path / "clip.avi", "mjpeg", 2)
    for shot in VideoFile(path, up=(0, -1, 0), focal=400.0):
        assert shot.intrinsics == Intrinsics(400.0, 400.0, 159.5, 119.5)
        assert shot.up is not None
        assert shot.up.tolist() == [0.0, -1.0, 0.0]


def test_times_of_uneven_frames_are_kept(tmp_path: Path) -> None:
    """As phones film in the dark."""
    times = [0.0, 0.033, 0.066, 0.5, 0.533, 2.0]
    path = write_video(tmp_path / "phone.mkv", "libx264", 6, rate=30.0, times=times)
    np.testing.assert_allclose([shot.time for shot in VideoFile(path)], times, atol=0.002)


@pytest.mark.parametrize(
    ("quarter", "bright"),
    [
        ((0, 1, -1, 0), (slice(None), slice(210, None))),  # clockwise: the top is at the right
        ((0, -1, 1, 0), (slice(None), slice(None, 30))),
        ((-1, 0, 0, -1), (slice(210, None), slice(None))),
    ],
)
def test_a_turned_video_is_seen_upright(
    tmp_path: Path, quarter: tuple[int, int, int, int], bright: tuple[slice, slice]
) -> None:
    path = write_video(tmp_path / "phone.mp4", "mpeg4", 2)
    turned_by_metadata(path, quarter)
    image = next(iter(VideoFile(path))).colour
    assert image.shape == ((240, 320, 3) if quarter[0] else (320, 240, 3))
    assert image[bright].mean() > 200
    assert np.median(image) < 120


def test_images_are_what_opencv_makes_of_the_file() -> None:
    clip = clip_or_skip()
    capture = cv2.VideoCapture(str(clip))
    for shot, _ in zip(VideoFile(clip), range(5), strict=False):
        np.testing.assert_array_equal(shot.colour, capture.read()[1])
    capture.release()
