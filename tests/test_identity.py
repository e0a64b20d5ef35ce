"""Who somebody is: by place, size and clothes; and who enters, is hidden, returns and leaves."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from puppet.tracking.body.sides import reversed_in_depth
from puppet.tracking.cameras.camera import Shot
from puppet.tracking.people import roster
from puppet.tracking.people.appearance import colours, difference
from puppet.tracking.people.duplicates import BODY, apart, part_of, same_body
from puppet.tracking.people.identity import GATE, Identity, Sighting, sight
from puppet.tracking.people.paint_out import covered, paint_out
from puppet.tracking.people.roster import Body, Roster, distinct
from tests.standing import HEIGHT, LENS, WIDTH, Figure, picture

RED, BLUE = ((40, 40, 200), (60, 20, 20)), ((200, 80, 30), (30, 30, 30))
FRAME = 1.0 / 30.0

places = st.tuples(st.floats(-1.0, 1.0), st.floats(-0.1, 0.1), st.floats(3.0, 6.0))


def shot(*figures: Figure, time: float = 0.0, depth: float | None = None) -> Shot:
    """depth: metres, everywhere; at half of the image's size."""
    measured = None
    if depth is not None:
        measured = np.full((HEIGHT // 2, WIDTH // 2), round(1000.0 * depth), np.uint16)
    return Shot(time, 0, picture(figures), depth=measured, intrinsics=LENS)


def seen(figure: Figure, time: float = 0.0) -> Sighting:
    sighting = sight(figure.landmarks(), shot(figure, time=time))
    assert sighting is not None
    return sighting


def body(figure: Figure, time: float) -> Body:
    return Body(figure.landmarks(), seen(figure, time))


# -- appearance -------------------------------------------------------------------------------


@given(places, places)
def test_the_same_clothes_are_alike_wherever_they_are(
    here: tuple[float, float, float], there: tuple[float, float, float]
) -> None:
    one, other = seen(Figure(here, RED)), seen(Figure(there, RED))
    assert difference(one.colours, other.colours) < 1.0
    assert difference(one.colours, seen(Figure(there, BLUE)).colours) > 20.0


def test_what_is_outside_of_the_image_or_hidden_has_no_colour() -> None:
    figure = Figure((0.0, 1.8, 4.0))
    found = colours(shot(figure).colour, figure.landmarks())
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1:]).all()
    hidden = replace(figure.landmarks(), visibility=np.zeros(33))
    assert np.isnan(colours(shot(figure).colour, hidden)).all()
    assert math.isnan(difference(found, np.full((3, 3), np.nan)))


# -- duplicates and paint ---------------------------------------------------------------------


@given(places, st.integers(0, 1000))
def test_a_body_that_was_found_twice_is_one(place: tuple[float, float, float], seed: int) -> None:
    once = Figure(place).landmarks()
    noise = np.random.default_rng(seed).normal(0.0, 0.02 * once.extent, (33, 2))
    twice = replace(once, pixels=once.pixels + noise)
    assert same_body(once, twice)
    assert same_body(once, reversed_in_depth(twice))
    assert part_of(twice, once)


@given(places, places)
def test_two_people_are_two(
    here: tuple[float, float, float], there: tuple[float, float, float]
) -> None:
    one, other = Figure(here).landmarks(), Figure(there).landmarks()
    between = np.linalg.norm((one.pixels - other.pixels)[BODY], axis=1)
    assume(between.min() > 0.1 * min(one.extent, other.extent))
    assert not same_body(one, other)
    assert apart(one, other) == pytest.approx(apart(other, one))
    assert len(distinct([body(Figure(here), 0.0), body(Figure(there), 0.0)])) == 2


@given(places)
def test_paint_covers_a_body_and_nothing_far_from_it(place: tuple[float, float, float]) -> None:
    figure = Figure(place)
    landmarks = figure.landmarks()
    painted = [(landmarks.pixels, landmarks.extent)]
    assert covered(landmarks.pixels, painted) == 1.0
    beside = landmarks.pixels + (0.8 * landmarks.extent, 0.0)
    assert covered(beside, painted) == 0.0
    image = picture([figure])
    paint_out(image, painted, np.eye(2, 3))
    clothes = np.array([figure.clothes[0], figure.clothes[1]])
    left = (image[:, :, None] == clothes).all(axis=3).any(axis=2)
    assert np.count_nonzero(left) < 0.002 * image[:, :, 0].size


def test_landmarks_that_are_no_numbers_paint_nothing() -> None:
    image = picture([])
    paint_out(image, [(np.full((33, 2), np.nan), 10.0), (np.full((33, 2), 1e9), 1.0)], np.eye(2, 3))
    np.testing.assert_array_equal(image, picture([]))


# -- sightings --------------------------------------------------------------------------------


@given(places)
def test_without_depth_the_distance_is_told_by_size(place: tuple[float, float, float]) -> None:
    sighting = seen(Figure(place))
    assert not sighting.measured
    np.testing.assert_allclose(sighting.position, place, atol=0.12 * place[2])


def test_depth_is_believed_and_gives_the_size() -> None:
    figure = Figure((0.3, 0.0, 4.0))
    sighting = sight(figure.landmarks(), shot(figure, depth=3.2))
    assert sighting is not None
    assert sighting.measured
    assert sighting.distance == pytest.approx(3.2)
    assert sighting.size == pytest.approx(0.8, abs=0.05)
    # Where nothing is known of depth it is as if there were none.
    without = sight(figure.landmarks(), shot(figure, depth=0.0))
    assert without is not None
    assert not without.measured


def test_ghosts_are_nobody() -> None:
    figure = Figure((0.0, 0.0, 4.0))
    whole = figure.landmarks()
    scene = shot(figure)
    ghosts = {
        "out of the image": Figure((9.0, 0.0, 4.0)).landmarks(),
        "not a number": replace(whole, pixels=np.full((33, 2), np.nan)),
        "a torso of nothing": replace(whole, world=whole.world * (1.0, 0.1, 1.0)),
        "invisible": replace(whole, visibility=np.zeros(33)),
        "far too far": Figure((0.0, 0.0, 40.0)).landmarks(),
    }
    assert [name for name, ghost in ghosts.items() if sight(ghost, scene) is not None] == []
    # A picture of a man on a wall ten metres away that looks as if he stood at four is a giant.
    assert sight(whole, shot(figure, depth=10.0)) is None


# -- identity ---------------------------------------------------------------------------------


def followed(figure: Figure, seconds: float = 1.0) -> Identity:
    """Somebody who has stood there until then."""
    identity = Identity(seen(figure))
    for step in range(1, round(seconds / FRAME) + 1):
        identity.learn(seen(figure, step * FRAME), crowded=False)
    return identity


@given(places, st.floats(0.0, 0.3), st.floats(0.05, 0.5))
def test_farther_away_fits_worse_and_longer_ago_fits_better(
    place: tuple[float, float, float], near: float, farther: float
) -> None:
    identity = followed(Figure(place), 0.2)
    x, y, z = place

    def misfit(step: float, after: float) -> float:
        time = identity.last.time + after
        return identity.misfit(replace(seen(Figure((x + step, y, z)), time)))

    assert misfit(near, FRAME) < misfit(near + farther, FRAME)
    assert misfit(near + farther, 2.0) < misfit(near + farther, 0.5)


def test_another_light_makes_nobody_another_while_they_are_followed() -> None:
    place = (0.0, 0.0, 4.0)
    identity = followed(Figure(place, RED))
    soon = identity.last.time + FRAME
    abrupt = seen(Figure(place, BLUE), soon)
    # All the stage has changed its light; or nothing but this body has.
    lit = replace(abrupt, light=abrupt.light + (-20.0, 10.0, 10.0))
    assert identity.fits(lit)
    assert not identity.fits(abrupt)
    # Out of sight for a moment, or somewhere else, it is another in any light.
    assert not identity.fits(replace(lit, time=soon + 0.5))
    elsewhere = seen(Figure((0.35, 0.0, 4.0), BLUE), soon)
    assert not identity.fits(replace(elsewhere, light=lit.light))


def test_who_walks_into_another_light_is_followed_and_their_colours_are_learnt() -> None:
    place, shots = (0.0, 0.0, 4.0), 20
    identity = followed(Figure(place, RED))
    start = identity.last.time
    for step in range(1, 8 * shots):
        share = min(step / shots, 1.0)
        mixed = np.rint((1.0 - share) * np.array(RED) + share * np.array(BLUE)).astype(int).tolist()
        sighting = seen(Figure(place, (tuple(mixed[0]), tuple(mixed[1]))), start + step * FRAME)
        assert identity.fits(sighting)
        identity.learn(sighting, crowded=False)
    assert identity.fits(seen(Figure(place, BLUE), identity.last.time + 2.0))
    assert not identity.fits(seen(Figure(place, RED), identity.last.time + 2.0))


def test_what_the_network_is_unsure_of_does_not_come_back() -> None:
    identity = followed(Figure((0.0, 0.0, 4.0)))
    back = seen(Figure((0.1, 0.0, 4.0)), identity.last.time + 1.0)
    assert identity.fits(back)
    assert not identity.fits(replace(back, score=0.6))


def test_somebody_who_is_seen_badly_is_expected_in_a_wider_place() -> None:
    place, time = (0.0, 0.0, 4.0), 1.0
    aside = Figure((1.0, 0.0, 4.0))
    sure, doubtful = followed(Figure(place)), followed(Figure(place))
    for step in range(1, 31):
        time = 1.0 + step * FRAME
        sure.learn(seen(Figure(place), time), crowded=False)
        doubtful.learn(replace(seen(Figure(place), time), score=0.7), crowded=False)
    there = seen(aside, time + FRAME)
    assert doubtful.doubtful
    assert not sure.doubtful
    assert doubtful.misfit(there) < GATE < sure.misfit(there)


@given(st.floats(-3.0, 3.0), st.floats(0.0, 20.0))
def test_unseen_they_go_on_and_come_to_a_stop(speed: float, after: float) -> None:
    identity = Identity(seen(Figure((0.0, 0.0, 5.0))))
    for step in range(1, 16):
        identity.learn(seen(Figure((speed * step * FRAME, 0.0, 5.0)), step * FRAME), crowded=False)
    here, there = identity.last.position, identity.position(identity.last.time + after)
    assert abs(there[0] - here[0]) <= min(after, 0.45) * abs(speed) * 1.1 + 0.01
    assert (there[0] - here[0]) * speed >= -1e-9


def test_measured_size_tells_people_in_the_same_clothes_apart() -> None:
    figure = Figure((0.0, 0.0, 4.0))
    identity = Identity(replace(seen(figure), size=1.0, measured=True))
    child = replace(seen(figure, 1.0), size=0.6, measured=True)
    assert not identity.fits(child)
    assert identity.fits(replace(child, size=1.05))


# -- roster -----------------------------------------------------------------------------------


def test_two_who_met_go_on_as_who_they_were() -> None:
    left, right = Figure((-0.4, 0.0, 4.0), RED), Figure((0.4, 0.0, 4.0), BLUE)
    roll = Roster()
    for step in range(6):
        bodies = [body(right, step * FRAME), body(left, step * FRAME)]
        persons = roll.followed
        matched = roll.match(bodies, persons)
        assert len(matched) == len(persons)
        fresh = [one for one in bodies if one not in list(matched.values())]
        roll.settle(step * FRAME, matched, fresh)
    # Each region has come to lie on the other's body.
    time = 6 * FRAME
    swapped = [body(left, time), body(right, time)]
    matched = roll.match(swapped, list(roll.performers.values()))
    for person, found in matched.items():
        assert difference(person.identity.last.colours, found.sighting.colours) < 1.0


def events_of(there: list[bool], step: float = FRAME) -> list[tuple[str, int, float]]:
    """What is told of one who is there in some shots and not in others."""
    roll, figure = Roster(), Figure((0.0, 0.0, 4.0))
    told: list[tuple[str, int, float]] = []
    for index, present in enumerate(there):
        time = index * step
        bodies = [body(figure, time)] if present else []
        matched = roll.match(bodies, [*roll.performers.values(), *roll.candidates])
        roll.settle(time, matched, [one for one in bodies if one not in list(matched.values())])
        told += [(event.kind, event.performer, event.time) for event in roll.events]
    return told


def test_who_is_seen_in_three_shots_enters() -> None:
    assert events_of([True] * 5) == [("entered", 0, 2 * FRAME)]


@given(st.lists(st.booleans(), max_size=30))
def test_who_is_never_seen_in_three_shots_on_end_is_no_performer(there: list[bool]) -> None:
    flickering = [one and index % 3 != 2 for index, one in enumerate(there)]
    assert events_of(flickering) == []


def test_a_short_loss_is_no_event_and_a_longer_one_is_told_once() -> None:
    assert len(events_of([True] * 4 + [False] * 5 + [True] * 4)) == 1
    long = events_of([True] * 4 + [False] * 40 + [True] * 4)
    assert [kind for kind, _, _ in long] == ["entered", "hidden", "returned"]


@given(st.lists(st.sampled_from([4, 15, 60, 150]), min_size=1, max_size=6))
def test_numbers_do_not_come_again_and_events_alternate(pauses: list[int]) -> None:
    there = [True] * 4
    for pause in pauses:
        there += [False] * pause + [True] * 10
    told = events_of(there, 0.1)
    entered = [performer for kind, performer, _ in told if kind == "entered"]
    assert entered == list(range(len(entered)))
    following = {
        "entered": {"hidden"},
        "hidden": {"returned", "left"},
        "returned": {"hidden"},
        "left": set(),
    }
    for performer in entered:
        kinds = [kind for kind, number, _ in told if number == performer]
        assert kinds[0] == "entered"
        assert all(b in following[a] for a, b in pairwise(kinds))
    gone = [pause for pause in pauses if 0.1 * (pause + 1) > roster.MEMORY]
    assert len([kind for kind, _, _ in told if kind == "left"]) == len(gone)
