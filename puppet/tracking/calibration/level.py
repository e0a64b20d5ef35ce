"""Which way is up, and where the floor is: the one place that decides what tells it.

A saved calibration counts most; then the floor that a depth camera sees; then gravity, from an IMU,
together with feet; and then people alone. They stand upright on the whole, and at least one foot is
on the floor most of the time: that is enough, if nothing better is known.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from puppet.kernel import Floats
from puppet.rotation import rotate, swing
from puppet.skeleton import Joint, TrackingState
from puppet.tracking.calibration.floor_plane import LEARNT_WITHIN, FloorPlane
from puppet.tracking.calibration.stage_frame import StageFromCamera

#: The camera's own up counts as so many people standing; more than the most are forgotten.
PRIOR_COUNT: Final = 10.0
MOST_COUNT: Final = 1000.0
#: Whoever stands has trunk and both legs in one line: the cosine of the largest angle between.
STRAIGHT: Final = 0.9
#: The lower feet of so many frames are remembered. This part of them may be below the floor: they
#: are seen too low as often as too high, and now and then both are off the floor.
FEET_KEPT: Final = 600
BELOW_FLOOR: Final = 0.3
#: So many people standing are enough to say where up is about; and so many to forget, when it has
#: to be settled, that the camera was thought to be level.
ENOUGH_COUNT: Final = 40.0
SETTLED_COUNT: Final = 15.0
#: While it is still being learnt, the level moves by this part of the way at each frame.
FLOOR_STEP: Final = 0.05
#: From the floor to the hips, metres, for those whose feet were never seen.
HIP_HEIGHT: Final = 0.95

_STANDING: Final = [
    Joint.HIP_CENTER,
    Joint.SHOULDER_CENTER,
    Joint.HIP_LEFT,
    Joint.HIP_RIGHT,
    Joint.ANKLE_LEFT,
    Joint.ANKLE_RIGHT,
]
_FEET: Final = [Joint.FOOT_LEFT, Joint.FOOT_RIGHT]


class Level:
    """Turns a camera's axes until up is +Y, and lifts them until the floor is at y = 0.

    Both are of the camera: right-handed, x to the right in its image, z from the scene towards it,
    y about up. The camera's axis keeps its heading, so whoever faces the camera faces +Z; a saved
    calibration says itself where the front is. Nothing that is learnt moves the stage in one go
    while somebody is on it.
    """

    def __init__(
        self,
        up: ArrayLike | None = None,
        floor: float | None = None,
        *,
        saved: StageFromCamera | None = None,
    ) -> None:
        """up: (3,) in the camera's axes; any length. floor: metres from the floor up to the
        camera. What is None is learnt. saved: a calibration; then nothing is learnt."""
        self._saved = saved
        self._gravity = up is not None
        self._known_up = up is not None
        self._floor = floor
        self._known_floor = floor is not None
        direction = np.array([0.0, 1.0, 0.0] if up is None else up, float)
        self._sum = PRIOR_COUNT * direction / np.linalg.norm(direction)
        self._count = PRIOR_COUNT
        self._standing = np.zeros(3)
        self._stood = 0.0
        self._feet = np.zeros((FEET_KEPT, len(_FEET), 3))
        self._feet_seen = 0
        self._plane: FloorPlane | None = None
        self._occupied = False

    @property
    def up(self) -> Floats:
        """(3,) unit vector in the camera's axes."""
        if self._saved is not None:
            return self._saved.up
        return np.asarray(self._sum / np.linalg.norm(self._sum))

    @property
    def saved(self) -> bool:
        """Whether it was known from a calibration."""
        return self._saved is not None

    @property
    def fixed(self) -> bool:
        """Whether there is nothing to learn."""
        return self._saved is not None or (self._known_up and self._known_floor)

    @property
    def origin(self) -> str:
        """What tells the floor, for people."""
        if self._saved is not None:
            return "a saved calibration"
        if self._plane is not None:
            return "depth"
        if self._known_floor:
            return "a given height"
        if not self._feet_seen:
            return "a guess" if self._floor is None else "hips"
        return "gravity and feet" if self._gravity else "feet"

    @property
    def about_up(self) -> tuple[Floats | None, float | None]:
        """What to look for a floor in depth by: up in the camera's axes, and radians around it.

        None and None while there is nothing but the camera's own up.
        """
        if self._gravity:
            return self.up, None
        return (self.up, LEARNT_WITHIN) if self._count > ENOUGH_COUNT else (None, None)

    def see_floor(self, plane: FloorPlane) -> None:
        """Take the floor that depth shows for the truth; at once, if nobody was there before."""
        if self._saved is not None or self._known_floor:
            return
        self._plane = plane
        self._known_up = True
        if not self._occupied:
            self.settle()

    def observe(self, positions: Floats, states: NDArray[np.uint8]) -> None:
        """Learn from a performer: (20, 3) metres in the camera's axes, and their states (20,)."""
        if self.fixed:
            return
        self._occupied = True
        if self._plane is not None:
            self._approach(self._plane, FLOOR_STEP)
            return
        if not self._known_up:
            self._observe_up(positions, states)
        if not self._known_floor:
            feet = positions[_FEET][states[_FEET] != TrackingState.NOT_TRACKED]
            if len(feet):
                # One foot alone fills both places.
                self._feet[self._feet_seen % FEET_KEPT] = feet
                self._feet_seen += 1
            elif not self._feet_seen and self._floor is None:
                self._floor = HIP_HEIGHT - float(positions[Joint.HIP_CENTER] @ self.up)
            if self._feet_seen:
                target = self._learnt_floor()
                before = target if self._floor is None else self._floor
                self._floor = before + FLOOR_STEP * (target - before)

    def settle(self) -> None:
        """Take what was learnt so far for the truth at once."""
        if self._plane is not None:
            self._approach(self._plane, 1.0)
            return
        if not self._known_up and self._stood >= SETTLED_COUNT:
            self._sum = self._standing / self._stood
            self._count = max(self._count, PRIOR_COUNT)
        if self._feet_seen:
            self._floor = self._learnt_floor()

    def stage_from_camera(self) -> StageFromCamera:
        """Where the camera is now: above the stage's origin, unless a calibration says where."""
        if self._saved is not None:
            return self._saved
        up = self.up
        ahead = np.array([0.0, 0.0, 1.0]) - up[2] * up
        length = float(np.linalg.norm(ahead))
        if length > 0.1:
            z = ahead / length
            rotation = np.stack([np.cross(up, z), up, z])
        else:  # it looks straight up or down, and has no heading of its own
            turn = swing(up, np.array([0.0, 1.0, 0.0]))
            rotation = np.stack([rotate(turn, axis) for axis in np.eye(3)], axis=1)
        return StageFromCamera(rotation, np.array([0.0, self._floor or 0.0, 0.0]))

    def to_stage(self, positions: Floats) -> Floats:
        """(N, 3) metres, the camera's axes -> the stage frame."""
        return self.stage_from_camera().to_stage(positions)

    def _approach(self, plane: FloorPlane, share: float) -> None:
        """Go a share of the way from the level as it is to a plane."""
        up = self.up + share * (plane.normal - self.up)
        self._sum = self._count * up / np.linalg.norm(up)
        before = plane.height if self._floor is None else self._floor
        self._floor = before + share * (plane.height - before)

    def _observe_up(self, positions: Floats, states: NDArray[np.uint8]) -> None:
        if (states[_STANDING] == TrackingState.NOT_TRACKED).any():
            return
        hips, shoulders, left_hip, right_hip, left, right = positions[_STANDING]
        trunk = shoulders - hips
        legs = (left_hip - left, right_hip - right)
        if min(_cosine(trunk, leg) for leg in legs) < STRAIGHT:
            return
        along = shoulders - 0.5 * (left + right)
        self._stood += 1.0
        self._standing += along / np.linalg.norm(along)
        self._count = min(self._count + 1.0, MOST_COUNT)
        mean = self._sum / np.linalg.norm(self._sum)
        mean += (along / np.linalg.norm(along) - mean) / self._count
        self._sum = mean

    def _learnt_floor(self) -> float:
        """Metres from the floor up to the camera, as the feet remembered say."""
        lowest = (self._feet[: self._feet_seen] @ self.up).min(axis=1)
        return -float(np.quantile(lowest, BELOW_FLOOR))


def _cosine(a: Floats, b: Floats) -> float:
    return float(a @ b / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-9))
