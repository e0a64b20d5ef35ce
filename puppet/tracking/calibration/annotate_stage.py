"""Drawing the stage over a camera's image: its floor, its origin and front, and the board."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from puppet.kernel import Floats
from puppet.tracking.calibration.annotate import Colour, draw_path, line_width, pixels_of
from puppet.tracking.calibration.board_pose import BoardPose
from puppet.tracking.calibration.stage_frame import StageFromCamera
from puppet.tracking.cameras.camera import Image
from puppet.tracking.cameras.intrinsics import Intrinsics

#: BGR.
GRID: Final[Colour] = (200, 200, 90)
LEFT_AXIS: Final[Colour] = (70, 70, 235)
UP_AXIS: Final[Colour] = (90, 210, 90)
FRONT_AXIS: Final[Colour] = (240, 150, 60)
BOARD: Final[Colour] = (80, 220, 255)
#: Metres between the lines of the floor, and from its middle to its edge.
STEP: Final = 0.5
REACH: Final = 2.0


def draw_floor(
    image: Image,
    stage_from_camera: StageFromCamera,
    intrinsics: Intrinsics,
    centre: tuple[float, float] = (0.0, 0.0),
) -> None:
    """A grid on the floor, half a metre wide, about a place (x, z) of the stage."""
    middle = np.array([centre[0], 0.0, centre[1]])
    width = 0.5 * line_width(image)
    along = np.linspace(-REACH, REACH, 33)
    for offset in np.arange(-REACH, REACH + 0.5 * STEP, STEP):
        across = np.full_like(along, offset)
        nothing = np.zeros_like(along)
        for line in ((along, nothing, across), (across, nothing, along)):
            points = stage_from_camera.to_camera(np.stack(line, axis=1) + middle)
            draw_path(image, points, intrinsics, GRID, width)


def draw_stage(image: Image, stage_from_camera: StageFromCamera, intrinsics: Intrinsics) -> None:
    """The stage's origin with a cross on the floor, its up, and an arrow to its front."""
    width = line_width(image)
    to_camera = stage_from_camera.to_camera
    head = [(-0.12, 0.0, 0.72), (0.0, 0.0, 0.95), (0.12, 0.0, 0.72)]
    for colour, line in (
        (LEFT_AXIS, [(0.0, 0.0, 0.0), (0.4, 0.0, 0.0)]),
        (UP_AXIS, [(0.0, 0.0, 0.0), (0.0, 0.4, 0.0)]),
        (FRONT_AXIS, [(0.0, 0.0, 0.0), (0.0, 0.0, 0.95)]),
        (FRONT_AXIS, head),
    ):
        points = to_camera(np.array(line))
        draw_path(image, points, intrinsics, (25, 25, 25), 2.2 * width)
        draw_path(image, points, intrinsics, colour, 1.4 * width)
    _label(image, to_camera(np.array([(0.0, 0.0, 1.1)])), intrinsics, "front", FRONT_AXIS)
    _label(image, to_camera(np.array([(0.5, 0.0, 0.0)])), intrinsics, "left", LEFT_AXIS)


def draw_board(image: Image, pose: BoardPose, intrinsics: Intrinsics) -> None:
    """The outline of a board where it was found, and the side that is its lower edge doubly."""
    x, y = 0.5 * pose.board.size[0], 0.5 * pose.board.size[1]
    corners = np.array([(-x, y, 0.0), (x, y, 0.0), (x, -y, 0.0), (-x, -y, 0.0), (-x, y, 0.0)])
    camera = corners @ pose.rotation.T + pose.shift
    width = line_width(image)
    draw_path(image, camera, intrinsics, BOARD, width)
    draw_path(image, camera[2:4], intrinsics, BOARD, 2.5 * width)


def _label(image: Image, place: Floats, intrinsics: Intrinsics, text: str, colour: Colour) -> None:
    if place[0, 2] > -0.1:
        return
    x, y = pixels_of(place, intrinsics)[0].tolist()
    if not (abs(x) < 1e5 and abs(y) < 1e5):
        return
    width = line_width(image)
    for ink, pen in (((25, 25, 25), 2.4), (colour, 1.0)):
        cv2.putText(
            image,
            text,
            (round(x), round(y)),
            cv2.FONT_HERSHEY_SIMPLEX,
            0.22 * width + 0.2,
            ink,
            max(1, round(pen * 0.6 * width)),
            cv2.LINE_AA,
        )
