"""One performer in one camera: from landmarks, frame after frame, to joints and their states.

landmarks ──▶ limb swaps, sides (whose is what?) ──▶ lift (metres) ──▶ states (known how well?)
          ──▶ leaps (possible?) ──▶ bone lengths (the same body as before) ──▶ seated
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.tracking.body.bone_lengths import BoneLengths
from puppet.tracking.body.joint_states import JointStates
from puppet.tracking.body.leaps import Leaps
from puppet.tracking.body.lift import Lift
from puppet.tracking.body.limb_swaps import LimbSwaps
from puppet.tracking.body.seated import seated
from puppet.tracking.body.sides import LookAgain, Sides
from puppet.tracking.cameras.camera import Shot
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.people.blazepose import Landmarks


class Body:
    """The memory of one performer's body."""

    def __init__(self, seated: bool = False) -> None:
        """seated: only the upper body counts."""
        self._seated = seated
        self._sides = Sides()
        self._swaps = LimbSwaps()
        self._lift = Lift()
        self._states = JointStates()
        self._leaps = Leaps()
        self._lengths = BoneLengths()

    def joints(
        self, landmarks: Landmarks, shot: Shot, look_again: LookAgain
    ) -> tuple[Floats, NDArray[np.uint8]]:
        """Positions (20, 3), metres from the lens, and states (20,).

        Axes: x to the right in the image, y up in the image, z from the scene to the camera.
        look_again: gives the landmarks in the same shot with the region turned by an angle (rad).
        """
        height, width = shot.colour.shape[:2]
        lens = shot.intrinsics or Intrinsics.assumed(width, height)
        seen = self._swaps.undone(landmarks, shot.time)
        seen = self._sides.keep(seen, shot.time, look_again)
        self._swaps.keep(seen, shot.time)
        lifted = self._lift(seen, shot, lens)
        states = self._states(seen, lifted.hidden, (width, height), shot.time)
        positions, states = self._leaps.held_back(lifted.positions, states, shot.time)
        positions = self._lengths(
            positions, states, shot.time, size=self._lift.size, measured=lifted.measured
        )
        if self._seated:
            lengths = self._lengths.lengths * self._lift.size
            positions, states = seated(positions, states, _up(shot), lengths)
        return positions, states


def _up(shot: Shot) -> Floats:
    """The direction of up in the camera's axes; that of the image if nothing better is known."""
    if shot.up is None:
        return np.array([0.0, 1.0, 0.0])
    up = shot.up * (1.0, -1.0, -1.0)
    return np.asarray(up / max(float(np.linalg.norm(up)), 1e-9))
