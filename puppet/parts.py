"""Who drives whom: the parts of a show, and which performer plays each.

Puppets belong to parts, as roles to actors. A free part is taken by whoever its rule names, and
then it is theirs, whoever else walks past, until they have left for a while or an operator says
otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

import numpy as np

from puppet.errors import BadDecisionError
from puppet.show import PartConfig
from puppet.skeleton import Joint, SkeletonFrame, TrackingState

#: A hand counts as raised when it has been above the head for so long, seconds.
RAISED_SECONDS: Final = 0.4
#: Whoever is not seen for so long has left, seconds.
LEFT: Final = 1.0
_ARMS: Final = (
    (Joint.HAND_LEFT, Joint.ELBOW_LEFT),
    (Joint.HAND_RIGHT, Joint.ELBOW_RIGHT),
)


@dataclass
class _Part:
    config: PartConfig
    holder: int | None = None
    #: When the holder was last where they have to be to keep it, capture time.
    held: float = 0.0
    #: Who may not take it by the rule, for an operator took it from them, and when they were seen.
    barred: dict[int, float] = field(default_factory=dict)


class Parts:
    """Gives parts to performers, moment after moment, on capture time."""

    def __init__(self, configs: Sequence[PartConfig] = ()) -> None:
        self._parts = {config.name: _Part(config) for config in configs or (PartConfig(),)}
        self._raised: dict[int, float] = {}
        self._there: dict[int, SkeletonFrame] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """The parts, in the order of the show."""
        return tuple(self._parts)

    @property
    def configs(self) -> tuple[PartConfig, ...]:
        """As the show says."""
        return tuple(part.config for part in self._parts.values())

    @property
    def holders(self) -> Mapping[str, int | None]:
        """Who plays each part now."""
        return MappingProxyType({name: part.holder for name, part in self._parts.items()})

    @property
    def there(self) -> tuple[int, ...]:
        """Who was there in the last moment."""
        return tuple(sorted(self._there))

    def step(self, frames: Sequence[SkeletonFrame], time: float) -> None:
        """Take in who is where (raw or conditioned, stage frame), and give free parts away."""
        self._there = {frame.performer: frame for frame in frames}
        self._watch_hands(time)
        for part in self._parts.values():
            if part.holder is not None:
                if self._keeps(part):
                    part.held = time
                elif time - part.held >= part.config.release_after:
                    part.holder = None
            part.barred |= {number: time for number in part.barred if number in self._there}
            # Who has left, and not just been overlooked, may come back as anybody.
            away = max(part.config.release_after, LEFT)
            part.barred = {one: seen for one, seen in part.barred.items() if time - seen < away}
        for part in self._parts.values():
            if part.holder is None:
                part.holder, part.held = self._candidate(part), time

    def assign(self, part: str, performer: int) -> None:
        """Give a part to a performer, whatever its rule says.

        Raises BadDecisionError for a part or performer that is not there.
        """
        chosen = self._part(part)
        if performer not in self._there:
            raise BadDecisionError(
                "no such performer is on stage",
                where=f"part {part}",
                expected=", ".join(map(str, self.there)) or "somebody before the camera",
                found=str(performer),
            )
        chosen.barred.pop(performer, None)
        chosen.holder, chosen.held = performer, self._there[performer].time

    def release(self, part: str) -> None:
        """Take a part from whoever plays it: its puppets rest until somebody else takes it."""
        chosen = self._part(part)
        if chosen.holder is not None:
            chosen.barred[chosen.holder] = chosen.held
            chosen.holder = None

    def reopen(self, part: str) -> None:
        """Let the rule choose again, among everybody."""
        chosen = self._part(part)
        chosen.barred.clear()
        chosen.holder = None

    def _part(self, name: str) -> _Part:
        try:
            return self._parts[name]
        except KeyError:
            raise BadDecisionError(
                "the show has no such part", expected=", ".join(self._parts), found=name
            ) from None

    def _keeps(self, part: _Part) -> bool:
        frame = self._there.get(part.holder) if part.holder is not None else None
        if frame is None:
            return False
        return part.config.rule != "zone" or self._in_zone(part, frame)

    def _candidate(self, part: _Part) -> int | None:
        rule = part.config.rule
        if rule == "operator":
            return None
        taken = {other.holder for other in self._parts.values()} | part.barred.keys()
        free = [
            frame
            for number, frame in self._there.items()
            if number not in taken and frame.states[Joint.SHOULDER_CENTER]
        ]
        if part.config.zone is not None:
            free = [frame for frame in free if self._in_zone(part, frame)]
        if rule == "raised-hand":
            free = [frame for frame in free if self._has_raised(frame)]
            free.sort(key=lambda frame: (self._raised[frame.performer], frame.performer))
        else:
            free.sort(key=lambda frame: (float(np.hypot(*_place(frame))), frame.performer))
        return free[0].performer if free else None

    def _in_zone(self, part: _Part, frame: SkeletonFrame) -> bool:
        zone = part.config.zone
        if zone is None:
            return True
        x, z = _place(frame)
        return zone.x[0] <= x <= zone.x[1] and zone.z[0] <= z <= zone.z[1]

    def _watch_hands(self, time: float) -> None:
        up = {number for number, frame in self._there.items() if _hand_is_up(frame)}
        self._raised = {number: self._raised.get(number, time) for number in up}

    def _has_raised(self, frame: SkeletonFrame) -> bool:
        since = self._raised.get(frame.performer)
        return since is not None and frame.time - since >= RAISED_SECONDS


def _place(frame: SkeletonFrame) -> tuple[float, float]:
    """Where on the floor they stand, metres: x and z of the shoulders, which are seen most."""
    x, _, z = frame.positions[Joint.SHOULDER_CENTER]
    return float(x), float(z)


def _hand_is_up(frame: SkeletonFrame) -> bool:
    if frame.states[Joint.HEAD] == TrackingState.NOT_TRACKED:
        return False
    head = frame.positions[Joint.HEAD, 1]
    return any(
        frame.states[hand] == TrackingState.TRACKED
        and frame.positions[hand, 1] > head
        and frame.positions[hand, 1] > frame.positions[elbow, 1]
        for hand, elbow in _ARMS
    )
