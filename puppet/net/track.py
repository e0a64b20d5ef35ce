"""`puppet track`: one source → skeleton frames on the bus."""

from __future__ import annotations

import threading
import time

from puppet.net.bus import Bus
from puppet.net.health import Health
from puppet.net.messages import SkeletonMessage, encode
from puppet.tracking.source import Source

#: Seconds by which a frame may be published behind its time before it counts as late.
LATE = 0.1


def run_track(source: Source, bus: Bus, stop: threading.Event, *, speed: float = 1.0) -> None:
    """Publish a source's frames until it ends or `stop` is set.

    A live source sets its own pace. Others are paced by their capture times, `speed` times faster.
    """
    info = source.info
    stream_ns = time.monotonic_ns()
    health = Health(bus, "track")
    health.note = info.name
    publish = bus.publisher("skeleton")
    bus.be_present("track", str(stream_ns))
    health.state = "running"
    started: float | None = None
    first = 0.0
    try:
        for frame in source:
            if stop.is_set():
                break
            if not info.live:
                now = time.monotonic()
                if started is None:
                    started, first = now, frame.time
                due = started + (frame.time - first) / speed
                if stop.wait(max(due - now, 0.0)):
                    break
                health.counters["late"] += now - due > LATE
            publish(
                encode(
                    SkeletonMessage.of(
                        frame,
                        source=info.name,
                        synthetic=info.synthetic,
                        stream_ns=stream_ns,
                        sent_ns=time.monotonic_ns(),
                    )
                )
            )
            health.counters["frames"] += 1
            health.counters["nobody"] += not frame.present
    finally:
        source.close()
        health.close()
