"""Clips of people that PyPI wheels carry: where benchmarks, recorded streams and pictures begin.

Four calibrated views of one and of two people (Pose2Sim), and a man who leaps off a roof while a
woman walks past (Sports2D); both BSD-3-Clause. Fetched with pip, never committed.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from puppet.errors import UnavailableError

POSE2SIM: Final = "pose2sim==0.10.49"
SPORTS2D: Final = "sports2d==0.8.34"


def wheel_of(requirement: str, wheels: Sequence[Path], scratch: Path) -> Path:
    """The wheel of `requirement`: one of those that were given, or else downloaded."""
    start = requirement.replace("==", "-") + "-"
    given = (wheel for wheel in wheels if wheel.name.startswith(start))
    return next(given, None) or download(requirement, scratch)


def download(requirement: str, directory: Path) -> Path:
    """The wheel of `requirement`, fetched with pip."""
    command = [
        *(sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"),
        *("--only-binary=:all:", "--dest", str(directory), requirement),
    ]
    try:
        subprocess.run(command, check=True)
    except subprocess.CalledProcessError:
        raise UnavailableError(
            "pip could not fetch the wheel", where=requirement, hint="give it with --wheel"
        ) from None
    return next(directory.glob("*.whl"))
