"""Times and numbers over a device's lives."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from puppet.tracking.cameras.oak_numbering import Numbering

RATE = 30.0


def test_a_gap_of_the_device_is_a_gap() -> None:
    numbering = Numbering(RATE)
    given_numbers = [
        numbering.number(10.0 + k / RATE, 100 + k, 10.05 + k / RATE) for k in (0, 1, 4, 5)
    ]
    assert [number and number[1] for number in given_numbers] == [0, 1, 4, 5]


def test_after_an_outage_the_gap_is_as_long_as_it_was() -> None:
    numbering = Numbering(RATE)
    numbering.number(10.0, 500, 10.0)
    numbering.restart()
    assert numbering.number(20.0, 0, 20.0) == (20.0, 300)
    assert numbering.number(20.0 + 1 / RATE, 1, 20.1) == (20.0 + 1 / RATE, 301)


def test_a_device_that_counts_anew_by_itself_is_followed() -> None:
    numbering = Numbering(RATE)
    numbering.number(10.0, 500, 10.0)
    assert numbering.number(10.1, 0, 10.1) == (10.1, 3)


def test_a_shot_is_never_from_the_future_nor_from_long_ago() -> None:
    numbering = Numbering(RATE)
    assert numbering.number(99.0, 0, 10.0) == (10.0, 0)
    assert numbering.number(0.5, 1, 10.1) == (10.1, 1)


lives = st.lists(
    st.lists(st.tuples(st.floats(0.0, 5.0), st.floats(-3.0, 3.0), st.integers(0, 10**6))),
    max_size=4,
)


@given(lives=lives, rate=st.floats(1.0, 120.0))
def test_whatever_a_device_says_both_grow(
    lives: list[list[tuple[float, float, int]]], rate: float
) -> None:
    numbering = Numbering(rate)
    now, numbers = 1000.0, []
    for life in lives:
        numbering.restart()
        for passed, off, sequence in life:
            now += passed
            number = numbering.number(now + off, sequence, now)
            if number is not None:
                assert number[0] <= now
                numbers.append(number)
    for (time, sequence), (later, further) in pairwise(numbers):
        assert time < later
        assert sequence < further
