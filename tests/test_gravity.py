"""Up, from an accelerometer."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.kernel import Floats
from puppet.tracking.cameras.gravity import Gravity

RATE = 100
UP = np.array([0.1, -0.95, 0.3])
UP /= np.linalg.norm(UP)

directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


def degrees(a: Floats | None, b: Floats) -> float:
    assert a is not None
    return math.degrees(math.acos(min(1.0, float(a @ b) / float(np.linalg.norm(b)))))


def settled(seconds: float = 3.0, up: Floats = UP, length: float = 9.81) -> Gravity:
    gravity = Gravity()
    for k in range(round(seconds * RATE)):
        gravity.observe(k / RATE, up * length)
    return gravity


@given(up=directions, length=st.floats(0.5, 20.0))
def test_at_rest_it_is_what_is_measured_whatever_the_unit(
    up: tuple[float, float, float], length: float
) -> None:
    assert degrees(settled(1.0, np.array(up), length).up, np.array(up)) < 1e-3


def test_it_is_not_known_before_there_were_enough_readings() -> None:
    gravity = Gravity()
    assert gravity.up is None
    gravity.observe(0.0, UP)
    assert gravity.up is None
    assert settled(1.0).up is not None


def test_after_a_half_life_half_of_it_is_new() -> None:
    gravity = settled(20.0, np.array([0.0, -1.0, 0.0]))
    for k in range(RATE):
        gravity.observe(20.0 + k / RATE, np.array([9.81, 0.0, 0.0]))
    assert degrees(gravity.up, np.array([1.0, -1.0, 0.0])) < 1.0


def test_a_shaken_camera_does_not_jump() -> None:
    rng = np.random.default_rng(1)
    gravity = settled()
    ups = []
    for k in range(2 * RATE):
        # As hands do it: 4 Hz, more than gravity itself.
        swing = 12.0 * np.sin(2.0 * math.pi * 4.0 * k / RATE) * np.array([0.9, 0.2, 0.4])
        gravity.observe(3.0 + k / RATE, UP * 9.81 + swing + rng.normal(0.0, 1.0, 3))
        assert gravity.up is not None
        ups.append(gravity.up)
    assert max(degrees(up, UP) for up in ups) < 5.0
    assert max(degrees(a, b) for a, b in pairwise(ups)) < 1.0


def test_a_blow_is_hardly_felt() -> None:
    gravity = settled()
    gravity.observe(3.0, np.array([80.0, 0.0, 0.0]))
    assert degrees(gravity.up, UP) < 0.1


@pytest.mark.parametrize("bad", [(math.nan, 0, 0), (0, 0, 0), (math.inf, 0, 0)])
def test_readings_that_mean_nothing_are_left_out(bad: tuple[float, float, float]) -> None:
    gravity = settled()
    before = gravity.up
    gravity.observe(3.0, np.array(bad, float))
    np.testing.assert_array_equal(gravity.up, before)


def test_time_that_runs_backwards_is_left_out() -> None:
    gravity = settled()
    before = gravity.up
    gravity.observe(1.0, np.array([9.81, 0.0, 0.0]))
    np.testing.assert_array_equal(gravity.up, before)
