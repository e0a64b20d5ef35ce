"""Which lenses and depths can be those of an image, and which are another camera's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.cameras.shot_check import depth_error, lens_doubt, lens_error


@given(
    size=st.sampled_from([(1280, 720), (640, 400), (1080, 1920), (640, 640)]),
    angle=st.floats(21.0, 149.0),
    off=st.tuples(st.floats(-0.14, 0.14), st.floats(-0.14, 0.14)),
)
def test_lenses_of_cameras_are_believed(
    size: tuple[int, int], angle: float, off: tuple[float, float]
) -> None:
    width, height = size
    focal = 0.5 * max(size) / math.tan(math.radians(0.5 * angle))
    lens = Intrinsics(focal, focal, (0.5 + off[0]) * (width - 1), (0.5 + off[1]) * (height - 1))
    assert not lens_error(lens, width, height)
    assert not lens_doubt(lens, width, height)


@pytest.mark.parametrize(
    ("numbers", "says"),
    [
        ((math.nan, 800, 640, 360), "not numbers"),
        ((800, 800, math.inf, 360), "not numbers"),
        ((0, 0, 0, 0), "focal lengths are 0 and 0"),
        ((800, -800, 640, 360), "focal lengths are 800 and -800"),
        ((800, 800, 1300, 360), "outside of 1280×720"),
        ((800, 800, 640, -20), "outside of 1280×720"),
        # The lens of an OAK's 1920×1080 image, for one of 1280×720.
        ((1568, 1566, 971, 748), "outside of 1280×720"),
        ((20000, 20000, 640, 360), "sees 3.7°"),
        ((100, 100, 640, 360), "sees 162.2°"),
    ],
)
def test_lenses_that_cannot_be_say_why(numbers: tuple[float, ...], says: str) -> None:
    assert says in lens_error(Intrinsics(*map(float, numbers)), 1280, 720)


@pytest.mark.parametrize(
    ("numbers", "size", "says"),
    [
        ((5000, 5000, 640, 360), (1280, 720), "sees 15°"),
        ((150, 150, 640, 360), (1280, 720), "sees 154°"),
        # The lens of an OAK's 1920×1080 image, for one of 1280×720.
        ((1568, 1566, 971, 543), (1280, 720), r"(971, 543), far off the middle of 1280×720"),
        ((800, 800, 360, 900), (720, 1280), r"(360, 900), far off the middle"),
        ((800, 600, 640, 360), (1280, 720), "focal lengths of 800 and 600"),
    ],
)
def test_lenses_that_are_odd_say_what_is(
    numbers: tuple[float, ...], size: tuple[int, int], says: str
) -> None:
    lens = Intrinsics(*map(float, numbers))
    assert not lens_error(lens, *size)
    assert says in lens_doubt(lens, *size)


def test_depth_may_be_coarser_but_not_of_another_shape() -> None:
    for rows, columns in ((720, 1280), (400, 711), (360, 640)):
        assert not depth_error(np.zeros((rows, columns), np.uint16), 1280, 720)
    for rows, columns in ((400, 640), (720, 720), (1280, 720), (0, 0)):
        wrong = depth_error(np.zeros((rows, columns), np.uint16), 1280, 720)
        assert f"{columns}×{rows}" in wrong
        assert "1280×720" in wrong
    assert "float32" in depth_error(np.zeros((720, 1280), np.float32), 1280, 720)
