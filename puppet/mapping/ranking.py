"""The k best assignments of rows to columns, best first (Murty 1968).

Murty's idea: the best assignment is known; every other one differs from it in a first place. So the
rest is split into as many disjoint problems as the best has pairs (this pair forbidden, those
before it forced), each problem is solved, and the best of their answers is the next best of all;
it is then split in turn. Every assignment is met once, so there are no doubles to remove.

What "best" means is the solver's: the Hungarian algorithm takes the greatest sum of powers of the
scores (Sanna 2015, section 3.6), best pair first takes the greatest pair again and again (section
5). Either leaves a row without a column rather than give it one that is not allowed.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any, Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from puppet.kernel import Floats

#: Pairs (row, column), in the order of the rows.
Assignment = tuple[tuple[int, int], ...]
#: (R, C) scores and (R, C) of what is allowed -> the best assignment.
Solver = Callable[[Floats, np.ndarray], Assignment]
#: How good an assignment is: greater is better, compared place by place.
Merit = tuple[float, ...]

#: The paper takes the second power of scores that run over three orders of magnitude; these run
#: over one, and a high power says as plainly that one good pair is worth more than two poor ones.
POWER: Final = 4
#: Even a pair without merit is better than none; to that power it must still be seen beside 1.
_SOMETHING: Final = 1e-3


def hungarian(scores: Floats, allowed: np.ndarray) -> Assignment:
    """The assignment with the greatest sum of scores to the `POWER`."""
    if scores.size == 0:
        return ()
    worth = np.maximum(scores, _SOMETHING)
    cost = np.where(allowed, -(worth**POWER), 0.0)
    rows, columns = linear_sum_assignment(cost)
    return tuple(
        (int(row), int(column))
        for row, column in zip(rows, columns, strict=True)
        if allowed[row, column]
    )


def best_first(scores: Floats, allowed: np.ndarray) -> Assignment:
    """The greatest pair, then the greatest of what is left; ties go to the first row and column."""
    open_pairs = np.where(allowed, scores, -np.inf)
    pairs = []
    for _ in range(min(scores.shape)):
        row, column = np.unravel_index(int(open_pairs.argmax()), scores.shape)
        if not np.isfinite(open_pairs[row, column]):
            break
        pairs.append((int(row), int(column)))
        open_pairs[row, :] = -np.inf
        open_pairs[:, column] = -np.inf
    return tuple(sorted(pairs))


def sum_of_powers(scores: Floats, assignment: Assignment) -> Merit:
    """What `hungarian` makes greatest."""
    return (float(sum(scores[pair] ** POWER for pair in assignment)),)


def greatest_first(scores: Floats, assignment: Assignment) -> Merit:
    """What `best_first` makes greatest: the scores from the greatest down, word by word."""
    return tuple(sorted((float(scores[pair]) for pair in assignment), reverse=True))


MERITS: Final[dict[Solver, Callable[[Floats, Assignment], Merit]]] = {
    hungarian: sum_of_powers,
    best_first: greatest_first,
}


def leaves_out(assignment: Assignment, allowed: np.ndarray) -> bool:
    """Whether a pair could be added: it is a better assignment without some of its pairs."""
    row_free, column_free = (np.ones(count, bool) for count in allowed.shape)
    for row, column in assignment:
        row_free[row] = column_free[column] = False
    return bool(allowed[row_free][:, column_free].any())


def whole_first(
    scores: Floats, allowed: np.ndarray, solve: Solver = hungarian
) -> Iterator[tuple[Merit, Assignment]]:
    """As `ranked`, but what merely drops pairs of a better one comes after all that does not.

    To somebody who wants another mapping, the same one with a pair less is none. Both kinds come
    best first.
    """
    yield from ranked(scores, allowed, solve, whole=True)
    for merit, assignment in ranked(scores, allowed, solve):
        if leaves_out(assignment, allowed):
            yield merit, assignment


def ranked(
    scores: Floats, allowed: np.ndarray, solve: Solver = hungarian, *, whole: bool = False
) -> Iterator[tuple[Merit, Assignment]]:
    """Assignments from the best down, each once, with how good it is.

    scores: (R, C), 0 or more. allowed: (R, C). whole: only those that no pair could be added to.
    """
    merit_of = MERITS[solve]
    order = count()  # ties come out in the order in which they were found: the same every time

    def entry(forced: Assignment, mask: np.ndarray) -> tuple[Any, ...] | None:
        free = mask.copy()
        for row, column in forced:
            free[row, :] = False
            free[:, column] = False
        if whole and _forsaken(forced, free, allowed):
            return None
        assignment = tuple(sorted((*forced, *solve(scores, free))))
        if not assignment:
            return None
        merit = merit_of(scores, assignment)
        # A pair more is better than none, so what comes after the last pair counts as nothing.
        key = (*(-value for value in merit), 0.0)
        return (key, next(order), merit, assignment, forced, mask)

    first = entry((), np.array(allowed, bool))
    heap = [] if first is None else [first]
    while heap:
        _, _, merit, assignment, forced, mask = heapq.heappop(heap)
        if not (whole and leaves_out(assignment, allowed)):
            yield merit, assignment
        fixed: list[tuple[int, int]] = list(forced)
        for pair in assignment:
            if pair in fixed:
                continue
            without = mask.copy()
            without[pair] = False
            branch = entry(tuple(fixed), without)
            if branch is not None:
                heapq.heappush(heap, branch)
            fixed.append(pair)


def _forsaken(forced: Assignment, free: np.ndarray, allowed: np.ndarray) -> bool:
    """Whether a pair is allowed whose row and column both have nothing left to choose from: then no
    assignment of this problem is whole, and there is no need to list them all."""
    row_used, column_used = np.array(free.any(axis=1)), np.array(free.any(axis=0))
    for row, column in forced:
        row_used[row] = column_used[column] = True
    return bool(allowed[~row_used][:, ~column_used].any())
