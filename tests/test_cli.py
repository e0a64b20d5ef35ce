"""The commands that read and write files, as typed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from puppet.tracking.takes.take import read_take
from tests.moments import frames_of

REPOSITORY = Path(__file__).resolve().parents[1]
COMMANDS = (
    "run",
    "track",
    "stage",
    "view",
    "render",
    "record",
    "import",
    "map",
    "decide",
    "parts",
    "cameras",
    "calibrate",
    "models",
)


def puppet(
    *arguments: str | Path, cwd: Path, **environment: str
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "puppet", *map(str, arguments)],
        cwd=cwd,
        env={**os.environ, "COLUMNS": "160", **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(tmp_path: Path, command: str) -> None:
    done = puppet(command, "--help", cwd=tmp_path)
    assert done.returncode == 0
    assert "Usage" in done.stdout
    options = [line for line in done.stdout.splitlines() if line.strip().startswith("--")]
    assert all(len(line.split()) > 2 for line in options), "an option without a word about it"


def test_record_makes_a_take_that_can_be_recorded_again(tmp_path: Path) -> None:
    first = puppet("record", "a.mcap", "--source", "rehearsal", "--seconds", "3", cwd=tmp_path)
    assert first.returncode == 0, first.stderr
    take = read_take(tmp_path / "a.mcap")
    assert take.info.synthetic
    assert take.duration == pytest.approx(3.0, abs=0.05)
    second = puppet("record", "b.mcap", "--source", "a.mcap", cwd=tmp_path)
    assert second.returncode == 0, second.stderr
    again = read_take(tmp_path / "b.mcap")
    once, twice = ([f.positions.tobytes() for f in frames_of(t)] for t in (take, again))
    assert once == twice


def test_record_does_not_lose_what_was_there(tmp_path: Path) -> None:
    there = tmp_path / "a.mcap"
    there.write_bytes(b"precious")
    done = puppet("record", "a.mcap", "--source", "rehearsal", cwd=tmp_path)
    assert done.returncode == 2
    assert "--overwrite" in done.stderr
    assert there.read_bytes() == b"precious"


def test_import_goes_on_after_a_file_that_it_cannot_read(shared: Path, tmp_path: Path) -> None:
    good = shared / "recordings/kinect1_precog/Seq1_1.csv"
    bad = tmp_path / "notes.txt"
    bad.write_text("not a recording\n")
    done = puppet("import", bad, good, "-o", tmp_path / "takes", cwd=tmp_path)
    assert done.returncode == 2
    assert "no format that is understood" in done.stderr
    assert len(read_take(tmp_path / "takes/Seq1_1.mcap")) == 232
    assert "232 frames" in done.stderr


def test_render_draws_films_and_sheets_that_open_again(tmp_path: Path) -> None:
    show = REPOSITORY / "configs/shows/rehearsal.toml"
    common = ("--seconds", "1", "--width", "320", "--height", "180")
    for name in ("film.mp4", "film.gif", "last.png"):
        done = puppet("render", show, name, *common, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / name).stat().st_size > 1000
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames >= 10  # type: ignore[attr-defined]
    done = puppet("render", show, "sheet.png", "--at", "0.2,0.8", *common, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with Image.open(tmp_path / "sheet.png") as page:
        assert page.width > 640


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("record", "x.mcap", "--source", "nobody.mp4"), "no such source"),
        (("record", "x.mcap", "--source", "empty.mcap"), "empty"),
        (("record", "x.mcap", "--source", "webcam:one"), "not a webcam"),
        (("record", "no/where.mcap", "--source", "rehearsal"), "no such folder"),
        (("run", "text.glb"), "not TOML"),
        (("track", "missing.toml"), "cannot be opened"),
        (("render", REPOSITORY / "configs/shows/rehearsal.toml", "x.bmp"), ".png, .mp4 or .gif"),
        (
            ("render", REPOSITORY / "configs/shows/rehearsal.toml", "x.mp4", "--sheet", "3"),
            "contact sheet",
        ),
        (
            ("render", REPOSITORY / "configs/shows/rehearsal.toml", "x.png", "--at", "soon"),
            "not moments",
        ),
        (
            ("render", REPOSITORY / "configs/shows/demo.toml", "x.png", "--at", "1,99"),
            "does not go on for so long",
        ),
    ],
)
def test_what_cannot_work_is_told_without_a_traceback(
    tmp_path: Path, arguments: tuple[str | Path, ...], says: str
) -> None:
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "text.glb").write_text("hello, this is text\n")
    done = puppet(*arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert says in done.stderr
    assert "Traceback" not in done.stderr


def test_a_video_without_models_says_what_works_without_them(tmp_path: Path) -> None:
    (tmp_path / "clip.mp4").write_bytes(b"whatever")
    done = puppet(
        "record", "x.mcap", "--source", "clip.mp4", cwd=tmp_path, PUPPET_CACHE=str(tmp_path)
    )
    assert done.returncode == 2
    assert "puppet models" in done.stderr
    assert "rehearsal" in done.stderr
    assert not (tmp_path / "x.mcap").exists()
