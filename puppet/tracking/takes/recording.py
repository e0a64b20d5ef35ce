"""Recordings that other programs made, as takes: what `puppet import` does."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from puppet.errors import BadFileError
from puppet.formats.bvh import read_bvh
from puppet.formats.bvh_skeleton import bvh_to_skeleton
from puppet.formats.kinect import read_kinect1_csv, read_kinect1_skl, read_kinect2_csv
from puppet.formats.performance import ImportReport, Performance, skeleton_frames
from puppet.formats.text import read_text
from puppet.skeleton import Moment, SkeletonFrame
from puppet.tracking.source import SourceInfo
from puppet.tracking.takes.take import MCAP_MAGIC, Take

UNDERSTOOD = (
    "Kinect v1 tables (.csv with semicolons; .skl), Kinect v2 tables (.csv with commas), BVH"
)


@dataclass(frozen=True, slots=True, eq=False)
class Imported:
    """A foreign recording as a take, with what was found and mended on the way."""

    info: SourceInfo
    frames: tuple[SkeletonFrame, ...]
    report: ImportReport

    @property
    def take(self) -> Take:
        """The same as a take in memory."""
        return Take(self.info, tuple(map(Moment.of, self.frames)))


def import_recording(path: Path, *, rate: float = 60.0) -> Imported:
    """Read a recording in whichever of the formats it is; its content says, not its name.

    rate: frames a second that are kept at most of BVH files (the Kinect has 30 anyway).

    Raises BadFileError for a file that is missing, empty, of no known format, or damaged.
    """
    performance = _reader(path, rate)(path)
    frames, report = skeleton_frames(performance)
    info = SourceInfo(
        name=path.name,
        kind=performance.kind,
        rate=performance.rate,
        floor=(0.0, 1.0, 0.0, 0.0),
        note="; ".join(report.notes),
    )
    return Imported(info, tuple(frames), report)


def _reader(path: Path, rate: float) -> Callable[[Path], Performance]:
    if _begins_with_magic(path):
        raise BadFileError(
            "this is a take already",
            where=path,
            found="an MCAP file",
            hint="`puppet run` and `puppet track` play takes as they are",
        )
    first = read_text(path).lstrip().split("\n", 1)[0]
    if re.match(r"HIERARCHY\b", first, re.IGNORECASE):
        return partial(_import_bvh, rate=rate)
    words = first.lower().replace(" ", "")
    if "\t" in first and "hipcenter_x" in words:
        return read_kinect1_skl
    if ";" in first and "hipcenter" in words:
        return read_kinect1_csv
    # A row of the v2, or what is left of one: the reader says what is missing.
    if first.count(",") >= 25 and re.match(r"[-+\d.,eE]+$", words):
        return read_kinect2_csv
    raise BadFileError(
        "this recording is of no format that is understood",
        where=path,
        expected=UNDERSTOOD,
        found=f"a file that begins with {first[:40]!r}",
    )


def _begins_with_magic(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(MCAP_MAGIC)) == MCAP_MAGIC
    except OSError:
        return False  # The reader says why.


def _import_bvh(path: Path, rate: float) -> Performance:
    return bvh_to_skeleton(read_bvh(path), rate=rate)
