"""`puppet import`: the format is seen by the content, and the take says what was mended."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from puppet.errors import BadFileError
from puppet.tracking.takes.recording import import_recording
from puppet.tracking.takes.rehearsal import Rehearsal
from puppet.tracking.takes.take import read_take, write_take
from tests.moments import frames_of
from tests.test_bvh import person
from tests.test_kinect_import import MILLISECONDS, TICKS, bodies, csv1, csv2, skl


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("kinect1-csv", csv1(bodies(4))),
        ("kinect1-skl", skl(bodies(4), MILLISECONDS[:4])),
        ("kinect2-csv", csv2(bodies(4), TICKS[:4])),
        ("bvh", person()),
        ("bvh", person().replace("HIERARCHY", "hierarchy")),
    ],
)
@pytest.mark.parametrize("name", ["recording.csv", "recording.bvh", "no_suffix"])
def test_the_content_says_the_format_whatever_the_name(
    tmp_path: Path, kind: str, text: str, name: str
) -> None:
    path = tmp_path / name
    path.write_text(text)
    imported = import_recording(path)
    assert imported.info.kind == kind
    assert imported.info.name == name
    assert not imported.info.synthetic
    assert imported.info.floor == (0.0, 1.0, 0.0, 0.0)
    assert imported.report.frames == len(imported.frames)


def test_an_imported_take_reads_back_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "a.skl"
    times = [*MILLISECONDS[:5], *(time + 3000 for time in MILLISECONDS[5:9])]
    path.write_text(skl(bodies(9), times))
    imported = import_recording(path)
    write_take(tmp_path / "a.mcap", imported.info, imported.take)
    take = read_take(tmp_path / "a.mcap")
    assert len(take) == len(imported.frames)
    assert take.info == imported.info
    for one, other in zip(frames_of(take), imported.frames, strict=True):
        np.testing.assert_allclose(one.positions, other.positions, atol=1e-4)
        np.testing.assert_array_equal(one.states, other.states)
        assert one.time == pytest.approx(other.time, abs=1e-6)


def test_the_report_says_only_what_there_is_to_say(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(csv2(bodies(4), TICKS[:4]))
    lines = import_recording(path).report.lines()
    assert lines[0].startswith("4 frames, 0.1 s at 30 frames a second")
    assert len(lines) == 2
    assert lines[1].startswith("floor:")


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "empty"),
        (b"   \n\n", "empty"),
        (b"name,age\nEve,3\n", "no format that is understood"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "not a text file"),
        (b'{"frames": []}', "no format that is understood"),
        (b"1,2,3,4\n", "no format that is understood"),
        (b"1," * 90, "too short"),
    ],
)
def test_a_foreign_file_is_refused_with_what_is_understood(
    tmp_path: Path, data: bytes, says: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(data)
    with pytest.raises(BadFileError) as caught:
        import_recording(path)
    assert says in str(caught.value)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFileError, match="no such file"):
        import_recording(tmp_path / "nothing.bvh")
    with pytest.raises(BadFileError, match="not a file"):
        import_recording(tmp_path)


def test_a_take_need_not_be_imported(tmp_path: Path) -> None:
    source = Rehearsal()
    write_take(tmp_path / "a.mcap", source.info, [next(iter(source))])
    with pytest.raises(BadFileError, match="a take already"):
        import_recording(tmp_path / "a.mcap")
