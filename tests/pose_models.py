"""What the tests of the tracker need from outside the repository: the models, and real clips."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest

from puppet.errors import UnavailableError
from puppet.tracking.models import PoseModels, cache_directory, model_paths

POSE2SIM = "pose2sim==0.10.49"
CLIP = "Pose2Sim/Demo_SinglePerson/videos/cam01.mp4"


def models_or_skip() -> PoseModels:
    """The pose models in this user's cache."""
    try:
        return model_paths()
    except UnavailableError as error:
        pytest.skip(f"{error.what}: run `puppet models`")


def clip_or_skip() -> Path:
    """A man who balances on one leg: 100 frames, 60 a second, 1080×1920. Kept in the cache."""
    kept = cache_directory() / "clips" / "balance_cam01.mp4"
    if not kept.exists():
        with tempfile.TemporaryDirectory() as scratch:
            command = [
                *(sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--no-input"),
                *("--disable-pip-version-check", "--retries", "1", "--timeout", "20"),
                *("--only-binary=:all:", "--dest", scratch, POSE2SIM),
            ]
            if subprocess.run(command, capture_output=True, check=False).returncode != 0:
                pytest.skip(f"pip could not fetch {POSE2SIM}, which carries the clip")
            with zipfile.ZipFile(next(Path(scratch).glob("*.whl"))) as wheel:
                data = wheel.read(CLIP)
        kept.parent.mkdir(parents=True, exist_ok=True)
        partial = kept.with_suffix(".partial")
        partial.write_bytes(data)
        partial.replace(kept)
    return kept
