"""From what a person types (`webcam:0`, `rehearsal`, a path) to a source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from puppet.errors import BadShowError
from puppet.show import TrackingConfig
from puppet.tracking.camera import Camera
from puppet.tracking.replay import Repeat, Replay
from puppet.tracking.source import Source
from puppet.tracking.take import read_take

if TYPE_CHECKING:
    from puppet.tracking.models import PoseModels

#: What can be typed, for help texts and errors.
FORMS = "a take (.mcap), a video file, webcam:N or rehearsal"


def open_source(
    text: str,
    *,
    folder: Path | None = None,
    repeat: Repeat = "once",
    speed: float = 1.0,
    max_rate: float | None = None,
    tracking: TrackingConfig | None = None,
    warn: Callable[[str], None] = lambda _text: None,
) -> Source:
    """Open a source. Relative paths start from `folder`.

    repeat, speed, max_rate: of takes and the rehearsal; a video is played once, as it was filmed.
    tracking: how people are looked for in the pictures of a camera.
    warn: called with each thing that was wrong but could be lived with.
    Raises BadShowError for something that is not a source, BadFileError for a file that cannot be
    read, UnavailableError if a camera or the pose models are missing.
    """
    if text == "rehearsal":
        from puppet.tracking.rehearsal import Rehearsal

        rehearsal = Rehearsal(min(max_rate or 30.0, 30.0))
        return Replay.of(rehearsal, repeat=repeat, speed=speed)
    kind, colon, rest = text.partition(":")
    if colon and kind == "webcam":
        if not rest.isdigit():
            raise BadShowError(
                "this is not a webcam", where="source", expected="webcam:0, webcam:1, …", found=text
            )
        models = _models()
        from puppet.tracking.webcam import Webcam

        return _watched(Webcam(int(rest)), models, tracking)
    path = Path(text) if folder is None else folder / text
    if not path.exists():
        raise BadShowError(
            "there is no such source",
            where=path.resolve(),
            expected=FORMS,
            found=f"{text!r}, and no such file",
            hint=None if folder is None else "paths in a show start from the show's own file",
        )
    if path.suffix.lower() == ".mcap":
        take = read_take(path)
        take = replace(take, info=replace(take.info, name=path.name))
        for warning in take.warnings:
            warn(warning)
        if max_rate is not None:
            take = take.thinned(max_rate)
        return Replay.of(take, repeat=repeat, speed=speed)
    models = _models()
    from puppet.tracking.video_file import VideoFile

    return _watched(VideoFile(path), models, tracking)


def _models() -> PoseModels:
    """Before a camera is opened: without them it would be opened for nothing."""
    from puppet.tracking.models import model_paths

    return model_paths()


def _watched(camera: Camera, models: PoseModels, tracking: TrackingConfig | None) -> Source:
    from puppet.tracking.watcher import Watcher

    return Watcher(camera, models, tracking)
