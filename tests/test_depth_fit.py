"""Depth tells how large and how far away somebody is, unless it is not of them at all."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.kernel import Floats
from puppet.tracking.body.depth_fit import DepthFit
from puppet.tracking.body.depth_probe import INSETS, depths_at
from tests.lifted_bodies import BLACK, LENS, depth_of, standing_body

BODY = standing_body()
SEEN = np.ones(33)
AWAY = 3.0


def true_depths(size: float = 1.0, noise: float = 0.0, seed: int = 0) -> Floats:
    """What depth measures of that body `size` times as large, which looks as it does at AWAY."""
    rough = np.random.default_rng(seed).normal(0.0, noise, 33)
    return np.asarray(size * (BODY[:, 2] + AWAY) + rough)


@given(st.floats(0.5, 1.5), st.integers(0, 1000))
def test_one_good_image_tells_size_and_distance(size: float, seed: int) -> None:
    fit = DepthFit()
    away = fit.away(true_depths(size, 0.03, seed), BODY[:, 2], AWAY, SEEN, 0.0)
    assert away == pytest.approx(size * AWAY, abs=0.1)
    assert fit.size == pytest.approx(size, abs=0.03)


@given(st.integers(0, 10_000))
def test_noise_is_never_believed_and_teaches_nothing(seed: int) -> None:
    fit, rng = DepthFit(), np.random.default_rng(seed)
    for frame in range(30):
        measured = rng.uniform(0.3, 8.0, 33)
        assert fit.away(measured, BODY[:, 2], AWAY, SEEN, frame / 30) is None
    assert fit.size == 1.0


@pytest.mark.parametrize("measured", [0.05, 0.4, 30.0])
def test_nobody_is_that_small_or_large(measured: float) -> None:
    assert DepthFit().away(np.full(33, measured), BODY[:, 2], AWAY, SEEN, 0.0) is None


@pytest.mark.parametrize("step", [1.0, 1 / 30, 1 / 240])
def test_what_stands_before_somebody_for_long_is_not_their_depth(step: float) -> None:
    """A table edge before the hips may be taken for them; a whole screen may not."""
    fit = DepthFit()
    for frame in range(40):
        fit.away(true_depths(0.8), BODY[:, 2], AWAY, SEEN, frame * step)
    screen = true_depths(0.8)
    screen[13:] = 0.9
    for frame in range(40, 400):
        away = fit.away(screen, BODY[:, 2], AWAY, SEEN, frame * step)
    assert away is None
    assert fit.size == pytest.approx(0.8, abs=0.01)


def test_without_two_points_of_the_trunk_nothing_is_said() -> None:
    measured = true_depths()
    measured[[11, 12, 23]] = np.nan
    assert DepthFit().away(measured, BODY[:, 2], AWAY, SEEN, 0.0) is None


def test_depth_is_looked_up_in_the_view_that_colour_shows() -> None:
    at = BODY + (0.1, 0.0, AWAY)
    found = depths_at(depth_of(at), BLACK, LENS.pixels(at), 400.0)
    near = [11, 12, 13, 14, 23, 24, 25, 26]  # not covered by each other, and in the image
    np.testing.assert_allclose(found[near], at[near, 2], atol=0.002)


def test_a_stuck_sensor_says_nothing() -> None:
    flat = np.full((180, 320), 3000, np.uint16)
    pixels = LENS.pixels(BODY + (0.0, 0.0, AWAY))
    assert np.isnan(depths_at(flat, BLACK, pixels, 400.0)).all()
    assert np.isnan(depths_at(flat, BLACK, np.full((33, 2), np.nan), 400.0)).all()
    assert len(INSETS) == 33
