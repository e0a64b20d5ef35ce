"""One performer as several cameras see them: what each camera saw, and what was made of it."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from puppet.kernel import Bytes, Floats, kernel
from puppet.skeleton import JOINT_COUNT, SkeletonFrame
from puppet.tracking.fusion.joints import STALE, fuse, take_in
from puppet.tracking.fusion.memory import Lenses, copy_slot, not_fused, unseen, with_slots
from puppet.tracking.fusion.place import TRUNK

#: Seconds for which what a camera saw tells where somebody is.
COMPARED: Final = 0.5
#: By how much further apart on the floor two views of one performer may be for each second between
#: them, m/s.
WALKING: Final = 1.5
#: Hip centre, shoulder centre, shoulders and hips: by these it is told where somebody stands.
_STANDING: Final = (0, 2, 4, 8, 12, 16)


@kernel
def floor_distance(a: Floats, a_states: Bytes, b: Floats, b_states: Bytes) -> float:
    """Metres on the floor between two skeletons, (20, 3) with states (20,).

    The mean of hips and shoulders that both show; of all joints, if those are too few; 1e9 if none.
    """
    for few in range(2):
        total, count = 0.0, 0
        for joint in range(JOINT_COUNT):
            if few == 0 and joint not in _STANDING:
                continue
            if a_states[joint] > 0 and b_states[joint] > 0:
                x, z = a[joint, 0] - b[joint, 0], a[joint, 2] - b[joint, 2]
                total += math.sqrt(x * x + z * z)
                count += 1
        if count > 1 - few:
            return total / count
    return 1e9


class FusedPerformer:
    """number: theirs for good. age: who has a smaller one was there first. links: for each camera's
    slot that sees them, its own number. cameras: the slots that ever saw them. doubted: since when
    a link is contradicted, by slot. last_seen: seconds on the fused clock."""

    def __init__(self, number: int, age: int, slots: int) -> None:
        self.number = number
        self.age = age
        self.links: dict[int, int] = {}
        self.cameras: set[int] = set()
        self.doubted: dict[int, float] = {}
        self.last_seen = -math.inf
        self._seen = unseen(slots)
        self._fused = not_fused()

    def widen(self, slots: int) -> None:
        """Make room for more cameras."""
        self._seen = with_slots(self._seen, slots)

    def see(self, slot: int, frame: SkeletonFrame, time: float, step: float) -> None:
        """A camera sees them. time: on the fused clock. step: seconds since its moment before."""
        self.links[slot] = frame.performer
        self.cameras.add(slot)
        self.last_seen = max(self.last_seen, time)
        take_in(slot, frame.positions, frame.states, time, step, self._seen, self._fused)

    def lose(self, slot: int) -> None:
        """A camera does not see them any more."""
        self.links.pop(slot, None)
        self.doubted.pop(slot, None)
        self._seen.times[slot] = np.nan
        self._seen.states[slot] = 0
        self._seen.steady[slot] = 0

    def absorb(self, other: FusedPerformer) -> None:
        """They are one: see with all the cameras that see the other."""
        for slot, number in other.links.items():
            copy_slot(slot, other._seen, self._seen)
            self.links[slot] = number
        self.cameras |= other.cameras
        self.last_seen = max(self.last_seen, other.last_seen)

    def away(self, slot: int, frame: SkeletonFrame, time: float) -> float | None:
        """Metres on the floor from where other cameras see them, less what they may have walked.

        None if no other camera does.
        """
        nearest = None
        for other in self.links:
            ago = abs(time - self._seen.times[other])
            if other != slot and ago < COMPARED:
                away = self._distance(other, frame) - WALKING * ago
                nearest = away if nearest is None else min(nearest, away)
        return nearest

    def was_away(self, frame: SkeletonFrame, time: float) -> float:
        """The same from where they were last, whoever saw it."""
        fused = self._fused
        away = floor_distance(frame.positions, frame.states, fused.positions, fused.states)
        return away - WALKING * (time - self.last_seen)

    def strays(self, slot: int, frame: SkeletonFrame, time: float) -> bool:
        """Whether of the cameras that see them this is the one which is furthest from what was made
        of it before."""
        fused = self._fused
        if not fused.states.any():
            return next(iter(self.links)) != slot
        own = floor_distance(frame.positions, frame.states, fused.positions, fused.states)
        return all(
            own >= self._distance_to_fused(other)
            for other in self.links
            if other != slot and abs(time - self._seen.times[other]) < COMPARED
        )

    def at(self, time: float, sequence: int, lenses: Lenses) -> SkeletonFrame | None:
        """They at `time`; None if no camera has seen them lately."""
        if not any(abs(time - self._seen.times[slot]) <= STALE for slot in self.links):
            return None
        fuse(time, TRUNK, self._seen, lenses, self._fused)
        if not self._fused.states.any():
            return None
        positions, states = self._fused.positions.copy(), self._fused.states.copy()
        return SkeletonFrame(time, sequence, self.number, positions, states)

    def _distance(self, slot: int, frame: SkeletonFrame) -> float:
        seen = self._seen
        return floor_distance(
            frame.positions, frame.states, seen.positions[slot], seen.states[slot]
        )

    def _distance_to_fused(self, slot: int) -> float:
        seen, fused = self._seen, self._fused
        return floor_distance(
            seen.positions[slot], seen.states[slot], fused.positions, fused.states
        )
