"""`puppet cameras`: what is plugged in, and how it is called in a show."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from puppet.errors import UnavailableError
from puppet.tracking.cameras.oak_listing import list_oaks
from puppet.tracking.cameras.webcam_refusal import DEVICES, check_webcam


def list_cameras() -> None:
    """Print each camera with its name as a source, and whether it can be used."""
    console = Console(soft_wrap=True, highlight=False)
    found = [*_webcams(), *_oaks()]
    for line in found:
        console.print(line, markup=False)
    if not found:
        console.print("no camera is plugged in: no webcam, no OAK; docs/oak.md says where to look")


def _webcams() -> Iterator[str]:
    for device in sorted(DEVICES.glob("video*"), key=_number):
        state = "free"
        try:
            check_webcam(_number(device))
        except UnavailableError as error:
            state = error.what.removeprefix("this webcam ")
        yield f"webcam:{_number(device)} ({state})"


def _number(device: Path) -> int:
    digits = device.name.removeprefix("video")
    return int(digits) if digits.isdigit() else 0


def _oaks() -> Iterator[str]:
    try:
        found = list_oaks()
    except UnavailableError as error:  # depthai is not there, or does not run here
        yield str(error)
        return
    for oak in found:
        yield str(oak)
