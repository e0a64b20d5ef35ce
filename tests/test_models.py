from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path

import pytest

from puppet.errors import BadFileError, UnavailableError
from puppet.tracking.people import models
from puppet.tracking.people.models import LICENCE_FILE, MANIFEST_FILE, fetch_models, model_paths
from tests.pose_models import models_or_skip


def ignore(_task: str, _done: float) -> None:
    """Progress that nobody looks at."""


@pytest.fixture
def unreachable_index(monkeypatch: pytest.MonkeyPatch) -> None:
    # Port 9 (discard) of the loopback is closed on any sane machine.
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")
    monkeypatch.setenv("PIP_EXTRA_INDEX_URL", "")
    monkeypatch.setenv("PIP_NO_INDEX", "0")
    monkeypatch.delenv("PIP_FIND_LINKS", raising=False)


@pytest.fixture
def cache(tmp_path: Path) -> Path:
    """A copy of the user's cache, to be damaged."""
    directory = models_or_skip().detector.parent
    shutil.copytree(directory, tmp_path / "models")
    return tmp_path


def wheel_with(path: Path, members: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return path


def test_missing_models_say_what_gets_them_and_what_works_without(tmp_path: Path) -> None:
    with pytest.raises(UnavailableError) as caught:
        model_paths(tmp_path)
    text = str(caught.value)
    for word in ("puppet models", "takes", "rehearsal", "Kinect", str(tmp_path)):
        assert word in text


def test_the_cache_can_be_put_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PUPPET_CACHE", str(tmp_path))
    with pytest.raises(UnavailableError, match=str(tmp_path)):
        model_paths()


@pytest.mark.usefixtures("unreachable_index")
def test_without_a_network_pip_s_reason_is_told(tmp_path: Path) -> None:
    with pytest.raises(UnavailableError) as caught:
        fetch_models(ignore, tmp_path)
    assert "rehearsal" in str(caught.value)
    assert "mediapipe" in (caught.value.found or "")
    assert not any((tmp_path / "models").iterdir())


def test_a_missing_wheel_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadFileError, match=r"gone\.whl"):
        fetch_models(ignore, tmp_path, wheel=tmp_path / "gone.whl")


def test_a_directory_is_no_wheel(tmp_path: Path) -> None:
    with pytest.raises(BadFileError, match="cannot be read"):
        fetch_models(ignore, tmp_path / "cache", wheel=tmp_path)


@pytest.mark.parametrize("data", [b"", b"this is not a wheel", b"PK\x03\x04" + bytes(100)])
def test_a_damaged_wheel_is_refused(tmp_path: Path, data: bytes) -> None:
    wheel = tmp_path / "damaged.whl"
    wheel.write_bytes(data)
    with pytest.raises(BadFileError, match="damaged"):
        fetch_models(ignore, tmp_path, wheel=wheel)
    assert not any((tmp_path / "models").iterdir())


def test_a_wheel_cut_off_in_the_middle_is_refused(tmp_path: Path) -> None:
    wheel = wheel_with(tmp_path / "cut.whl", {models._DETECTOR.member: bytes(1000)})
    wheel.write_bytes(wheel.read_bytes()[:600])
    with pytest.raises(BadFileError, match="damaged"):
        fetch_models(ignore, tmp_path, wheel=wheel)


def test_a_wheel_without_models_is_refused(tmp_path: Path) -> None:
    wheel = wheel_with(tmp_path / "other.whl", {"other/__init__.py": b""})
    with pytest.raises(BadFileError, match="does not carry the pose models"):
        fetch_models(ignore, tmp_path, wheel=wheel)


def test_other_weights_are_refused(tmp_path: Path) -> None:
    members = (models._DETECTOR.member, models._LANDMARKS.member, models.WHEEL_LICENCE)
    wheel = wheel_with(tmp_path / "forged.whl", dict.fromkeys(members, b"weights"))
    with pytest.raises(BadFileError, match="not the ones that puppet knows"):
        fetch_models(ignore, tmp_path, wheel=wheel)
    assert not any((tmp_path / "models").iterdir())


def test_a_cache_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(UnavailableError, match="PUPPET_CACHE"):
        fetch_models(ignore, file, wheel=tmp_path / "any.whl")


@pytest.mark.usefixtures("unreachable_index")
def test_a_second_fetch_does_nothing(cache: Path) -> None:
    told: list[tuple[str, float]] = []
    before = sorted((path, path.stat().st_mtime_ns) for path in cache.rglob("*"))
    found = fetch_models(lambda task, done: told.append((task, done)), cache)
    assert found == model_paths(cache)
    assert found.licence.read_text().lstrip().startswith("Apache License")
    assert told == [("the pose models are here", 1.0)]
    assert before == sorted((path, path.stat().st_mtime_ns) for path in cache.rglob("*"))


@pytest.mark.parametrize("name", ["pose_detection.onnx", "pose_landmark_full.onnx", LICENCE_FILE])
def test_one_wrong_byte_in_the_cache_is_noticed(cache: Path, name: str) -> None:
    path = cache / "models" / name
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(UnavailableError, match=name) as caught:
        model_paths(cache)
    assert "puppet models" in str(caught.value)


def test_a_lost_model_is_noticed(cache: Path) -> None:
    (cache / "models" / "pose_detection.onnx").unlink()
    with pytest.raises(UnavailableError, match="damaged"):
        model_paths(cache)


@pytest.mark.parametrize("data", [b"", b"\xff\xfe", b"{", b"[]", b'{"wheel": 3}'])
def test_a_damaged_manifest_is_noticed(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / MANIFEST_FILE).write_bytes(data)
    with pytest.raises(UnavailableError, match="damaged"):
        model_paths(tmp_path)


def test_models_of_another_version_are_made_anew(tmp_path: Path) -> None:
    (tmp_path / "models").mkdir()
    manifest = {"wheel": "mediapipe==0.9", "conversion": 1, "sha256": {}}
    (tmp_path / "models" / MANIFEST_FILE).write_text(json.dumps(manifest))
    with pytest.raises(UnavailableError, match="another version"):
        model_paths(tmp_path)
