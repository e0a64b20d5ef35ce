"""From what a person types (`webcam:0`, `oak:`, a path) to a camera."""

from __future__ import annotations

from pathlib import Path

from puppet.errors import BadShowError
from puppet.oak_config import OakConfig
from puppet.tracking.cameras.camera import Camera
from puppet.tracking.cameras.raw_format import is_raw

#: What can be typed, for help texts and errors.
FORMS = "a video file, a raw recording (.mcap), webcam:N or oak:"


def open_camera(text: str, *, folder: Path | None = None, oak: OakConfig | None = None) -> Camera:
    """Open a camera. Relative paths start from `folder`. oak: what an OAK does on the device.

    Raises BadShowError for something that is not a camera, BadFileError for a file that cannot be
    read, UnavailableError if the device is missing.
    """
    kind, colon, rest = text.partition(":")
    if colon and kind == "webcam":
        number = webcam_number(text)
        from puppet.tracking.cameras.webcam import Webcam

        return Webcam(number)
    if text == "oak" or (colon and kind == "oak"):
        from puppet.tracking.cameras.oak import OakCamera

        return OakCamera(rest, oak)
    path = Path(text) if folder is None else folder / text
    if not path.exists():
        raise BadShowError(
            "there is no such camera",
            where=path.resolve(),
            expected=FORMS,
            found=f"{text!r}, and no such file",
            hint=None if folder is None else "paths in a show start from the show's own file",
        )
    if path.suffix.lower() == ".mcap" or is_raw(path):
        from puppet.tracking.cameras.raw_recording import RawRecording

        return RawRecording(path)
    from puppet.tracking.cameras.video_file import VideoFile

    return VideoFile(path)


def webcam_number(text: str) -> int:
    """The number in ``webcam:N``. Raises BadShowError if there is none."""
    number = text.partition(":")[2]
    if not (number.isascii() and number.isdigit()):
        raise BadShowError(
            "this is not a webcam", where="source", expected="webcam:0, webcam:1, …", found=text
        )
    return int(number)
