"""Commands that read and write files: takes, recordings, films, models."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from puppet.cli.options import ShowFile, app


@app.command()
def render(
    show: ShowFile,
    output: Annotated[
        Path,
        typer.Argument(
            help="Where to: .mp4, .gif, .png (the last moment), or %04d.png for one file each."
        ),
    ],
    source: Annotated[
        str | None,
        typer.Option(help="Use this source instead of the show's."),
    ] = None,
    start: Annotated[float, typer.Option(help="Begin so many seconds into the source.")] = 0.0,
    seconds: Annotated[
        float | None,
        typer.Option(help="How long; all of the source if not given."),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(help="Pictures a second of the film: 30, and 15 for a GIF, if not given."),
    ] = None,
    width: Annotated[int | None, typer.Option(help="Pixels.")] = None,
    height: Annotated[int | None, typer.Option(help="Pixels.")] = None,
    sheet: Annotated[
        int,
        typer.Option(help="A contact sheet of so many moments instead (.png)."),
    ] = 0,
    at: Annotated[
        str,
        typer.Option(help="A contact sheet of these moments: seconds, with commas between."),
    ] = "",
) -> None:
    """Draw a show offline: every frame, smooth edges, no hurry, the same each time."""
    from puppet.commands.offline import render_show

    render_show(
        show,
        output,
        source=source,
        start=start,
        seconds=seconds,
        fps=fps,
        size=(width, height),
        sheet=sheet,
        at=at,
    )


@app.command()
def record(
    take: Annotated[Path, typer.Argument(help="The file to write, .mcap.")],
    source: Annotated[str, typer.Option(help="A video file, webcam:0, oak:, rehearsal, a take.")],
    seconds: Annotated[
        float | None,
        typer.Option(help="Stop after so long."),
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a take that is there.")] = False,
    raw: Annotated[
        bool, typer.Option(help="Keep what the camera sees, not who is there: NAME.raw.mcap.")
    ] = False,
) -> None:
    """Record a source as a take, or what a camera sees. Ctrl-C ends a recording and keeps it."""
    if raw:
        from puppet.commands.raw import record_raw

        return record_raw(take, source, seconds, overwrite)
    from puppet.commands.files import record_take

    return record_take(take, source, seconds, overwrite)


@app.command(name="import")
def import_(
    files: Annotated[list[Path], typer.Argument(help="Kinect .csv and .skl, or .bvh files.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The take to write, or a folder for several."),
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace takes that are there.")] = False,
) -> None:
    """Turn other programs' recordings into takes."""
    from puppet.commands.files import import_files

    sys.exit(import_files(files, output, overwrite))


@app.command()
def models(
    cache: Annotated[
        Path | None,
        typer.Option(help="Keep them here instead of in the user's cache."),
    ] = None,
    wheel: Annotated[
        Path | None,
        typer.Option(help="Take them out of this mediapipe wheel: for a machine without network."),
    ] = None,
) -> None:
    """Get the pose models that webcams and videos need (35 MB, once)."""
    from puppet.commands.files import get_models

    get_models(cache, wheel)
