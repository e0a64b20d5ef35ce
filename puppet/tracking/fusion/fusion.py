"""Several calibrated cameras, one stage: what each sees of a performer becomes one skeleton.

    fusion = Fusion()
    fused = fusion.add("left", moment, time.monotonic())  # None: it will count with the next

No latency is added: one camera leads, and each of its moments is answered when it comes. The others
add what they saw last, moved on by its velocity, and are believed the less the older it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from puppet.kernel import Floats
from puppet.skeleton import JOINT_COUNT, Moment, SkeletonFrame
from puppet.tracking.fusion.clock import Heard
from puppet.tracking.fusion.lead import Lead
from puppet.tracking.fusion.match import Matching
from puppet.tracking.fusion.memory import Lenses


@dataclass(frozen=True, slots=True)
class FusionConfig:
    """What is known of the cameras.

    camera_positions: (3,) metres in the stage frame, where each camera stands, by its name; of one
    that is not here it is not known in which direction it is to be trusted. depth_cameras: those
    that measure depth. across, along: standard deviations, metres, of a tracked joint on its body,
    across and along the line of sight of a camera without depth; body_across, body_along: of the
    place of the whole body. measured: of all of these with depth.
    """

    camera_positions: Mapping[str, ArrayLike] = field(default_factory=dict)
    depth_cameras: frozenset[str] = frozenset()
    across: float = 0.02
    along: float = 0.08
    body_across: float = 0.03
    body_along: float = 0.12
    measured: float = 0.025


class Fusion:
    """Moments of several cameras in, fused moments out, on one clock that only runs forward.

    With one camera its own moments come out. Otherwise performers have numbers of their own, which
    stay while any camera sees them. Positions must be in the common stage frame.
    """

    def __init__(self, config: FusionConfig | None = None) -> None:
        self._config = config or FusionConfig()
        self._lead = Lead()
        self._matching = Matching()
        self._slots: dict[str, int] = {}
        self._times: dict[str, float] = {}
        self._places: dict[str, Floats] = {
            camera: np.asarray(place, float).reshape(3)
            for camera, place in self._config.camera_positions.items()
        }
        self._with_depth = set(self._config.depth_cameras)
        self._lenses = self._lenses_now()
        self._time = -np.inf
        self._sequence = -1

    @property
    def lead(self) -> str | None:
        """The camera whose moments are answered."""
        return self._lead.camera

    def place_camera(self, camera: str, position: ArrayLike | None, depth: bool = False) -> None:
        """Say, or say anew, where a camera stands, (3,) metres, and whether it measures depth."""
        self._places.pop(camera, None)
        self._with_depth.discard(camera)
        if position is not None:
            self._places[camera] = np.asarray(position, float).reshape(3)
        if depth:
            self._with_depth.add(camera)
        self._lenses = self._lenses_now()

    @staticmethod
    def warm_up() -> None:
        """Compile what two cameras need, which takes seconds on a new machine."""
        fusion = Fusion()
        frame = SkeletonFrame(
            0.0, 0, 0, np.zeros((JOINT_COUNT, 3)), np.full(JOINT_COUNT, 2, np.uint8)
        )
        for time in (0.0, 0.01, 0.02):
            for camera in ("one", "other"):
                fusion.add(camera, Moment(0.0, 0, (frame,)).at(time, 1), time)

    def add(self, camera: str, moment: Moment, arrived: float) -> Moment | None:
        """What a camera sees, and when it came (monotonic seconds) → what all of them see.

        None if it adds to the next moment of the leading camera, or came too late for that.
        """
        heard, time = self._lead.hear(camera, moment.time, arrived)
        if heard is Heard.LATE:
            return None
        slot = self._slot_of(camera)
        if heard is Heard.RESTARTED and not self._lead.alone:
            self._matching.forget_numbers(slot)
        step = moment.time - self._times.get(camera, np.inf)
        self._times[camera] = moment.time
        self._matching.take_in(slot, moment.frames, time, step)
        if not self._lead.answers(camera, arrived) or time <= self._time:
            return None
        self._time = time
        alone = self._lead.alone
        self._sequence = max(self._sequence + 1, moment.sequence if alone else 0)
        performers = sorted(self._matching.performers, key=lambda one: one.number)
        frames = [one.at(time, self._sequence, self._lenses) for one in performers]
        if alone:
            return moment.at(time, self._sequence)
        return Moment(time, self._sequence, tuple(frame for frame in frames if frame is not None))

    def _slot_of(self, camera: str) -> int:
        if camera not in self._slots:
            self._slots[camera] = self._matching.add_camera()
            self._lenses = self._lenses_now()
        return self._slots[camera]

    def _lenses_now(self) -> Lenses:
        config, cameras = self._config, list(self._slots)

        def either(depth: float, colour: float) -> Floats:
            return np.array([depth if name in self._with_depth else colour for name in cameras])

        return Lenses(
            np.array([self._places.get(name, np.zeros(3)) for name in cameras]).reshape(-1, 3),
            np.array([name in self._places for name in cameras], np.int32),
            either(config.measured, config.across),
            either(config.measured, config.along),
            either(config.measured, config.body_across),
            either(config.measured, config.body_along),
        )
