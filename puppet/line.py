"""The line: from raw moments to the poses of all puppets on stage.

Pure but for its memory (conditioning, neutral stances, parts, transitions), which lives on capture
time alone: the same moments give the same poses, bit for bit, at any speed and in any process. The
stage runs it live; `puppet render`, the tests and the benchmarks run it without a bus.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from puppet.cast import StagedPuppet
from puppet.driven import DrivenPuppet
from puppet.errors import BadShowError
from puppet.mapping.proposal import Proposal
from puppet.mapping.stance import Stance, upright
from puppet.parts import Parts
from puppet.performer import Performer, PerformerTick
from puppet.pose import Pose
from puppet.show import ConditioningConfig, PartConfig, Show
from puppet.skeleton import JOINT_COUNT, Moment, SkeletonFrame, mirrored, nobody

#: Seconds after which a performer who has left is forgotten; who returns earlier is known.
REMEMBERED: Final = 60.0


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """What one step of the line gives.

    performers: everybody who is there or still fading, by number. parts: who plays each part.
    poses: by the puppets' names.
    """

    time: float
    sequence: int
    performers: tuple[PerformerTick, ...]
    parts: Mapping[str, int | None]
    poses: dict[str, Pose]

    @property
    def lead(self) -> PerformerTick | None:
        """Whoever plays the first part that is taken; else somebody who is there."""
        by_number = {now.frame.performer: now for now in self.performers}
        players = [by_number[number] for number in self.parts.values() if number in by_number]
        there = sorted(self.performers, key=lambda now: not now.raw.present)
        return next(iter([*players, *there]), None)

    @property
    def frame(self) -> SkeletonFrame:
        """The lead's conditioned skeleton, or that of nobody."""
        return self.lead.frame if self.lead is not None else _vacant(self.time, self.sequence)

    @property
    def neutral(self) -> Stance | None:
        """The lead's neutral stance."""
        return self.lead.neutral if self.lead is not None else None


class Line:
    """Performers, the parts they play, and the puppets that follow."""

    def __init__(
        self,
        puppets: Iterable[StagedPuppet],
        conditioning: ConditioningConfig | None = None,
        parts: Sequence[PartConfig] = (),
        mirror: bool = False,
    ) -> None:
        self.puppets = tuple(puppets)
        self.parts = Parts(parts)
        #: What performers who come from now on count from; None until they have stood still.
        self.stance: Stance | None = None
        self._mirror = mirror
        self._conditioning = conditioning
        self._performers: dict[int, Performer] = {}
        unseen = upright(np.zeros(3), 0.0)
        self._driven = {puppet.name: DrivenPuppet(puppet, unseen) for puppet in self.puppets}
        self._part_of = {puppet.name: self._existing(puppet) for puppet in self.puppets}
        self._drivers: dict[str, int | None] = dict.fromkeys(self._driven)
        self._last: Moment | None = None

    @classmethod
    def of(cls, show: Show, puppets: Iterable[StagedPuppet]) -> Line:
        """The line of a show."""
        return cls(puppets, show.conditioning, show.parts, show.mirror)

    @property
    def time(self) -> float | None:
        """Capture time of the last step."""
        return None if self._last is None else self._last.time

    @property
    def mirror(self) -> bool:
        """Whether puppets move as in a mirror before the performer."""
        return self._mirror

    @mirror.setter
    def mirror(self, mirror: bool) -> None:
        if mirror != self._mirror:
            self._mirror = mirror
            self._performers.clear()  # left is right now: nothing of the past holds
            for driven in self._driven.values():
                driven.ease()

    def step(self, moment: Moment) -> Tick:
        """Take in a moment; its time must be later than the last one's."""
        time, sequence = moment.time, moment.sequence
        dt = 0.0 if self._last is None else max(time - self._last.time, 0.0)
        self._last = moment
        seen = {
            frame.performer: mirrored(frame) if self._mirror else frame for frame in moment.frames
        }
        self._meet(seen, time)
        now = {
            number: performer.step(seen.get(number), time, sequence)
            for number, performer in sorted(self._performers.items())
            if number in seen or not performer.faded
        }
        self.parts.step(moment.frames, time)  # zones are on the floor, not in the mirror
        holders = self.parts.holders
        poses = {}
        for name, driven in self._driven.items():
            player = holders[self._part_of[name]]
            performer = None if player is None else now.get(player)
            self._follow(name, driven, player, performer)
            frame = _vacant(time, sequence) if performer is None else performer.frame
            poses[name] = driven.step(frame, dt)
        return Tick(time, sequence, tuple(now.values()), holders, poses)

    def idle(self, time: float) -> Tick:
        """Go on without a moment: as if nobody was there. Holding and easing go on."""
        return self.step(Moment(time, 0 if self._last is None else self._last.sequence))

    def at_rest(self, time: float) -> Tick:
        """Every puppet at rest at its place, as before any moment; changes nothing."""
        unseen = _vacant(time, 0)
        poses = {name: driven.asked(unseen) for name, driven in self._driven.items()}
        return Tick(time, 0, (), self.parts.holders, poses)

    def set_mapping(self, puppet: str, proposal: Proposal) -> None:
        """Drive a puppet by another mapping from the next step on; it gets there without a jump."""
        self._driven[puppet].set_mapping(proposal)

    def mapping(self, puppet: str) -> Proposal:
        """What drives a puppet now."""
        return self._driven[puppet].proposal

    def puppets_of(self, part: str) -> tuple[str, ...]:
        """The puppets that follow whoever plays a part."""
        return tuple(name for name, its_part in self._part_of.items() if its_part == part)

    def warm_up(self) -> None:
        """Compile every kernel of the line before the show, with a line that is thrown away."""
        stand_in = Line(self.puppets, self._conditioning, self.parts.configs)
        points = np.zeros((20, 3))
        for sequence in range(3):
            frame = SkeletonFrame(
                sequence / 30.0, sequence, 0, points, np.full(20, sequence, np.uint8)
            )
            tick = stand_in.step(Moment.of(frame))
        for driven in stand_in._driven.values():
            driven.warm_up(tick.frame)

    def _existing(self, puppet: StagedPuppet) -> str:
        name = puppet.part or self.parts.names[0]
        if name not in self.parts.names:
            raise BadShowError(
                "a puppet belongs to a part that the show does not have",
                where=f"puppet {puppet.name}: part",
                expected=", ".join(self.parts.names),
                found=name,
            )
        return name

    def _meet(self, seen: Mapping[int, SkeletonFrame], time: float) -> None:
        """Get to know who came in, and forget who left long ago."""
        for number in seen:
            if number not in self._performers:
                # A captured stance is that of the room, not of its mirror image.
                stance = None if self._mirror else self.stance
                self._performers[number] = Performer(number, self._conditioning, stance)
        held = set(self.parts.holders.values())
        gone = [
            number
            for number, performer in self._performers.items()
            if number not in held and number not in seen and time - performer.seen > REMEMBERED
        ]
        for number in gone:
            del self._performers[number]

    def _follow(
        self, name: str, driven: DrivenPuppet, player: int | None, performer: PerformerTick | None
    ) -> None:
        """Ease over when another performer drives the puppet, or the same from another stance."""
        changed = player != self._drivers[name]
        self._drivers[name] = player
        if performer is None or performer.neutral is None:
            if changed:
                driven.ease()
        elif changed or performer.anew:
            driven.set_neutral(performer.neutral)


def _vacant(time: float, sequence: int) -> SkeletonFrame:
    """Nobody, and nobody fading: what drives a puppet whose part is free."""
    return replace(nobody(time, sequence), influence=np.zeros(JOINT_COUNT))
