"""What a camera of known pose sees of the printed board."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from PIL import Image as Pictures
from scipy.spatial.transform import Rotation

from puppet.kernel import Floats
from puppet.tracking.calibration.board import BOARDS, Board
from puppet.tracking.calibration.board_print import page
from puppet.tracking.calibration.stage_frame import StageFromCamera
from puppet.tracking.cameras.camera import Image
from puppet.tracking.cameras.intrinsics import Intrinsics

WIDTH, HEIGHT = 1280, 720
LENS = Intrinsics.assumed(WIDTH, HEIGHT, 1000.0)
A4, A3 = BOARDS[0], BOARDS[1]
#: A printed page at so many dots a metre.
DOTS = 3000.0


@lru_cache
def printed(board: Board) -> Image:
    width, height = (round(side * DOTS) for side in board.page)
    return np.asarray(page(board).resize((width, height), Pictures.Resampling.BOX))


def seen(
    board: Board,
    rotation: Floats,
    shift: Floats,
    *,
    seed: int = 0,
    noise: float = 3.0,
    blur: float = 0.7,
    hide: float = 0.0,
    lens: Intrinsics = LENS,
) -> Image:
    """What a camera sees of the page, whose board is at camera = rotation @ board + shift."""
    sheet = printed(board)
    # From dots of the page to metres on the board, whose middle is where the page says.
    left = 0.5 * board.page[0]
    top = 0.4 * (board.page[1] - board.size[1]) + 0.5 * board.size[1]
    board_from_dots = np.array(
        [[1 / DOTS, 0, 0.5 / DOTS - left], [0, -1 / DOTS, top - 0.5 / DOTS], [0, 0, 1]]
    )
    flip = np.diag([1.0, -1.0, -1.0])
    lens_from_board = np.column_stack([(flip @ rotation)[:, :2], flip @ shift])
    fine = 4  # finer pixels, whose means are those of the camera
    camera = np.diag([lens.focal_x, lens.focal_y, 1.0])
    camera[:2, 2] = lens.centre_x, lens.centre_y
    finer = np.array([[fine, 0, 0.5 * fine - 0.5], [0, fine, 0.5 * fine - 0.5], [0, 0, 1]])
    whole = finer @ camera @ lens_from_board @ board_from_dots
    size = (fine * WIDTH, fine * HEIGHT)
    image = cv2.warpPerspective(sheet, whole, size, borderValue=(90, 90, 90))
    image = cv2.resize(image, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    pixels = cv2.GaussianBlur(image, (0, 0), blur).astype(float) if blur else image.astype(float)
    if hide:
        middle = lens.pixels((flip @ shift)[None])[0]
        pixels[:, int(middle[0] + (0.5 - hide) * 0.5 * WIDTH) :] = 120
    pixels += np.random.default_rng(seed).normal(0.0, noise, pixels.shape)
    grey = np.clip(pixels, 0, 255).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def camera_at(
    eye: tuple[float, float, float], at: tuple[float, float, float], roll: float = 0.0
) -> StageFromCamera:
    """A camera on the stage that looks at a place."""
    back = np.subtract(eye, at) / np.linalg.norm(np.subtract(eye, at))
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    rotation = np.column_stack([right, np.cross(back, right), back])
    turn = Rotation.from_rotvec(roll * back).as_matrix()
    return StageFromCamera(turn @ rotation, np.array(eye))


#: Where a board lies on the stage, its lower edge to the audience: stage = LYING @ board.
LYING = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])


def view(
    stage_from_camera: StageFromCamera, stage_from_board: Floats, middle: Floats
) -> tuple[Floats, Floats]:
    camera_from_stage = stage_from_camera.rotation.T
    return camera_from_stage @ stage_from_board, stage_from_camera.to_camera(middle[None])[0]
