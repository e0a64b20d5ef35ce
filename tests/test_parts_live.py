"""Parts, events and conditioning of a running stage, over a real bus; and two cameras at once."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from puppet.cast import load_cast
from puppet.commands.parts import parts_live
from puppet.errors import BadDecisionError
from puppet.line import Line
from puppet.net.bus import Bus
from puppet.net.messages import (
    ConditioningMessage,
    Decoder,
    EventMessage,
    Message,
    SceneMessage,
    SkeletonMessage,
    encode,
)
from puppet.net.part_endpoint import ask_parts
from puppet.net.part_messages import PartsRequest
from puppet.net.stage import Stage
from puppet.show import PartConfig, load_show
from puppet.skeleton import Joint, Moment
from puppet.tracking.fusion.fusion import Fusion
from tests.shows import write_show
from tests.test_parts import standing

PATIENCE = 30.0


class Tracker:
    """Publishes where people stand, as a tracker does, until it is closed."""

    def __init__(self, bus: Bus, camera: str, **people: tuple[int, float]) -> None:
        self.people = people
        self.clock = 0.0
        self._camera = camera
        self._send = bus.publisher(f"skeleton/{camera}")
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        stream, sequence = time.monotonic_ns(), 0
        while not self._stop.wait(0.02):
            self.clock += 1.0 / 30.0
            sequence += 1
            frames = tuple(
                standing(number, x, -2.0, self.clock, hand_up=name.startswith("up"))
                for name, (number, x) in self.people.items()
            )
            moment = Moment(self.clock, sequence, frames).at(self.clock, sequence)
            self._send(
                encode(
                    SkeletonMessage.of(
                        moment,
                        source="people",
                        camera=self._camera,
                        synthetic=True,
                        stream_ns=stream,
                        sent_ns=time.monotonic_ns(),
                    )
                )
            )

    def close(self) -> None:
        self._stop.set()
        self._thread.join()


class Audience:
    """Hears everything that the stage says."""

    def __init__(self, bus: Bus) -> None:
        self.heard: dict[type[Message], list[Message]] = {}
        for key, kind in (
            ("scene", SceneMessage),
            ("events", EventMessage),
            ("conditioning", ConditioningMessage),
        ):
            messages: list[Message] = []
            self.heard[kind] = messages
            decode: Decoder[Message] = Decoder(kind)
            bus.listen(key, lambda data, m=messages, d=decode: m.append(d(data)))  # type: ignore[misc]

    def until(self, kind: type[Message], wanted: Callable[[Message], bool]) -> Message:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            found = [message for message in list(self.heard[kind]) if wanted(message)]
            if found:
                return found[-1]
            time.sleep(0.01)
        raise AssertionError(f"no such {kind.__name__} came")

    def later(self, than: Message) -> SceneMessage:
        """A scene a second and a half later, by the stage's clock."""
        assert isinstance(than, SceneMessage)
        end = than.time + 1.5
        found = self.until(SceneMessage, lambda s: isinstance(s, SceneMessage) and s.time > end)
        assert isinstance(found, SceneMessage)
        return found


@pytest.fixture
def show(tmp_path: Path, free_port: int) -> Path:
    return write_show(
        tmp_path,
        {"lamp": ("lamp.glb", "fk"), "fish": ("fish.glb", "fk")},
        f'[bus]\nendpoint = "tcp/127.0.0.1:{free_port}"\n',
    )


@contextmanager
def on_stage(path: Path, *parts: PartConfig, cameras: int = 1) -> Iterator[tuple[Bus, Audience]]:
    """A running stage, and a bus that is joined to it."""
    show = load_show(path)
    stop = threading.Event()
    with Bus.host(show.bus.endpoint, show.key) as hub:
        line = Line(load_cast(show, path), parts=parts)
        line.warm_up()
        if cameras > 1:
            Fusion.warm_up()
        stage = Stage(line, hub, fusion=Fusion() if cameras > 1 else None)
        thread = threading.Thread(target=stage.run, args=(stop,))
        thread.start()
        try:
            with Bus.join(show.bus.endpoint, show.key, PATIENCE) as bus:
                yield bus, Audience(bus)
        finally:
            stop.set()
            thread.join()


def test_an_operator_gives_takes_and_reopens_a_part(
    show: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with on_stage(show) as (bus, audience):
        tracker = Tracker(bus, "camera", near=(3, 0.0), far=(5, 1.0))
        audience.until(EventMessage, lambda e: e == event(e, "took", 3, "lead"))
        answer = ask_parts(bus, PartsRequest(act="assign", part="lead", performer=5))
        assert [(part.name, part.performer) for part in answer.parts] == [("lead", 5)]
        assert answer.parts[0].puppets == ("lamp", "fish")
        assert answer.performers == (3, 5)
        audience.until(SceneMessage, lambda s: parts_in(s) == {5: ("lead",), 3: ()})
        with pytest.raises(BadDecisionError, match="no such performer"):
            ask_parts(bus, PartsRequest(act="assign", part="lead", performer=9))
        capsys.readouterr()
        parts_live(show, "lead", None, give=None, release=True, reopen=False)
        assert "before the camera: 3, 5" in capsys.readouterr().out
        audience.until(EventMessage, lambda e: e == event(e, "lost", 5, "lead"))
        # The other one takes it, for it was taken from the first.
        audience.until(SceneMessage, lambda s: parts_in(s) == {3: ("lead",), 5: ()})
        tracker.close()


def test_coming_and_going_are_events_and_conditioning_can_be_watched(show: Path) -> None:
    with on_stage(show) as (bus, audience):
        tracker = Tracker(bus, "camera", one=(1, 0.0))
        audience.until(EventMessage, lambda e: e == event(e, "entered", 1))
        tracker.people = {"one": (1, 0.0), "two": (2, 1.5)}
        audience.until(EventMessage, lambda e: e == event(e, "entered", 2))
        heard = audience.until(
            ConditioningMessage, lambda c: len(getattr(c, "performers", ())) == 2
        )
        assert isinstance(heard, ConditioningMessage)
        watched = next(one for one in heard.performers if one.performer == 2)
        raw = np.frombuffer(watched.steps["raw"]).reshape(20, 3)
        assert raw[Joint.SHOULDER_CENTER, 0] == pytest.approx(1.5)
        assert next(iter(watched.steps)) == "raw"
        assert len(watched.steps) >= 2
        tracker.people = {"two": (2, 1.5)}
        audience.until(EventMessage, lambda e: e == event(e, "left", 1))
        tracker.close()


def test_what_two_cameras_see_is_one_performer(show: Path) -> None:
    with on_stage(show, cameras=2) as (bus, audience):
        left = Tracker(bus, "left", one=(1, 0.02))
        right = Tracker(bus, "right", one=(8, -0.02))
        right.clock = 5000.0  # the clock of another machine
        first = audience.until(SceneMessage, lambda _scene: True)
        seen = audience.later(first)
        assert len(seen.performers) == 1
        number = seen.performers[0].performer
        left.close()  # one camera fails: the other goes on with the same performer
        after = audience.later(seen)
        assert [now.performer for now in after.performers] == [number]
        assert after.performers[0].frame(0.0, 0).present
        right.close()


def event(of: Message, kind: str, performer: int, part: str = "") -> Message:
    assert isinstance(of, EventMessage)
    return EventMessage(kind=kind, time=of.time, performer=performer, part=part)  # type: ignore[arg-type]


def parts_in(scene: Message) -> dict[int, tuple[str, ...]]:
    assert isinstance(scene, SceneMessage)
    return {now.performer: now.parts for now in scene.performers}
