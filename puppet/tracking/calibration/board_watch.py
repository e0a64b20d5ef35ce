"""Calibrating by a printed board: shots of it are gathered while it lies or stands still."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np

from puppet.errors import PuppetError
from puppet.kernel import Floats
from puppet.tracking.calibration.board import BoardFinder, BoardSight
from puppet.tracking.calibration.board_pose import (
    BoardPose,
    lies,
    locate,
    stage_from_lying,
    stage_from_standing,
)
from puppet.tracking.calibration.level import Level
from puppet.tracking.calibration.on_mark import FoundStage
from puppet.tracking.cameras.camera import Shot
from puppet.tracking.cameras.intrinsics import Intrinsics

#: Shots of the board that are taken together, and how many are looked at before it is given up.
SHOTS: Final = 20
MOST_LOOKS: Final = 300
#: Metres and radians (one standard deviation) from which on a place is called unsure.
UNSURE: Final = (0.02, 0.015)

Lying = Literal["floor", "stands"]


class BoardWatch:
    """Gathers shots of the board. progress: 0..1."""

    def __init__(self, square: float | None = None) -> None:
        """square: metres that a square of the print measures, if it is not as it should be."""
        self._finder = BoardFinder(square)
        self._sights: list[BoardSight] = []
        self._looks = 0

    @property
    def progress(self) -> float:
        """0..1, of the shots that are needed."""
        return min(1.0, len(self._sights) / SHOTS)

    @property
    def enough(self) -> bool:
        """Whether there are shots enough, or it makes no sense to wait for more."""
        return len(self._sights) >= SHOTS or self._looks >= MOST_LOOKS

    def look(self, shot: Shot) -> BoardSight | None:
        """Take in a shot."""
        self._looks += 1
        sight = self._finder.find(shot.colour)
        if sight is not None:
            self._sights.append(sight)
        return sight

    def pose(self, lens: Intrinsics, level: Level) -> BoardPose:
        """Where the board is. Raises PuppetError, in words for people, if that cannot be said."""
        return locate(self._sights[-SHOTS:], lens, _known_up(level))


def stage_by_board(
    pose: BoardPose,
    level: Level,
    lying: Lying | None = None,
    height: float | None = None,
) -> FoundStage:
    """The stage that a board stands for. Up is gravity's or the floor's where they are known.

    lying: on the floor, or upright; None lets its direction decide. height: metres from the floor
    to the middle of a board that stands; None where the floor is seen in depth.
    Raises PuppetError for a board that stands above a floor that nobody knows.
    """
    up = _known_up(level)
    on_floor = lies(pose, up) if lying is None else lying == "floor"
    unsure = pose.shift_error > UNSURE[0] or pose.turn_error > UNSURE[1]
    quality = pose.quality + (
        "; that is unsure: bring the board nearer or print it larger" if unsure else ""
    )
    if on_floor:
        frame = stage_from_lying(pose, up)
        floor = "the board" if up is None else f"the board, and up from {_told(level)}"
        return FoundStage(frame, None, None, floor, "a board on the floor", quality)
    if height is None:
        if level.origin != "depth":
            raise PuppetError(
                "the board stands, and how high above the floor is not known",
                expected="a board flat on the floor, or the height of its middle",
                hint="say --board-height METRES, or lay it on the floor (--board-lies)",
            )
        height = float(level.to_stage(pose.shift[None])[0, 1])
    frame = stage_from_standing(pose, height, up)
    return FoundStage(frame, None, None, f"{height:.2f} m below the board", "a board", quality)


def _known_up(level: Level) -> Floats | None:
    """Up in the camera's axes, where depth or gravity tells it."""
    known = level.origin == "depth" or (level.about_up[0] is not None and level.about_up[1] is None)
    return np.asarray(level.up) if known else None


def _told(level: Level) -> str:
    return "depth" if level.origin == "depth" else "gravity"
