"""Where the board is before a camera, from several shots of it, and the stage that follows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from puppet.errors import PuppetError
from puppet.kernel import Floats
from puppet.tracking.calibration.board import Board, BoardSight
from puppet.tracking.calibration.stage_frame import StageFromCamera, angle_between
from puppet.tracking.cameras.intrinsics import Intrinsics

#: So many corners are needed at least, each in this part of the shots.
LEAST: Final = 6
OFTEN: Final = 0.5
#: Pixels that a corner may wander about (median over the corners) while camera and board stand.
WANDER: Final = 2.0
#: A corner that is off by so many times the usual, and by so many pixels, is left out.
OUTLIER: Final = 4.0
OUTLIER_PIXELS: Final = 1.0
#: Corners that are off by more than this part of the focal length are not those of a flat board.
MOST_ERROR: Final = 0.003
#: A flat board can be seen in two ways. One counts as right if the other fits so much worse.
CLEAR: Final = 1.6
#: Radians between the board's normal and up, below which it lies.
LYING: Final = math.radians(50.0)

#: What a lens calls y down and z away, the camera's axes call y up and z back.
_FLIP: Final = np.diag([1.0, -1.0, -1.0])
#: stage_from_board of a board that lies on the floor, its lower edge to the audience.
_LIES: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class BoardPose:
    """Where a board is, in the camera's axes: camera = rotation @ board + shift, metres.

    error: pixels (RMS) between its corners and where they should be. turn_error, shift_error:
    radians and metres (one standard deviation) that follow from it. shots, corners: how many.
    """

    board: Board
    rotation: Floats
    shift: Floats
    error: float
    turn_error: float
    shift_error: float
    shots: int
    corners: int

    @property
    def quality(self) -> str:
        """One sentence for people."""
        return (
            f"{self.board.paper} board at {np.linalg.norm(self.shift):.2f} m, "
            f"{self.error:.2f} px off, ±{1000 * self.shift_error:.1f} mm "
            f"±{math.degrees(self.turn_error):.1f}°"
        )


def locate(sights: Sequence[BoardSight], lens: Intrinsics, up: Floats | None = None) -> BoardPose:
    """The pose of a board that lies or stands still, from all shots of it together.

    up: (3,) in the camera's axes, if known: decides between the two ways to see a flat board.
    Raises PuppetError, in words for people, if too little is seen of it, or it moves.
    """
    if not sights:
        raise PuppetError(
            "no board is seen",
            expected="the printed board, flat, wholly in the picture and large in it",
            found="none of its markers",
            hint="print one with `puppet calibrate --print-board board.pdf`; bring it nearer, and "
            "see that no light glares on it",
        )
    papers = [sight.board for sight in sights]
    board = max(set(papers), key=papers.count)
    seen = [sight for sight in sights if sight.board == board]
    numbers, pixels = _corners(seen)
    if len(numbers) < LEAST:
        raise PuppetError(
            "too little is seen of the board",
            expected=f"at least {LEAST} of its corners in most shots",
            found=f"{len(numbers)}",
            hint="bring it nearer, print it larger (--paper a3), or uncover it",
        )
    points = seen[0].points(numbers)
    keep = np.ones(len(points), bool)
    for _ in range(2):
        rotation, shift, off = _solve(points, pixels, keep, lens, up)
        usual = float(np.median(off[keep]))
        keep = off < max(OUTLIER * usual, OUTLIER_PIXELS)
        if keep.sum() < LEAST or usual > MOST_ERROR * lens.focal_x:
            raise PuppetError(
                "the board's corners do not fit together",
                expected="a flat board, and the lens that belongs to these images",
                found=f"{usual:.1f} pixels between where corners are and should be",
            )
    rotation, shift, off = _solve(points, pixels, keep, lens, up)
    error = float(np.sqrt(np.mean(off[keep] ** 2)))
    turn_error, shift_error = _errors(points[keep], rotation, shift, lens, max(error, 0.05))
    return BoardPose(
        board,
        _FLIP @ rotation,
        _FLIP @ shift,
        error,
        turn_error,
        shift_error,
        len(seen),
        int(keep.sum()),
    )


def lies(pose: BoardPose, up: Floats | None = None) -> bool:
    """Whether the board lies on the floor, as far as one can tell; up is about the camera's own
    if it is not known."""
    return angle_between(pose.rotation[:, 2], np.array([0, 1.0, 0]) if up is None else up) < LYING


def stage_from_lying(pose: BoardPose, up: Floats | None = None) -> StageFromCamera:
    """The stage whose origin is the middle of a board on the floor, and whose front is beyond its
    lower edge. up: (3,) in the camera's axes; the board's own normal if it is not known better."""
    stage_from_camera = _LIES @ pose.rotation.T
    return _upright(stage_from_camera, pose.shift, up, 0.0)


def stage_from_standing(
    pose: BoardPose, height: float, up: Floats | None = None
) -> StageFromCamera:
    """The stage whose origin is on the floor under a board that stands or hangs, facing its front.

    height: metres from the floor to the board's middle. up: as in `stage_from_lying`; the board's
    own way up if it is not known.
    """
    return _upright(pose.rotation.T, pose.shift, up, height)


def _upright(rotation: Floats, middle: Floats, up: Floats | None, height: float) -> StageFromCamera:
    if up is not None:
        y = up / np.linalg.norm(up)
        z = rotation[2] - (rotation[2] @ y) * y
        z /= np.linalg.norm(z)
        rotation = np.stack([np.cross(y, z), y, z])
    return StageFromCamera(rotation, np.array([0.0, height, 0.0]) - rotation @ middle)


def _corners(sights: Sequence[BoardSight]) -> tuple[list[int], Floats]:
    """The corners that are seen often, and their median pixels. Raises PuppetError if they move."""
    counts: dict[int, list[Floats]] = {}
    for sight in sights:
        for number, corner in sight.corners.items():
            counts.setdefault(number, []).append(corner)
    often = sorted(n for n, at in counts.items() if len(at) >= OFTEN * len(sights))
    squares = [n for n in often if n < 100]
    numbers = squares if len(squares) >= LEAST else often
    if numbers:
        wander = [np.linalg.norm(np.std(counts[n], axis=0)) for n in numbers]
        if float(np.median(wander)) > WANDER:
            raise PuppetError(
                "the board or the camera moves",
                expected="both standing still while the shots are taken",
                found=f"corners that wander by {float(np.median(wander)):.1f} pixels",
                hint="lay the board down, or fix it to something",
            )
    return numbers, np.array([np.median(counts[n], axis=0) for n in numbers]).reshape(-1, 2)


def _solve(
    points: Floats, pixels: Floats, keep: Floats, lens: Intrinsics, up: Floats | None
) -> tuple[Floats, Floats, Floats]:
    """lens_from_board, (3, 3) and (3,), and the pixels (N,) by which each corner is off."""
    _, turns, shifts, errors = cv2.solvePnPGeneric(
        points[keep], pixels[keep], _matrix(lens), None, flags=cv2.SOLVEPNP_IPPE
    )
    ways = list(range(len(turns)))
    wrong = np.ravel(errors)
    if len(ways) > 1 and up is not None and wrong.max() < CLEAR * wrong.min():
        # Level or upright, whichever is nearer: that is how boards are placed.
        def askew(way: int) -> float:
            normal = _FLIP @ np.asarray(cv2.Rodrigues(turns[way])[0], float)[:, 2]
            angle = angle_between(normal, up)
            return min(angle, abs(angle - math.pi / 2.0))

        way = min(ways, key=askew)
    else:
        way = int(wrong.argmin())
    turn, shift = cv2.solvePnPRefineLM(
        points[keep], pixels[keep], _matrix(lens), None, turns[way], shifts[way]
    )
    rotation, place = np.asarray(cv2.Rodrigues(turn)[0], float), np.asarray(shift, float).ravel()
    off = np.linalg.norm(lens.pixels(points @ rotation.T + place) - pixels, axis=1)
    return rotation, place, np.asarray(off)


def _errors(
    points: Floats, rotation: Floats, shift: Floats, lens: Intrinsics, error: float
) -> tuple[float, float]:
    """Radians and metres (one standard deviation) by which a pose is unsure."""
    turn = cv2.Rodrigues(rotation)[0]
    jacobian = np.asarray(cv2.projectPoints(points, turn, shift, _matrix(lens), None)[1])[:, :6]
    spread = np.linalg.pinv(jacobian.T @ jacobian) * (error * error / 2.0)
    return math.sqrt(float(np.trace(spread[:3, :3]))), math.sqrt(float(np.trace(spread[3:, 3:])))


def _matrix(lens: Intrinsics) -> Floats:
    return np.array(
        [[lens.focal_x, 0.0, lens.centre_x], [0.0, lens.focal_y, lens.centre_y], [0.0, 0.0, 1.0]]
    )
