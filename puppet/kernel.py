"""Compiled numeric kernels: plain functions over flat float64 arrays, made fast by numba.

With ``NUMBA_DISABLE_JIT=1`` the very same functions run as Python and are the reference. Arrays
must be writable-flag consistent from call to call: numba compiles a second signature for a
read-only array, so constants are frozen once (``frozen``) and buffers never are.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
import platformdirs
from numpy.typing import ArrayLike, NDArray

P = ParamSpec("P")
R = TypeVar("R")

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bytes = NDArray[np.uint8]

#: Machine code of so many versions of the kernels is kept.
_VERSIONS_KEPT = 3


def _cache_folder() -> Path:
    """Where the machine code of these very kernels is kept between processes.

    numba looks at a kernel's own file to see whether its machine code is old, not at the kernels
    that it calls; so code from an older version would go on running after an update. A folder for
    each version of all kernels together cannot be stale.
    """
    package = Path(__file__).parent
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        source = path.read_bytes()
        if b"kernel" in source:
            digest.update(str(path.relative_to(package)).encode() + source)
    folder = Path(platformdirs.user_cache_dir("puppet")) / "kernels"
    current = folder / digest.hexdigest()[:16]
    if not current.is_dir():
        try:
            others = sorted(folder.iterdir(), key=lambda old: old.stat().st_mtime)
            for old in others[: 1 - _VERSIONS_KEPT]:
                shutil.rmtree(old, ignore_errors=True)
        except OSError:
            pass  # there is no cache yet, or it may not be looked at
    return current


if "NUMBA_CACHE_DIR" not in os.environ:
    numba.config.CACHE_DIR = str(_cache_folder())  # type: ignore[attr-defined]


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` on first call and keep the machine code on disk for the next process."""
    return cast("Callable[P, R]", numba.njit(cache=True, error_model="numpy")(function))


def frozen(values: ArrayLike, dtype: Any = np.float64) -> NDArray[Any]:
    """A contiguous, read-only copy: the form in which constants are kept and handed to kernels."""
    array = np.array(values, dtype=dtype, order="C", copy=True)
    array.setflags(write=False)
    return array
