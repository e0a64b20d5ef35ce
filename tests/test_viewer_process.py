"""`puppet view` against a stage that the test plays: what it survives."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from puppet.cast import load_cast
from puppet.line import Line
from puppet.net.bus import Bus
from puppet.net.messages import (
    CastMember,
    CastMessage,
    Decoder,
    HealthMessage,
    SceneMessage,
    encode,
)
from puppet.net.scene import scene_of
from puppet.show import load_show
from puppet.tracking.takes.rehearsal import Rehearsal

REPOSITORY = Path(__file__).resolve().parents[1]
SHOW = REPOSITORY / "configs/shows/demo.toml"
MENAGERIE = REPOSITORY / "configs/shows/menagerie.toml"
PATIENCE = 60.0


class PlayedStage:
    """A stage of the test's own, with a real viewer process before it."""

    def __init__(self, port: int) -> None:
        show = load_show(SHOW)
        self.bus = Bus.host(f"tcp/127.0.0.1:{port}", show.key)
        self.cast = CastMessage(revision=1, members=())
        self.bus.answer("cast", lambda _request: encode(self.cast))
        self.health: HealthMessage | None = None
        decode = Decoder(HealthMessage)

        def hear(data: bytes) -> None:
            self.health = decode(data)

        self.bus.listen("health/view", hear)
        self._publish = self.bus.publisher("scene")

    def play(self, show_path: Path, revision: int) -> SceneMessage:
        """Take on the cast of a show; gives a scene with it."""
        puppets = load_cast(load_show(show_path), show_path)
        self.cast = CastMessage(
            revision=revision,
            members=tuple(
                CastMember(p.name, str(p.path), p.scale, p.proposal.mode, ()) for p in puppets
            ),
        )
        line = Line(puppets)
        for frame, _ in zip(Rehearsal(), range(40), strict=False):
            tick = line.step(frame)
        return scene_of(
            tick, sequence=1, frame_sent_ns=0, cast=revision, source="t", synthetic=True
        )

    def show_until(self, scene: SceneMessage, enough: Callable[[HealthMessage], bool]) -> None:
        """Send a scene again and again until the viewer's health says what is wanted."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            self._publish(encode(scene))
            time.sleep(0.05)
            if self.health is not None and enough(self.health):
                return
        raise AssertionError(f"the viewer did not get there: {self.health}")


@pytest.fixture
def played(free_port: int, tmp_path: Path) -> Iterator[tuple[PlayedStage, subprocess.Popen[str]]]:
    stage = PlayedStage(free_port)
    viewer = subprocess.Popen(
        [sys.executable, "-m", "puppet", "view", str(SHOW), "--headless", "--port", str(free_port)],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
    )
    yield stage, viewer
    if viewer.poll() is None:
        viewer.send_signal(signal.SIGTERM)
    viewer.communicate(timeout=20)
    stage.bus.close()


def test_scenes_that_make_no_sense_are_left_out_and_the_picture_goes_on(
    played: tuple[PlayedStage, subprocess.Popen[str]],
) -> None:
    stage, viewer = played
    good = stage.play(SHOW, revision=1)
    stage.show_until(good, lambda health: health.counters.get("frames_drawn", 0) > 3)
    broken = msgspec.structs.replace(good.puppets[0], bones=b"1234567")
    other = msgspec.structs.replace(good.puppets[0], bones=good.puppets[1].bones)
    stateless = msgspec.structs.replace(good.performers[0], states=bytes([7] * 20))
    for number, bad in enumerate(
        (
            msgspec.structs.replace(good, puppets=(broken,)),
            msgspec.structs.replace(good, puppets=(other,)),
            msgspec.structs.replace(good, performers=(stateless,)),
            msgspec.structs.replace(good, version=7),
        ),
        start=1,
    ):
        stage.show_until(bad, lambda h, n=number: h.counters.get("refused", 0) >= n)  # type: ignore[misc]
        assert stage.health is not None
        before = stage.health.counters["frames_drawn"]
        stage.show_until(good, lambda h, n=before: h.counters["frames_drawn"] > n)  # type: ignore[misc]
    assert viewer.poll() is None


def test_another_cast_is_met_while_the_viewer_runs(
    played: tuple[PlayedStage, subprocess.Popen[str]],
) -> None:
    stage, viewer = played
    first = stage.play(SHOW, revision=1)
    stage.show_until(first, lambda health: health.counters.get("frames_drawn", 0) > 3)
    second = stage.play(MENAGERIE, revision=2)
    assert stage.health is not None
    before = stage.health.counters["frames_drawn"]
    stage.show_until(second, lambda health: health.counters["frames_drawn"] > before + 3)
    assert stage.health.counters.get("refused", 0) == 0
    assert viewer.poll() is None


def test_without_gl_it_says_what_to_install(tmp_path: Path) -> None:
    nowhere = str(tmp_path)
    done = subprocess.run(
        [sys.executable, "-m", "puppet", "render", str(SHOW), "x.png"],
        cwd=tmp_path,
        env={
            **os.environ,
            "__EGL_VENDOR_LIBRARY_DIRS": nowhere,
            "__EGL_VENDOR_LIBRARY_FILENAMES": f"{nowhere}/none.json",
        },
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 2, done.stderr
    assert "no GL to draw with" in done.stderr
    assert "apt install" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_stance_that_was_only_assumed_is_said_so() -> None:
    from puppet.net.view import _notes

    puppets = load_cast(load_show(SHOW), SHOW)
    line = Line(puppets)
    first = replace(next(iter(Rehearsal())), sequence=0)
    tick = line.step(first)
    scene = scene_of(tick, sequence=1, frame_sent_ns=0, cast=1, source="t", synthetic=False)
    assert _notes(scene) == ("stand still to calibrate",)
