"""How often a pair like this one is right: the score and the margin as a probability.

The margin says most: where the next best mapping is nearly as good, the choice is nearly open. The
curve follows the frequencies of `puppet bench mapping` (docs/mapping-benchmark.md has the table),
and stays below them, because the weights of the evidence were chosen on the same rigs.
"""

from __future__ import annotations

import math
from typing import Final, Literal

Certainty = Literal["sure", "likely", "doubtful"]

#: With no margin at all, what a large margin adds, and the margin that gives two thirds of it.
_OPEN, _ADDED, _MARGIN = 0.75, 0.23, 0.08
#: A pair that scores less than this is a makeshift; what that takes away at most.
_MAKESHIFT, _TAKEN = 0.5, 0.2
#: From these confidences on a pair is called sure, and likely.
SURE: Final = 0.92
LIKELY: Final = 0.85


def confidence(score: float, margin: float) -> float:
    """0..1 from a pair's score and margin, both about 0..1."""
    clear = 1.0 - math.exp(-max(margin, 0.0) / _MARGIN)
    makeshift = max(_MAKESHIFT - score, 0.0) / _MAKESHIFT
    return min(max(_OPEN + _ADDED * clear - _TAKEN * makeshift + 2.0 * min(margin, 0.0), 0.0), 1.0)


def certainty(value: float) -> Certainty:
    """A confidence as a word."""
    if value >= SURE:
        return "sure"
    return "likely" if value >= LIKELY else "doubtful"
