"""A printed ChArUco board: finding it in images, and where it is before a camera.

The board's axes: x to the right and y up as it is printed, z out of the paper; the origin is its
middle. Several cameras that see the same board, where it lies or stands, share one stage by it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import cv2
import numpy as np

from puppet.kernel import Floats
from puppet.tracking.cameras.camera import Image

COLUMNS, ROWS = 5, 3
#: Markers of 4×4 cells have the largest cells, and are seen from farthest away.
DICTIONARY: Final = cv2.aruco.DICT_4X4_50
#: A marker's side as a part of its square's.
MARKER: Final = 0.76
#: Corners of squares are exact; corners of markers stand in where there are fewer than this.
ENOUGH: Final = 6
#: A marker at least so large, as a part of the image, is looked for.
SMALLEST: Final = 0.015
#: Pixels that a marker's corners may be off from where all the others say that they are.
ASTRAY: Final = 3.0
#: The window in which a corner is refined, pixels: the white rim around markers at most, or their
#: corners would be in it as well.
WINDOWS: Final = (2, 11)


@dataclass(frozen=True)
class Board:
    """One size of the board. paper: what it is printed on. square: metres. first: its markers'
    first number, by which sizes are told apart."""

    paper: str
    page: tuple[float, float]
    square: float
    first: int

    @property
    def size(self) -> tuple[float, float]:
        """Metres across and up."""
        return COLUMNS * self.square, ROWS * self.square

    @property
    def numbers(self) -> range:
        """Its markers' numbers."""
        return range(self.first, self.first + COLUMNS * ROWS // 2)

    @cached_property
    def pattern(self) -> Any:
        """OpenCV's board of it; its own axes begin at the upper left, y down."""
        return cv2.aruco.CharucoBoard(
            (COLUMNS, ROWS),
            self.square,
            MARKER * self.square,
            cv2.aruco.getPredefinedDictionary(DICTIONARY),
            np.array(self.numbers, np.int32),
        )

    def points(self, corners: Any) -> Floats:
        """OpenCV's points of the pattern (N, 3), metres -> (N, 3) in the board's axes."""
        width, height = self.size
        pattern = np.asarray(corners, float).reshape(-1, 3)
        return np.column_stack(
            [pattern[:, 0] - width / 2, height / 2 - pattern[:, 1], np.zeros(len(pattern))]
        )


#: Page and squares in metres.
BOARDS: Final = (
    Board("A4", (0.297, 0.210), 0.054, 0),
    Board("A3", (0.420, 0.297), 0.077, 10),
    Board("A2", (0.594, 0.420), 0.109, 20),
)


@dataclass(frozen=True, slots=True, eq=False)
class BoardSight:
    """The board in one image: its corners, by their numbers, in pixels."""

    board: Board
    corners: dict[int, Floats]

    def points(self, numbers: Sequence[int]) -> Floats:
        """(N, 3) metres: where corners are on the board. 0.. are of squares, 100.. of markers."""
        pattern = self.board.pattern
        squares = np.asarray(pattern.getChessboardCorners()).reshape(-1, 3)
        markers = np.concatenate([np.reshape(four, (4, 3)) for four in pattern.getObjPoints()])
        return self.board.points(
            [squares[n] if n < 100 else markers[n - 100] for n in numbers],
        )


class BoardFinder:
    """Finds the board in images."""

    def __init__(self, square: float | None = None) -> None:
        """square: metres that a square really measures, if a printer has scaled the page."""
        self._boards = tuple(
            board if square is None else Board(board.paper, board.page, square, board.first)
            for board in BOARDS
        )
        parameters = cv2.aruco.DetectorParameters()
        parameters.minMarkerPerimeterRate = SMALLEST
        # Small, blurred markers are read by the middles of their cells. What is misread so does
        # not fit to the others.
        parameters.perspectiveRemovePixelPerCell = 8
        parameters.perspectiveRemoveIgnoredMarginPerCell = 0.3
        parameters.errorCorrectionRate = 1.0
        self._markers = cv2.aruco.ArucoDetector(
            cv2.aruco.getPredefinedDictionary(DICTIONARY), parameters
        )

    def find(self, image: Image) -> BoardSight | None:
        """The board in an image; None if fewer than two of its markers are seen. Of several, the
        one of which most is seen."""
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        quads = self._quads(grey)
        board = max(self._boards, key=lambda one: len(quads.keys() & set(one.numbers)))
        own = {n: quads[n] for n in board.numbers if n in quads}
        if len(own) < 2:
            return None
        seen = BoardSight(
            board,
            {
                100 + 4 * (n - board.first) + k: corner
                for n, quad in own.items()
                for k, corner in enumerate(quad)
            },
        )
        numbers = sorted(seen.corners)
        pixels = np.array([seen.corners[n] for n in numbers])
        plan, fits = cv2.findHomography(
            seen.points(numbers)[:, :2], pixels, cv2.RANSAC, ASTRAY, maxIters=500
        )
        if plan is None or int(fits.sum()) < 8:
            return None
        corners = _square_corners(grey, seen, own.keys(), np.asarray(plan, float))
        if len(corners) < ENOUGH:
            fitting = [n for n, fit in zip(numbers, np.ravel(fits), strict=True) if fit]
            corners |= {n: seen.corners[n] for n in fitting}
        return BoardSight(board, corners)

    def _quads(self, grey: Any) -> dict[int, Floats]:
        """The four corners (4, 2) of every marker that is seen, by its number."""
        found: dict[int, Floats] = {}
        for scale in (1, 2):  # small markers are read where their cells are a few pixels wide
            if scale == 2:
                if len(found) == COLUMNS * ROWS // 2:
                    break
                grey = cv2.resize(grey, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
            quads, numbers, _ = self._markers.detectMarkers(grey)
            for number, quad in zip([] if numbers is None else numbers.ravel(), quads, strict=True):
                # The middle of the first pixel is at 0 in either image.
                pixels = (np.reshape(np.asarray(quad, float), (4, 2)) + 0.5) / scale - 0.5
                found.setdefault(int(number), pixels)
        return found


def _square_corners(
    grey: Any, seen: BoardSight, markers: Collection[int], plan: Floats
) -> dict[int, Floats]:
    """Corners of squares, to parts of a pixel, near to where `plan` (3, 3), which leads from the
    board to pixels, has them; those at which none of the `markers` lies may be covered."""
    numbers = range((COLUMNS - 1) * (ROWS - 1))
    places = seen.points(numbers)[:, :2]
    pixels = _led(plan, places)
    rim = 0.5 * (1.0 - MARKER) * seen.board.square
    around = _led(plan, (places[:, None] + rim * np.array([(1, 0), (0, 1)])).reshape(-1, 2))
    rims = np.linalg.norm(around.reshape(-1, 2, 2) - pixels[:, None], axis=2).min(axis=1)
    height, width = grey.shape
    found: dict[int, Floats] = {}
    for n, (row, column) in enumerate(np.ndindex(ROWS - 1, COLUMNS - 1)):
        window = round(min(max(float(rims[n]), WINDOWS[0]), WINDOWS[1]))
        x, y = pixels[n]
        inside = window < x < width - 1 - window and window < y < height - 1 - window
        beside = {_marker_at(row + i, column + j) for i in (0, 1) for j in (0, 1)} - {None}
        if not inside or not any(seen.board.first + m in markers for m in beside if m is not None):
            continue
        start = pixels[n].astype(np.float32).reshape(1, 1, 2)
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 0.005)
        refined = cv2.cornerSubPix(grey, start.copy(), (window, window), (-1, -1), stop)
        corner = np.asarray(refined, float).reshape(2)
        if np.linalg.norm(corner - pixels[n]) < 2.0 * window:
            found[n] = corner
    return found


def _marker_at(row: int, column: int) -> int | None:
    """Which of the board's markers is in a square; None in a black one."""
    place = COLUMNS * row + column
    return place // 2 if place % 2 else None


def _led(plan: Floats, places: Floats) -> Floats:
    """(N, 2) metres on the board -> (N, 2) pixels."""
    homogeneous = np.column_stack([places, np.ones(len(places))]) @ plan.T
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])
