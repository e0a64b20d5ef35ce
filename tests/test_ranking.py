"""The k best assignments, against all that there are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.kernel import Floats
from puppet.mapping.ranking import (
    MERITS,
    POWER,
    Assignment,
    Merit,
    Solver,
    best_first,
    hungarian,
    leaves_out,
    ranked,
    sum_of_powers,
    whole_first,
)

SOLVERS: tuple[Solver, ...] = (hungarian, best_first)


def partial_assignments(allowed: np.ndarray) -> Iterator[Assignment]:
    """Every way to pair some rows with some columns, of which none is used twice; but not none."""

    def grow(row: int, taken: frozenset[int], so_far: Assignment) -> Iterator[Assignment]:
        if row == len(allowed):
            if so_far:
                yield so_far
            return
        yield from grow(row + 1, taken, so_far)
        for column in np.flatnonzero(allowed[row]):
            if int(column) not in taken:
                yield from grow(row + 1, taken | {int(column)}, (*so_far, (row, int(column))))

    return grow(0, frozenset(), ())


@st.composite
def problems(draw: st.DrawFn, *, different: bool = False) -> tuple[Floats, np.ndarray]:
    """Scores and what is allowed; with many equal scores, or all different."""
    rows, columns = draw(st.integers(1, 4)), draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    if different:
        scores = rng.permutation(np.linspace(0.1, 0.95, rows * columns)).reshape(rows, columns)
    else:
        scores = rng.integers(1, 5, size=(rows, columns)) / 4.0
    return scores, rng.random((rows, columns)) < draw(st.sampled_from([0.5, 0.8, 1.0]))


def check_sound(assignment: Assignment, allowed: np.ndarray) -> None:
    rows, columns = [row for row, _ in assignment], [column for _, column in assignment]
    assert list(assignment) == sorted(assignment)
    assert len(set(rows)) == len(rows)
    assert len(set(columns)) == len(columns)
    assert all(allowed[pair] for pair in assignment)


@pytest.mark.parametrize("solve", SOLVERS)
@given(problem=problems())
def test_every_partial_assignment_is_met_once(
    solve: Solver, problem: tuple[Floats, np.ndarray]
) -> None:
    scores, allowed = problem
    met = [assignment for _, assignment in ranked(scores, allowed, solve)]
    assert len(set(met)) == len(met)
    assert set(met) == set(partial_assignments(allowed))
    for assignment in met:
        check_sound(assignment, allowed)


def order_of(merits: Sequence[Merit]) -> list[Merit]:
    """From the best down; rounded, as sums in another order differ in their last digits."""
    return sorted((tuple(round(part, 12) for part in merit) for merit in merits), reverse=True)


@given(problems())
def test_the_hungarian_ranks_by_the_sum_whatever_is_equal(
    problem: tuple[Floats, np.ndarray],
) -> None:
    scores, allowed = problem
    found = [merit for merit, _ in ranked(scores, allowed, hungarian)]
    every = [
        (float(sum(scores[pair] ** POWER for pair in assignment)),)
        for assignment in partial_assignments(allowed)
    ]
    assert [tuple(round(part, 12) for part in merit) for merit in found] == order_of(every)


@given(problems(different=True))
def test_best_first_ranks_by_the_greatest_pair_then_the_next(
    problem: tuple[Floats, np.ndarray],
) -> None:
    scores, allowed = problem
    found = [assignment for _, assignment in ranked(scores, allowed, best_first)]

    def word(assignment: Assignment) -> list[float]:
        return sorted((float(scores[pair]) for pair in assignment), reverse=True)

    every = sorted(partial_assignments(allowed), key=word, reverse=True)
    assert found == every


@pytest.mark.parametrize("solve", SOLVERS)
@given(problem=problems())
def test_an_assignment_comes_with_its_merit(
    solve: Solver, problem: tuple[Floats, np.ndarray]
) -> None:
    for merit, assignment in islice(ranked(*problem, solve), 10):
        assert merit == MERITS[solve](problem[0], assignment)


@given(problems())
def test_the_first_of_the_hungarian_leaves_no_pair_out_that_could_be_had(
    problem: tuple[Floats, np.ndarray],
) -> None:
    """A pair without merit is better than none."""
    scores, allowed = problem
    assignment = hungarian(scores * (scores > 0.6), allowed)
    rows, columns = {row for row, _ in assignment}, {column for _, column in assignment}
    left = [
        (row, column)
        for row, column in np.argwhere(allowed).tolist()
        if row not in rows and column not in columns
    ]
    assert not left


@given(problems(different=True))
def test_best_first_is_what_a_person_does_with_a_pencil(
    problem: tuple[Floats, np.ndarray],
) -> None:
    scores, allowed = problem
    pairs = [(row, column) for row, column in np.argwhere(allowed).tolist()]
    pairs.sort(key=lambda pair: -scores[pair])
    taken: list[tuple[int, int]] = []
    for row, column in pairs:
        if all(row != r and column != c for r, c in taken):
            taken.append((row, column))
    assert best_first(scores, allowed) == tuple(sorted(taken))


def is_part(assignment: Assignment, every: Sequence[Assignment]) -> bool:
    return any(set(assignment) < set(other) for other in every)


@pytest.mark.parametrize("solve", SOLVERS)
@given(problem=problems())
def test_what_merely_drops_a_pair_comes_last_and_nothing_is_lost(
    solve: Solver, problem: tuple[Floats, np.ndarray]
) -> None:
    every = list(partial_assignments(problem[1]))
    found = list(whole_first(*problem, solve))
    met = [assignment for _, assignment in found]
    assert len(met) == len(every)
    assert set(met) == set(every)
    dropped = [is_part(assignment, every) for assignment in met]
    assert dropped == sorted(dropped)
    assert [leaves_out(assignment, problem[1]) for assignment in met] == dropped
    for kind in (False, True):
        # In the order that they have among all.
        some = [one for one, is_less in zip(found, dropped, strict=True) if is_less == kind]
        merits = [merit for merit, a in ranked(*problem, solve) if is_part(a, every) == kind]
        assert order_of([merit for merit, _ in some]) == order_of(merits)
        if solve is hungarian:
            assert [tuple(round(x, 12) for x in m) for m, _ in some] == order_of(merits)


def test_alternatives_are_found_without_listing_all_that_drop_a_pair() -> None:
    """A second assignment of nine pairs: 2⁹ that lie between are passed over."""
    allowed = np.eye(10, dtype=bool)
    allowed[0, 1] = allowed[1, 0] = True
    solved = 0

    def solve(scores: Floats, free: np.ndarray) -> Assignment:
        nonlocal solved
        solved += 1
        return hungarian(scores, free)

    MERITS[solve] = sum_of_powers
    try:
        scores = np.where(np.eye(10, dtype=bool), 0.9, 0.1)
        found = list(islice(whole_first(scores, allowed, solve), 2))
    finally:
        del MERITS[solve]
    assert [len(assignment) for _, assignment in found] == [10, 10]
    assert solved < 20


def test_equal_pairs_go_to_the_first_row_and_column() -> None:
    assert best_first(np.full((2, 3), 0.5), np.ones((2, 3), bool)) == ((0, 0), (1, 1))


def test_the_hungarian_is_not_greedy() -> None:
    """The best pair of all is left, because it would cost the other row everything."""
    scores = np.array([[0.9, 0.85], [0.88, 0.1]])
    allowed = np.ones((2, 2), bool)
    assert hungarian(scores, allowed) == ((0, 1), (1, 0))
    assert best_first(scores, allowed) == ((0, 0), (1, 1))
    assert sum_of_powers(scores, ((0, 1), (1, 0))) > sum_of_powers(scores, ((0, 0), (1, 1)))


@pytest.mark.parametrize("solve", SOLVERS)
def test_where_nothing_is_allowed_there_is_no_assignment(solve: Solver) -> None:
    assert list(ranked(np.ones((3, 2)), np.zeros((3, 2), bool), solve)) == []
    assert list(ranked(np.ones((0, 5)), np.zeros((0, 5), bool), solve)) == []


@pytest.mark.parametrize("solve", SOLVERS)
@given(problem=problems())
def test_scores_and_permissions_are_left_alone(
    solve: Solver, problem: tuple[Floats, np.ndarray]
) -> None:
    scores, allowed = problem
    before = scores.copy(), allowed.copy()
    list(islice(ranked(scores, allowed, solve), 5))
    np.testing.assert_array_equal(scores, before[0])
    np.testing.assert_array_equal(allowed, before[1])
