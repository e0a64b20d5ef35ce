"""Putting loose bones back: feet that an animator's rig keeps apart from the legs they end.

Rigs made for keyframes often hang the feet on the root, or on nothing, so that IK can hold them on
the floor; a mouth may lie beside the head. Driven by a performer, the leg would go and leave the
foot behind, with torn skin between. Such a bone begins where another one runs or ends, far from
its own parent; it is given to that bone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from puppet.armature import Armature, side_of
from puppet.kernel import Floats, frozen
from puppet.mesh import Model
from puppet.rotation import conjugate, multiply, rotate

#: A bone hangs on another if it begins this near to it, as a share of the armature's size; it is
#: loose if it begins further than this from its parent.
NEAR: Final = 0.06
FAR: Final = 0.09


def with_loose_bones_attached(model: Model) -> Model:
    """The model with every loose bone on the bone that it belongs to, at the same rest pose."""
    armature = model.armature
    new_parents = armature.parents.copy()
    warnings = []
    for bone in range(len(armature)):
        owner = _owner(armature, bone)
        if owner is not None and not _is_ancestor(new_parents, bone, owner):
            new_parents[bone] = owner
            warnings.append(f"bone {armature.names[bone]!r} was loose: now {_on(armature, owner)}")
    if not warnings:
        return model
    positions, rotations = armature.rest
    offsets, local = np.array(armature.offsets), np.array(armature.rotations)
    for bone in np.flatnonzero(new_parents != armature.parents):
        parent = new_parents[bone]
        back = conjugate(rotations[parent])
        offsets[bone] = rotate(back, positions[bone] - positions[parent])
        local[bone] = multiply(back, rotations[bone])
    moved = Armature.build(
        armature.name,
        armature.names,
        new_parents.tolist(),
        offsets,
        local,
        armature.tips,
        armature.limits,
        armature.lower,
        armature.upper,
        armature.movements,
    )
    index = np.array([moved.index(name) for name in armature.names], np.uint16)
    meshes = tuple(replace(mesh, bones=index[mesh.bones]) for mesh in model.meshes)
    tips = _ending_where_the_next_begins(moved, set(map(int, index[new_parents >= 0])))
    return Model(replace(moved, tips=tips), meshes, (*model.warnings, *warnings))


def _owner(armature: Armature, bone: int) -> int | None:
    """The bone that a loose bone belongs to; None if it is not loose, or nothing is near."""
    parent = int(armature.parents[bone])
    size = armature.size
    place = armature.rest[0][bone]
    if parent >= 0 and (armature.parents[parent] >= 0 or _gap(armature, parent, place) < FAR * size):
        return None
    below = _below(armature, bone)
    side = side_of(armature.names[bone])
    gaps = [
        _gap(armature, other, place)
        if other not in below and other != parent and side_of(armature.names[other]) in ("", side)
        else np.inf
        for other in range(len(armature))
    ]
    owner = int(np.argmin(gaps))
    return owner if gaps[owner] < NEAR * size else None


def _gap(armature: Armature, bone: int, place: Floats) -> float:
    """Metres from a place to the nearest point of a bone, at rest."""
    start, end = armature.rest[0][bone], armature.rest_tips[bone]
    along = end - start
    length = float(along @ along)
    share = min(max(float((place - start) @ along) / length, 0.0), 1.0) if length > 1e-18 else 0.0
    return float(np.linalg.norm(start + share * along - place))


def _below(armature: Armature, start: int) -> set[int]:
    bones = [start]
    for bone in bones:
        bones.extend(armature.children[bone])
    return set(bones)


def _is_ancestor(parents: np.ndarray, bone: int, of: int) -> bool:
    while of >= 0 and of != bone:
        of = int(parents[of])
    return of == bone


def _ending_where_the_next_begins(armature: Armature, _touched: set[int]) -> Floats:
    return frozen(armature.tips)


def _on(armature: Armature, owner: int) -> str:
    return f"it hangs on {armature.names[owner]!r}"
