"""What the stage tells of one step of the line: scenes, conditioning, who came and went."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Final

from puppet.line import Tick
from puppet.net.messages import (
    ConditionedSteps,
    ConditioningMessage,
    EventKind,
    EventMessage,
    PerformerNow,
    PuppetPose,
    SceneMessage,
)
from puppet.performer import PerformerTick

#: Seconds for which somebody may be unseen without having left.
ABSENT: Final = 1.0
#: The steps of conditioning that are told, in the order in which a frame meets them.
STEPS: Final = ("raw", "believed", "filtered", "predicted", "shown")


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
    """What viewers are told."""
    lead = tick.lead
    others = (now for now in tick.performers if now is not lead)
    performers = () if lead is None else (lead, *others)
    return SceneMessage(
        sequence=sequence,
        time=tick.time,
        frame_sent_ns=frame_sent_ns,
        posed_ns=time.monotonic_ns(),
        cast=cast,
        mapping=mapping,
        source=source,
        synthetic=synthetic,
        puppets=tuple(PuppetPose.of(name, pose) for name, pose in tick.poses.items()),
        performers=tuple(shown for now in performers for shown in _shown(now, tick)),
    )


def _shown(now: PerformerTick, tick: Tick) -> Iterator[PerformerNow]:
    if now.neutral is None:
        return
    x, y, z = now.neutral.hip.tolist()
    number = now.frame.performer
    yield PerformerNow(
        performer=number,
        parts=tuple(part for part, player in tick.parts.items() if player == number),
        positions=now.frame.positions.tobytes(),
        states=now.frame.states.tobytes(),
        influence=now.frame.influence.tobytes(),
        neutral_hip=(x, y, z),
        neutral_heading=now.neutral.heading,
        measured=now.measured,
    )


def conditioning_of(tick: Tick) -> ConditioningMessage:
    """Everybody's joints before and after each step of conditioning."""
    return ConditioningMessage(time=tick.time, performers=tuple(map(_steps, tick.performers)))


def _steps(now: PerformerTick) -> ConditionedSteps:
    steps = now.steps
    return ConditionedSteps(
        now.frame.performer,
        {name: getattr(steps, name).tobytes() for name in STEPS},
        steps.states.tobytes(),
        steps.influence.tobytes(),
        steps.trust.tobytes(),
    )


class Events:
    """Finds out who came and went, and who took or lost a part, from step to step."""

    def __init__(self) -> None:
        self._seen: dict[int, float] = {}
        self._parts: dict[str, int | None] = {}

    def __call__(self, tick: Tick) -> list[EventMessage]:
        """What happened since the step before."""
        there = {now.frame.performer for now in tick.performers if now.raw.present}
        events = [self._event("entered", tick, one) for one in sorted(there - self._seen.keys())]
        self._seen |= dict.fromkeys(there, tick.time)
        for one, seen in sorted(self._seen.items()):
            if tick.time - seen > ABSENT:
                del self._seen[one]
                events.append(self._event("left", tick, one))
        for part, player in tick.parts.items():
            before = self._parts.get(part)
            if before != player:
                if before is not None:
                    events.append(self._event("lost", tick, before, part))
                if player is not None:
                    events.append(self._event("took", tick, player, part))
        self._parts = dict(tick.parts)
        return events

    @staticmethod
    def _event(kind: EventKind, tick: Tick, performer: int, part: str = "") -> EventMessage:
        return EventMessage(kind=kind, time=tick.time, performer=performer, part=part)
