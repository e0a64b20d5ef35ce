"""The performer as a figure of rods: 20 joints, and bones in the colours of the mapping."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats, frozen
from puppet.render.palette import HUMAN_BONE_COLORS, JOINT, NEUTRAL
from puppet.render.rods import Rods, no_rods, rods
from puppet.skeleton import HUMAN_BONES, JOINT_PARENTS, Joint, TrackingState

#: Metres, by joint; the wide ones are nearest to the trunk.
_JOINT_RADII: Final = frozen(
    [
        *(0.050, 0.046, 0.044, 0.098),
        *(0.042, 0.034, 0.027, 0.032) * 2,
        *(0.046, 0.040, 0.030, 0.030) * 2,
    ]
)
#: How thick a bone is beside the joints that it ends in.
_SLENDER: Final = 0.74
_BONE_ENDS: Final = np.array([joint for joint, parent in enumerate(JOINT_PARENTS) if parent >= 0])
_BONE_STARTS: Final = np.array([JOINT_PARENTS[joint] for joint in _BONE_ENDS])
#: By joint: the human bone that ends in it, or -1 (the two hips hang on the trunk by none).
_HUMAN_BONE: Final[dict[int, int]] = {bone.end: index for index, bone in enumerate(HUMAN_BONES)}


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """The performer in parts: what is tracked is solid, what is inferred is hollow."""

    bones: Rods
    joints: Rods
    head: Rods
    hollow: Rods

    @property
    def solid(self) -> Rods:
        """All that throws a shadow."""
        return np.concatenate([self.bones, self.joints, self.head])


NOBODY: Final = Figure(no_rods(), no_rods(), no_rods(), no_rods())


def together(figures: Sequence[Figure]) -> Figure:
    """Several figures as one; NOBODY if there is none."""
    if len(figures) <= 1:
        return figures[0] if figures else NOBODY
    return Figure(
        *(
            np.concatenate([getattr(one, part) for one in figures])
            for part in ("bones", "joints", "head", "hollow")
        )
    )


def figure(joints: Floats, states: NDArray[np.uint8], mapped: Collection[int] = ()) -> Figure:
    """The figure of a performer.

    joints: (20, 3) metres, world. states: (20,) `TrackingState`. mapped: the human bones that some
    puppet follows; they have their colour, the others are grey. A joint that is not tracked is left
    out, with the bones that end in it.
    """
    states = np.where(np.isfinite(joints).all(axis=1), states, TrackingState.NOT_TRACKED)
    colors = np.ones((len(_BONE_ENDS), 4))
    for row, joint in enumerate(_BONE_ENDS):
        bone = _HUMAN_BONE.get(int(joint), -1)
        colors[row, :3] = HUMAN_BONE_COLORS[bone] if bone in mapped else NEUTRAL
    slender = _SLENDER * _JOINT_RADII
    slender[Joint.HEAD] = slender[Joint.SHOULDER_CENTER]
    bones = rods(
        joints[_BONE_STARTS],
        joints[_BONE_ENDS],
        np.column_stack([slender[_BONE_STARTS], slender[_BONE_ENDS]]),
        colors,
    )
    colors = np.ones((len(joints), 4))
    colors[:, :3] = JOINT
    head = _HUMAN_BONE[Joint.HEAD]
    colors[Joint.HEAD, :3] = HUMAN_BONE_COLORS[head] if head in mapped else NEUTRAL
    balls = rods(joints, joints, np.column_stack([_JOINT_RADII, _JOINT_RADII]), colors)

    of_bones = np.minimum(states[_BONE_STARTS], states[_BONE_ENDS])
    tracked = states == TrackingState.TRACKED
    is_head = np.arange(len(joints)) == Joint.HEAD
    return Figure(
        bones[of_bones == TrackingState.TRACKED],
        balls[tracked & ~is_head],
        balls[tracked & is_head],
        np.concatenate(
            [bones[of_bones == TrackingState.INFERRED], balls[states == TrackingState.INFERRED]]
        ),
    )
