"""`puppet track`: one source → skeleton frames on the bus."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from functools import partial

from puppet.net.bus import Bus
from puppet.net.health import Health
from puppet.net.messages import SkeletonMessage, encode
from puppet.skeleton import Moment
from puppet.tracking.source import Source, Watchful
from puppet.tracking.takes.replay import Replay, paced

#: Seconds by which a frame may be published behind its time before it counts as late.
LATE = 0.1
#: The key of a camera without a name.
ONLY_CAMERA = "camera"
#: Seconds that a source gets to give its next moment after it was asked to end.
PATIENCE = 1.0


def run_track(
    source: Source,
    bus: Bus,
    stop: threading.Event,
    camera: str = "",
    warn: Callable[[str], None] = lambda _text: None,
) -> None:
    """Publish a source's moments, each at its time, until it ends or `stop` is set.

    camera: the name of the source in its show, where there are several. warn: called with each
    thing that is wrong and can be lived with, as soon as the source knows of it.
    """
    told: set[str] = set()
    info = source.info
    watcher = source if isinstance(source, Watchful) else None
    stream_ns = time.monotonic_ns()
    health = Health(bus, track_role(camera), partial(_look, source, watcher))
    publish = bus.publisher(f"skeleton/{camera or ONLY_CAMERA}")
    bus.be_present("track", str(stream_ns))
    if not info.live:
        _wait_for_stage(bus, stop)  # or the beginning of a recording would be lost
    health.state = "running"
    threading.Thread(target=_let_go, args=(source, stop), daemon=True).start()
    started: float | None = None
    try:
        for due, moment in _timed(source):
            now = time.monotonic()
            started = now - due if started is None else started
            if stop.wait(max(started + due - now, 0.0)):
                break
            health.counters["late"] += not info.live and now - (started + due) > LATE
            message = SkeletonMessage.of(
                moment,
                source=info.name,
                camera=camera,
                lens=None if watcher is None else watcher.lens,
                depth=watcher is not None and watcher.has_depth,
                synthetic=info.synthetic,
                stream_ns=stream_ns,
                sent_ns=time.monotonic_ns(),
            )
            publish(encode(message))
            health.counters["frames"] += 1
            for warning in () if watcher is None else watcher.warnings:
                if warning not in told:
                    told.add(warning)
                    warn(warning)
            if info.live:  # how old what was seen is when it goes out
                health.gauges["age_ms"] = 1000.0 * (time.monotonic() - moment.time)
            health.counters["nobody"] += not moment.present
    finally:
        source.close()
        health.close()


def _look(source: Source, watcher: Watchful | None, health: Health) -> None:
    """What the source says of itself, into the health."""
    trouble = source.trouble
    health.note = trouble or source.info.name
    if health.state in ("running", "trouble"):
        health.state = "trouble" if trouble else "running"
    if watcher is None:
        return
    if not trouble:
        facts = (source.info.name, f"floor: from {watcher.floor}", *watcher.warnings)
        health.note = "; ".join(facts)
    # Copied first: the tracker may add to them meanwhile.
    health.gauges.update(dict(watcher.milliseconds))
    for event, count in dict(watcher.events).items():
        health.counters[event] = count


def _let_go(source: Source, stop: threading.Event) -> None:
    """A camera in trouble gives no moment after which to look whether it is time to end."""
    stop.wait()
    time.sleep(PATIENCE)
    source.close()


def track_role(camera: str) -> str:
    """What the health of a tracker is published as."""
    return f"track.{camera}" if camera else "track"


def _wait_for_stage(bus: Bus, stop: threading.Event) -> None:
    there = threading.Event()

    def watch(role: str, _name: str, alive: bool) -> None:
        if role == "stage" and alive:
            there.set()

    bus.watch_presence(watch)
    while not there.wait(0.1) and not stop.is_set():
        pass


def _timed(source: Source) -> Iterator[tuple[float, Moment]]:
    """Moments with the seconds, from the first one, at which each is due.

    A live source comes in its own time. A recording says how fast it is to be played; a video file
    is played as it was filmed.
    """
    if isinstance(source, Replay):
        yield from paced(source)
        return
    first: float | None = None
    for moment in source:
        first = moment.time if first is None else first
        yield (0.0 if source.info.live else moment.time - first), moment
