"""The tracked human: 20 joints in Kinect v1 order, and the 17-bone graph used for mapping.

Positions are metres in the stage frame: right-handed, +Y up, the performer faces +Z and has the
left hand towards +X. Every source converts to it once.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray


class Joint(IntEnum):
    """The 20 joints in the order of the Kinect SDK v1."""

    HIP_CENTER = 0
    SPINE = 1
    SHOULDER_CENTER = 2
    HEAD = 3
    SHOULDER_LEFT = 4
    ELBOW_LEFT = 5
    WRIST_LEFT = 6
    HAND_LEFT = 7
    SHOULDER_RIGHT = 8
    ELBOW_RIGHT = 9
    WRIST_RIGHT = 10
    HAND_RIGHT = 11
    HIP_LEFT = 12
    KNEE_LEFT = 13
    ANKLE_LEFT = 14
    FOOT_LEFT = 15
    HIP_RIGHT = 16
    KNEE_RIGHT = 17
    ANKLE_RIGHT = 18
    FOOT_RIGHT = 19


class TrackingState(IntEnum):
    """What the tracker knows of a joint."""

    NOT_TRACKED = 0
    INFERRED = 1
    TRACKED = 2


JOINT_COUNT: Final = len(Joint)
JOINT_NAMES: Final = tuple(joint.name.lower() for joint in Joint)
#: The joint that each joint hangs on; -1 for the hip centre.
JOINT_PARENTS: Final = (-1, 0, 1, 2, 2, 4, 5, 6, 2, 8, 9, 10, 0, 12, 13, 14, 0, 16, 17, 18)


@dataclass(frozen=True, slots=True)
class HumanBone:
    """One node of the human graph: its parent there, and the two joints that it runs between."""

    name: str
    parent: int
    start: Joint
    end: Joint


def _human_bones() -> tuple[HumanBone, ...]:
    bones = [
        HumanBone("pelvis", -1, Joint.HIP_CENTER, Joint.SPINE),
        HumanBone("chest", 0, Joint.SPINE, Joint.SHOULDER_CENTER),
        HumanBone("head", 1, Joint.SHOULDER_CENTER, Joint.HEAD),
    ]
    for side, word in (("R", "RIGHT"), ("L", "LEFT")):
        shoulder, elbow, wrist, hand = (
            Joint[f"{name}_{word}"] for name in ("SHOULDER", "ELBOW", "WRIST", "HAND")
        )
        first = len(bones)
        bones += [
            HumanBone(f"shoulder.{side}", 1, Joint.SHOULDER_CENTER, shoulder),
            HumanBone(f"upper_arm.{side}", first, shoulder, elbow),
            HumanBone(f"forearm.{side}", first + 1, elbow, wrist),
            HumanBone(f"hand.{side}", first + 2, wrist, hand),
        ]
    for side, word in (("R", "RIGHT"), ("L", "LEFT")):
        hip, knee, ankle, foot = (
            Joint[f"{name}_{word}"] for name in ("HIP", "KNEE", "ANKLE", "FOOT")
        )
        first = len(bones)
        bones += [
            HumanBone(f"thigh.{side}", 0, hip, knee),
            HumanBone(f"shin.{side}", first, knee, ankle),
            HumanBone(f"foot.{side}", first + 1, ankle, foot),
        ]
    return tuple(bones)


#: The 17 bones of the human graph, in the order of Sanna 2015, appendix A.
HUMAN_BONES: Final = _human_bones()
HUMAN_BONE_NAMES: Final = tuple(bone.name for bone in HUMAN_BONES)
HUMAN_PARENTS: Final = tuple(bone.parent for bone in HUMAN_BONES)


def _ones() -> NDArray[np.float64]:
    return np.ones(JOINT_COUNT)


@dataclass(frozen=True, slots=True, eq=False)
class SkeletonFrame:
    """One performer at one instant.

    time: capture time in seconds on the source's own clock; it never runs backwards in a source.
    sequence: counts the frames of a source; a gap is a frame that was lost.
    performer: who this is, as far as the tracker can tell.
    positions: (20, 3) metres, stage frame. Where the state is not tracked the value means nothing.
    states: (20,) `TrackingState`.
    influence: (20,) in 0..1, how far each joint may move a puppet; sources leave it at 1, and
        conditioning takes it down for joints that were lost.
    """

    time: float
    sequence: int
    performer: int
    positions: NDArray[np.float64]
    states: NDArray[np.uint8]
    influence: NDArray[np.float64] = field(default_factory=_ones)

    def __post_init__(self) -> None:
        if self.positions.shape != (JOINT_COUNT, 3) or self.states.shape != (JOINT_COUNT,):
            raise ValueError(
                f"a skeleton has positions ({JOINT_COUNT}, 3) and states ({JOINT_COUNT},), "
                f"not {self.positions.shape} and {self.states.shape}"
            )

    @property
    def present(self) -> bool:
        """Whether anybody is there: at least one joint is tracked or inferred."""
        return bool(self.states.any())


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """Everybody whom a source sees at one instant: what a source gives, and the line takes in.

    time, sequence: as in `SkeletonFrame`, and the same in all its frames.
    frames: one for each performer who is there, each performer once; empty if nobody is.
    """

    time: float
    sequence: int
    frames: tuple[SkeletonFrame, ...] = ()

    def __post_init__(self) -> None:
        performers = [frame.performer for frame in self.frames]
        if len(set(performers)) != len(performers):
            raise ValueError(f"a performer is at one place at a time, but these are: {performers}")

    @classmethod
    def of(cls, frame: SkeletonFrame) -> Self:
        """The moment in which one performer is seen, or nobody if the frame is empty."""
        return cls(frame.time, frame.sequence, (frame,) if frame.present else ())

    @property
    def present(self) -> bool:
        """Whether anybody is there."""
        return bool(self.frames)

    def frame_of(self, performer: int) -> SkeletonFrame:
        """What is seen of a performer; an empty frame if they are not there."""
        for frame in self.frames:
            if frame.performer == performer:
                return frame
        return nobody(self.time, self.sequence, performer)

    def at(self, time: float, sequence: int) -> Moment:
        """The same at another time."""
        if (time, sequence) == (self.time, self.sequence):
            return self
        frames = (replace(frame, time=time, sequence=sequence) for frame in self.frames)
        return Moment(time, sequence, tuple(frames))


#: The joint on the other side of the body; those in the middle are their own.
OTHER_SIDE: Final = tuple(
    Joint[joint.name.replace("LEFT", "?").replace("RIGHT", "LEFT").replace("?", "RIGHT")]
    for joint in Joint
)


def mirrored(frame: SkeletonFrame) -> SkeletonFrame:
    """As in a mirror before the performer: left and right are exchanged, and so is x."""
    order = list(OTHER_SIDE)
    return replace(
        frame,
        positions=frame.positions[order] * (-1.0, 1.0, 1.0),
        states=frame.states[order],
        influence=frame.influence[order],
    )


def nobody(time: float, sequence: int, performer: int = 0) -> SkeletonFrame:
    """The frame of a source that runs but sees no one: every joint not tracked, at the origin."""
    return SkeletonFrame(
        time, sequence, performer, np.zeros((JOINT_COUNT, 3)), np.zeros(JOINT_COUNT, np.uint8)
    )
