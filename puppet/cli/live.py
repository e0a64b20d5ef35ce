"""Commands of a live show: its processes, and who drives whom."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from puppet.cli.options import Port, ShowFile, app


@app.command()
def run(
    show: ShowFile,
    headless: Annotated[bool, typer.Option(help="No window, even if there is a display.")] = False,
    seconds: Annotated[
        float | None,
        typer.Option(help="Stop so long after the first picture."),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Write what happened as JSON."),
    ] = None,
    port: Port = None,
    source: Annotated[
        str | None,
        typer.Option(
            help="Use this source instead of the show's: a path, webcam:0, oak:, rehearsal."
        ),
    ] = None,
    png: Annotated[Path | None, typer.Option(help="Keep the newest picture here.")] = None,
    mp4: Annotated[Path | None, typer.Option(help="Film the show.")] = None,
    gif: Annotated[Path | None, typer.Option(help="Film the show as a GIF.")] = None,
) -> None:
    """Run a show: tracker, stage and viewer together.

    It ends with Ctrl-C, or when its window is closed.
    """
    from puppet.commands.live import run_show

    sys.exit(
        run_show(
            show,
            headless,
            seconds,
            report,
            port,
            source,
            {"png": png, "mp4": mp4, "gif": gif},
        )
    )


@app.command()
def track(
    show: ShowFile,
    source: Annotated[
        str | None,
        typer.Option(
            help="Use this source instead of the show's: a path, webcam:0, oak:, rehearsal."
        ),
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option(help="Which of the show's sources, if it has several."),
    ] = None,
    stage: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Where the stage is, if elsewhere: tcp/192.168.1.20:7447."
        ),
    ] = None,
    port: Port = None,
) -> None:
    """Publish the skeletons of one source. Start, stop and replace it while a show runs."""
    from puppet.commands.live import track_show

    track_show(show, source, port, camera, stage)


@app.command()
def stage(show: ShowFile, port: Port = None) -> None:
    """Turn skeletons into poses: the hub of a show."""
    from puppet.commands.live import stage_show

    stage_show(show, port)


@app.command()
def view(
    show: ShowFile,
    headless: Annotated[bool, typer.Option(help="No window, even if there is a display.")] = False,
    port: Port = None,
    png: Annotated[Path | None, typer.Option(help="Keep the newest picture here.")] = None,
    mp4: Annotated[Path | None, typer.Option(help="Film the show.")] = None,
    gif: Annotated[Path | None, typer.Option(help="Film the show as a GIF.")] = None,
) -> None:
    """Draw a show, in a window or without one. There may be several."""
    from puppet.commands.live import view_show

    view_show(show, headless, port, {"png": png, "mp4": mp4, "gif": gif})


@app.command()
def parts(
    show: ShowFile,
    part: Annotated[
        str | None, typer.Argument(help="Which part; all are listed if it is left out.")
    ] = None,
    give: Annotated[
        int | None, typer.Option(metavar="PERFORMER", help="Give it to this performer.")
    ] = None,
    release: Annotated[
        bool, typer.Option("--release", help="Take it from whoever plays it; its puppets rest.")
    ] = False,
    reopen: Annotated[
        bool, typer.Option("--reopen", help="Let the part's rule choose again, among everybody.")
    ] = False,
    port: Port = None,
) -> None:
    """Who drives whom in a show that is running: list it, and change it."""
    from puppet.commands.parts import parts_live

    parts_live(show, part, port, give=give, release=release, reopen=reopen)


@app.command()
def cameras() -> None:
    """List the cameras that are plugged in: webcams, and OAK depth cameras."""
    from puppet.commands.cameras import list_cameras

    list_cameras()
