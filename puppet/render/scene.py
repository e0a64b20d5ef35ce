"""What is drawn, as plain data: nothing here knows of GL, files or the bus."""

from __future__ import annotations

import math
from collections.abc import Mapping
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
    performer: whom to draw beside the puppets, or None.
    performer_offset: metres, performer_yaw: radians about +Y; world_from_stage of the performer.
    status: what the overlay says; None for no overlay.
    show_pairs: whether mapped bones are marked on the puppets.
    """

    poses: Mapping[str, Pose] = field(default_factory=lambda: MappingProxyType({}))
    performer: SkeletonFrame | None = None
    performer_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    performer_yaw: float = 0.0
    camera: Camera = Camera()
    status: Status | None = None
    show_pairs: bool = True

    @property
    def performer_joints(self) -> Floats | None:
        """(20, 3) metres in the world, or None if nobody is drawn."""
        if self.performer is None or not self.performer.present:
            return None
        sine, cosine = math.sin(self.performer_yaw), math.cos(self.performer_yaw)
        turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
        joints: Floats = self.performer.positions @ turn.T + self.performer_offset
        return joints

    @property
    def tracked(self) -> int:
        """How many of the 20 joints are tracked."""
        if self.performer is None:
            return 0
        return int((self.performer.states == TrackingState.TRACKED).sum())

    @property
    def state(self) -> TrackingState:
        """In one word: nobody there, partly inferred, or well tracked (15 joints or more)."""
        if self.performer is None or not self.performer.present:
            return TrackingState.NOT_TRACKED
        enough = self.tracked >= _TRACKED_ENOUGH
        return TrackingState.TRACKED if enough else TrackingState.INFERRED
