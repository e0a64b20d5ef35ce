"""The pictures of a calibration: one for each step, and one that always shows how it is now."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from puppet.errors import UnavailableError
from puppet.skeleton import Moment
from puppet.tracking.calibration.annotate import draw_caption, draw_skeleton
from puppet.tracking.calibration.annotate_stage import draw_board, draw_floor, draw_stage
from puppet.tracking.calibration.board_pose import BoardPose
from puppet.tracking.calibration.stage_frame import StageFromCamera
from puppet.tracking.cameras.camera import Image, Shot
from puppet.tracking.cameras.intrinsics import Intrinsics

#: Pixels of the longer side of a picture.
LARGEST: Final = 1280
#: Seconds between two pictures of how it is now.
EVERY: Final = 0.5
NOW: Final = "now"


class StagePictures:
    """Writes pictures into a folder, each replaced in one go."""

    def __init__(self, folder: Path, camera: str = "") -> None:
        """camera: what tells several cameras' pictures apart."""
        self.folder = folder
        self._prefix = f"{camera}-" if camera else ""
        self._due = float("-inf")

    def keep(self, name: str, image: Image) -> Path:
        """Write a picture. Raises UnavailableError if that is not possible."""
        path = self.folder / f"{self._prefix}{name}.png"
        try:
            self.folder.mkdir(exist_ok=True)
            part = path.with_name(f".{path.name}.part")
            part.write_bytes(cv2.imencode(".png", image)[1].tobytes())
            part.replace(path)
        except OSError as error:
            raise UnavailableError(
                "the picture cannot be written", where=path, found=error.strerror or str(error)
            ) from None
        return path

    def due(self, time: float) -> bool:
        """Whether it is time for another picture of how it is now. time: the shot's, s."""
        if time < self._due:
            return False
        self._due = time + EVERY
        return True


def picture(
    shot: Shot,
    captions: Sequence[str],
    *,
    moment: Moment | None = None,
    floor: StageFromCamera | None = None,
    centre: tuple[float, float] = (0.0, 0.0),
    stage: StageFromCamera | None = None,
    board: BoardPose | None = None,
) -> Image:
    """A shot with what is known drawn over it.

    moment: who is seen, in the camera's axes. floor: where the floor is; about `centre` (x, z) on
    it a grid is drawn. stage: its origin and front are drawn as well.
    """
    height, width = shot.colour.shape[:2]
    lens = shot.intrinsics or Intrinsics.assumed(width, height)
    factor = min(1.0, LARGEST / max(width, height))
    image: Image = np.asarray(
        cv2.resize(shot.colour, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA), np.uint8
    )
    lens = lens.resized(factor)
    if stage is not None or floor is not None:
        draw_floor(image, stage or floor or StageFromCamera(), lens, centre)
    if board is not None:
        draw_board(image, board, lens)
    if stage is not None:
        draw_stage(image, stage, lens)
    for frame in moment.frames if moment is not None else ():
        draw_skeleton(image, frame.positions, frame.states, lens)
    draw_caption(image, captions)
    return image
