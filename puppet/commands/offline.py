"""`puppet render`: a show drawn without a bus or a clock, every frame of it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from puppet.cast import load_cast
from puppet.errors import BadShowError
from puppet.line import Line, Tick
from puppet.mapping.stance import upright
from puppet.render.context import headless_context
from puppet.render.output import open_output
from puppet.render.renderer import Renderer
from puppet.render.scene import PuppetOnStage
from puppet.render.sheet import contact_sheet
from puppet.render.staging import Staging
from puppet.show import Show, load_show
from puppet.tracking.calibration.calibrated import saved_stance, use_calibration
from puppet.tracking.open import open_source
from puppet.tracking.source import Source

T = TypeVar("T")

#: A film of a source that does not say how long it is ends here, seconds.
LONGEST = 600.0
#: Pixels to which a picture of a contact sheet is drawn if the size is not given.
SHEET_SIZE = (640, 360)
FILM_FPS, GIF_FPS = 30.0, 15.0


class Studio:
    """The line and the renderer of a show, without hurry: twice the pixels, averaged."""

    def __init__(self, show: Show, path: Path) -> None:
        self.show = show
        cast = load_cast(show, path)
        self.line = Line.of(show, cast)
        size = (show.view.width, show.view.height)
        self._renderer = Renderer(headless_context(), size, samples=0, supersample=2)
        extents = []
        for puppet in cast:
            pairs = {bone: pair.human for pair in puppet.proposal.pairs for bone in pair.bones}
            self._renderer.add_puppet(PuppetOnStage(puppet.name, puppet.model, pairs))
            extents.append(self._renderer.rest_extent(puppet.name, puppet.placement.position))
        self._staging = Staging(show.view, extents, size[0] / size[1])

    def picture(self, tick: Tick) -> NDArray[np.uint8]:
        """(height, width, 3) sRGB."""
        stance = tick.neutral or upright(np.zeros(3), 0.0)
        frames = sorted(
            (now.frame for now in tick.performers if now.neutral is not None),
            key=lambda frame: frame.performer != tick.frame.performer,
        )
        idle = {frame.performer for frame in frames} - set(tick.parts.values())
        picture = self._staging.picture(
            tick.poses, frames, stance.hip, stance.heading, status=None, idle=idle
        )
        self._renderer.draw(picture)
        return self._renderer.read()


def render_show(
    path: Path,
    output: Path,
    *,
    source: str | None,
    start: float,
    seconds: float | None,
    fps: float | None,
    size: tuple[int | None, int | None],
    sheet: int,
    at: str,
) -> None:
    """Draw a source through a show into a film, a picture of its end, or a contact sheet."""
    show = load_show(path)
    times = _times(at)
    is_sheet = bool(sheet or times)
    if is_sheet and output.suffix.lower() != ".png":
        raise BadShowError(
            "a contact sheet is one picture", where=output, expected="a name that ends in .png"
        )
    fps = fps or (GIF_FPS if output.suffix.lower() == ".gif" else FILM_FPS)
    if not (fps > 0 and start >= 0 and (seconds is None or seconds > 0) and sheet >= 0):
        raise BadShowError(
            "these times are not possible",
            expected="--fps and --seconds above 0, --start and --sheet from 0",
            found=f"--fps {fps:g} --seconds {seconds} --start {start:g} --sheet {sheet}",
        )
    default = SHEET_SIZE if is_sheet else (show.view.width, show.view.height)
    view = msgspec.structs.replace(
        show.view, width=size[0] or default[0], height=size[1] or default[1]
    )
    studio = Studio(msgspec.structs.replace(show, view=view), path)
    config = show.all_sources[0]
    if source is None and len(show.all_sources) > 1:
        _say(f"puppet render: of the show's sources, {config.name} is drawn")
    opened = open_source(
        source or config.path,
        folder=None if source else path.parent,
        repeat="once" if seconds is None else config.repeat,
        tracking=show.tracking,
        oak=config.oak,
        warn=lambda text: _say(f"puppet render: {text}"),
    )
    if use_calibration(opened, path, lambda text: _say(f"puppet render: {text}")):
        studio.line.stance = saved_stance(path)
    ticks = _ticks(studio.line, opened, start, seconds)
    if is_sheet:
        _sheet(studio, ticks, output, sheet, times)
        return
    film = open_output(output, fps=fps)
    moments = list(_moments(ticks, fps))
    if not moments:
        raise BadShowError("the source has nothing in this stretch of time", where=str(path))
    if output.suffix.lower() == ".png" and "%" not in output.name:
        moments = moments[-1:]  # one file holds one picture: the last
    for tick in _progress(moments, "drawing"):
        film.write(studio.picture(tick), tick.time)
    film.close()
    _say(f"{output}: {len(moments)} pictures")


def _times(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split(",") if word.strip()]
    except ValueError:
        raise BadShowError(
            "these are not moments", where="--at", expected="seconds, as 2.5,4,7", found=text
        ) from None


def _ticks(
    line: Line, source: Source, start: float, seconds: float | None
) -> Iterator[tuple[float, Tick]]:
    """Steps the line over the whole source; gives the wanted stretch, with its own time."""
    end = start + (LONGEST if seconds is None else seconds)
    first: float | None = None
    for moment in source:
        first = moment.time if first is None else first
        tick = line.step(moment)
        elapsed = moment.time - first
        if elapsed > end:
            break
        if elapsed >= start:
            yield elapsed, tick
    source.close()


def _moments(ticks: Iterator[tuple[float, Tick]], fps: float) -> Iterator[Tick]:
    """Not more than `fps` of them a second."""
    due = -np.inf
    for elapsed, tick in ticks:
        if elapsed >= due - 1e-6:
            due = max(due + 1.0 / fps, elapsed + 0.5 / fps)
            yield tick


def _sheet(
    studio: Studio,
    ticks: Iterator[tuple[float, Tick]],
    output: Path,
    count: int,
    times: list[float],
) -> None:
    """Draw the moments nearest to `times`, or else `count` of them evenly spread."""
    moments = list(ticks)
    if not moments:
        raise BadShowError("the source has nothing in this stretch of time", where=str(output))
    elapsed = np.array([moment[0] for moment in moments])
    late = [time for time in times if time > elapsed[-1] + 0.5]
    if late:
        raise BadShowError(
            "the source does not go on for so long",
            where="--at",
            expected=f"moments from {elapsed[0]:.1f} to {elapsed[-1]:.1f} s",
            found=", ".join(f"{time:g}" for time in late),
        )
    wanted = np.array(times) if times else np.linspace(elapsed[0], elapsed[-1], count)
    chosen = [moments[int(np.abs(elapsed - time).argmin())] for time in wanted]
    images = [studio.picture(tick) for _, tick in _progress(chosen, "drawing")]
    labels = [f"{time:.1f} s" for time, _ in chosen]
    film = open_output(output)
    film.write(contact_sheet(images, columns=min(4, len(images)), labels=labels), 0.0)
    film.close()
    _say(f"{output}: {len(images)} moments")


def _progress(items: list[T], what: str) -> Iterator[T]:
    yield from track(items, description=what, console=Console(stderr=True), transient=True)


def _say(text: str) -> None:
    sys.stderr.write(text + "\n")
