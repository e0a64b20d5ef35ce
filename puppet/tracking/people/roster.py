"""The performers whom a camera's `People` knows, by number: who enters, is hidden, returns, leaves.

It knows nothing of images but what `Body` tells of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.people.blazepose import Landmarks, Region
from puppet.tracking.people.duplicates import part_of, same_body
from puppet.tracking.people.events import Event
from puppet.tracking.people.identity import Identity, Sighting

#: Somebody new has to be seen in so many shots one after the other, ...
CONFIRM: Final = 3
#: ... or in so many while a performer is not seen who might come out as them.
PATIENCE: Final = 8
#: Not seen for so long, a performer is hidden (s); after so long they have left.
HIDDEN_AFTER: Final = 0.25
MEMORY: Final = 12.0
#: Bodies whose hips are nearer to each other than this, in sides of the region, are crowded.
CROWDED: Final = 0.35
_IMPOSSIBLE: Final = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One body in one shot."""

    landmarks: Landmarks
    sighting: Sighting


@dataclass(slots=True, eq=False)
class Person:
    """Somebody who is followed or remembered. Without a number they are not yet a performer."""

    identity: Identity
    landmarks: Landmarks
    number: int | None = None
    hidden: bool = False
    sightings: int = 1
    #: Until then, s, the others are painted out where this one is looked for.
    alone_until: float = -math.inf

    def region(self, time: float, lens: Intrinsics) -> Region:
        """Where to look for them."""
        region = self.landmarks.following or self.landmarks.region
        last = self.identity.last
        expected = self.identity.position(time)
        # From shot to shot the network's own region is the better one.
        if time - last.time < HIDDEN_AFTER:
            return region
        moved = lens.pixels(np.stack([expected, last.position]))
        nearer = last.distance / float(expected[2])
        return Region(region.centre + moved[0] - moved[1], region.side * nearer, region.angle)


@dataclass(slots=True)
class Roster:
    """Performers by number, and those who may become performers."""

    performers: dict[int, Person] = field(default_factory=dict)
    candidates: list[Person] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    _next: int = 0

    @property
    def followed(self) -> list[Person]:
        """Who is looked for in the next shot, performers first."""
        shown = [person for person in self.performers.values() if not person.hidden]
        return shown + self.candidates

    @property
    def hidden(self) -> list[Person]:
        """Who has not been seen for a while, the latest first."""
        lost = [person for person in self.performers.values() if person.hidden]
        return sorted(lost, key=lambda person: -person.identity.last.time)

    def match(self, bodies: Sequence[Body], persons: Sequence[Person]) -> dict[Person, Body]:
        """Which body is whose, so that together it is the likeliest; not everybody gets one."""
        if not bodies or not persons:
            return {}
        costs = np.full((len(persons), len(bodies)), _IMPOSSIBLE)
        for row, person in enumerate(persons):
            for column, body in enumerate(bodies):
                if person.identity.fits(body.sighting):
                    costs[row, column] = person.identity.cost(body.sighting)
        rows, columns = linear_sum_assignment(costs)
        return {
            persons[row]: bodies[column]
            for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
            if costs[row, column] < _IMPOSSIBLE
        }

    def settle(self, time: float, seen: dict[Person, Body], fresh: Sequence[Body]) -> None:
        """The end of a shot.

        seen: the persons who were in it. fresh: bodies that are none of theirs.
        """
        self.events.clear()
        everybody = [*seen.values(), *fresh]
        for person, body in seen.items():
            others = (other for other in everybody if other is not body)
            crowded = any(_near(body.landmarks, other.landmarks) for other in others)
            person.identity.learn(body.sighting, crowded=crowded)
            person.landmarks = body.landmarks
            person.sightings += 1
        for number, person in list(self.performers.items()):
            self._note(number, person, time, person in seen)
        performers = [body for person, body in seen.items() if person.number is not None]
        self.candidates = [
            person
            for person in self.candidates
            if person in seen and _apart_from(performers, seen[person])
        ]
        self._promote(time, anybody_lost=len(performers) < len(self.performers))
        self.candidates += (
            Person(Identity(body.sighting), body.landmarks)
            for body in fresh
            if _apart_from(performers, body)
        )

    def _note(self, number: int, person: Person, time: float, seen: bool) -> None:
        unseen = time - person.identity.last.time
        if seen and person.hidden:
            person.hidden = False
            self.events.append(Event("returned", number, time))
        elif not seen and not person.hidden and unseen >= HIDDEN_AFTER:
            person.hidden = True
            self.events.append(Event("hidden", number, time))
        if unseen >= MEMORY:
            del self.performers[number]
            self.events.append(Event("left", number, time))

    def _promote(self, time: float, *, anybody_lost: bool) -> None:
        needed = PATIENCE if anybody_lost else CONFIRM
        for person in [person for person in self.candidates if person.sightings >= needed]:
            self.candidates.remove(person)
            person.number = self._next
            self.performers[self._next] = person
            self.events.append(Event("entered", self._next, time))
            self._next += 1


def distinct(bodies: Sequence[Body]) -> list[Body]:
    """The bodies without those that lie on one that comes before."""
    kept: list[Body] = []
    for body in bodies:
        if not any(same_body(body.landmarks, other.landmarks) for other in kept):
            kept.append(body)
    return kept


def _apart_from(known: Sequence[Body], newcomer: Body) -> bool:
    return not any(part_of(newcomer.landmarks, one.landmarks) for one in known)


def _near(one: Landmarks, other: Landmarks) -> bool:
    hips = [landmarks.pixels[[23, 24]].mean(axis=0) for landmarks in (one, other)]
    return math.dist(*hips) < CROWDED * max(one.extent, other.extent)
