#!/usr/bin/env python
"""Make the takes in tests/recorded_streams/ anew: a function for each kind of stream.

    python script/make_recorded_streams.py [--wheel pose2sim-0.10.49-py3-none-any.whl] [NAME ...]

With names (``balance``) only those are made. The real ones need `puppet models` first.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from puppet.errors import PuppetError, UnavailableError
from puppet.tracking.models import model_paths
from puppet.tracking.take import write_take

STREAMS: Final = Path(__file__).resolve().parents[1] / "tests" / "recorded_streams"

POSE2SIM: Final = "pose2sim==0.10.49"
POSE2SIM_LICENCE: Final = "BSD-3-Clause (video: pose2sim)"
DEMO: Final = "Pose2Sim/Demo_SinglePerson"
CAMERAS: Final = ("cam01", "cam02", "cam03", "cam04")
#: The calibration counts in 64ths of a pixel.
SUBPIXELS: Final = 64.0


def make_rehearsal(_wheel: Path | None) -> None:
    """The synthetic choreography, once."""
    from puppet.tracking.rehearsal import Rehearsal

    source = Rehearsal()
    path = STREAMS / "rehearsal.mcap"
    report(path, write_take(path, source.info, source))


def make_balance(wheel: Path | None) -> None:
    """One person who balances on one leg, seen from four sides at once: what our own tracker makes
    of the four single-person clips in the pose2sim wheel, levelled by their calibration."""
    from puppet.tracking.video import VideoSource

    models = model_paths()
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        with zipfile.ZipFile(wheel or download(POSE2SIM, scratch)) as archive:
            calibration = archive.read(f"{DEMO}/calibration/Calib.qca.txt")
            for camera in CAMERAS:
                archive.extract(f"{DEMO}/videos/{camera}.mp4", scratch)
        for camera in CAMERAS:
            up, focal = read_calibration(calibration, camera)
            clip = scratch / DEMO / "videos" / f"{camera}.mp4"
            source = VideoSource(clip, models=models, up=up, focal=focal)
            info = replace(
                source.info,
                note=f"a man balances on one leg; pose2sim's single-person demo, {camera} of 4 "
                "that saw it at once; landmarks by BlazePose, levelled by the calibration",
                licence=POSE2SIM_LICENCE,
            )
            path = STREAMS / f"balance_{camera}.mcap"
            report(path, write_take(path, info, source))
            source.close()


#: What can be made, by name. Each gets the wheel that was given, if any.
MAKERS: Final[dict[str, Callable[[Path | None], None]]] = {
    "rehearsal": make_rehearsal,
    "balance": make_balance,
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


def download(requirement: str, directory: Path) -> Path:
    """The wheel of `requirement`, fetched with pip."""
    command = [
        *(sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"),
        *("--only-binary=:all:", "--dest", str(directory), requirement),
    ]
    try:
        subprocess.run(command, check=True)
    except subprocess.CalledProcessError:
        raise UnavailableError(
            "pip could not fetch the wheel", where=requirement, hint="give it with --wheel"
        ) from None
    return next(directory.glob("*.whl"))


def report(path: Path, frames: int) -> None:
    print(f"{path.name}: {frames} frames, {path.stat().st_size / 1000:.0f} kB")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of: {', '.join(MAKERS)}")
    parser.add_argument("--wheel", type=Path, help=f"{POSE2SIM}, already downloaded")
    arguments = parser.parse_args()
    unknown = set(arguments.names) - set(MAKERS)
    if unknown:
        parser.error(f"unknown: {', '.join(sorted(unknown))}; there are: {', '.join(MAKERS)}")
    for name in arguments.names or MAKERS:
        MAKERS[name](arguments.wheel)


if __name__ == "__main__":
    try:
        main()
    except PuppetError as error:
        raise SystemExit(str(error)) from None
