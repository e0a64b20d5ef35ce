#!/usr/bin/env python
"""Make the takes in tests/recorded_streams/ anew: a function for each kind of stream.

    python script/make_recorded_streams.py [--wheel WHEEL ...] [NAME ...]

With names (``balance``) only those are made. The real ones need `puppet models` first, and
fetch the wheels that carry the clips (pose2sim, sports2d) unless they are given.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from puppet.errors import PuppetError
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.people.models import model_paths
from puppet.tracking.takes.take import write_take
from puppet.tracking.watcher import Watcher

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from benchmarks.clips import POSE2SIM, SPORTS2D, wheel_of

STREAMS: Final = Path(__file__).resolve().parents[1] / "tests" / "recorded_streams"

POSE2SIM_LICENCE: Final = "BSD-3-Clause (video: pose2sim)"
CAMERAS: Final = ("cam01", "cam02", "cam03", "cam04")
#: The calibration counts in 64ths of a pixel.
SUBPIXELS: Final = 64.0

SPORTS2D_LICENCE: Final = "BSD-3-Clause (video: sports2d)"
SPORTS2D_CLIP: Final = "Sports2D/Demo/demo.mp4"
#: As the clip's own calibration has it: a level camera; pixels; metres above the ground.
SPORTS2D_UP: Final = (0.0, -1.0, 0.0)
SPORTS2D_FOCAL: Final = 2520.09
SPORTS2D_HEIGHT: Final = 1.71


def make_rehearsal(_wheels: list[Path]) -> None:
    """The synthetic choreography, once."""
    from puppet.tracking.takes.rehearsal import Rehearsal

    source = Rehearsal()
    path = STREAMS / "rehearsal.mcap"
    report(path, write_take(path, source.info, source))


def make_balance(wheels: list[Path]) -> None:
    """One person who balances on one leg, seen from four sides at once: what our own tracker makes
    of the four single-person clips in the pose2sim wheel, levelled by their calibration."""
    what = "a man balances on one leg; pose2sim's single-person demo"
    make_four_views(wheels, "Pose2Sim/Demo_SinglePerson", "balance", what)


def make_duo(wheels: list[Path]) -> None:
    """The same with a second person in the picture, who looks on and waves; in two of the four they
    overlap, and in cam03 he comes to stand right behind her."""
    what = "a man balances on one leg and a woman looks on; pose2sim's multi-person demo"
    make_four_views(wheels, "Pose2Sim/Demo_MultiPerson", "duo", what)


def make_four_views(wheels: list[Path], demo: str, name: str, what: str) -> None:
    """A take of each of the four clips of one of pose2sim's demonstrations."""
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        with zipfile.ZipFile(wheel_of(POSE2SIM, wheels, scratch)) as archive:
            calibration = archive.read(f"{demo}/calibration/Calib.qca.txt")
            for camera in CAMERAS:
                archive.extract(f"{demo}/videos/{camera}.mp4", scratch)
        for camera in CAMERAS:
            up, focal = read_calibration(calibration, camera)
            clip = VideoFile(scratch / demo / "videos" / f"{camera}.mp4", up=up, focal=focal)
            note = (
                f"{what}, {camera} of 4 that saw it at once; landmarks by BlazePose, levelled by "
                "the calibration"
            )
            make_take(Watcher(clip, model_paths()), f"{name}_{camera}", note, POSE2SIM_LICENCE)


def make_leap(wheels: list[Path]) -> None:
    """A man waves on a roof, leaps off with a somersault and runs away; a woman walks past below
    him, comes out from behind a tree and leaves at the border. Sports2d's walking figure."""
    note = (
        "a man waves on a roof and leaps off, a woman walks past; sports2d's demo; landmarks by "
        "BlazePose, levelled by the calibration"
    )
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        with zipfile.ZipFile(wheel_of(SPORTS2D, wheels, scratch)) as archive:
            archive.extract(SPORTS2D_CLIP, scratch)
        clip = VideoFile(scratch / SPORTS2D_CLIP, up=SPORTS2D_UP, focal=SPORTS2D_FOCAL)
        watcher = Watcher(clip, model_paths(), floor=SPORTS2D_HEIGHT)
        make_take(watcher, "leap", note, SPORTS2D_LICENCE)


def make_take(watcher: Watcher, name: str, note: str, licence: str) -> None:
    path = STREAMS / f"{name}.mcap"
    report(path, write_take(path, replace(watcher.info, note=note, licence=licence), watcher))
    watcher.close()


#: What can be made, by name. Each gets the wheels that were given.
MAKERS: Final[dict[str, Callable[[list[Path]], None]]] = {
    "rehearsal": make_rehearsal,
    "balance": make_balance,
    "duo": make_duo,
    "leap": make_leap,
}


def read_calibration(data: bytes, camera: str) -> tuple[tuple[float, float, float], float]:
    """Up in the camera's image (x right, y down, z away), and the focal length in pixels.

    The rotation's rows are the camera's axes in the room (x right, y up, z backwards), where z is
    up: so its last column is the room's up in the camera's axes.
    """
    for node in ElementTree.fromstring(data).iterfind("cameras/camera"):
        transform, intrinsic = node.find("transform"), node.find("intrinsic")
        if node.get("serial") == camera and transform is not None and intrinsic is not None:
            x, y, z = (float(transform.attrib[f"r{row}3"]) for row in (1, 2, 3))
            return (x, -y, -z), float(intrinsic.attrib["focalLengthV"]) / SUBPIXELS
    raise SystemExit(f"the calibration does not have {camera}")


def report(path: Path, frames: int) -> None:
    print(f"{path.name}: {frames} frames, {path.stat().st_size / 1000:.0f} kB")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of: {', '.join(MAKERS)}")
    parser.add_argument(
        *("--wheel", "-w"),
        type=Path,
        action="append",
        default=[],
        help=f"{POSE2SIM} or {SPORTS2D}, already downloaded; may be given more than once",
    )
    arguments = parser.parse_args()
    wheels: list[Path] = arguments.wheel
    unknown = set(arguments.names) - set(MAKERS)
    if unknown:
        parser.error(f"unknown: {', '.join(sorted(unknown))}; there are: {', '.join(MAKERS)}")
    for name in arguments.names or MAKERS:
        MAKERS[name](wheels)


if __name__ == "__main__":
    try:
        main()
    except PuppetError as error:
        raise SystemExit(str(error)) from None
