"""What the tests of the tracker need from outside the repository: the models, and real clips."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest

from puppet.errors import UnavailableError
from puppet.tracking.people.models import PoseModels, cache_directory, model_paths

POSE2SIM = "pose2sim==0.10.49"
#: A man who balances on one leg; and he with a woman who waves at him: 100 frames, 60 a second,
#: 1088×1920, each seen from four sides.
CLIPS = {
    f"{name}_{camera}": f"Pose2Sim/Demo_{demo}/videos/{camera}.mp4"
    for name, demo in (("balance", "SinglePerson"), ("duo", "MultiPerson"))
    for camera in ("cam01", "cam02", "cam03", "cam04")
}


def models_or_skip() -> PoseModels:
    """The pose models in this user's cache."""
    try:
        return model_paths()
    except UnavailableError as error:
        pytest.skip(f"{error.what}: run `puppet models`")


def clip_or_skip(name: str = "balance_cam01") -> Path:
    """One of `CLIPS`, kept in the cache."""
    folder = cache_directory() / "clips"
    kept = folder / f"{name}.mp4"
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
                clips = {clip: wheel.read(member) for clip, member in CLIPS.items()}
        folder.mkdir(parents=True, exist_ok=True)
        for clip, data in clips.items():
            partial = folder / f"{clip}.partial"
            partial.write_bytes(data)
            partial.replace(folder / f"{clip}.mp4")
    return kept
