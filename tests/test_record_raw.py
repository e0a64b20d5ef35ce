"""`puppet record --raw`: any camera into a raw recording, and nothing lost of what was there."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from puppet.commands import raw
from puppet.errors import BadFileError, BadShowError, UnavailableError
from puppet.tracking.cameras.open_camera import open_camera
from puppet.tracking.cameras.raw_recording import RawRecording
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.cameras.webcam import Webcam
from tests.test_raw_recording import INFO, some_shots, write
from tests.test_video_file import write_video
from tests.test_webcam import FakeCapture, plugged


@pytest.fixture(autouse=True)
def stop(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """In the place of Ctrl-C."""
    event = threading.Event()
    monkeypatch.setattr(raw, "stop_event", lambda: event)
    return event


def test_a_video_is_recorded_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clip = write_video(tmp_path / "clip.mp4", "mpeg4", 20)
    path = tmp_path / "a.raw.mcap"
    raw.record_raw(path, str(clip), None, overwrite=False)
    recording = RawRecording(path)
    assert recording.recorded == VideoFile(clip).info
    assert [shot.time for shot in recording] == [shot.time for shot in VideoFile(clip)]
    said = capsys.readouterr().err.replace("\n", "")
    assert "20 shots, depth in 0 of them" in said
    assert not list(tmp_path.glob("*.part"))


def test_a_recording_of_a_recording_keeps_depth_and_camera(tmp_path: Path) -> None:
    first = write(tmp_path / "a.raw.mcap", some_shots(30), INFO, "png")
    raw.record_raw(tmp_path / "b.raw.mcap", str(first), 0.5, overwrite=False)
    second = RawRecording(tmp_path / "b.raw.mcap")
    assert len(second) == 16
    assert second.info.device == INFO.device
    for read, wrote in zip(second, some_shots(16), strict=True):
        assert read.time == wrote.time
        assert (read.depth is None) == (wrote.depth is None)


def test_lost_shots_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = write(tmp_path / "a.raw.mcap", some_shots(12))
    raw.record_raw(tmp_path / "b.raw.mcap", str(first), None, overwrite=False)
    assert "1 shots were lost" in capsys.readouterr().err


def test_ctrl_c_ends_a_recording_and_keeps_it(
    tmp_path: Path, stop: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    capture = plugged(monkeypatch, FakeCapture(10_000))
    grab = capture.grab

    def and_then_stop() -> bool:
        if capture.left == 9_990:
            stop.set()
        return grab()

    monkeypatch.setattr(capture, "grab", and_then_stop)
    raw.record_raw(tmp_path / "a.raw.mcap", "webcam:0", None, overwrite=False)
    recording = RawRecording(tmp_path / "a.raw.mcap")
    assert 5 < len(recording) < 12
    assert recording.recorded.name == "webcam:0"
    assert not capture.isOpened()


def test_nothing_is_replaced_unasked(tmp_path: Path) -> None:
    clip = write_video(tmp_path / "clip.mp4", "mpeg4", 3)
    path = tmp_path / "a.raw.mcap"
    path.write_bytes(b"dear to me")
    with pytest.raises(BadShowError, match="such a file already"):
        raw.record_raw(path, str(clip), None, overwrite=False)
    assert path.read_bytes() == b"dear to me"
    raw.record_raw(path, str(clip), None, overwrite=True)
    assert len(RawRecording(path)) == 3


def test_a_camera_that_gives_nothing_leaves_what_was_there(
    tmp_path: Path, stop: threading.Event
) -> None:
    path = tmp_path / "a.raw.mcap"
    path.write_bytes(b"dear to me")
    stop.set()
    clip = write_video(tmp_path / "clip.mp4", "mpeg4", 3)
    with pytest.raises(BadShowError, match="gave no picture"):
        raw.record_raw(path, str(clip), None, overwrite=True)
    assert path.read_bytes() == b"dear to me"
    assert not list(tmp_path.glob("*.part"))


def test_cameras_are_opened_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_video(tmp_path / "clip.mp4", "mpeg4", 3)
    write(tmp_path / "a.raw.mcap", some_shots(3))
    assert isinstance(open_camera("clip.mp4", folder=tmp_path), VideoFile)
    assert isinstance(open_camera("a.raw.mcap", folder=tmp_path), RawRecording)
    # Whatever it is called.
    (tmp_path / "a.raw.mcap").rename(tmp_path / "recording")
    assert isinstance(open_camera("recording", folder=tmp_path), RawRecording)
    plugged(monkeypatch, FakeCapture(3))
    assert isinstance(open_camera("webcam:0"), Webcam)


@pytest.mark.parametrize("name", ["webcam:", "webcam:front", "webcam:-1", "webcam:²"])
def test_a_webcam_has_a_number(name: str) -> None:
    with pytest.raises(BadShowError, match="webcam:0"):
        open_camera(name)


@pytest.mark.parametrize(
    ("name", "error", "says"),
    [
        ("nothing.mp4", BadShowError, "no such camera"),
        ("text.mp4", BadFileError, "no video can be read"),
        ("text.mcap", BadFileError, "not a raw recording"),
        ("webcam:97", UnavailableError, "webcam:97"),
    ],
)
def test_what_is_no_camera_is_named(
    tmp_path: Path, name: str, error: type[Exception], says: str
) -> None:
    if name.startswith("text"):
        (tmp_path / name).write_text("hello\n" * 300)
    with pytest.raises(error, match=says):
        open_camera(name, folder=tmp_path)
