"""From what a person types (`webcam:0`, `rehearsal`, a path) to a source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from puppet.errors import BadShowError
from puppet.oak_config import OakConfig
from puppet.show import TrackingConfig
from puppet.tracking.source import Source
from puppet.tracking.takes.replay import Repeat, Replay
from puppet.tracking.takes.take import read_take

#: What can be typed, for help texts and errors.
FORMS = "a take (.mcap), a raw recording, a video file, webcam:N, oak: or rehearsal"
#: What begins so is a device, not a path.
DEVICES = ("webcam:", "oak:")


def is_device(text: str) -> bool:
    """Whether that is a camera that is plugged in."""
    return text == "oak" or text.startswith(DEVICES)


def check_source(text: str, folder: Path | None = None) -> None:
    """See whether a source is there, without keeping it open or loading the pose models.

    Raises what `open_source` would. A device is looked for and not opened.
    """
    if text == "rehearsal":
        return
    if text == "oak" or text.startswith("oak:"):
        from puppet.tracking.cameras.oak_listing import choose_oak, list_oaks

        choose_oak(text.partition(":")[2], list_oaks())
    elif text.startswith("webcam:"):
        from puppet.tracking.cameras.open_camera import webcam_number
        from puppet.tracking.cameras.webcam_refusal import check_webcam

        check_webcam(webcam_number(text))
    else:
        path = _existing(text, folder)
        if path.suffix.lower() == ".mcap" and not _is_raw(path):
            read_take(path)
        else:
            from puppet.tracking.cameras.open_camera import open_camera

            open_camera(text, folder=folder).close()


def open_source(
    text: str,
    *,
    folder: Path | None = None,
    repeat: Repeat = "once",
    speed: float = 1.0,
    max_rate: float | None = None,
    tracking: TrackingConfig | None = None,
    oak: OakConfig | None = None,
    warn: Callable[[str], None] = lambda _text: None,
) -> Source:
    """Open a source. Relative paths start from `folder`.

    repeat, speed, max_rate: of takes and the rehearsal; a video is played once, as it was filmed.
    tracking: how people are looked for in the pictures of a camera. oak: what an OAK does on the
        device.
    warn: called with each thing that was wrong but could be lived with.
    Raises BadShowError for something that is not a source, BadFileError for a file that cannot be
    read, UnavailableError if a camera or the pose models are missing.
    """
    if text == "rehearsal":
        from puppet.tracking.takes.rehearsal import Rehearsal

        rehearsal = Rehearsal(min(max_rate or 30.0, 30.0))
        return Replay.of(rehearsal, repeat=repeat, speed=speed)
    if not is_device(text):
        path = _existing(text, folder)
        if path.suffix.lower() == ".mcap" and not _is_raw(path):
            take = read_take(path)
            take = replace(take, info=replace(take.info, name=path.name))
            for warning in take.warnings:
                warn(warning)
            if max_rate is not None:
                take = take.thinned(max_rate)
            return Replay.of(take, repeat=repeat, speed=speed)
    return _watched(text, folder, tracking, oak)


def _existing(text: str, folder: Path | None) -> Path:
    path = Path(text) if folder is None else folder / text
    if not path.exists():
        raise BadShowError(
            "there is no such source",
            where=path.resolve(),
            expected=FORMS,
            found=f"{text!r}, and no such file",
            hint=None if folder is None else "paths in a show start from the show's own file",
        )
    return path


def _is_raw(path: Path) -> bool:
    from puppet.tracking.cameras.raw_format import is_raw

    return is_raw(path)


def _watched(
    text: str, folder: Path | None, tracking: TrackingConfig | None, oak: OakConfig | None
) -> Source:
    from puppet.tracking.cameras.open_camera import open_camera
    from puppet.tracking.people.models import model_paths
    from puppet.tracking.watcher import Watcher

    models = model_paths()  # first: without them a camera would be opened for nothing
    return Watcher(open_camera(text, folder=folder, oak=oak), models, tracking)
