"""Takes: written, read back, cut off, and foreign files in their place."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from puppet.errors import BadFileError
from puppet.skeleton import JOINT_NAMES, Moment, SkeletonFrame
from puppet.tracking.source import SourceInfo
from puppet.tracking.takes.take import SCHEMA, Take, read_take, write_take

INFO = SourceInfo("a test", "test", 30.0, synthetic=True, floor=(0.0, 1.0, 0.0, 0.0), note="n")
RECORDED = sorted((Path(__file__).parent / "recorded_streams").glob("*.mcap"))


def some_moments(count: int, seed: int = 0) -> list[Moment]:
    """Two performers, of whom one is there now and then only."""
    rng = np.random.default_rng(seed)

    def frame(i: int, performer: int) -> SkeletonFrame:
        states = rng.integers(0, 3, 20).astype(np.uint8)
        states[0] = 2
        return SkeletonFrame(i / 30, i, performer, rng.normal(size=(20, 3)), states)

    there = [(4,), (4, 7), (7,), ()]
    return [
        Moment(i / 30, i, tuple(frame(i, one) for one in there[i // 5 % 4])) for i in range(count)
    ]


@given(st.integers(0, 40), st.integers(0, 100))
def test_a_take_gives_back_what_was_written(
    tmp_path_factory: pytest.TempPathFactory, count: int, seed: int
) -> None:
    path = tmp_path_factory.mktemp("take") / "a.mcap"
    moments = some_moments(count, seed)
    assert write_take(path, INFO, moments) == count
    take = read_take(path)
    assert take.info == INFO
    assert not take.warnings
    for wrote, read in zip(moments, take, strict=True):
        assert read.sequence == wrote.sequence
        assert read.time == pytest.approx(wrote.time, abs=1e-6)
        for one, other in zip(wrote.frames, read.frames, strict=True):
            assert one.performer == other.performer
            np.testing.assert_allclose(other.positions, one.positions, atol=5.1e-5)
            np.testing.assert_array_equal(other.states, one.states)


def test_other_mcap_tools_can_open_it_and_the_schema_is_true(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    moments = some_moments(50)
    write_take(path, INFO, moments)
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        # A message for each performer, and one where nobody is there.
        assert summary.statistics.message_count == sum(max(1, len(m.frames)) for m in moments)
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            assert json.loads(schema.data) == SCHEMA
            jsonschema.validate(json.loads(message.data), SCHEMA)
        (metadata,) = reader.iter_metadata()
        assert metadata.metadata["joints"].split() == list(JOINT_NAMES)


@pytest.mark.parametrize("share", [0.4, 0.6, 0.8, 0.95])
def test_a_take_that_was_cut_off_still_gives_its_frames(tmp_path: Path, share: float) -> None:
    path = tmp_path / "a.mcap"
    write_take(path, INFO, some_moments(300))
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    take = read_take(path)
    assert take.info == INFO
    assert len(take) >= 300 * share - 60
    assert any("cut off" in warning for warning in take.warnings) or len(take) == 300


@pytest.mark.parametrize(("rate", "count"), [(30.0, 30), (15.0, 15), (10.0, 10), (60.0, 30)])
def test_a_thinned_take_keeps_its_time_and_spacing(rate: float, count: int) -> None:
    take = Take(INFO, tuple(some_moments(31))).thinned(rate)
    assert len(take) == count + 1
    times = [frame.time for frame in take]
    np.testing.assert_allclose(np.diff(times), 1.0 / min(rate, 30.0), atol=1e-9)
    assert [frame.sequence for frame in take] == list(range(count + 1))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "cannot be opened"),
        (b"", "empty"),
        (b"HIERARCHY\nROOT Hips\n", "not a take"),
        (b"\x89PNG\r\n\x1a\n" + bytes(100), "not a take"),
        (b"\x89MCAP0\r\n", "not a take"),
        (b"\x89MCAP0\r\n" + bytes(range(256)), "not a take"),
    ],
)
def test_what_is_not_a_take_is_said_so(tmp_path: Path, content: bytes | None, says: str) -> None:
    path = tmp_path / "a.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BadFileError, match=says) as caught:
        read_take(path)
    assert str(path) in str(caught.value)


def test_a_take_of_another_format_version_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"
    monkeypatch.setattr("puppet.tracking.takes.take.FORMAT_VERSION", 99)
    write_take(path, INFO, some_moments(3))
    monkeypatch.undo()
    with pytest.raises(BadFileError, match="another format version") as caught:
        read_take(path)
    assert "99" in str(caught.value)


@pytest.mark.parametrize("path", RECORDED, ids=lambda path: path.stem)
def test_the_recorded_streams_are_small_whole_and_say_what_they_are(path: Path) -> None:
    take = read_take(path)
    assert path.stat().st_size < 1_000_000
    assert not take.warnings
    assert take.info.licence
    assert take.info.synthetic == (path.stem == "rehearsal")
    times = np.array([frame.time for frame in take])
    assert (np.diff(times) > 0).all()
    if path.stem == "rehearsal":
        assert take.duration >= 40.0


def test_there_are_recorded_streams() -> None:
    assert {path.stem for path in RECORDED} >= {"rehearsal", "balance_cam01", "balance_cam04"}
