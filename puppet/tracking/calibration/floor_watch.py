"""The floor from a camera's depth images, over time: looked for until it is sure, then left alone.

Whatever happens later in the show, it stays: a camera that is moved has to be calibrated anew.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from puppet.kernel import Floats
from puppet.tracking.calibration.floor_plane import FloorPlane, find_floor
from puppet.tracking.calibration.stage_frame import angle_between
from puppet.tracking.cameras.camera import Shot
from puppet.tracking.cameras.intrinsics import Intrinsics

#: Seconds between two looks, while the floor is not sure.
PAUSE: Final = 0.4
#: So many planes that agree make it sure, of so many that were found last.
AGREE: Final = 4
KEPT: Final = 8
#: Planes agree that differ by so many radians and metres at most.
TURN: Final = math.radians(3.0)
LIFT: Final = 0.08
#: A plane counts from this confidence on.
CONFIDENT: Final = 0.5


class FloorWatch:
    """Watches one camera's shots for the floor.

    plane: the best guess so far; None while no floor was found. sure: whether it is final.
    """

    def __init__(self) -> None:
        self.plane: FloorPlane | None = None
        self.sure = False
        self._found: list[FloorPlane] = []
        self._due = -math.inf

    def look(self, shot: Shot, up: Floats | None = None, within: float | None = None) -> bool:
        """Take a shot in. True if the plane is another one now. up, within: as in `find_floor`."""
        if self.sure or shot.depth is None or shot.time < self._due:
            return False
        self._due = shot.time + PAUSE
        height, width = shot.colour.shape[:2]
        lens = shot.intrinsics or Intrinsics.assumed(width, height)
        found = find_floor(shot.depth, lens.resized(shot.depth.shape[1] / width), up, within)
        if found is None or found.confidence < CONFIDENT:
            return False
        self._found = [*self._found[1 - KEPT :], found]
        alike = max(([p for p in self._found if _agree(p, q)] for q in self._found), key=len)
        normal = np.mean([plane.normal for plane in alike], axis=0)
        best = max(alike, key=lambda plane: plane.confidence)
        self.plane = FloorPlane(
            normal / np.linalg.norm(normal),
            float(np.mean([plane.height for plane in alike])),
            best.share,
            best.area,
            best.spread,
            best.confidence,
        )
        self.sure = len(alike) >= AGREE
        return True


def _agree(a: FloorPlane, b: FloorPlane) -> bool:
    return angle_between(a.normal, b.normal) < TURN and abs(a.height - b.height) < LIFT
