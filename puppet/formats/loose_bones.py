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

from puppet.armature import Armature
from puppet.kernel import Floats
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
    for bone in _candidates(armature):
        owner = _owner(armature, bone)
        if owner is not None and not _is_ancestor(new_parents, bone, owner):
            new_parents[bone] = owner
            name, on = armature.names[bone], armature.names[owner]
            warnings.append(f"bone {name!r} lay loose: it now hangs on {on!r}")
    if not warnings:
        return model
    positions, rotations = armature.rest
    offsets, local = np.array(armature.offsets), np.array(armature.rotations)
    for bone in np.flatnonzero(new_parents != armature.parents).tolist():
        parent = int(new_parents[bone])
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
    places = {name: bone for bone, name in enumerate(moved.names)}
    index = np.array([places[name] for name in armature.names], np.uint16)
    meshes = tuple(replace(mesh, bones=index[mesh.bones]) for mesh in model.meshes)
    return Model(moved, meshes, (*model.warnings, *warnings))


def _candidates(armature: Armature) -> list[int]:
    """Roots but for the main one, and what hangs on a root, far from it."""
    parents = armature.parents
    weight = np.ones(len(armature))
    for bone in reversed(range(len(armature))):
        if parents[bone] >= 0:
            weight[parents[bone]] += weight[bone]
    roots = [bone for bone in range(len(armature)) if parents[bone] < 0]
    main = max(roots, key=lambda bone: weight[bone])
    found = [bone for bone in roots if bone != main]
    for root in roots:
        for bone in armature.children[root]:
            gap = _gaps(armature, armature.rest[0][bone])[root]
            if gap > FAR * armature.size:
                found.append(bone)
    return found


def _owner(armature: Armature, bone: int) -> int | None:
    """The bone that a loose bone belongs to; None if nothing is near enough."""
    gaps = _gaps(armature, armature.rest[0][bone])
    gaps[armature.below(bone)] = np.inf
    if armature.parents[bone] >= 0:
        gaps[armature.parents[bone]] = np.inf
    side = armature.sides[bone]
    for other, its in enumerate(armature.sides):
        if side and its and its != side:
            gaps[other] = np.inf
    owner = int(np.argmin(gaps))
    return owner if gaps[owner] < NEAR * armature.size else None


def _gaps(armature: Armature, place: Floats) -> Floats:
    """Metres from a place to the nearest point of each bone, at rest. (3,) -> (B,)"""
    start = armature.rest[0]
    along = armature.rest_tips - start
    lengths = np.maximum((along * along).sum(axis=1), 1e-18)
    share = np.clip(((place - start) * along).sum(axis=1) / lengths, 0.0, 1.0)
    return np.asarray(np.linalg.norm(start + share[:, None] * along - place, axis=1))


def _is_ancestor(parents: np.ndarray, bone: int, of: int) -> bool:
    while of >= 0 and of != bone:
        of = int(parents[of])
    return of == bone
