"""Which performer of one camera is which of another: by where they stand on the floor.

Who is paired stays so: something else must fit better by far, for a while, before that changes. A
camera's own numbers are believed, for they come from all that it sees of a person.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from puppet.skeleton import SkeletonFrame
from puppet.tracking.fusion.performer import FusedPerformer

#: Metres on the floor within which two cameras see one performer, and by how much further apart
#: they may be if they are paired, or if the camera knew them as such.
GATE: Final = 0.5
PAIRED: Final = 0.3
#: Seconds until those who are paired are parted, and until two performers are found to be one.
CONTRADICTED: Final = 0.5
ALIKE: Final = 0.3
#: Seconds for which it is remembered where somebody was whom no camera sees.
REMEMBERED: Final = 2.0

#: Numbers that are remembered to have been given.
NUMBERS_KEPT: Final = 512

_NEVER: Final = 1e6


class Matching:
    """Says for each performer of each camera who they are. Numbers are never given twice."""

    def __init__(self) -> None:
        #: Those who are seen, or were lately; who came first is first.
        self.performers: list[FusedPerformer] = []
        #: For each slot: the camera's number → ours.
        self._known: list[dict[int, int]] = []
        self._used: set[int] = set()
        self._ages = 0

    def add_camera(self) -> int:
        """Another camera. -> its slot."""
        self._known.append({})
        for one in self.performers:
            one.widen(len(self._known))
        return len(self._known) - 1

    def forget_numbers(self, slot: int) -> None:
        """The camera has begun anew: its numbers say nothing of those before."""
        self._known[slot].clear()
        for one in self.performers:
            one.lose(slot)
            one.cameras.discard(slot)

    def take_in(self, slot: int, frames: Sequence[SkeletonFrame], time: float, step: float) -> None:
        """What a camera sees. time: on the fused clock, s. step: s since its moment before."""
        self.performers = [one for one in self.performers if time - one.last_seen < REMEMBERED]
        seen = {frame.performer: _writable(frame) for frame in frames if frame.present}
        paired: dict[int, FusedPerformer] = {}
        for one in self.performers:
            number = one.links.get(slot)
            if number in seen:
                paired[number] = one
            elif number is not None:
                one.lose(slot)
        if len(self._known) > 1:
            self._part(slot, seen, paired, time)
        self._pair(slot, seen, paired, time)
        for number, frame in seen.items():
            paired[number].see(slot, frame, time, step)
            self._known[slot][number] = paired[number].number

    def _part(
        self,
        slot: int,
        seen: dict[int, SkeletonFrame],
        paired: dict[int, FusedPerformer],
        time: float,
    ) -> None:
        """Part pairs that were contradicted for long enough, and join performers who are one."""
        numbers = list(seen)
        costs = np.full((len(numbers), len(self.performers) + len(numbers)), GATE)
        for row, number in enumerate(numbers):
            for column, one in enumerate(self.performers):
                away = one.away(slot, seen[number], time)
                if paired.get(number) is one:
                    costs[row, column] = GATE if away is None else away - PAIRED
                else:
                    costs[row, column] = _NEVER if away is None else away
        performers = list(self.performers)
        for row, column in zip(*linear_sum_assignment(costs), strict=True):
            own = paired.get(numbers[row])
            if own is None:
                continue
            other = performers[column] if column < len(performers) else None
            alone = own.away(slot, seen[numbers[row]], time) is None
            if other is own or (alone and other is None):
                own.doubted.pop(slot, None)
            elif time - own.doubted.setdefault(slot, time) < (ALIKE if alone else CONTRADICTED):
                pass
            elif alone and other is not None:
                if slot not in other.links:
                    paired[numbers[row]] = self._join(own, other)
            elif own.strays(slot, seen[numbers[row]], time):
                own.lose(slot)
                del paired[numbers[row]]

    def _join(self, one: FusedPerformer, other: FusedPerformer) -> FusedPerformer:
        """Two performers turn out to be one: the one who came first."""
        first, second = sorted((one, other), key=lambda performer: performer.age)
        first.absorb(second)
        self.performers.remove(second)
        for known in self._known:
            for number, ours in known.items():
                if ours == second.number:
                    known[number] = first.number
        return first

    def _pair(
        self,
        slot: int,
        seen: dict[int, SkeletonFrame],
        paired: dict[int, FusedPerformer],
        time: float,
    ) -> None:
        """Find a performer for everybody in `seen` who is not in `paired`."""
        free = [one for one in self.performers if slot not in one.links]
        numbers = [number for number in seen if number not in paired]
        if free and numbers:
            costs = np.full((len(numbers), len(free) + len(numbers)), GATE)
            for row, number in enumerate(numbers):
                for column, one in enumerate(free):
                    costs[row, column] = self._misfit(slot, seen[number], one, time)
            for row, column in zip(*linear_sum_assignment(costs), strict=True):
                if column < len(free):
                    paired[numbers[row]] = free[column]
        for number in numbers:
            if number not in paired:
                one = FusedPerformer(self._number(slot, number), self._ages, len(self._known))
                self._ages += 1
                self.performers.append(one)
                paired[number] = one

    def _misfit(self, slot: int, frame: SkeletonFrame, one: FusedPerformer, time: float) -> float:
        known = self._known[slot].get(frame.performer) == one.number
        away = one.away(slot, frame, time)
        if away is not None:
            return away - PAIRED if known else away
        if known:
            return -PAIRED
        # Where no other camera can tell, a camera that saw them is right that this is another.
        return _NEVER if slot in one.cameras else one.was_away(frame, time)

    def _number(self, slot: int, number: int) -> int:
        """The camera's own, where nobody has it; so with one camera all numbers stay."""
        known = self._known[slot].get(number)
        if known is not None and all(one.number != known for one in self.performers):
            return known
        ours = number if number not in self._used else max(self._used) + 1
        self._used.add(ours)
        if len(self._used) > NUMBERS_KEPT:  # in weeks, visitors by the thousand: only the latest
            self._used = set(sorted(self._used)[-NUMBERS_KEPT // 2 :])
        for known_to in self._known:
            for old in list(known_to)[: -NUMBERS_KEPT // 2]:
                del known_to[old]
        return ours


def _writable(frame: SkeletonFrame) -> SkeletonFrame:
    """The frame in arrays of the one kind that kernels are compiled for."""
    positions, states = np.array(frame.positions, float), np.array(frame.states, np.uint8)
    return SkeletonFrame(frame.time, frame.sequence, frame.performer, positions, states)
