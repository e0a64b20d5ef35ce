"""The pose network's weights: fetched once from the wheel that carries them, kept in the cache.

No model hub is asked. The weights are part of a wheel on the Python package index; pip fetches it
(with the user's own index, proxy and certificates), they are checked against known SHA-256 sums,
converted to ONNX and kept, with their licence, in the user's cache directory.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import msgspec
import platformdirs

from puppet.errors import BadFileError, UnavailableError

#: Later wheels carry no weights.
WHEEL: Final = "mediapipe==0.10.21"
#: Which build of it is fetched does not matter, as nothing in it is run; all carry these weights.
WHEEL_TAGS: Final = ("--python-version", "3.11", "--platform", "manylinux_2_28_x86_64")
WHEEL_BYTES: Final = 35_622_638
WHEEL_LICENCE: Final = "mediapipe-0.10.21.dist-info/LICENSE"
LICENCE_FILE: Final = "LICENSE.mediapipe"
MANIFEST_FILE: Final = "models.json"
#: Goes up when the converter gives other files than before; older ones are then made anew.
CONVERSION: Final = 1
#: The environment variable that says where the cache is, for those who want it elsewhere.
CACHE_VARIABLE: Final = "PUPPET_CACHE"

WITHOUT_MODELS: Final = (
    "takes, `rehearsal` and imported Kinect and BVH recordings work without the models; "
    "only video files and cameras need them"
)
GET_MODELS: Final = f"`puppet models` gets them, once, with pip; {WITHOUT_MODELS}"

#: What is being done, and how much of it is done, 0 to 1.
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class PoseModels:
    """Where the converted models are: the person detector, the 33 landmarks, their licence."""

    detector: Path
    landmarks: Path
    licence: Path


@dataclass(frozen=True, slots=True)
class _Weights:
    """One network in the wheel. outputs: its output names -> ours."""

    name: str
    member: str
    sha256: str
    outputs: Mapping[str, str]

    @property
    def file(self) -> str:
        return f"{self.name}.onnx"


_DETECTOR = _Weights(
    "pose_detection",
    "mediapipe/modules/pose_detection/pose_detection.tflite",
    "9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c",
    {"Identity": "boxes", "Identity_1": "scores"},
)
_LANDMARKS = _Weights(
    "pose_landmark_full",
    "mediapipe/modules/pose_landmark/pose_landmark_full.tflite",
    "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
    {
        "Identity": "landmarks",
        "Identity_1": "score",
        "Identity_3": "heatmap",
        "Identity_4": "world",
    },
)


class _Manifest(msgspec.Struct):
    """Kept beside the models, so that a damaged file is noticed. sha256: file name -> its sum."""

    wheel: str
    conversion: int
    sha256: dict[str, str]


def cache_directory() -> Path:
    """Where this user's cache is: $PUPPET_CACHE, or else what the operating system suggests."""
    chosen = os.environ.get(CACHE_VARIABLE)
    return Path(chosen) if chosen else platformdirs.user_cache_path("puppet")


def model_paths(cache: Path | None = None) -> PoseModels:
    """The models in the cache (default: `cache_directory()`), their sums checked.

    Raises UnavailableError if they are not there, not whole, or of another version.
    """
    directory = _directory(cache)
    manifest_path = directory / MANIFEST_FILE
    try:
        manifest = msgspec.json.decode(manifest_path.read_bytes(), type=_Manifest)
    except FileNotFoundError:
        raise UnavailableError(
            "the pose models are not here yet", where=directory, hint=GET_MODELS
        ) from None
    except (OSError, msgspec.DecodeError, UnicodeDecodeError) as error:
        raise _damaged(manifest_path, str(error)) from None
    if (manifest.wheel, manifest.conversion) != (WHEEL, CONVERSION):
        raise UnavailableError(
            "the pose models here were made by another version of puppet",
            where=directory,
            expected=f"{WHEEL}, conversion {CONVERSION}",
            found=f"{manifest.wheel}, conversion {manifest.conversion}",
            hint=GET_MODELS,
        )
    for name in (_DETECTOR.file, _LANDMARKS.file, LICENCE_FILE):
        path = directory / name
        try:
            found = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            raise _damaged(path, error.strerror or str(error)) from None
        if found != manifest.sha256.get(name):
            raise _damaged(path, f"a file with the SHA-256 sum {found[:16]}…")
    return _paths(directory)


def fetch_models(
    progress: Progress, cache: Path | None = None, *, wheel: Path | None = None
) -> PoseModels:
    """Make sure that the models are in the cache; does nothing if they are there and whole.

    wheel: the wheel, already downloaded, for a machine without a network. The files appear under
    their names only when they are complete. Raises UnavailableError when pip cannot fetch the
    wheel or the cache cannot be written, and BadFileError when the wheel is not what it should be.
    """
    directory = _directory(cache)
    try:
        models = model_paths(cache)
    except UnavailableError:
        pass
    else:
        progress("the pose models are here", 1.0)
        return models
    try:
        directory.mkdir(parents=True, exist_ok=True)
        # In the same file system as the cache, so that the files can be renamed into it.
        with tempfile.TemporaryDirectory(prefix="fetching-", dir=directory) as name:
            scratch = Path(name)
            if wheel is None:
                wheel = _download(scratch, progress)
            _convert(wheel, scratch, progress)
            for file in (_DETECTOR.file, _LANDMARKS.file, LICENCE_FILE, MANIFEST_FILE):
                (scratch / file).replace(directory / file)
    except OSError as error:
        raise UnavailableError(
            "the pose models cannot be kept here",
            where=directory,
            found=error.strerror or str(error),
            hint=f"set {CACHE_VARIABLE} to a directory that can be written; {WITHOUT_MODELS}",
        ) from error
    progress("the pose models are here", 1.0)
    return _paths(directory)


def _directory(cache: Path | None) -> Path:
    return (cache_directory() if cache is None else cache) / "models"


def _paths(directory: Path) -> PoseModels:
    return PoseModels(
        directory / _DETECTOR.file, directory / _LANDMARKS.file, directory / LICENCE_FILE
    )


def _damaged(where: Path, found: str) -> UnavailableError:
    return UnavailableError(
        "the pose models are damaged",
        where=where,
        expected="the file that `puppet models` wrote",
        found=found,
        hint=f"`puppet models` makes them anew; {WITHOUT_MODELS}",
    )


def _download(scratch: Path, progress: Progress) -> Path:
    """Have pip put the wheel into `scratch`; pip's own time limits make sure that this ends."""
    task = f"downloading {WHEEL}"
    target, temporary, report = scratch / "wheel", scratch / "pip", scratch / "pip.txt"
    temporary.mkdir()
    command = [
        *(sys.executable, "-m", "pip", "download", "--quiet", "--no-input"),
        *("--disable-pip-version-check", "--progress-bar", "off"),
        *("--retries", "1", "--timeout", "20"),
        *("--no-deps", "--only-binary=:all:", *WHEEL_TAGS, "--dest", str(target), WHEEL),
    ]
    # What pip has so far lies in its temporary directory: its size is the progress.
    environment = {**os.environ, "TMPDIR": str(temporary)}
    done = 0.0
    progress(task, done)
    with report.open("wb") as output:
        process = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=output, stderr=output
        )
        try:
            while process.poll() is None:
                try:
                    process.wait(0.2)
                except subprocess.TimeoutExpired:
                    done = max(done, min(_size(temporary) / WHEEL_BYTES, 0.99))
                    progress(task, done)
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
    wheels = list(target.glob("*.whl"))
    if process.returncode != 0 or len(wheels) != 1:
        raise UnavailableError(
            "pip could not fetch the wheel that carries the pose models",
            where=WHEEL,
            found=_last_error(report.read_text(errors="replace")),
            hint="check the network and try again, or give a wheel that was downloaded elsewhere; "
            + WITHOUT_MODELS,
        )
    progress(task, 1.0)
    return wheels[0]


def _size(directory: Path) -> int:
    total = 0
    for path in directory.rglob("*"):
        try:
            total += path.stat().st_size
        except OSError:  # pip has just moved or removed it
            continue
    return total


def _last_error(report: str) -> str:
    lines = [line.strip() for line in report.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR:")] or lines
    return errors[-1].removeprefix("ERROR:").strip() if errors else "pip said nothing"


def _convert(wheel: Path, scratch: Path, progress: Progress) -> None:
    """Write the converted models, the licence and the manifest into `scratch`."""
    from puppet.tracking.people.tflite_to_onnx import tflite_to_onnx

    members = _read_wheel(wheel, (_DETECTOR.member, _LANDMARKS.member, WHEEL_LICENCE))
    sums = {LICENCE_FILE: _write(scratch / LICENCE_FILE, members[WHEEL_LICENCE])}
    for i, weights in enumerate((_DETECTOR, _LANDMARKS)):
        progress("converting to ONNX", i / 2)
        _check(members[weights.member], weights, wheel)
        model = tflite_to_onnx(members[weights.member], weights.outputs)
        sums[weights.file] = _write(scratch / weights.file, model)
    manifest = msgspec.json.encode(_Manifest(WHEEL, CONVERSION, sums))
    _write(scratch / MANIFEST_FILE, msgspec.json.format(manifest))
    progress("converting to ONNX", 1.0)


def _read_wheel(wheel: Path, members: Iterable[str]) -> dict[str, bytes]:
    what = "this wheel cannot be read"
    try:
        with zipfile.ZipFile(wheel) as archive:
            return {member: archive.read(member) for member in members}
    except KeyError as error:
        what, found = "this wheel does not carry the pose models", str(error.args[0])
    except OSError as error:
        found = error.strerror or str(error)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError) as error:
        what, found = "this wheel is damaged", str(error)
    raise BadFileError(
        what, where=wheel, expected=WHEEL, found=found, hint=f"download it again; {WITHOUT_MODELS}"
    )


def _check(data: bytes, weights: _Weights, wheel: Path) -> None:
    found = hashlib.sha256(data).hexdigest()
    if found != weights.sha256:
        raise BadFileError(
            "the weights in this wheel are not the ones that puppet knows",
            where=f"{wheel}: {weights.member}",
            expected=f"SHA-256 {weights.sha256}",
            found=found,
            hint=f"fetch {WHEEL} again, from an index that you trust; {WITHOUT_MODELS}",
        )


def _write(path: Path, data: bytes) -> str:
    """Write `data` all the way to the disk; returns its SHA-256."""
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    return hashlib.sha256(data).hexdigest()
