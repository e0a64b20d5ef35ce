"""Goals beyond reach are brought back softly."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.solvers.reach import EASY, soft_distance

REACHES = st.floats(1e-3, 1e3)
SHARES = st.floats(0.0, 1e3)


@given(reach=REACHES, share=st.floats(0.0, EASY))
def test_what_is_easily_in_reach_is_left_alone(reach: float, share: float) -> None:
    assert soft_distance(share * reach, reach, EASY * reach) == min(share, EASY) * reach


@given(reach=REACHES, share=SHARES)
def test_nothing_is_asked_for_beyond_reach(reach: float, share: float) -> None:
    assert 0.0 <= soft_distance(share * reach, reach, EASY * reach) <= reach


@given(reach=REACHES, a=SHARES, b=SHARES)
def test_what_is_farther_is_not_asked_for_nearer(reach: float, a: float, b: float) -> None:
    near, far = sorted((a, b))
    start = EASY * reach
    assert soft_distance(near * reach, reach, start) <= soft_distance(far * reach, reach, start)


@given(reach=REACHES, a=SHARES, step=st.floats(0.0, 1.0))
def test_it_never_moves_faster_than_the_goal(reach: float, a: float, step: float) -> None:
    start = EASY * reach
    moved = soft_distance((a + step) * reach, reach, start) - soft_distance(a * reach, reach, start)
    assert moved <= (step + 1e-9) * reach


@given(reach=REACHES)
def test_there_is_no_kink_where_it_begins(reach: float) -> None:
    start, step = EASY * reach, 1e-6 * reach
    slope = (soft_distance(start + step, reach, start) - start) / step
    assert slope == pytest.approx(1.0, abs=1e-4)


def test_it_comes_as_near_to_the_whole_reach_as_one_likes() -> None:
    assert soft_distance(3.0, 1.0, EASY) == pytest.approx(1.0, abs=1e-6)


def test_a_chain_that_is_stretched_already_is_cut_off() -> None:
    assert soft_distance(1.5, 1.0, 1.0) == 1.0
