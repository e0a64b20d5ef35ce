"""Deciding while the show runs: real stages, a real bus, and the poses that come out."""

from __future__ import annotations

import getpass
import itertools
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.cast import load_cast
from puppet.cli import main
from puppet.errors import UnavailableError
from puppet.formats.armature_toml import load_puppet
from puppet.formats.mapping_file import mappings_path
from puppet.kernel import Floats
from puppet.line import Line
from puppet.mapping.decisions import Decision
from puppet.net.bus import Bus
from puppet.net.mapping_client import MappingClient
from puppet.net.messages import (
    CastMessage,
    Decoder,
    SceneMessage,
    SkeletonMessage,
    encode,
)
from puppet.net.scene import scene_of
from puppet.net.stage import Stage
from puppet.pose import Pose, forward_kinematics
from puppet.show import load_show
from puppet.skeleton import Joint, Moment, SkeletonFrame
from tests.shows import ARMATURES, REPOSITORY, write_show
from tests.stage_models import standing

#: First starts compile kernels, and the machine may be busy.
PATIENCE = 90.0
CAST = {
    "lamp": ("lamp.glb", "fk"),
    "fish": ("fish.glb", "fk"),
    "gull": ("seagull.glb", "ik"),
}
#: Degrees. The shade turns by more than 20 when its arm goes up, and not at all for the other.
FOLLOWS, RESTS = 15.0, 2.0


@contextmanager
def puppet(*arguments: str | Path) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "puppet", *map(str, arguments)],
        cwd=REPOSITORY,
        env={**os.environ, "DISPLAY": "", "WAYLAND_DISPLAY": ""},
        stdin=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class Performer:
    """Somebody who stands before the stage, publishes skeletons, and hears every scene."""

    def __init__(self, port: int, show: Path) -> None:
        self.bus = Bus.join(f"tcp/127.0.0.1:{port}", load_show(show).key, wait=PATIENCE)
        self.scenes: list[SceneMessage] = []
        decode = Decoder(SceneMessage)
        self.bus.listen("scene", lambda data: self.scenes.append(decode(data)))
        self.positions = with_arms()
        self._send = self.bus.publisher("skeleton/camera")
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._perform, daemon=True)
        self._thread.start()

    def _perform(self) -> None:
        # A second of the performance takes less, so that nobody has to wait for it.
        stream = time.monotonic_ns()
        states = np.full(len(Joint), 2, np.uint8)
        for sequence in itertools.count():
            if self._stop.wait(0.012):
                return
            frame = SkeletonFrame(sequence / 30.0, sequence, 0, self.positions, states)
            self._send(
                encode(
                    SkeletonMessage.of(
                        Moment.of(frame),
                        source="performer",
                        synthetic=True,
                        stream_ns=stream,
                        sent_ns=time.monotonic_ns(),
                    )
                )
            )

    def settled(self, seconds: float = 1.5) -> SceneMessage:
        """The scene when what is done now has been done for so long, by the stage's clock."""
        sent = time.monotonic_ns()
        first = self.until(lambda scene: scene.frame_sent_ns > sent)
        return self.until(lambda scene: scene.time > first.time + seconds)

    def until(self, wanted: Callable[[SceneMessage], bool]) -> SceneMessage:
        """The newest scene, as soon as it is one that is wanted."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if self.scenes and wanted(scene := self.scenes[-1]):
                return scene
            time.sleep(0.005)
        raise AssertionError("no such scene came")

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.bus.close()


def with_arms(left: float = 0.0, right: float = 0.0) -> Floats:
    """Standing, with the arms raised sideways by so many degrees."""
    positions = np.array(standing().positions)
    for side, angle in (("LEFT", left), ("RIGHT", -right)):
        shoulder = positions[Joint[f"SHOULDER_{side}"]].copy()
        turn = Rotation.from_euler("z", angle, degrees=True)
        for name in ("ELBOW", "WRIST", "HAND"):
            joint = Joint[f"{name}_{side}"]
            positions[joint] = shoulder + turn.apply(positions[joint] - shoulder)
    return positions


def pose_of(scene: SceneMessage, puppet: str) -> Pose:
    return next(p for p in scene.puppets if p.name == puppet).pose()


def turned(armature: Armature, bone: str, was: Pose, now: Pose) -> float:
    """Degrees that a bone has turned in the world."""
    index = armature.index(bone)
    before, after = (forward_kinematics(armature, pose)[1][index] for pose in (was, now))
    return float(
        np.degrees((Rotation.from_quat(after) * Rotation.from_quat(before).inv()).magnitude())
    )


def angles(a: Pose, b: Pose) -> Floats:
    """Radians by which each bone differs in its parent, and the whole puppet in the world."""
    first, second = (Rotation.from_quat(np.vstack([p.rotation, p.bones])) for p in (a, b))
    return np.asarray((second * first.inv()).magnitude())


@pytest.fixture(scope="module")
def show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_show(tmp_path_factory.mktemp("live"), CAST)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def port() -> int:
    import socket

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        found: int = probe.getsockname()[1]
        return found


@pytest.fixture(scope="module")
def performer(show: Path, port: int) -> Iterator[Performer]:
    """A stage of its own process, and somebody before it, whose neutral stance it knows."""
    with puppet("stage", show, "--port", str(port)):
        performer = Performer(port, show)
        performer.settled(3.0)  # two seconds of standing still are measured
        yield performer
        performer.close()


def arms_that_move(performer: Performer, bone: str, armature: Armature) -> tuple[float, float]:
    """Degrees that a bone of the lamp turns when the left arm goes up, and the right."""
    found = []
    performer.positions = with_arms()
    rest = pose_of(performer.settled(), "lamp")
    for left, right in ((90.0, 0.0), (0.0, 90.0)):
        performer.positions = with_arms(left, right)
        found.append(turned(armature, bone, rest, pose_of(performer.settled(), "lamp")))
    performer.positions = with_arms()
    return found[0], found[1]


def test_a_decision_changes_at_once_what_drives_a_bone_and_undo_restores_it(
    performer: Performer,
) -> None:
    lamp = load_puppet(ARMATURES / "lamp.glb").model.armature
    client = MappingClient(performer.bus, 20.0)
    left, right = arms_that_move(performer, "shade", lamp)
    assert left < RESTS
    assert right > FOLLOWS
    client.decide("lamp", [Decision("lock", "fk", "shade", "hand.L")], "test")
    left, right = arms_that_move(performer, "shade", lamp)
    assert left > FOLLOWS, "the shade does not follow the arm that it is locked to"
    assert right < RESTS, "the shade still follows the other arm"
    client.undo("lamp")
    left, right = arms_that_move(performer, "shade", lamp)
    assert left < RESTS
    assert right > FOLLOWS, "undo did not restore what was"


def test_fk_to_ik_and_back_is_no_jump(performer: Performer) -> None:
    """Each step goes no further than easing over half a second from one pose to the other."""
    client = MappingClient(performer.bus, 20.0)
    performer.positions = with_arms(left=100.0, right=40.0)
    poses = [pose_of(performer.settled(), "fish")]
    for mode in ("ik", "fk"):
        start = len(performer.scenes) - 1
        client.decide("fish", [Decision("mode", mode)])
        poses.append(pose_of(performer.settled(), "fish"))
        way, move = angles(poses[-2], poses[-1]), poses[-1].translation - poses[-2].translation
        assert way.max() > 0.2, "the two ways of driving look the same, so this says nothing"
        steps = 0
        for was, now in itertools.pairwise(performer.scenes[start:]):
            if now.sequence != was.sequence + 1:
                continue  # one was lost on the way
            # 3t² − 2t³ over half a second is steepest in its middle: 1.5 / 0.5 s.
            share = 3.0 * (now.time - was.time)
            step = angles(pose_of(was, "fish"), pose_of(now, "fish"))
            assert (step <= 1.05 * share * way + 0.01).all(), "a bone jumped"
            shift = pose_of(now, "fish").translation - pose_of(was, "fish").translation
            assert np.linalg.norm(shift) <= 1.05 * share * np.linalg.norm(move) + 0.005
            steps += bool(step.max() > 1e-3)
        assert steps >= 5, "it went over in one step"
    assert angles(poses[0], poses[2]).max() < 0.01, "back in FK it is not what it was"
    performer.positions = with_arms()


def test_scenes_count_the_changes_and_the_cast_tells_the_new_pairs(performer: Performer) -> None:
    client = MappingClient(performer.bus, 20.0)
    decode = Decoder(CastMessage)
    before = performer.settled(0.1)

    def dorsal() -> dict[int, int]:
        reply = performer.bus.ask("cast", timeout=20.0)
        assert reply is not None
        cast = decode(reply)
        assert cast.revision == before.cast, "the viewers would load every model again"
        return dict(next(m for m in cast.members if m.name == "fish").pairs)

    bone = load_puppet(ARMATURES / "fish.glb").model.armature.index("dorsal")
    assert bone not in dorsal()
    client.decide("fish", [Decision("lock", "fk", "dorsal", "head")])
    after = performer.settled(0.1)
    assert after.mapping == before.mapping + 1
    assert dorsal()[bone] == 2
    client.undo("fish")
    assert performer.settled(0.1).mapping == before.mapping + 2
    assert bone not in dorsal()


def test_a_refused_decision_and_garbage_do_not_touch_the_show(performer: Performer) -> None:
    client = MappingClient(performer.bus, 20.0)
    before = performer.settled(0.1)
    for data in (b"", b"\xff" * 100, b"\x91" * 5000):
        assert performer.bus.ask("mapping/decide", data, timeout=20.0) is not None
    for decision in (Decision("lock", "fk", "shode", "hand.L"), Decision("mode", "ik")):
        with pytest.raises(Exception, match="no such"):
            client.decide("lamp" if decision.bone else "dog", [decision])
    after = performer.settled(0.1)
    assert (after.mapping, after.cast) == (before.mapping, before.cast)
    assert after.time > before.time


def test_a_stage_that_was_killed_comes_back_with_what_was_decided(
    tmp_path: Path, free_port: int
) -> None:
    show = write_show(tmp_path, {"lamp": ("lamp.glb", "fk")})
    with puppet("track", show, "--port", str(free_port)):
        with puppet("stage", show, "--port", str(free_port)) as stage:
            bus = Bus.join(f"tcp/127.0.0.1:{free_port}", load_show(show).key, wait=PATIENCE)
            scenes = bus.latest("scene")
            first = _tracked(scenes.take)
            client = MappingClient(bus, 20.0)
            client.decide("lamp", [Decision("lock", "fk", "base", "head")], "Ann")
            decided = client.decide("lamp", [Decision("mode", "ik")], "Ann")
            stage.kill()  # the moment the answer is there
            stage.wait()
            bus.close()
        with puppet("stage", show, "--port", str(free_port)):
            bus = Bus.join(f"tcp/127.0.0.1:{free_port}", load_show(show).key, wait=PATIENCE)
            scenes = bus.latest("scene")
            again = _tracked(scenes.take)
            assert again.cast != first.cast, "viewers must meet the new cast"
            client = MappingClient(bus, 20.0)
            assert client.propose("lamp")[0] == decided
            assert client.history("lamp")["steps"] == [
                "lock base = head (Ann)",
                "drive it by IK (Ann)",
            ]
            assert client.puppets()[0]["warnings"] == []
            reply = bus.ask("cast", timeout=20.0)
            assert reply is not None
            assert Decoder(CastMessage)(reply).members[0].mode == "ik"
            back = client.undo("lamp")
            assert {pair["bone"]: pair["human"] for pair in back["pairs"]}["base"] == "head"
            bus.close()
    kept = {path.name for path in tmp_path.iterdir()}
    assert kept == {"show.toml", mappings_path(show).name}


def _tracked(
    take: Callable[[float], bytes | None],
) -> SceneMessage:
    """A scene that was made from the tracker's rehearsal."""
    decode, end = Decoder(SceneMessage), time.monotonic() + PATIENCE
    while time.monotonic() < end:
        data = take(0.5)
        if data is not None:
            scene = decode(data)
            if scene.frame_sent_ns and scene.source == "rehearsal":
                return scene
    raise AssertionError("no such scene came")


class Decide:
    """`puppet decide SHOW …` in this process, which saves the start of another."""

    def __init__(
        self,
        show: Path,
        port: int,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        self._fixed = (str(show), "--port", str(port))
        self._monkeypatch = monkeypatch
        self._capsys = capsys
        monkeypatch.setenv("COLUMNS", "160")

    def __call__(self, *arguments: str) -> tuple[int, str, str]:
        """-> exit code, stdout, stderr"""
        argv = ["puppet", "decide", self._fixed[0], *arguments, *self._fixed[1:]]
        self._monkeypatch.setattr(sys, "argv", argv)
        with pytest.raises(SystemExit) as end:
            main()
        streams = self._capsys.readouterr()
        return int(end.value.code or 0), streams.out, streams.err

    def rows(self, *arguments: str) -> dict[str, list[str]]:
        """The rows of the table by their first cells, without scores; the call must succeed."""
        code, out, err = self(*arguments)
        assert code == 0, err
        cells = [[cell.strip() for cell in line.split("│")[1:-1]] for line in out.splitlines()]
        return {
            row[0]: [cell for cell in row[1:] if not re.fullmatch(r"[01]\.\d\d", cell)]
            for row in cells
            if row
        }


@pytest.fixture
def decide(
    performer: Performer,
    show: Path,
    port: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> Iterator[Decide]:
    """The command, and a fish and a gull about which nothing holds, before and after."""
    client = MappingClient(performer.bus, 20.0)

    def undo() -> None:
        for name in ("fish", "gull", "lamp"):
            while client.history(name)["holds"]:
                client.undo(name)

    undo()
    yield Decide(show, port, monkeypatch, capsys)
    undo()


def test_the_command_lists_the_puppets_and_what_drives_them(decide: Decide) -> None:
    rows = decide.rows()
    assert {name: row[0] for name, row in rows.items()} == {
        "lamp": "FK",
        "fish": "FK",
        "gull": "IK",
    }
    assert rows["lamp"][1] == "5"
    assert "dorsal" in rows["fish"][-1]
    assert decide.rows("lamp")["shade"][0] == "hand.R"


def test_every_option_of_the_command_does_what_it_says(decide: Decide) -> None:
    assert decide.rows("fish", "--lock", "fin.R=hand.L")["fin.R"] == ["hand.L", "lock"]
    assert decide.rows("fish", "--accept", "head=head")["head"] == ["head", "accept"]
    assert decide.rows("fish", "--set", "fin.L=hand.L")["fin.L"] == ["hand.L", "set"]
    assert decide.rows("fish", "--clear", "fin.L")["fin.L"][0] != "hand.L"
    assert decide.rows("fish", "--reject", "back=pelvis").get("back", [""])[0] != "pelvis"
    assert decide.rows("fish", "--forbid", "middle=chest").get("middle", [""])[0] != "chest"
    assert decide.rows("fish", "--undo")["middle"][0] == "chest"
    assert decide.rows("fish", "--redo").get("middle", [""])[0] != "chest"
    code, out, err = decide("fish", "--mode", "ik", "--lock", "dorsal=head")
    assert code == 0
    for word in ("fish: inverse kinematics", "end effector", "goes with"):
        assert word in out
    me = getpass.getuser()
    for number, sentence in enumerate(
        ("lock fin.R = hand.L", "accept head = head", "set fin.L = hand.L",
         "clear what was said of fin.L", "reject back = pelvis", "forbid middle = chest",
         "drive it by IK; lock dorsal = head"),
        start=1,
    ):  # fmt: skip
        assert f"{number}. {sentence} ({me})\n" in err
    code, out, err = decide("fish", "--undo")
    assert f"7. drive it by IK; lock dorsal = head ({me})  (undone)\n" in err
    assert "undone" not in err.split("7.")[0]


def test_the_command_explains_and_takes_in_an_edited_file(decide: Decide, show: Path) -> None:
    explained = decide.rows("fish", "--explain")["fin.R"]
    assert "geometry" in explained[2]
    assert "thigh.R" in explained[3] or "foot.R" in explained[3]
    decide.rows("fish", "--lock", "fin.R=hand.L")
    kept = mappings_path(show)
    kept.write_text(kept.read_text().replace("hand.L", "forearm.L"))
    assert decide.rows("fish", "--reload")["fin.R"] == ["forearm.L", "lock"]
    kept.write_text(kept.read_text().replace("forearm.L", "paw"))
    code, _, err = decide("fish", "--reload")
    assert code == 0
    assert "no such human bone or limb (paw)" in err
    code, _, err = decide("fish", "--reload", "--undo")
    assert code == 2
    assert "--reload" in err


def test_the_command_makes_masters_and_takes_them_apart(decide: Decide) -> None:
    before = decide.rows("gull")
    assert "wings" not in before
    grouped = decide.rows("gull", "--group", "wings=wing_tip.L, wing_tip.R")
    assert "wings" in grouped
    assert "wing_tip.L" not in grouped
    assert decide.rows("gull", "--lock", "wings=hand.L")["wings"] == ["hand.L", "lock"]
    assert decide.rows("gull", "--ungroup", "wings") == before


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("dog", "--mode", "ik"), ("no such puppet", "one of lamp, fish, gull", "dog")),
        (("fish", "--lock", "fin.R"), ("--lock", "not a pair", "BONE=HUMAN")),
        (("fish", "--lock", "fin.X=head"), ("fish", "no such bone", "fin.X")),
        (("fish", "--mode", "xk"), ("--mode", "fk or ik")),
        (("gull", "--group", "wings"), ("--group", "not a master", "NAME=BONE,BONE")),
        (("gull", "--ungroup", "wings"), ("gull", "no such master", "wings")),
        (("fish", "--undo"), ("fish", "nothing to undo")),
        (("fish", "--undo", "--redo"), ("only one of these",)),
        (("fish", "--undo", "--lock", "fin.R=hand.L"), ("only one of these", "another call")),
        (("--lock", "fin.R=hand.L"), ("which puppet", "puppet decide SHOW PUPPET")),
        (("fish", "--lock", "fin.R=hand.L", "--forbid", "fin.R=hand.L"), ("locked and forbidden",)),
    ],
)  # fmt: skip
def test_what_the_command_cannot_do_it_says_and_nothing_changes(
    decide: Decide, performer: Performer, arguments: tuple[str, ...], says: tuple[str, ...]
) -> None:
    client = MappingClient(performer.bus, 20.0)
    before = [(client.propose(name), client.history(name)["holds"]) for name in ("fish", "gull")]
    code, out, err = decide(*arguments)
    assert (code, out) == (2, "")
    for text in says:
        assert text in err
    after = [(client.propose(name), client.history(name)["holds"]) for name in ("fish", "gull")]
    assert after == before


def test_the_command_decides_from_a_process_of_its_own(
    performer: Performer, show: Path, port: int, tmp_path: Path
) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "puppet", "decide", str(show), "lamp", "--lock", "shade=hand.L",
         "--port", str(port)],
        cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
        timeout=PATIENCE,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "hand.L" in done.stdout
    client = MappingClient(performer.bus, 20.0)
    pairs = client.propose("lamp")[0]["pairs"]
    assert {pair["bone"]: pair["human"] for pair in pairs}["shade"] == "hand.L"
    assert mappings_path(show).exists()
    client.undo("lamp")


def test_without_a_stage_the_command_says_what_to_start(
    show: Path, free_port: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = Decide(show, free_port, monkeypatch, capsys)("lamp", "--mode", "ik")
    assert code == 2
    assert f"tcp/127.0.0.1:{free_port}: no show is running there" in err
    assert "puppet run SHOW" in err


@pytest.mark.parametrize(
    ("option", "says"),
    [
        (("--mode", "xk"), "there is no such mode"),
        (("--lock", "shade"), "this is not a pair"),
        (("--group", "wings"), "this is not a master"),
    ],
)
def test_what_is_malformed_is_told_before_anybody_is_asked(
    show: Path, free_port: int, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], option: tuple[str, str], says: str,
) -> None:  # fmt: skip
    code, _, err = Decide(show, free_port, monkeypatch, capsys)("lamp", *option)
    assert code == 2
    assert says in err
    assert "no show is running" not in err


def test_a_show_that_is_still_starting_is_waited_for_and_not_started_again(
    show: Path, free_port: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        "puppet.commands.mapping.MappingClient", partial(MappingClient, timeout=0.5)
    )
    with Bus.host(f"tcp/127.0.0.1:{free_port}", load_show(show).key):
        code, _, err = Decide(show, free_port, monkeypatch, capsys)("lamp", "--mode", "ik")
    assert code == 2
    assert "no stage answers" in err
    assert "may still be starting" in err


def test_a_stage_in_a_thread_takes_a_change_between_two_frames(
    tmp_path: Path, free_port: int
) -> None:
    """Whoever holds the service decides as well as whoever asks over the bus."""
    path = write_show(tmp_path, {"lamp": ("lamp.glb", "fk")})
    config = load_show(path)
    cast = load_cast(config, path)
    stop = threading.Event()
    with Bus.host(f"tcp/127.0.0.1:{free_port}", config.key) as hub:
        line = Line(cast, config.conditioning)
        stage = Stage(line, hub, cast.mappings)
        thread = threading.Thread(target=stage.run, args=(stop,))
        thread.start()
        try:
            performer = Performer(free_port, path)
            performer.settled(0.5)
            for number in range(1, 6):
                cast.mappings.decide("lamp", [Decision("mode", "ik" if number % 2 else "fk")])
                scene = performer.settled(0.1)
                assert scene.mapping == number
                assert line.mapping("lamp").mode == cast.mappings.current("lamp").mode
            performer.close()
        finally:
            stop.set()
            thread.join(20)
        assert stage.health.counters["refused"] == 0


def test_the_viewer_takes_over_new_marks_without_loading_the_models_again(
    tmp_path: Path, free_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    from puppet.net import view
    from puppet.render.context import headless_context

    path = write_show(tmp_path, {"fish": ("fish.glb", "fk")}, "[view]\nwidth = 320\nheight = 240\n")
    config = load_show(path)
    cast = load_cast(config, path)
    try:
        ctx = headless_context()
    except UnavailableError as error:
        pytest.skip(str(error))
    loaded: list[Path] = []

    def load(model: Path) -> object:
        loaded.append(model)
        return load_puppet(model)

    monkeypatch.setattr(view, "load_puppet", load)
    endpoint = f"tcp/127.0.0.1:{free_port}"
    with Bus.host(endpoint, config.key) as hub, Bus.join(endpoint, config.key, wait=10.0) as guest:
        stage = Stage(Line(cast), hub, cast.mappings)
        publish = hub.publisher("scene")
        viewer = view.Viewer(ctx, guest, config.view, config.puppets)
        viewer.overlay = False
        tick = stage.line.at_rest(0.0)
        numbers = itertools.count(1)

        def picture(mapping: int) -> Floats:
            """Of the puppet at rest, so that nothing but the marks can differ."""
            scene = scene_of(
                tick, sequence=next(numbers), frame_sent_ns=0, cast=stage._cast, source="t",
                synthetic=True, mapping=mapping,
            )  # fmt: skip
            end = time.monotonic() + PATIENCE
            while time.monotonic() < end:
                publish(encode(scene))
                drawn = viewer.next_scene(0.5)
                if drawn is not None and viewer._mapping == mapping and viewer.draw(drawn):
                    return np.asarray(viewer.renderer.read(), float)
            raise AssertionError(f"the viewer did not get there: {viewer.health.note}")

        before = picture(0)
        np.testing.assert_array_equal(picture(0), before)
        cast.mappings.decide("fish", [Decision("lock", "fk", "dorsal", "head")])
        stage._take_over_changes()
        after = picture(1)
        assert np.abs(after - before).max() > 30, "the marks are those of the old mapping"
        cast.mappings.undo("fish")
        stage._take_over_changes()
        np.testing.assert_array_equal(picture(2), before)
        assert loaded == [ARMATURES / "fish.glb"], "the model was loaded again"
        assert viewer.health.counters.get("refused", 0) == 0
        viewer.close()
        stage.health.close()


def test_a_show_may_keep_its_decisions_elsewhere_and_says_what_is_wrong_there(
    tmp_path: Path, free_port: int
) -> None:
    path = write_show(tmp_path, {"lamp": ("lamp.glb", "fk")}, 'mappings = "kept/mine.toml"')
    kept = tmp_path / "kept/mine.toml"
    kept.parent.mkdir()
    lamp = load_cast(load_show(path), path).mappings
    lamp.decide("lamp", [Decision("lock", "fk", "shade", "hand.L")])
    assert kept.exists()
    assert not mappings_path(path).exists()
    whole = kept.read_text()
    kept.write_text(whole[:-60])
    done = subprocess.run(
        [sys.executable, "-m", "puppet", "run", str(path), "--headless", "--seconds", "1",
         "--port", str(free_port)],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, timeout=PATIENCE,
    )  # fmt: skip
    assert done.returncode == 2
    assert f"{kept}: " in done.stderr
    assert "cut off" in done.stderr
    assert "Traceback" not in done.stderr
    kept.write_text(whole)
    again = load_cast(load_show(path), path)
    assert {p.name: p.partner for p in again.puppets[0].proposal.pairs}["shade"] == "hand.L"
