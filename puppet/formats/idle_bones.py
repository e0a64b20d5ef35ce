"""Leaving out bones that move nothing: IK targets, poles and end markers of an animator's rig.

They have a place in the file that they were made for; on stage they would only take a hand or a
foot away from a bone that can be seen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from puppet.armature import Armature
from puppet.kernel import frozen
from puppet.mesh import Model

#: Names that a warning gives before it only counts.
_NAMED = 8


def without_idle_bones(model: Model) -> Model:
    """The model without bones that, with all below them, hold no part of the skin.

    The tips of the others stay where they are. A model without skin, or without such bones, is
    returned as it is.
    """
    armature = model.armature
    moves = np.zeros(len(armature), bool)
    for mesh in model.meshes:
        moves[np.unique(mesh.bones[mesh.weights > 0.0])] = True
    for bone in reversed(range(len(armature))):
        if moves[bone] and armature.parents[bone] >= 0:
            moves[armature.parents[bone]] = True
    if moves.all() or not moves.any():
        return model
    kept = np.flatnonzero(moves)
    index = np.full(len(armature), -1)
    index[kept] = np.arange(len(kept))
    parents = armature.parents[kept]
    smaller = Armature(
        armature.name,
        tuple(armature.names[bone] for bone in kept),
        frozen(np.where(parents >= 0, index[parents], -1), np.int32),
        frozen(armature.offsets[kept]),
        frozen(armature.rotations[kept]),
        frozen(armature.tips[kept]),
        frozen(armature.limits[kept]),
        frozen(armature.lower[kept]),
        frozen(armature.upper[kept]),
        tuple(armature.movements[bone] for bone in kept),
    )
    meshes = tuple(
        # An influence without weight may name any bone; it gets the first.
        replace(mesh, bones=np.maximum(index[mesh.bones], 0).astype(np.uint16))
        for mesh in model.meshes
    )
    idle = [name for bone, name in enumerate(armature.names) if not moves[bone]]
    more = f" and {len(idle) - _NAMED} more" if len(idle) > _NAMED else ""
    warning = f"left out bones that move nothing: {', '.join(idle[:_NAMED])}{more}"
    return Model(smaller, meshes, (*model.warnings, warning))
