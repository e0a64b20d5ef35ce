"""How often a pair like this one is right: the score and the margin as a probability."""

from __future__ import annotations

import math
from typing import Final, Literal

Certainty = Literal["sure", "likely", "doubtful"]

#: A logistic curve over score and margin, fitted to `puppet bench mapping` (docs/benchmarks.md).
_BIAS, _SCORE, _MARGIN = -1.2, 2.6, 3.0
#: From these confidences on a pair is called sure, and likely.
SURE: Final = 0.8
LIKELY: Final = 0.6


def confidence(score: float, margin: float) -> float:
    """0..1 from a pair's score and margin, both about 0..1."""
    return 1.0 / (1.0 + math.exp(-(_BIAS + _SCORE * score + _MARGIN * margin)))


def certainty(value: float) -> Certainty:
    """A confidence as a word."""
    if value >= SURE:
        return "sure"
    return "likely" if value >= LIKELY else "doubtful"
