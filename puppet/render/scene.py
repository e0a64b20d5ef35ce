"""What is drawn, as plain data: nothing here knows of GL, files or the bus."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from puppet.kernel import Floats
from puppet.mesh import Model
from puppet.pose import Pose
from puppet.render.camera import Camera
from puppet.skeleton import SkeletonFrame, TrackingState

#: Of the 20 joints, how many have to be seen before the state is called tracked.
_TRACKED_ENOUGH = 15


@dataclass(frozen=True, slots=True, eq=False)
class PuppetOnStage:
    """A puppet that pictures may show.

    pairs: bone index -> human bone index (0..16), for the colours of the mapping.
    """

    name: str
    model: Model
    pairs: Mapping[int, int] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True, slots=True)
class Status:
    """What the overlay says. None is not known, and not shown.

    fps: pictures a second. latency: seconds from the tracker to the picture.
    source: its name. notes: short words for people, "rehearsal · synthetic", "frozen".
    """

    fps: float | None = None
    latency: float | None = None
    source: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """The stage at one instant.

    poses: by the name of a puppet; a puppet without a pose is not drawn.
    performers: whom to draw beside the puppets; the first is the one that the status speaks of.
    idle: numbers of performers whom no puppet follows; they are drawn without colours.
    performer_offset: metres, performer_yaw: radians about +Y; world_from_stage of performers.
    status: what the overlay says; None for no overlay.
    show_pairs: whether mapped bones are marked on the puppets.
    """

    poses: Mapping[str, Pose] = field(default_factory=lambda: MappingProxyType({}))
    performers: Sequence[SkeletonFrame] = ()
    idle: Collection[int] = ()
    performer_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    performer_yaw: float = 0.0
    camera: Camera = Camera()
    status: Status | None = None
    show_pairs: bool = True

    @property
    def present(self) -> tuple[SkeletonFrame, ...]:
        """The performers who are there."""
        return tuple(frame for frame in self.performers if frame.present)

    def in_world(self, frame: SkeletonFrame) -> Floats:
        """(20, 3) metres in the world: where a performer's joints are drawn."""
        sine, cosine = math.sin(self.performer_yaw), math.cos(self.performer_yaw)
        turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
        joints: Floats = frame.positions @ turn.T + self.performer_offset
        return joints

    @property
    def tracked(self) -> int:
        """How many of the first performer's 20 joints are tracked."""
        if not self.present:
            return 0
        return int((self.present[0].states == TrackingState.TRACKED).sum())

    @property
    def state(self) -> TrackingState:
        """In one word: nobody there, partly inferred, or well tracked (15 joints or more)."""
        if not self.present:
            return TrackingState.NOT_TRACKED
        enough = self.tracked >= _TRACKED_ENOUGH
        return TrackingState.TRACKED if enough else TrackingState.INFERRED
