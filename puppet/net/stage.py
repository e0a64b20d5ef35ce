"""`puppet stage`: skeleton frames → poses. The one owner of mappings and poses.

It steps when a frame arrives, not on a timer. When frames stop coming it goes on by itself, so that
what was lost is held and then eased to rest. Two trackers of one camera never mix: the one that
started last is followed. What several cameras see is fused.
"""

from __future__ import annotations

import threading
import time
from queue import SimpleQueue
from typing import Protocol

from puppet.errors import BadMessageError
from puppet.line import Line, Tick
from puppet.mapping.proposal import Proposal
from puppet.mapping.service import MappingService
from puppet.mapping.stance import Stance
from puppet.net.bus import Bus
from puppet.net.health import Health
from puppet.net.mapping_endpoint import answer_mapping
from puppet.net.messages import CastMember, CastMessage, Decoder, SkeletonMessage, encode
from puppet.net.numbers import Numbers
from puppet.net.part_endpoint import PartEndpoint
from puppet.net.scene import Events, conditioning_of, scene_of
from puppet.net.stream_clock import NOMINAL_STEP, StageClock, StreamGate
from puppet.skeleton import Moment

#: Seconds of silence after which the stage goes on by itself, and how often it then steps.
SILENCE = 0.12
IDLE_STEP = NOMINAL_STEP


class Fuses(Protocol):
    """Makes one moment of what several cameras see, as `puppet.tracking.fusion.fusion` does."""

    def add(self, camera: str, moment: Moment, arrived: float) -> Moment | None:
        """Take in what a camera sees, heard at `arrived` (monotonic seconds)."""
        ...

    def place_camera(
        self, camera: str, position: tuple[float, float, float] | None, depth: bool = False
    ) -> None:
        """Where a camera's lens is on the stage, and whether it measures depth."""
        ...


class Stage:
    """Runs a line between the trackers' moments and the viewers' scenes."""

    def __init__(
        self,
        line: Line,
        bus: Bus,
        mappings: MappingService | None = None,
        fusion: Fuses | None = None,
        stance: Stance | None = None,
    ) -> None:
        """`mappings`: who decides; None leaves every puppet as it is. `fusion`: makes one moment of
        what several cameras see; None where there is one camera. `stance`: the neutral one that was
        captured on the calibrated stage."""
        self.line = line
        self._moments = bus.latest("skeleton/*")
        self._publish = bus.publisher("scene")
        self._tell = bus.publisher("events")
        self._show_conditioning = bus.publisher("conditioning")
        self._decode = Decoder(SkeletonMessage)
        self._fusion = fusion
        self._stance = stance
        self._lenses: dict[str, tuple[tuple[float, float, float] | None, bool]] = {}
        self._gates: dict[str, StreamGate] = {}
        self._gaps: dict[str, int] = {}
        self._clock = StageClock()
        self._numbers = Numbers()
        self._heard = -1e9
        self._sequence = 0
        self._source, self._synthetic = "", False
        self._events = Events()
        self.health = Health(bus, "stage")
        self._cast = time.time_ns()  # another stage, another cast
        self._mapping = 0
        self._changes: SimpleQueue[tuple[str, Proposal]] = SimpleQueue()
        bus.answer("cast", lambda _request: encode(self._cast_message()))
        self._parts = PartEndpoint(bus, line)
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
                waiting = time.monotonic() - self._heard > SILENCE
                data = self._moments.take(IDLE_STEP if waiting else SILENCE)
                now = time.monotonic()
                self._take_over_changes()
                if data is not None:
                    self._take_in(data, now)
                elif now - self._heard > SILENCE:
                    self._go_on(now)
        finally:
            self.health.close()

    def _take_in(self, data: bytes, now: float) -> None:
        try:
            message = self._decode(data)
            moment: Moment | None = message.moment()
        except BadMessageError as error:
            # One bad message must not end a show; the operator sees it in the stage's health.
            self.health.counters["refused"] += 1
            self.health.note = str(error)
            return
        if not self._gates.setdefault(message.camera, StreamGate()).follows(message.stream_ns, now):
            self.health.counters["other_trackers"] += 1
            return
        self._heard = now
        self._source, self._synthetic = message.source, message.synthetic
        self._count_gap(message)
        self.health.counters["frames_in"] += 1
        self._place(message)
        stream: object = message.stream_ns
        if self._fusion is not None and moment is not None:
            moment, stream = self._fusion.add(message.camera, moment, now), "fused"
        elif moment is not None:
            moment = self._numbers.kept(moment, stream)
        if moment is None:  # it is kept for the next moment of the leading camera
            self.health.counters["frames_posed"] += 1
            return
        tick = self.line.step(self._clock.place(moment, stream, self.line.time))
        self._send(tick, message.sent_ns)
        self.health.counters["frames_posed"] += 1
        self.health.state = "running" if moment.present else "nobody"
        self.health.gauges["tick_ms"] = 1000.0 * (time.monotonic() - now)

    def _place(self, message: SkeletonMessage) -> None:
        """Take note of where the camera stands; a captured stance holds on its own stage only."""
        place = (message.lens, message.depth)
        if self._lenses.get(message.camera) != place:
            self._lenses[message.camera] = place
            known = [lens is not None for lens, _ in self._lenses.values()]
            self.line.stance = self._stance if all(known) else None
            if len(known) > 1 and not all(known):
                self.health.note = (
                    "cameras that are not calibrated to one stage cannot be fused well: "
                    + ", ".join(name for name, (lens, _) in self._lenses.items() if lens is None)
                )
            if self._fusion is not None:
                self._fusion.place_camera(message.camera, message.lens, message.depth)

    def _take_over_changes(self) -> None:
        """Between two frames, so that no pose is half of one mapping and half of another."""
        self._parts.take_over()
        while not self._changes.empty():
            self.line.set_mapping(*self._changes.get())
            self._mapping += 1

    def _count_gap(self, message: SkeletonMessage) -> None:
        gap = message.sequence - self._gaps.get(message.camera, message.sequence)
        if gap > 1:
            self.health.counters["dropped"] += gap - 1
        self._gaps[message.camera] = message.sequence

    def _go_on(self, now: float) -> None:
        self.health.state = "waiting"
        self._gaps.clear()
        if self.line.time is not None:
            self._send(self.line.idle(self.line.time + IDLE_STEP), 0)
        else:
            self._send(self.line.at_rest(now), 0)

    def _send(self, tick: Tick, sent_ns: int) -> None:
        self._sequence += 1
        scene = scene_of(
            tick,
            sequence=self._sequence,
            frame_sent_ns=sent_ns,
            cast=self._cast,
            mapping=self._mapping,
            source=self._source,
            synthetic=self._synthetic,
        )
        self._publish(encode(scene))
        if tick.performers:
            self._show_conditioning(encode(conditioning_of(tick)))
        for event in self._events(tick):
            self._tell(encode(event))
        self.health.gauges["performers"] = sum(now.raw.present for now in tick.performers)
