"""The hierarchy of a BVH file as an armature."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.errors import BadFileError
from puppet.formats.bvh import BvhMotion
from puppet.formats.bvh_skeleton import guess_unit, heading_of, human_joints, upright
from puppet.kernel import Floats, frozen
from puppet.skeleton import Joint

#: How well a pose must stand (see `_standing`) to be a rest pose.
_STANDS: Final = 0.75
#: So many frames are looked at for a better one.
_LOOKED_AT: Final = 200


def bvh_armature(motion: BvhMotion, warn: Callable[[str], None] = lambda _: None) -> Armature:
    """The hierarchy at rest: metres, +Y up, facing +Z, standing on y = 0, its root over the origin.

    A human rests in the pose in which all angles of the file are 0. Where that is no stance (some
    programs put every bone along its own x), it rests as in the frame that is most like one. Unit,
    up axis and heading are those of a human, too.

    Other creatures rest with all angles 0 and +Y up; their largest side is taken to be in metres,
    centimetres or millimetres, whichever is nearest to a metre.

    The frames of bones are parallel to the armature's where the file's angles are 0.

    warn: called with a sentence for what was guessed.
    """
    rest = replace(motion, values=frozen(np.zeros((1, motion.values.shape[1]))))
    try:
        rest, unit, stage_from_file = _human_rest(motion, rest, warn)
    except BadFileError:
        unit, stage_from_file = _unit_by_size(motion), Rotation.identity()
        warn(f"unit: {unit:g} m, as this is no human and its size says so; +Y taken to be up")
    places, turns = rest.forward()
    offsets, rotations = np.zeros((len(motion.names), 3)), []
    for joint, parent in enumerate(motion.parents):
        turn, offset = turns[joint], places[0, joint]
        if parent >= 0:
            back = turns[parent].inv()
            turn, offset = back * turn, back.apply(offset - places[0, parent])[0]
        offsets[joint] = stage_from_file.apply(offset) * unit
        rotations.append((stage_from_file * turn * stage_from_file.inv()).as_quat()[0])
    first = next(joint for joint, parent in enumerate(motion.parents) if parent < 0)
    roots = np.array(motion.parents) < 0
    offsets[roots] -= offsets[first] * (1.0, 0.0, 1.0)
    armature = Armature.build(motion.name, motion.names, motion.parents, offsets, rotations)
    tips = armature.tips.copy()
    for joint, end in motion.ends.items():
        bone = armature.index(motion.names[joint])
        if not armature.children[bone]:
            tips[bone] = stage_from_file.apply(end.copy()) * unit
    armature = replace(armature, tips=frozen(tips))
    lowest = min(armature.rest[0][:, 1].min(), armature.rest_tips[:, 1].min())
    grounded = armature.offsets.copy()
    grounded[armature.parents < 0, 1] -= lowest
    return replace(armature, offsets=frozen(grounded))


def _human_rest(
    motion: BvhMotion, zero: BvhMotion, warn: Callable[[str], None]
) -> tuple[BvhMotion, float, Rotation]:
    """The rest pose as a motion of one frame, metres in a unit, and the turn to the stage's axes.

    zero: the frame with all angles 0. Raises BadFileError if this is no human.
    """
    joints, height = human_joints(zero)
    turn, _ = upright(joints)
    stands = float(_standing(turn.apply(joints[0])[None])[0])
    if stands < _STANDS:
        stride = max(1, len(motion.values) // _LOOKED_AT)
        performed, _ = human_joints(motion.every(stride))
        performed_turn, _ = upright(performed)
        flat = performed_turn.apply(performed.reshape(-1, 3)).reshape(performed.shape)
        whole = np.isfinite(motion.values[::stride]).all(axis=1)
        scores = np.where(whole, np.nan_to_num(_standing(flat), nan=-np.inf), -np.inf)
        best = int(scores.argmax())
        if scores[best] > stands:
            warn(f"it does not stand with all angles 0: it rests as in frame {best * stride + 1}")
            zero = replace(motion, values=frozen(motion.values[best * stride][None]))
            joints, turn = performed[best : best + 1], performed_turn
    unit, note = guess_unit(height)
    warn(note)
    facing = Rotation.from_euler("y", -heading_of(turn.apply(joints[0])))
    return zero, unit, facing * turn


def _standing(joints: Floats) -> Floats:
    """How much poses are like standing with hanging or spread arms, at most 1. (F, 20, 3) -> (F,)

    The least of: trunk up, legs down, and arms straight and not up.
    """

    def way(start: Joint, end: Joint) -> Floats:
        along = joints[:, end] - joints[:, start]
        unit: Floats = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
        return unit

    parts = [way(Joint.HIP_CENTER, Joint.SHOULDER_CENTER)[:, 1]]
    for side in ("LEFT", "RIGHT"):
        parts.append(-way(Joint[f"HIP_{side}"], Joint[f"KNEE_{side}"])[:, 1])
        parts.append(-way(Joint[f"KNEE_{side}"], Joint[f"ANKLE_{side}"])[:, 1])
        upper = way(Joint[f"SHOULDER_{side}"], Joint[f"ELBOW_{side}"])
        fore = way(Joint[f"ELBOW_{side}"], Joint[f"WRIST_{side}"])
        parts.append(1.0 - np.maximum(upper[:, 1], 0.0))
        parts.append(0.5 + 0.5 * (upper * fore).sum(axis=1))
    least: Floats = np.min(parts, axis=0)
    return least


def _unit_by_size(motion: BvhMotion) -> float:
    size = Armature.build(motion.name, motion.names, motion.parents, motion.offsets).size
    return min((1.0, 0.01, 0.001), key=lambda unit: abs(np.log(max(size, 1e-9) * unit)))
