"""What the stage tells of one step of the line: scenes, conditioning, who came and went."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Final

from puppet.line import Tick
from puppet.net.messages import (
    ConditioningMessage,
    EventKind,
    EventMessage,
    PerformerNow,
    PuppetPose,
    SceneMessage,
)
from puppet.performer import PerformerTick

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


def conditioning_of(now: PerformerTick, time: float) -> ConditioningMessage:
    """One performer's joints before and after each step of conditioning."""
    steps = now.steps
    positions = {name: getattr(steps, name) for name in STEPS}
    return ConditioningMessage(
        time=time,
        performer=now.frame.performer,
        steps={name: at.tobytes() for name, at in positions.items()},
        states=steps.states.tobytes(),
        influence=steps.influence.tobytes(),
        trust=steps.trust.tobytes(),
    )


class Events:
    """Finds out who came and went, and who took or lost a part, from step to step."""

    def __init__(self) -> None:
        self._there: frozenset[int] = frozenset()
        self._parts: dict[str, int | None] = {}

    def __call__(self, tick: Tick) -> list[EventMessage]:
        """What happened since the step before."""
        there = frozenset(now.frame.performer for now in tick.performers if now.raw.present)
        events = [self._event("entered", tick, one) for one in sorted(there - self._there)]
        events += [self._event("left", tick, one) for one in sorted(self._there - there)]
        for part, player in tick.parts.items():
            before = self._parts.get(part)
            if before != player:
                if before is not None:
                    events.append(self._event("lost", tick, before, part))
                if player is not None:
                    events.append(self._event("took", tick, player, part))
        self._there, self._parts = there, dict(tick.parts)
        return events

    @staticmethod
    def _event(kind: EventKind, tick: Tick, performer: int, part: str = "") -> EventMessage:
        return EventMessage(kind=kind, time=tick.time, performer=performer, part=part)
