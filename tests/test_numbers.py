"""A tracker that is started anew counts from 0 again; performers keep their numbers."""

from __future__ import annotations

from puppet.net.numbers import REMEMBERED, Numbers
from puppet.skeleton import Moment
from tests.test_parts import standing


def seen(time: float, **people: tuple[int, float]) -> Moment:
    frames = tuple(standing(number, x, -2.0, time) for number, x in people.values())
    return Moment(time, round(30 * time), frames).at(time, round(30 * time))


def places(moment: Moment) -> dict[int, float]:
    """Number -> where it stands."""
    return {frame.performer: float(frame.positions[2, 0].round(3)) for frame in moment.frames}


def test_in_the_first_stream_nothing_is_changed() -> None:
    numbers = Numbers()
    for time in (0.0, 1.0, 500.0):
        moment = seen(time, a=(3, 0.0), b=(7, time))
        kept = numbers.kept(moment, "one")
        for one, other in zip(kept.frames, moment.frames, strict=True):
            assert one is other


def test_who_stands_where_they_stood_is_who_they_were() -> None:
    numbers = Numbers()
    numbers.kept(seen(50.0, a=(4, -1.0), b=(5, 1.0)), "one")
    # The new tracker finds them one after the other, and the other way round.
    assert places(numbers.kept(seen(0.0, b=(0, 1.1)), "two")) == {5: 1.1}
    assert places(numbers.kept(seen(0.3, b=(0, 1.2), a=(1, -0.9)), "two")) == {5: 1.2, 4: -0.9}
    assert places(numbers.kept(seen(9.0, a=(1, 0.5)), "two")) == {4: 0.5}


def test_a_lone_performer_goes_on_wherever_the_new_source_sees_them() -> None:
    numbers = Numbers()
    numbers.kept(seen(50.0, a=(0, 0.0)), "one")
    assert places(numbers.kept(seen(0.0, a=(0, 3.0)), "two")) == {0: 3.0}


def test_whoever_comes_later_is_new_and_never_gets_a_number_that_was_given() -> None:
    numbers = Numbers()
    numbers.kept(seen(0.0, a=(0, 0.0), b=(1, 1.0)), "one")
    numbers.kept(seen(10.0, a=(0, 0.0)), "two")
    assert places(numbers.kept(seen(15.0, a=(0, 0.0), c=(1, 1.0)), "two")) == {0: 0.0, 2: 1.0}


def test_visitors_of_weeks_are_not_all_remembered() -> None:
    numbers = Numbers()
    numbers.kept(seen(0.0, a=(0, 0.0)), "one")
    for visitor in range(1, 400):
        numbers.kept(seen(visitor * 0.5 * REMEMBERED, a=(visitor, 0.0)), "one")
    assert len(numbers._ours) < 5
    assert len(numbers._seen) < 5
