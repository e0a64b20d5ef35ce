"""Which bones of a chain go with which bones of another, in order: the last step of FK mapping.

Both run from the body outwards, and their pairs must too: a forearm never drives what lies further
in than the bone of its upper arm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from puppet.kernel import Floats

#: (bone, human bone) -> how well they go together; -inf for never.
Worth = Callable[[int, int], float]


def aligned(bones: Sequence[int], humans: Sequence[int], worth: Worth) -> list[tuple[int, int]]:
    """The order-preserving pairs with the greatest sum of worths; as many as have a positive one.

    Of equal sums, the one that pairs the bones nearest to the body wins.
    """
    rows, columns = len(bones), len(humans)
    # Lists: for the few bones of a limb, arrays would take several times as long.
    best = [[0.0] * (columns + 1) for _ in range(rows + 1)]
    step = [[0] * columns for _ in range(rows)]  # 0 pair, 1 leave the bone, 2 the human
    for row in range(rows - 1, -1, -1):
        for column in range(columns - 1, -1, -1):
            paired = worth(bones[row], humans[column])
            choices = (
                paired + best[row + 1][column + 1] if paired > 0.0 else -math.inf,
                best[row + 1][column],
                best[row][column + 1],
            )
            best[row][column] = max(choices)
            step[row][column] = choices.index(best[row][column])
    pairs = []
    row = column = 0
    while row < rows and column < columns:
        move = step[row][column]
        if move == 0:
            pairs.append((bones[row], humans[column]))
        row += int(move != 2)
        column += int(move != 1)
    return pairs


def overlap(lengths: Floats, other: Floats) -> Floats:
    """How much each piece of one chain lies beside each piece of another of the same length.

    lengths: (N,), other: (M,) metres. Returns (N, M), shares of the whole; rows sum to 1 over all.
    """
    ours, theirs = _stretches(lengths), _stretches(other)
    start = np.maximum.outer(ours[:-1], theirs[:-1])
    end = np.minimum.outer(ours[1:], theirs[1:])
    return np.asarray(np.maximum(end - start, 0.0))


def _stretches(lengths: Floats) -> Floats:
    total = float(lengths.sum())
    if total < 1e-12:
        return np.linspace(0.0, 1.0, len(lengths) + 1)
    return np.concatenate([[0.0], np.cumsum(lengths) / total])
