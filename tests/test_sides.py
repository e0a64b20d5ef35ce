from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from puppet.tracking.body.sides import GAP, HOLD, Sides, reversed_in_depth
from puppet.tracking.people.blazepose import LANDMARK_COUNT, Landmarks, Region

LEFT_SHOULDER, RIGHT_SHOULDER = 11, 12
STEP = 1 / 30


def standing(turn: float = 0.0) -> Landmarks:
    """A body of which only the sides matter, turned about its vertical axis by `turn` (rad)."""
    world = np.zeros((LANDMARK_COUNT, 3))
    world[:, 1] = np.linspace(-0.9, 0.9, LANDMARK_COUNT)
    left = np.arange(LANDMARK_COUNT) % 2 == 1
    world[:, 0] = np.where(left, 0.2, -0.2) * np.cos(turn)
    world[:, 2] = np.where(left, 0.2, -0.2) * np.sin(turn)
    pixels = 400.0 + 300.0 * world[:, :2]
    ones = np.ones(LANDMARK_COUNT)
    region = Region(np.array([400.0, 400.0]), 800.0, 0.0)
    return Landmarks(pixels, world, ones, ones, 1.0, region)


def nothing(_turn: float) -> None:
    return None


def test_the_other_reading_of_the_other_reading_is_the_first() -> None:
    body = standing(0.4)
    again = reversed_in_depth(reversed_in_depth(body))
    np.testing.assert_array_equal(again.pixels, body.pixels)
    np.testing.assert_array_equal(again.world, body.world)


def test_the_other_reading_has_the_same_outline() -> None:
    body = standing(0.4)
    other = reversed_in_depth(body)
    assert sorted(map(tuple, other.pixels)) == sorted(map(tuple, body.pixels))
    np.testing.assert_array_equal(other.pixels[LEFT_SHOULDER], body.pixels[RIGHT_SHOULDER])


def test_a_jump_is_looked_at_again() -> None:
    sides, body = Sides(), standing()
    sides.keep(body, 0.0, nothing)
    turns: list[float] = []

    def look_again(turn: float) -> Landmarks:
        turns.append(turn)
        return body

    assert sides.keep(reversed_in_depth(body), STEP, look_again) is body
    assert len(turns) == 1


def test_a_short_jump_never_shows() -> None:
    sides, body = Sides(), standing()
    for frame in range(30):
        seen = reversed_in_depth(body) if 10 <= frame < 14 else body
        kept = sides.keep(seen, frame * STEP, nothing)
        assert kept.pixels[LEFT_SHOULDER, 0] > kept.pixels[RIGHT_SHOULDER, 0]


def test_a_jump_that_lasts_is_turned_back() -> None:
    sides, body = Sides(), standing()
    sides.keep(body, 0.0, nothing)
    for frame in range(1, round((HOLD + 0.1) / STEP)):
        kept = sides.keep(reversed_in_depth(body), frame * STEP, nothing)
        np.testing.assert_array_equal(kept.pixels, body.pixels)


def test_the_network_is_believed_in_the_end() -> None:
    sides, body = Sides(), standing()
    other = reversed_in_depth(body)
    sides.keep(body, 0.0, nothing)
    kept = [sides.keep(other, frame * STEP, nothing) for frame in range(1, 90)]
    assert kept[-1] is other


def test_after_a_gap_anything_is_believed() -> None:
    sides, body = Sides(), standing()
    other = reversed_in_depth(body)
    sides.keep(body, 0.0, nothing)
    assert sides.keep(other, GAP + 0.1, nothing) is other


@given(rate=st.floats(-1.0, 1.0))
def test_whoever_turns_round_is_left_alone(rate: float) -> None:
    """Up to a turn a second, at 30 frames a second."""
    sides = Sides()
    for frame in range(60):
        body = standing(2.0 * np.pi * rate * frame * STEP)
        assert sides.keep(body, frame * STEP, nothing) is body
