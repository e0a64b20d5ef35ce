"""One performer in one camera: from landmarks, frame after frame, to joints and their states.

landmarks ──▶ sides (front or back?) ──▶ lift (metres)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.tracking.blazepose import Landmarks
from puppet.tracking.camera import Shot
from puppet.tracking.intrinsics import Intrinsics
from puppet.tracking.lift import Lift
from puppet.tracking.sides import LookAgain, Sides


class Body:
    """The memory of one performer's body."""

    def __init__(self) -> None:
        self._sides = Sides()
        self._lift: Lift | None = None
        self._lens: tuple[Intrinsics, int, int] | None = None

    def joints(
        self, landmarks: Landmarks, shot: Shot, look_again: LookAgain
    ) -> tuple[Floats, NDArray[np.uint8]]:
        """Positions (20, 3), metres from the lens, and states (20,).

        Axes: x to the right in the image, y up in the image, z from the scene to the camera.
        look_again: gives the landmarks in the same shot with the region turned by an angle (rad).
        """
        height, width = shot.colour.shape[:2]
        lens = shot.intrinsics or Intrinsics.assumed(width, height)
        if self._lift is None or self._lens != (lens, width, height):
            self._lens = (lens, width, height)
            self._lift = Lift(lens, width, height)
        seen = self._sides.keep(landmarks, shot.time, look_again)
        return self._lift.joints(seen, shot.time)
