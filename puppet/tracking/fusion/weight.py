"""How much what a camera saw says, and in which direction: covariances and their sums.

Along its line of sight a camera without depth knows little, across it much. So two cameras that
stand at right angles fix a joint as triangulation would: each says what the other cannot
(information form of the Gaussian product; Durrant-Whyte 1988).
"""

from __future__ import annotations

import math
from typing import Final

from puppet.kernel import Floats, kernel

#: What is inferred may be so many times as wrong.
INFERRED: Final = 4.0
#: How wrong a guess is that goes on with the last velocity: a share of the way, and m/s² of what
#: people do meanwhile.
GUESSED_SHARE: Final = 0.35
GUESSED_PUSH: Final = 8.0
#: Seconds by which a joint is moved on at its last velocity; beyond, it stays there.
MOVED_ON: Final = 0.1


@kernel
def guess_error(speed: float, age: float) -> float:
    """The standard deviation, metres, of where a joint of that speed (m/s) is after `age` (s)."""
    share = GUESSED_SHARE * speed * age
    push = 0.5 * GUESSED_PUSH * age * age
    return math.sqrt(share * share + push * push)


@kernel
def distance(a: Floats, b: Floats) -> float:
    """Metres between two places (3,)."""
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return math.sqrt(x * x + y * y + z * z)


@kernel
def weigh(
    seen: Floats, place: Floats, known: bool, across: float, along: float, weight: Floats
) -> None:
    """Fill in `weight` (6,), the symmetric Σ⁻¹ (xx, xy, xz, yy, yz, zz) of what is seen at `seen`.

    place: (3,) where the camera stands, if known; else it is the same in all directions. across,
    along: standard deviations, metres.
    """
    # Σ⁻¹ = 1/across² (I - u uᵀ) + 1/along² u uᵀ
    x, y, z = seen[0] - place[0], seen[1] - place[1], seen[2] - place[2]
    away = math.sqrt(x * x + y * y + z * z)
    if known and away > 1e-6:
        flat = 1.0 / (across * across)
        more = 1.0 / (along * along) - flat
        x, y, z = x / away, y / away, z / away
    else:
        flat = 3.0 / (2.0 * across * across + along * along)
        more = 0.0
    weight[0] = flat + more * x * x
    weight[1] = more * x * y
    weight[2] = more * x * z
    weight[3] = flat + more * y * y
    weight[4] = more * y * z
    weight[5] = flat + more * z * z


@kernel
def add(total: Floats, weight: Floats, value: Floats) -> None:
    """Add to `total` (9,), Σ⁻¹ and Σ⁻¹ value, what is said of `value` (3,) with `weight` (6,)."""
    for index in range(6):
        total[index] += weight[index]
    total[6] += weight[0] * value[0] + weight[1] * value[1] + weight[2] * value[2]
    total[7] += weight[1] * value[0] + weight[3] * value[1] + weight[4] * value[2]
    total[8] += weight[2] * value[0] + weight[4] * value[1] + weight[5] * value[2]


@kernel
def solve(total: Floats, value: Floats) -> None:
    """Fill in `value` (3,), the mean of all that was added to `total` (9,). Σ⁻¹ is definite."""
    a, b, c, d, e, f = total[0], total[1], total[2], total[3], total[4], total[5]
    ca, cb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * ca + b * cb + c * cc
    cd, ce, cf = a * f - c * c, b * c - a * e, a * d - b * b
    p, q, r = total[6], total[7], total[8]
    value[0] = (ca * p + cb * q + cc * r) / determinant
    value[1] = (cb * p + cd * q + ce * r) / determinant
    value[2] = (cc * p + ce * q + cf * r) / determinant
