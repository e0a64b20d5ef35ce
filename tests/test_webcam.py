"""Webcams: live until they are unplugged, and what is said of those that cannot be used."""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from puppet.errors import UnavailableError
from puppet.tracking.cameras import webcam_refusal
from puppet.tracking.cameras.webcam import Webcam

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux tells")


class FakeCapture:
    """Of OpenCV's captures, what a webcam needs: a few images, then it is unplugged."""

    def __init__(self, images: int, *, opened: bool = True, rate: float = 30.0) -> None:
        self.left, self.opened, self.rate = images, opened, rate
        self.waiting = threading.Event()
        self.goes_on = threading.Event()
        self.goes_on.set()
        self.released_in_mid_image = False

    def isOpened(self) -> bool:  # noqa: N802
        return self.opened

    def set(self, _what: int, _value: float) -> bool:
        return True

    def get(self, _what: int) -> float:
        return self.rate

    def grab(self) -> bool:
        self.waiting.set()
        self.goes_on.wait(10.0)
        self.released_in_mid_image |= not self.opened
        self.waiting.clear()
        self.left -= 1
        return self.opened and self.left >= 0

    def retrieve(self) -> tuple[bool, Any]:
        return True, np.full((4, 6, 3), self.left % 256, np.uint8)

    def release(self) -> None:
        self.opened = False


def plugged(monkeypatch: pytest.MonkeyPatch, capture: FakeCapture) -> FakeCapture:
    monkeypatch.setattr(cv2, "VideoCapture", lambda _index: capture)
    return capture


@pytest.fixture
def devices(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A folder in the place of /dev, and a webcam that gives nothing."""
    plugged(monkeypatch, FakeCapture(0, opened=False))
    monkeypatch.setattr(webcam_refusal, "DEVICES", tmp_path)
    return tmp_path


def test_a_webcam_is_live_until_it_is_unplugged(monkeypatch: pytest.MonkeyPatch) -> None:
    capture = plugged(monkeypatch, FakeCapture(5))
    camera = Webcam(0)
    shots = list(camera)
    assert camera.info.live
    assert (camera.info.name, camera.info.kind, len(camera)) == ("webcam:0", "webcam", 0)
    assert len(shots) == 4  # the first image showed that it answers
    times = [shot.time for shot in shots]
    assert times == sorted(times)
    assert [shot.sequence for shot in shots] == [0, 1, 2, 3]
    assert not capture.isOpened()
    camera.close()
    camera.close()


@pytest.mark.parametrize(("said", "believed"), [(60.0, 60.0), (0.0, 30.0), (1e9, 30.0)])
def test_rates_that_cannot_be_are_not_believed(
    monkeypatch: pytest.MonkeyPatch, said: float, believed: float
) -> None:
    plugged(monkeypatch, FakeCapture(5, rate=said))
    assert Webcam(0).info.rate == believed


def test_closing_it_while_an_image_is_waited_for_ends_the_shots(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """OpenCV crashes if a capture is released while it is grabbed from."""
    capture = plugged(monkeypatch, FakeCapture(100))
    camera = Webcam(0)
    shots = iter(camera)
    next(shots)
    capture.goes_on.clear()
    capture.waiting.clear()
    rest: list[Any] = []
    reader = threading.Thread(target=lambda: rest.extend(shots))
    reader.start()
    assert capture.waiting.wait(10.0)
    camera.close()
    capture.goes_on.set()
    reader.join(10.0)
    assert not reader.is_alive()
    assert len(rest) <= 1
    assert not capture.released_in_mid_image
    assert not capture.isOpened()


def test_a_webcam_that_is_not_there_is_named(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(UnavailableError, match="webcam:97"):
        Webcam(97)
    assert capfd.readouterr() == ("", "")


@linux
def test_those_that_are_there_are_listed(devices: Path) -> None:
    (devices / "video2").touch()
    with pytest.raises(UnavailableError, match=r"is not there(.|\n)*there are: video2"):
        Webcam(0)


@linux
def test_a_webcam_that_another_program_uses_names_the_program(devices: Path) -> None:
    device = devices / "video0"
    device.touch()
    script = f"handle = open({str(device)!r}); print('open', flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"open\n"
        with pytest.raises(
            UnavailableError,
            match=rf"in use by another program(.|\n)*\(process {other.pid}\)",
        ):
            Webcam(0)
        other.communicate(b"\n")
    with pytest.raises(UnavailableError, match="gives no pictures"):
        Webcam(0)


@linux
def test_a_webcam_that_another_user_s_program_uses_is_known_by_the_driver(
    devices: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (devices / "video0").touch()

    def busy(_handle: int, request: int, _argument: object) -> int:
        assert request == webcam_refusal.REQUEST_BUFFERS
        raise OSError(errno.EBUSY, "busy")

    monkeypatch.setattr(fcntl, "ioctl", busy)
    with pytest.raises(UnavailableError, match="in use by another program"):
        Webcam(0)


@linux
def test_a_webcam_that_may_not_be_used_says_so(
    devices: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (devices / "video0").touch()

    def forbidden(*_arguments: object) -> int:
        raise PermissionError(errno.EACCES, "not you")

    monkeypatch.setattr(os, "open", forbidden)
    monkeypatch.setattr(os, "access", lambda *_arguments: False)
    with pytest.raises(UnavailableError, match=r"may not be used by this user(.|\n)*group"):
        Webcam(0)


def test_where_nothing_can_be_told_the_hint_says_what_to_look_for(
    devices: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (devices / "video0").touch()
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(UnavailableError, match=r"does not answer(.|\n)*plugged in, is free"):
        Webcam(0)
