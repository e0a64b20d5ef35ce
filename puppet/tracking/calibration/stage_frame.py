"""Where a camera stands on the stage, and where the stage's own origin and front are.

The camera's axes: x to the right in its image, y up in its image, z from the scene to the camera.
The stage's: +Y up from the floor at y = 0, +Z to the audience, +X to the left of who faces it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from puppet.kernel import Floats
from puppet.mapping.stance import Stance, heading_of, stance_of
from puppet.skeleton import Joint


@dataclass(frozen=True, slots=True, eq=False)
class StageFromCamera:
    """A rigid motion: stage = rotation @ camera + shift.

    rotation: (3, 3). shift: (3,) metres, which is where the lens is on the stage.
    """

    rotation: Floats = field(default_factory=lambda: np.eye(3))
    shift: Floats = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def of(cls, quaternion: Sequence[float], shift: ArrayLike) -> StageFromCamera:
        """From a quaternion xyzw, of any length but 0, and a shift (3,)."""
        matrix = Rotation.from_quat(np.asarray(quaternion, float)).as_matrix()
        return cls(np.asarray(matrix), np.asarray(shift, float))

    @property
    def quaternion(self) -> Floats:
        """(4,) the rotation, xyzw, w >= 0."""
        return np.asarray(Rotation.from_matrix(self.rotation).as_quat(canonical=True))

    @property
    def up(self) -> Floats:
        """(3,) the stage's up in the camera's axes."""
        return np.asarray(self.rotation[1])

    def to_stage(self, points: Floats) -> Floats:
        """(N, 3) metres, the camera's axes -> the stage frame."""
        return np.asarray(points @ self.rotation.T + self.shift)

    def to_camera(self, points: Floats) -> Floats:
        """(N, 3) metres, the stage frame -> the camera's axes."""
        return np.asarray((points - self.shift) @ self.rotation)

    def with_mark(self, x: float, z: float, heading: float) -> StageFromCamera:
        """The same camera on a stage whose origin is at (x, 0, z) of this one and whose front is
        at `heading` (radians about +Y from +Z)."""
        turn = Rotation.from_euler("y", -heading).as_matrix()
        return StageFromCamera(turn @ self.rotation, turn @ (self.shift - (x, 0.0, z)))


def mark_of(positions: Floats) -> tuple[float, float, float]:
    """Where somebody stands and which way they face: x and z, metres, and heading, radians.

    positions: (20, 3), the stage frame.
    """
    x, _, z = positions[Joint.HIP_CENTER]
    return float(x), float(z), float(heading_of(positions))


def joints_of(stance: Stance) -> Floats:
    """(20, 3) metres, the stage frame: the joints of a stance where it was taken."""
    turn = Rotation.from_euler("y", stance.heading)
    return np.asarray(turn.apply(np.array(stance.joints)) + stance.hip)


def at_mark(stance: Stance, x: float, z: float, heading: float) -> Stance:
    """The stance on a stage with that mark; see `StageFromCamera.with_mark`."""
    turn = Rotation.from_euler("y", -heading)
    return stance_of(np.asarray(turn.apply(joints_of(stance) - (x, 0.0, z))))


def angle_between(a: Floats, b: Floats) -> float:
    """Radians between two directions (3,), of any length but 0."""
    cosine = float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b))
    return math.acos(min(max(cosine, -1.0), 1.0))
