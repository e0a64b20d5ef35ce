"""Rows of (N, 3) arrays in kernels. Written out, for numba compiles slices of arrays slowly."""

from __future__ import annotations

import math

from puppet.kernel import Floats, kernel


@kernel
def length_of(v: Floats) -> float:
    """The length of (3,)."""
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@kernel
def put(rows: Floats, row: int, v: Floats) -> None:
    """rows[row] = v, (3,)."""
    rows[row, 0], rows[row, 1], rows[row, 2] = v[0], v[1], v[2]


@kernel
def add(rows: Floats, row: int, v: Floats, times: float) -> None:
    """rows[row] += v * times, (3,)."""
    rows[row, 0] += v[0] * times
    rows[row, 1] += v[1] * times
    rows[row, 2] += v[2] * times


@kernel
def scale(rows: Floats, row: int, times: float) -> None:
    """rows[row] *= times."""
    rows[row, 0] *= times
    rows[row, 1] *= times
    rows[row, 2] *= times
