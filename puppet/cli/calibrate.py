"""`puppet calibrate`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from puppet.cli.options import app
from puppet.errors import BadShowError


@app.command()
def calibrate(
    show: Annotated[
        Path | None, typer.Argument(help="The show whose cameras are to be calibrated, a .toml.")
    ] = None,
    camera: Annotated[
        str | None, typer.Option(help="Only this one of the show's sources, if it has several.")
    ] = None,
    source: Annotated[
        str | None,
        typer.Option(help="Look through this instead of the show's: webcam:0, a recording."),
    ] = None,
    board: Annotated[
        bool,
        typer.Option("--board", help="By the printed board: puts several cameras on one stage."),
    ] = False,
    board_lies: Annotated[
        bool, typer.Option("--board-lies", help="The board lies on the floor, however it looks.")
    ] = False,
    board_height: Annotated[
        float | None,
        typer.Option(help="The board stands or hangs, its middle so many metres above the floor."),
    ] = None,
    square: Annotated[
        float | None,
        typer.Option(help="What a square of the print really measures, millimetres."),
    ] = None,
    lens: Annotated[
        bool, typer.Option("--lens", help="First measure the lens, by showing it the board.")
    ] = False,
    pictures: Annotated[
        Path | None, typer.Option(help="The folder for the pictures; beside the show if not given.")
    ] = None,
    print_board: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the board to print, .pdf or .png, and stop."),
    ] = None,
    paper: Annotated[str, typer.Option(help="What it is printed on: a4, a3, a2.")] = "a3",
    overwrite: Annotated[bool, typer.Option(help="Replace a board file that is there.")] = False,
    saved: Annotated[
        bool, typer.Option("--show-saved", help="Print what is saved, and stop.")
    ] = False,
    undo: Annotated[
        bool, typer.Option("--undo", help="Bring back the calibration before the last one.")
    ] = False,
) -> None:
    """Find out where a show's cameras stand, its stage's origin and front, and the neutral stance.

    Guides through it with pictures; the result is kept beside the show.
    """
    from puppet.commands.calibrate import (
        calibrate_show,
        show_calibration,
        undo_calibration,
        write_board,
    )
    from puppet.commands.calibration_steps import Wishes

    if print_board is not None:
        write_board(print_board, paper, overwrite)
        return
    if show is None:
        raise BadShowError(
            "say which show is to be calibrated",
            expected="puppet calibrate SHOW.toml",
            hint="--print-board FILE needs no show",
        )
    if saved:
        show_calibration(show)
    elif undo:
        undo_calibration(show)
    else:
        lying: Literal["floor", "stands"] | None = (
            "floor" if board_lies else "stands" if board_height is not None else None
        )
        wishes = Wishes(
            board or board_lies or board_height is not None,
            lying,
            board_height,
            None if square is None else square / 1000.0,
            lens,
            pictures,
        )
        sys.exit(calibrate_show(show, wishes, camera=camera, source=source))
