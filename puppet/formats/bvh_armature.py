"""The hierarchy of a BVH file as an armature."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.errors import BadFileError
from puppet.formats.bvh import BvhMotion
from puppet.formats.bvh_skeleton import guess_frame
from puppet.kernel import frozen


def bvh_armature(
    motion: BvhMotion, *, unit: float | None = None, stage_from_file: Rotation | None = None
) -> Armature:
    """The hierarchy at rest: metres, +Y up, standing on y = 0 with its root over the origin.

    unit: metres in one unit of the file. stage_from_file: the turn from its axes to the stage's.
    What is not given is guessed from the build of a human; for other creatures the largest side is
    taken to be in metres, centimetres or millimetres, whichever is nearest to a metre, and +Y up.

    BVH has no rest rotations, so every bone's frame is parallel to the armature's.
    """
    if unit is None or stage_from_file is None:
        try:
            guessed_unit, guessed_turn = guess_frame(motion)
        except BadFileError:
            guessed_unit, guessed_turn = _unit_by_size(motion), Rotation.identity()
        unit = guessed_unit if unit is None else unit
        stage_from_file = guessed_turn if stage_from_file is None else stage_from_file
    roots = np.array(motion.parents) < 0
    offsets = stage_from_file.apply(motion.offsets.copy()) * unit  # SciPy wants to write
    offsets[roots] *= (0.0, 1.0, 0.0)
    armature = Armature.build(motion.name, motion.names, motion.parents, offsets)
    tips = armature.tips.copy()
    for joint, end in motion.ends.items():
        bone = armature.index(motion.names[joint])
        if not armature.children[bone]:
            tips[bone] = stage_from_file.apply(end) * unit
    armature = replace(armature, tips=frozen(tips))
    lowest = min(armature.rest[0][:, 1].min(), armature.rest_tips[:, 1].min())
    grounded = armature.offsets.copy()
    grounded[armature.parents < 0, 1] -= lowest
    return replace(armature, offsets=frozen(grounded))


def _unit_by_size(motion: BvhMotion) -> float:
    size = Armature.build(motion.name, motion.names, motion.parents, motion.offsets).size
    return min((1.0, 0.01, 0.001), key=lambda unit: abs(np.log(max(size, 1e-9) * unit)))
