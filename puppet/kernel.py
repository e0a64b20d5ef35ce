"""Compiled numeric kernels: plain functions over flat float64 arrays, made fast by numba.

With ``NUMBA_DISABLE_JIT=1`` the very same functions run as Python and are the reference. Arrays
must be writable-flag consistent from call to call: numba compiles a second signature for a
read-only array, so constants are frozen once (``frozen``) and buffers never are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

P = ParamSpec("P")
R = TypeVar("R")

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bytes = NDArray[np.uint8]


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` on first call and keep the machine code on disk for the next process."""
    return cast("Callable[P, R]", numba.njit(cache=True, error_model="numpy")(function))


def frozen(values: ArrayLike, dtype: Any = np.float64) -> NDArray[Any]:
    """A contiguous, read-only copy: the form in which constants are kept and handed to kernels."""
    array = np.array(values, dtype=dtype, order="C", copy=True)
    array.setflags(write=False)
    return array
