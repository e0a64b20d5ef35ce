"""Replacing a file in one go: whatever happens, the old file or the new one is there, whole."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path
from typing import Final

#: Seconds after which the part of a file that a killed process left is nobody's any more.
STALE: Final = 60.0


def replace_file(path: Path, data: bytes) -> None:
    """Write `data` in place of what is there. When this returns, it is on the disk.

    Raises OSError if that is not possible; then the old file is as it was.
    """
    path = path.resolve()  # what a link leads to is replaced, not the link
    _sweep(path)
    part = path.with_name(f".{path.name}.{os.getpid()}-{time.time_ns():x}")
    mode = path.stat().st_mode & 0o777 if path.exists() else 0o666
    try:
        with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as out:
            out.write(data)
            out.flush()
            os.fsync(out.fileno())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _sweep(path: Path) -> None:
    """Remove what killed processes left of this file."""
    for left in path.parent.iterdir():
        if left.name.startswith(f".{path.name}."):
            with contextlib.suppress(OSError):
                if time.time() - left.stat().st_mtime > STALE:
                    left.unlink()
