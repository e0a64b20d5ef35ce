"""`puppet track`: one source → skeleton frames on the bus."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

from puppet.net.bus import Bus
from puppet.net.health import Health
from puppet.net.messages import SkeletonMessage, encode
from puppet.skeleton import SkeletonFrame
from puppet.tracking.replay import Replay, paced
from puppet.tracking.source import Source

#: Seconds by which a frame may be published behind its time before it counts as late.
LATE = 0.1


def run_track(source: Source, bus: Bus, stop: threading.Event) -> None:
    """Publish a source's frames, each at its time, until it ends or `stop` is set."""
    info = source.info
    stream_ns = time.monotonic_ns()
    health = Health(bus, "track")
    health.note = info.name
    publish = bus.publisher("skeleton")
    bus.be_present("track", str(stream_ns))
    if not info.live:
        _wait_for_stage(bus, stop)  # or the beginning of a recording would be lost
    health.state = "running"
    started: float | None = None
    try:
        for due, frame in _timed(source):
            now = time.monotonic()
            started = now - due if started is None else started
            if stop.wait(max(started + due - now, 0.0)):
                break
            health.counters["late"] += now - (started + due) > LATE
            message = SkeletonMessage.of(
                frame,
                source=info.name,
                synthetic=info.synthetic,
                stream_ns=stream_ns,
                sent_ns=time.monotonic_ns(),
            )
            publish(encode(message))
            health.counters["frames"] += 1
            health.counters["nobody"] += not frame.present
    finally:
        source.close()
        health.close()


def _wait_for_stage(bus: Bus, stop: threading.Event) -> None:
    there = threading.Event()

    def watch(role: str, _name: str, alive: bool) -> None:
        if role == "stage" and alive:
            there.set()

    bus.watch_presence(watch)
    while not there.wait(0.1) and not stop.is_set():
        pass


def _timed(source: Source) -> Iterator[tuple[float, SkeletonFrame]]:
    """Frames with the seconds, from the first one, at which each is due.

    A live source comes in its own time. A recording says how fast it is to be played; a video file
    is played as it was filmed.
    """
    if isinstance(source, Replay):
        yield from paced(source)
        return
    first: float | None = None
    for frame in source:
        first = frame.time if first is None else first
        yield (0.0 if source.info.live else frame.time - first), frame
