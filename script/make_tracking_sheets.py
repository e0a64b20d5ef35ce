#!/usr/bin/env python
"""Draw what the tracker finds over what the camera saw, moment by moment: docs/pictures/tracking/.

    python script/make_tracking_sheets.py [--wheel WHEEL.whl]… [--into FOLDER] [NAME …]

For looking at with one's own eyes. A disc is a tracked joint, a ring an inferred one; what is not
tracked is not drawn. Each performer has a colour. The clips are `make_recorded_streams.py`'s.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from puppet.errors import PuppetError
from puppet.tracking.calibration.annotate import Colour, draw_skeleton
from puppet.tracking.cameras.camera import Image
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.people.models import model_paths
from puppet.tracking.watcher import Watcher

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from benchmarks.clips import POSE2SIM, SPORTS2D, wheel_of

PICTURES: Final = Path(__file__).resolve().parents[1] / "docs/pictures/tracking"
#: Name of the sheet -> the wheel, the clips in it, and how many moments of each.
SHEETS: Final = {
    "balance": (
        POSE2SIM,
        [f"Pose2Sim/Demo_SinglePerson/videos/cam0{camera}.mp4" for camera in (1, 2, 3, 4)],
        5,
    ),
    "duo": (
        POSE2SIM,
        [f"Pose2Sim/Demo_MultiPerson/videos/cam0{camera}.mp4" for camera in (1, 2, 3, 4)],
        5,
    ),
    "leap": (SPORTS2D, ["Sports2D/Demo/demo.mp4"], 12),
}
COLOURS: Final[tuple[Colour, ...]] = (
    (80, 200, 255),
    (255, 170, 60),
    (120, 230, 120),
    (220, 120, 240),
)
#: Pixels that a picture is wide, and pictures in a row: upright ones, and others.
UPRIGHT: Final = (190, 10)
WIDE: Final = (470, 4)
QUALITY: Final = 72


def drawn(clip: Path, moments: int) -> Iterator[Image]:
    """Pictures of the clip at moments that are evenly spread, with everybody drawn over it."""
    watcher = Watcher(VideoFile(clip), model_paths())
    wanted = set(np.linspace(4, len(watcher) - 1, moments).round().astype(int).tolist())
    for shot, moment in watcher.unlevelled():
        if moment.sequence not in wanted:
            continue
        image = shot.colour.copy()
        height, width = image.shape[:2]
        lens = shot.intrinsics or Intrinsics.assumed(width, height)
        for frame in moment.frames:
            colour = COLOURS[frame.performer % len(COLOURS)]
            draw_skeleton(image, frame.positions, frame.states, lens, colour)
        scale = (UPRIGHT if height > width else WIDE)[0] / width
        yield np.asarray(
            cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8
        )


def sheet(pictures: list[Image]) -> Image:
    """Pictures of one size in rows."""
    height, width = pictures[0].shape[:2]
    columns = (UPRIGHT if height > width else WIDE)[1]
    rows = [pictures[i : i + columns] for i in range(0, len(pictures), columns)]
    blank = np.zeros_like(pictures[0])
    full = [np.hstack(row + [blank] * (len(rows[0]) - len(row))) for row in rows]
    return np.asarray(np.vstack(full), np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of: {', '.join(SHEETS)}")
    parser.add_argument("--wheel", "-w", type=Path, action="append", default=[], help="repeatable")
    parser.add_argument("--into", type=Path, default=PICTURES, help="the folder for the pictures")
    arguments = parser.parse_args()
    unknown = set(arguments.names) - set(SHEETS)
    if unknown:
        parser.error(f"unknown: {', '.join(sorted(unknown))}; there are: {', '.join(SHEETS)}")
    arguments.into.mkdir(parents=True, exist_ok=True)
    for name in arguments.names or SHEETS:
        requirement, clips, moments = SHEETS[name]
        with tempfile.TemporaryDirectory() as folder:
            scratch = Path(folder)
            wheel = wheel_of(requirement, arguments.wheel, scratch)
            pictures: list[Image] = []
            with zipfile.ZipFile(wheel) as archive:
                for index, clip in enumerate(clips):
                    path = scratch / f"{index}.mp4"
                    path.write_bytes(archive.read(clip))
                    pictures += drawn(path, moments)
        target = arguments.into / f"{name}.jpg"
        cv2.imwrite(str(target), sheet(pictures), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        print(f"{target}: {len(pictures)} moments, {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    try:
        main()
    except PuppetError as error:
        raise SystemExit(str(error)) from None
