"""Everybody in one camera's images: who is where, and that it stays the same person.

Each performer has a region of their own that goes with them from shot to shot. Somebody new is
looked for now and then in the rest of the image, out of which those who are known are painted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np

from puppet.tracking.cameras.camera import Shot
from puppet.tracking.people.blazepose import BlazePose, Landmarks, Region
from puppet.tracking.people.duplicates import BODY, part_of, same_body
from puppet.tracking.people.events import Event
from puppet.tracking.people.identity import lens_of, sight
from puppet.tracking.people.models import PoseModels
from puppet.tracking.people.paint_out import covered
from puppet.tracking.people.roster import Body, Person, Roster, distinct

MOST: Final = 4
#: Somebody new is looked for so often, s; and so often while there is a reason to: somebody was
#: found just now, is seen badly, or is hidden since so short a time.
SEARCH: Final = 0.3
SEARCH_SOON: Final = 0.1
LATELY: Final = 3.0
#: New bodies that are looked at in one search.
LOOKS: Final = 2
#: Where a performer could be seen only with the others painted out, these stay so for so long, s.
ALONE: Final = 0.3
#: Of somebody's joints no more than this share may lie on those who are painted out.
MOST_COVERED: Final = 0.5
#: Landmark networks that run at once: more gain nothing on the two cores that there have to be.
THREADS: Final = 2


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """One performer in one shot. performer: the number that stays theirs while they are there."""

    performer: int
    landmarks: Landmarks


class People:
    """Follows the performers of one camera from shot to shot.

    The same shots give the same performers: it knows no clock but the shots' own.
    """

    def __init__(self, models: PoseModels, most: int = MOST, *, second_look: bool = True) -> None:
        """most: performers who are followed at once. second_look: whoever is alone is looked at
        twice, also in the mirror, on a second core.

        Raises UnavailableError for models that cannot be loaded.
        """
        self._pose = BlazePose(models)
        self._most = most
        self._second_look = second_look
        self._threads = ThreadPoolExecutor(THREADS, "landmarks")
        self.reset()

    def reset(self) -> None:
        """Forget everybody; numbers begin anew."""
        self._roster = Roster()
        self._time = float("-inf")
        self._searched = float("-inf")
        self._searches = 0
        self._found = False
        self._around: dict[int, list[Landmarks]] = {}

    @property
    def known(self) -> frozenset[int]:
        """The performers who are remembered, seen just now or not."""
        return frozenset(self._roster.performers)

    @property
    def events(self) -> tuple[Event, ...]:
        """What happened in the last shot."""
        return tuple(self._roster.events)

    def look(self, shot: Shot) -> list[Seen]:
        """Who is in the shot, by their numbers."""
        if shot.time < self._time:
            self.reset()
        self._time = shot.time
        seen = self._follow(shot)
        fresh = self._search(shot, seen) if self._search_is_due(shot.time, seen) else []
        self._roster.settle(shot.time, seen, fresh)
        return self._performers(seen)

    def look_again(self, shot: Shot, seen: Seen, turn: float) -> Landmarks | None:
        """The same performer in the same shot, with the region turned by `turn` (rad).

        None if nobody is seen so, or somebody else.
        """
        person = self._roster.performers.get(seen.performer)
        others = self._around.get(seen.performer, [])
        alone = person is not None and shot.time < person.alone_until
        region = seen.landmarks.region.turned(turn)
        again = self._pose.look(shot.colour, region, others if alone else ())
        if again is None or any(same_body(again, other) for other in others):
            return None
        return again

    def _performers(self, seen: dict[Person, Body]) -> list[Seen]:
        numbered = {
            person.number: body.landmarks
            for person, body in seen.items()
            if person.number is not None
        }
        self._around = {
            number: [body.landmarks for person, body in seen.items() if person.number != number]
            for number in numbered
        }
        return [Seen(number, numbered[number]) for number in sorted(numbered)]

    def _follow(self, shot: Shot) -> dict[Person, Body]:
        """Who of those that were there is still there, each in their own region."""
        followed = self._roster.followed
        lens = lens_of(shot)
        regions = [person.region(shot.time, lens) for person in followed]
        before = [
            [other.landmarks for other in followed if other is not person]
            if shot.time < person.alone_until
            else []
            for person in followed
        ]
        found = zip(followed, self._bodies(shot, regions, before), strict=True)
        own = {person: body for person, body in found if body is not None}
        # Two regions that have met on one body: it is the one's whom it fits better.
        order = sorted(
            own,
            key=lambda person: (
                person.number is None,
                person.identity.misfit(own[person].sighting),
            ),
        )
        bodies = distinct([own[person] for person in order])
        performers = list(self._roster.performers.values())
        seen = self._roster.match(bodies, performers)
        taken = list(seen.values())
        for person in self._roster.candidates:
            body = own.get(person)
            if body in bodies and body not in taken and person.identity.fits(body.sighting):
                seen[person] = body
        for person, region, without in zip(followed, regions, before, strict=True):
            if person.number is not None and person not in seen:
                self._follow_differently(shot, person, region, bool(without), seen)
        return seen

    def _follow_differently(
        self, shot: Shot, person: Person, region: Region, alone: bool, seen: dict[Person, Body]
    ) -> None:
        """Look once more for a performer who was lost: with the others painted out, if they were
        not, and else with them. Nobody may be seen on another's body."""
        others = [body.landmarks for body in seen.values()]
        if not others:
            return
        [body] = self._bodies(shot, [region], [[] if alone else others])
        if body is None or any(same_body(body.landmarks, other) for other in others):
            return
        if person.identity.fits(body.sighting):
            seen[person] = body
            person.alone_until = shot.time + ALONE if not alone else shot.time

    def _search_is_due(self, time: float, seen: dict[Person, Body]) -> bool:
        if not seen:
            return True
        if len(seen) >= self._most and not any(person.identity.doubtful for person in seen):
            return False
        lost = [
            person
            for person in self._roster.performers.values()
            if person not in seen and time - person.identity.last.time < LATELY
        ]
        doubted = any(person.identity.doubtful for person in seen)
        pause = SEARCH_SOON if self._found or lost or doubted else SEARCH
        return time - self._searched >= pause

    def _search(self, shot: Shot, seen: dict[Person, Body]) -> list[Body]:
        """Look for the hidden where they should come out, and for anybody in the rest of the image.

        Adds to `seen` who has come back; gives the bodies that are nobody's.
        """
        hidden = [person for person in self._roster.hidden if person not in seen]
        lately = [one for one in hidden if shot.time - one.identity.last.time < LATELY]
        doubtful = [person for person in seen if person.identity.doubtful]
        known = [body.landmarks for person, body in seen.items() if not person.identity.doubtful]
        views = _views(*shot.colour.shape[:2])
        view = views[self._searches % len(views)]
        places = [person.region(shot.time, lens_of(shot)) for person in lately[:1]]
        places += self._pose.detect(shot.colour, known, view)[:LOOKS]
        bodies = [body for body in self._bodies(shot, places, [known] * len(places)) if body]
        for person in doubtful:
            self._correct(person, seen, bodies)
        taken = list(seen.values())
        found = [body for body in distinct(taken + bodies) if body not in taken]
        back = self._roster.match(found[: max(0, self._most - len(seen))], hidden)
        seen.update(back)
        returned = list(back.values())
        fresh = [body for body in found if body not in returned]
        self._searched = shot.time
        self._searches += 1
        self._found = bool(found)
        return fresh[: max(0, self._most - len(seen))]

    def _correct(self, person: Person, seen: dict[Person, Body], bodies: Sequence[Body]) -> None:
        """Somebody who was seen badly in their own region is taken where they are seen better."""
        for body in bodies:
            if (
                body.landmarks.score > max(person.identity.trust, seen[person].landmarks.score)
                and part_of(body.landmarks, seen[person].landmarks)
                and person.identity.fits(body.sighting)
            ):
                seen[person] = body

    def _bodies(
        self, shot: Shot, regions: Sequence[Region], without: Iterable[Sequence[Landmarks]]
    ) -> list[Body | None]:
        """What is in each of the regions, with those people painted out."""

        # Whoever is alone gets the second core as well.
        twice = self._second_look and len(regions) == 1 == len(self._roster.followed)

        def look(region: Region, others: Sequence[Landmarks]) -> Body | None:
            landmarks = self._pose.look(shot.colour, region, others, twice=twice)
            if landmarks is None:
                return None
            painted = [(one.pixels, one.extent) for one in others]
            # What lies under the paint cannot have been seen: the network has guessed it.
            if painted and covered(landmarks.pixels[BODY], painted) > MOST_COVERED:
                return None
            sighting = sight(landmarks, shot)
            return None if sighting is None else Body(landmarks, sighting)

        if len(regions) < 2:
            return list(map(look, regions, without))
        return list(self._threads.map(look, regions, without))


def _views(height: int, width: int) -> list[tuple[int, int]]:
    """Columns of the image that are searched in turn: all of them, then squares.

    The detector's picture is small and square: in all of a wide image it overlooks people who are
    less than half of it high.
    """
    count = math.ceil(width / height) if width > height else 0
    starts = np.linspace(0, width - height, count).round().astype(int).tolist()
    return [(0, width), *((start, start + height) for start in starts)]
