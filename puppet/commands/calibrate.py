"""`puppet calibrate`: where a show's cameras stand, step by step, with pictures."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
from rich.console import Console

from puppet.commands.calibration_steps import CameraSteps, Wishes
from puppet.commands.guide import Guide
from puppet.commands.signals import stop_event
from puppet.errors import BadShowError
from puppet.formats.calibration_file import (
    backup_path,
    calibration_path,
    read_calibration,
    swap_with_backup,
    write_calibration,
)
from puppet.show import Show, SourceConfig, TrackingConfig, load_show
from puppet.tracking.calibration.stage_pictures import StagePictures
from puppet.tracking.open import open_source
from puppet.tracking.watcher import Watcher


def calibrate_show(
    path: Path, wishes: Wishes, *, camera: str | None = None, source: str | None = None
) -> int:
    """Guide through the calibration of the show's cameras, and save it. -> exit code

    camera: only this one. source: look through this instead, as `puppet run --source` does.
    """
    show = load_show(path)
    where = calibration_path(path)
    kept = read_calibration(where)
    stop, guide = stop_event(), Guide()
    folder = wishes.pictures or path.with_name(f"{path.stem}.stage")
    for config in _cameras(show, camera, source):
        opened = open_source(
            config.path,
            folder=None if source else path.parent,
            tracking=TrackingConfig(show.tracking.performers, show.tracking.seated),
            oak=config.oak,
            warn=guide.warn,
        )
        with closing(opened):
            if not isinstance(opened, Watcher):
                raise BadShowError(
                    "this is no camera, so there is nothing to calibrate",
                    where=config.path,
                    expected="a camera, a video file or a raw recording",
                    found="skeletons, which are on the stage already",
                    hint="look through a camera with --source, as in --source webcam:0",
                )
            pictures = StagePictures(folder, config.name)
            steps = CameraSteps(opened, kept, wishes, pictures, guide, stop.is_set)
            found = steps.go()
        if found is None:
            guide.warn("stopped: nothing of this camera was saved")
            return 1
        kept = found
        write_calibration(where, kept)
    guide.say(
        f"saved in {where}"
        + (" (--undo brings back what was there)" if backup_path(where).exists() else "")
    )
    guide.say(f"the pictures are in {folder}")
    return 0


def show_calibration(path: Path) -> None:
    """Print what is saved for a show."""
    where = calibration_path(path)
    load_show(path)
    file = read_calibration(where)
    console = Console(soft_wrap=True)
    if not file.cameras:
        console.print(f"{where}: nothing is calibrated; `puppet calibrate {path}` does it")
        return
    for row in file.cameras:
        x, y, z = row.translation
        console.print(
            f"{row.device}, images of {row.width}×{row.height}: the lens is {y:.2f} m above the "
            f"floor, {np.hypot(x, z):.2f} m from the origin, {_direction(x, z)}\n"
            f"  floor: from {row.floor}; origin: {row.origin}\n"
            f"  {row.quality} ({row.when})",
            markup=False,
            highlight=False,
        )
    if file.stance is not None:
        console.print(
            f"the neutral stance is kept ({file.stance.kind}, {file.stance.when})", highlight=False
        )


def undo_calibration(path: Path) -> None:
    """Bring back the calibration that was there before the last one."""
    load_show(path)
    file = swap_with_backup(calibration_path(path))
    cameras = ", ".join(row.device for row in file.cameras) or "no camera"
    Guide().say(f"the calibration before this one is back: {cameras}")


def write_board(path: Path, paper: str, overwrite: bool) -> None:
    """Write the board to print."""
    from puppet.tracking.calibration.board_print import board_for, print_board

    if path.exists() and not overwrite:
        raise BadShowError(
            "there is such a file already", where=path, hint="another name, or --overwrite"
        )
    board = board_for(paper)
    print_board(path, board)
    Guide().say(
        f"{path}: print it at 100 % on {board.paper}; the bar must be 100 mm long, a square "
        f"{1000 * board.square:.0f} mm (else say --square)"
    )


def _cameras(show: Show, camera: str | None, source: str | None) -> list[SourceConfig]:
    """The sources to calibrate: all that are on this machine, or the one that was named."""
    if source is not None:
        return [SourceConfig(source)]
    if camera is not None:
        return [show.source_named(camera)]
    here = [config for config in show.all_sources if not config.remote]
    if not here:
        raise BadShowError(
            "all cameras of this show are on other machines",
            where=show.name,
            hint="run `puppet calibrate SHOW --camera NAME` there, and copy the file to the show",
        )
    return here


def _direction(x: float, z: float) -> str:
    if max(abs(x), abs(z)) < 0.1:
        return "above it"
    ahead = "in front" if z > 0 else "behind"
    side = "left" if x > 0 else "right"
    if abs(x) < 0.4 * abs(z):
        return ahead
    return f"to the {side}" if abs(z) < 0.4 * abs(x) else f"{ahead}, to the {side}"
