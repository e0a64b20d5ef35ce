"""`puppet stage`: skeleton frames → poses. The one owner of mappings and poses.

It steps when a frame arrives, not on a timer. When frames stop coming it goes on by itself, so that
what was lost is held and then eased to rest. Two trackers never mix: the one that started last is
followed, and an older one takes over again when that has gone silent.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from queue import SimpleQueue

from puppet.errors import BadMessageError
from puppet.line import Line, Tick
from puppet.mapping.proposal import Proposal
from puppet.mapping.service import MappingService
from puppet.net.bus import Bus
from puppet.net.health import Health
from puppet.net.mapping_endpoint import answer_mapping
from puppet.net.messages import (
    CastMember,
    CastMessage,
    Decoder,
    PerformerNow,
    PuppetPose,
    SceneMessage,
    SkeletonMessage,
    encode,
)
from puppet.skeleton import SkeletonFrame

#: Seconds of silence after which the stage goes on by itself, and how often it then steps.
SILENCE = 0.12
IDLE_STEP = 1.0 / 30.0
#: Seconds of silence after which another tracker is followed.
STREAM_SILENCE = 1.0


@dataclass
class StreamClock:
    """Joins the clocks of successive trackers to one that only runs forward.

    Within a stream the spacing of capture times is kept. Where a stream begins, or one has fallen
    behind what the stage went through by itself, it is joined a nominal step later.
    """

    stream_ns: int = -1
    heard: float = -1e9
    _offset: float = 0.0
    _first: bool = True

    def follows(self, stream_ns: int, now: float) -> bool:
        """Whether a frame of this stream is to be used, heard at `now` (monotonic seconds)."""
        if stream_ns != self.stream_ns:
            if stream_ns < self.stream_ns and now - self.heard < STREAM_SILENCE:
                return False
            self.stream_ns = stream_ns
            self._first = True
        self.heard = now
        return True

    def place(self, frame: SkeletonFrame, line_time: float | None) -> SkeletonFrame:
        """The frame on the stage's clock."""
        if line_time is None:
            self._offset = 0.0
        elif self._first or frame.time + self._offset <= line_time:
            self._offset = line_time + IDLE_STEP - frame.time
        self._first = False
        if self._offset == 0.0:
            return frame
        return SkeletonFrame(
            frame.time + self._offset,
            frame.sequence,
            frame.performer,
            frame.positions,
            frame.states,
        )


class Stage:
    """Runs a line between the tracker's frames and the viewers' scenes."""

    def __init__(self, line: Line, bus: Bus, mappings: MappingService | None = None) -> None:
        """`mappings`: who decides; None leaves every puppet as it is."""
        self.line = line
        self._frames = bus.latest("skeleton")
        self._publish = bus.publisher("scene")
        self._decode = Decoder(SkeletonMessage)
        self._clock = StreamClock()
        self._sequence = 0
        self._source, self._synthetic = "", False
        self._last_sequence = -1
        self.health = Health(bus, "stage")
        self._cast = time.time_ns()  # another stage, another cast
        self._mapping = 0
        self._changes: SimpleQueue[tuple[str, Proposal]] = SimpleQueue()
        bus.answer("cast", lambda _request: encode(self._cast_message()))
        if mappings is not None:
            mappings.on_change = lambda puppet, proposal: self._changes.put((puppet, proposal))
            answer_mapping(bus, mappings)
        bus.be_present("stage", "0")

    def _cast_message(self) -> CastMessage:
        """Who is on stage, as of now."""
        members = []
        for puppet in self.line.puppets:
            proposal = self.line.mapping(puppet.name)
            pairs = tuple((bone, pair.human) for pair in proposal.pairs for bone in pair.bones)
            members.append(
                CastMember(puppet.name, str(puppet.path), puppet.scale, proposal.mode, pairs)
            )
        return CastMessage(revision=self._cast, members=tuple(members))

    def run(self, stop: threading.Event) -> None:
        """Until `stop` is set."""
        try:
            while not stop.is_set():
                waiting = time.monotonic() - self._clock.heard > SILENCE
                data = self._frames.take(IDLE_STEP if waiting else SILENCE)
                now = time.monotonic()
                self._take_over_changes()
                if data is not None:
                    self._take_in(data, now)
                elif now - self._clock.heard > SILENCE:
                    self._go_on(now)
        finally:
            self.health.close()

    def _take_in(self, data: bytes, now: float) -> None:
        try:
            message = self._decode(data)
            frame = message.frame()
        except BadMessageError as error:
            # One bad message must not end a show; the operator sees it in the stage's health.
            self.health.counters["refused"] += 1
            self.health.note = str(error)
            return
        if not self._clock.follows(message.stream_ns, now):
            self.health.counters["other_trackers"] += 1
            return
        self._source, self._synthetic = message.source, message.synthetic
        self._count_gap(message)
        self.health.counters["frames_in"] += 1
        tick = self.line.step(self._clock.place(frame, self.line.time))
        self._send(tick, message.sent_ns)
        self.health.counters["frames_posed"] += 1
        self.health.state = "running" if frame.present else "nobody"
        self.health.gauges["tick_ms"] = 1000.0 * (time.monotonic() - now)

    def _take_over_changes(self) -> None:
        """Between two frames, so that no pose is half of one mapping and half of another."""
        while not self._changes.empty():
            self.line.set_mapping(*self._changes.get())
            self._mapping += 1

    def _count_gap(self, message: SkeletonMessage) -> None:
        gap = message.sequence - self._last_sequence
        if gap > 1 and self._last_sequence >= 0:
            self.health.counters["dropped"] += gap - 1
        self._last_sequence = message.sequence

    def _go_on(self, now: float) -> None:
        self.health.state = "waiting"
        self._last_sequence = -1
        if self.line.time is not None:
            self._send(self.line.idle(self.line.time + IDLE_STEP), 0)
        else:
            self._send(self.line.at_rest(now), 0)

    def _send(self, tick: Tick, sent_ns: int) -> None:
        self._sequence += 1
        self._publish(
            encode(
                scene_of(
                    tick,
                    sequence=self._sequence,
                    frame_sent_ns=sent_ns,
                    cast=self._cast,
                    mapping=self._mapping,
                    source=self._source,
                    synthetic=self._synthetic,
                )
            )
        )


def scene_of(
    tick: Tick,
    *,
    sequence: int,
    frame_sent_ns: int,
    cast: int,
    source: str,
    synthetic: bool,
    mapping: int = 0,
) -> SceneMessage:
    """What viewers are told of one step of the line."""
    performer = None
    if tick.neutral is not None:
        hip = tick.neutral.hip
        performer = PerformerNow(
            performer=tick.frame.performer,
            positions=tick.frame.positions.tobytes(),
            states=tick.frame.states.tobytes(),
            influence=tick.frame.influence.tobytes(),
            neutral_hip=(float(hip[0]), float(hip[1]), float(hip[2])),
            neutral_heading=tick.neutral.heading,
            measured=tick.measured,
        )
    return SceneMessage(
        sequence=sequence,
        time=tick.frame.time,
        frame_sent_ns=frame_sent_ns,
        posed_ns=time.monotonic_ns(),
        cast=cast,
        mapping=mapping,
        source=source,
        synthetic=synthetic,
        puppets=tuple(PuppetPose.of(name, pose) for name, pose in tick.poses.items()),
        performer=performer,
    )
