"""The show as its users run it: real processes, a real bus, a real headless GL context."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import numpy as np
import pytest
from PIL import Image

from puppet.cast import load_cast
from puppet.errors import UnavailableError
from puppet.line import Line
from puppet.net.bus import Bus
from puppet.net.messages import (
    VERSION,
    Decoder,
    HealthMessage,
    SceneMessage,
    SkeletonMessage,
    encode,
)
from puppet.show import load_show
from puppet.skeleton import Moment, SkeletonFrame
from puppet.tracking.takes.rehearsal import Rehearsal
from puppet.tracking.takes.take import read_take

REPOSITORY = Path(__file__).resolve().parents[1]
SHOW = REPOSITORY / "configs/shows/demo.toml"
TAKE = REPOSITORY / "tests/recorded_streams/balance_cam01.mcap"
#: First starts compile kernels, and the machine may be busy.
PATIENCE = 90.0


def puppet(*arguments: str, cwd: Path | None = None) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "puppet", *arguments],
        cwd=cwd or REPOSITORY,
        env={**os.environ, "DISPLAY": "", "WAYLAND_DISPLAY": ""},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@contextmanager
def running(*arguments: str, cwd: Path | None = None) -> Iterator[subprocess.Popen[str]]:
    process = puppet(*arguments, cwd=cwd)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        try:
            process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


class Scenes:
    """What a viewer would see."""

    def __init__(self, port: int, show: str) -> None:
        self.bus = Bus.join(f"tcp/127.0.0.1:{port}", show)
        self._newest = self.bus.latest("scene")
        self._decode = Decoder(SceneMessage)

    def until(self, wanted: Callable[[SceneMessage], bool]) -> SceneMessage:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            data = self._newest.take(0.5)
            if data is not None and wanted(scene := self._decode(data)):
                return scene
        raise AssertionError("no such scene came")


@pytest.fixture
def stage(free_port: int) -> Iterator[tuple[int, Scenes]]:
    """A running stage and somebody who watches it."""
    with running("stage", str(SHOW), "--port", str(free_port)):
        scenes = Scenes(free_port, load_show(SHOW).key)
        scenes.until(lambda _scene: True)
        yield free_port, scenes
        scenes.bus.close()


def test_a_whole_show_runs_unattended_and_reports(tmp_path: Path, free_port: int) -> None:
    process = puppet(
        "run", str(SHOW), "--headless", "--seconds", "4", "--report", "r.json", "--port",
        str(free_port), "--mp4", "film.mp4", cwd=tmp_path,
    )  # fmt: skip
    _, errors = process.communicate(timeout=PATIENCE + 60)
    assert process.returncode == 0, errors
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["frames_in"] >= 100
    assert report["frames_posed"] == report["frames_in"]
    assert report["frames_drawn"] >= 20
    assert report["puppets"] == ["fish", "lamp"]
    assert 0.0 < report["latency_ms"]["p50"] <= report["latency_ms"]["p99"]
    assert set(report["rss_mb"]) == {"track", "stage", "view"}
    assert all(0 < megabytes < 500 for megabytes in report["rss_mb"].values())
    assert (tmp_path / "film.mp4").stat().st_size > 10_000


def test_without_a_display_it_says_so_and_keeps_pictures(tmp_path: Path, free_port: int) -> None:
    process = puppet("run", str(SHOW), "--seconds", "3", "--port", str(free_port), cwd=tmp_path)
    _, errors = process.communicate(timeout=PATIENCE + 60)
    assert process.returncode == 0, errors
    assert "no display" in errors
    assert "puppet-view.png" in errors
    with Image.open(tmp_path / "puppet-view.png") as image:
        picture = np.asarray(image.convert("RGB"), float)
    assert picture.shape == (720, 1280, 3)
    orange = (picture[..., 0] > 180) & (picture[..., 1] < 140) & (picture[..., 2] < 60)
    assert orange.sum() > 2000, "the fish is not in the picture"


def test_the_bus_changes_no_bit_of_a_pose(stage: tuple[int, Scenes]) -> None:
    """A take through tracker, bus and stage gives the poses that the line gives by itself."""
    _port, scenes = stage
    line = Line(load_cast(load_show(SHOW), SHOW))
    send = scenes.bus.publisher("skeleton/camera")
    for frame in list(read_take(TAKE))[:40]:
        wanted = line.step(frame)
        message = SkeletonMessage.of(
            frame, source="test", synthetic=False, stream_ns=1, sent_ns=time.monotonic_ns()
        )
        send(encode(message))
        scene = scenes.until(lambda s, sent=message.sent_ns: s.frame_sent_ns == sent)  # type: ignore[misc]
        for got in scene.puppets:
            assert got.bones == wanted.poses[got.name].bones.tobytes()
            assert got.translation == wanted.poses[got.name].translation.tobytes()


def is_felt(scene: SceneMessage) -> bool:
    """Whether somebody is there whom the puppets follow by now, half of the way at least."""
    return any(np.frombuffer(now.influence).max() > 0.5 for now in scene.performers)


def test_a_tracker_is_picked_up_killed_and_replaced_while_the_show_runs(
    stage: tuple[int, Scenes],
) -> None:
    port, scenes = stage
    arguments = ("track", str(SHOW), "--port", str(port))
    first = puppet(*arguments)
    scenes.until(lambda s: s.source == "balance_cam01.mcap" and s.frame_sent_ns > 0 and is_felt(s))
    first.kill()
    first.communicate()
    # The stage goes on by itself, and what was lost eases away.
    gone = scenes.until(lambda s: s.frame_sent_ns == 0 and len(s.performers) > 0)
    assert gone.puppets
    with running(*arguments, "--source", "rehearsal"):
        back = scenes.until(lambda s: s.source == "rehearsal" and s.frame_sent_ns > 0)
        assert back.synthetic
        assert back.time > gone.time


def test_a_stage_that_was_killed_is_found_again_by_its_tracker(free_port: int) -> None:
    arguments = ("stage", str(SHOW), "--port", str(free_port))
    key = load_show(SHOW).key
    with running("track", str(SHOW), "--port", str(free_port)):
        for _ in range(2):
            hub = puppet(*arguments)
            scenes = Scenes(free_port, key)
            scenes.until(lambda s: s.frame_sent_ns > 0)
            scenes.bus.close()
            hub.kill()
            hub.communicate()


def test_a_message_of_another_version_is_refused_and_the_show_goes_on(
    stage: tuple[int, Scenes],
) -> None:
    _port, scenes = stage
    send = scenes.bus.publisher("skeleton/camera")
    seen = Rehearsal().frame(0.0)

    def message(version: int, sequence: int) -> bytes:
        frame = SkeletonFrame(sequence / 30, sequence, 0, seen.positions, seen.states)
        made = SkeletonMessage.of(
            Moment.of(frame), source="s", synthetic=True, stream_ns=5, sent_ns=sequence
        )
        return encode(msgspec.structs.replace(made, version=version))

    send(message(99, 1))
    send(b"not a message at all")
    send(b"\x91" * 5000)  # a list in a list in a list …
    time.sleep(0.2)
    send(message(VERSION, 2))
    assert scenes.until(lambda s: s.frame_sent_ns == 2).source == "s"


def test_a_port_in_use_is_told_with_what_to_do(free_port: int) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", free_port))
        other.listen()
        process = puppet("stage", str(SHOW), "--port", str(free_port))
        _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    assert "in use" in errors
    assert "--port" in errors
    with Bus.host(f"tcp/127.0.0.1:{free_port}", "x"), pytest.raises(UnavailableError):
        Bus.host(f"tcp/127.0.0.1:{free_port}", "x")


def test_the_bus_listens_on_loopback_only(stage: tuple[int, Scenes]) -> None:
    port, _ = stage
    tables = [Path("/proc/net/tcp"), Path("/proc/net/tcp6")]
    listening = [
        line.split()[1]
        for table in tables
        if table.exists()
        for line in table.read_text().splitlines()[1:]
        if line.split()[3] == "0A"
    ]
    ours = [address for address in listening if address.endswith(f":{port:04X}")]
    assert ours == [f"0100007F:{port:04X}"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("nothing.toml", "cannot be opened"),
        ("colour", "unknown field `colour`"),
        ("armature", "missing.glb"),
        ("source", "there is no such source"),
    ],
)
def test_a_show_that_cannot_run_says_why_at_once(tmp_path: Path, text: str, says: str) -> None:
    good = SHOW.read_text().replace("../armatures", str(REPOSITORY / "configs/armatures"))
    good = good.replace("../../tests", str(REPOSITORY / "tests"))
    path = tmp_path / "show.toml"
    if text == "colour":
        good += "colour = 1\n"
    elif text == "armature":
        good = good.replace("fish.glb", "missing.glb")
    elif text == "source":
        good = good.replace("balance_cam01", "nobody")
    if text != "nothing.toml":
        path.write_text(good)
    process = puppet("run", str(path), "--headless", "--seconds", "1", cwd=tmp_path)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2
    assert says in errors
    assert "Traceback" not in errors


def test_ctrl_c_ends_everything(tmp_path: Path, free_port: int) -> None:
    process = puppet("run", str(SHOW), "--headless", "--port", str(free_port), cwd=tmp_path)
    scenes = Scenes(free_port, load_show(SHOW).key)
    scenes.until(lambda s: s.frame_sent_ns > 0)
    scenes.bus.close()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=40)
    assert process.returncode == 0, errors
    left = subprocess.run(
        ["pgrep", "-f", f"puppet (stage|track|view) .*--port {free_port}"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert left.stdout == ""


def test_a_recording_does_not_begin_before_there_is_a_stage(tmp_path: Path, free_port: int) -> None:
    """Of a take that is played once, and is over in two seconds, the stage hears every frame."""
    text = SHOW.read_text().replace('"ping-pong"', '"once"')
    text = text.replace("../armatures", str(REPOSITORY / "configs/armatures"))
    text = text.replace("../../tests", str(REPOSITORY / "tests"))
    show = tmp_path / "once.toml"
    show.write_text(text)
    frames = len(read_take(TAKE).thinned(30))
    with running("track", str(show), "--port", str(free_port)):
        time.sleep(2.5)  # the tracker is up long before the stage
        with running("stage", str(show), "--port", str(free_port)):
            scenes = Scenes(free_port, load_show(show).key)
            decode = Decoder(HealthMessage)
            counted: list[int] = []

            def hear(data: bytes) -> None:
                counters = decode(data).counters
                # What the stage was too slow for is counted as well; a lost beginning is not.
                counted.append(counters.get("frames_in", 0) + counters.get("dropped", 0))

            scenes.bus.listen("health/stage", hear)
            scenes.until(lambda _scene: bool(counted) and counted[-1] >= frames - 1)
            scenes.bus.close()


@pytest.mark.parametrize("role", ["track", "stage", "view"])
def test_whatever_is_killed_in_a_show_comes_back(tmp_path: Path, free_port: int, role: str) -> None:
    process = puppet("run", str(SHOW), "--headless", "--port", str(free_port), cwd=tmp_path)
    scenes = Scenes(free_port, load_show(SHOW).key)
    drawn: list[HealthMessage] = []
    decode = Decoder(HealthMessage)
    scenes.bus.listen("health/view", lambda data: drawn.append(decode(data)))
    try:
        scenes.until(lambda s: s.frame_sent_ns > 0 and bool(drawn))
        found = subprocess.run(
            ["pgrep", "-f", f"puppet {role} .*--port {free_port}"],
            capture_output=True,
            text=True,
            check=True,
        )
        os.kill(int(found.stdout.split()[0]), signal.SIGKILL)
        time.sleep(1.0)
        drawn.clear()
        scenes.until(
            lambda s: (
                s.frame_sent_ns > 0
                and bool(drawn)
                and drawn[-1].counters.get("frames_drawn", 0) > 5
            )
        )
        assert process.poll() is None
    finally:
        scenes.bus.close()
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=40)
