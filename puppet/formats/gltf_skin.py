"""Skinned and rigid glTF meshes, baked into the rest pose of the armature and repaired.

After baking nothing is left of bind poses, node transforms and scales: vertices stand in the
armature's frame where the rest pose puts them, so a bone's motion from rest is all that skinning
needs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from puppet.formats.bone_names import listed
from puppet.formats.gltf_file import GltfFile
from puppet.formats.gltf_material import Surface
from puppet.kernel import Floats
from puppet.mesh import Mesh

_INFLUENCES: Final = 4
#: How far a bone may rest from where it was bound, as a part of a turn or of the skin's size.
_MOVED: Final = 0.02
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


@dataclass(frozen=True, slots=True, eq=False)
class Binding:
    """How the vertices of one mesh node reach the rest pose.

    label: the mesh, for people; names: J, the bones. bones: (J,) the armature's bone for each joint
    of the skin.
    matrices: (J, 4, 4) armature_from_mesh at rest, for a vertex that follows joint j alone.
    origins: (J, 3) where the joints are in the mesh's own frame.
    rigid: the mesh has no skin and follows ``bones[0]``.
    """

    label: str
    names: tuple[str, ...]
    bones: NDArray[np.intp]
    matrices: Floats
    origins: Floats
    rigid: bool = False


def bind_skin(
    file: GltfFile,
    skin_index: int,
    bone_of_node: Mapping[int, int],
    bone_names: Sequence[str],
    label: str,
) -> Binding:
    """The binding of a skin at rest. Inverse bind matrices that make no sense are replaced."""
    skin = file.item(file.document.skins, skin_index, "skins")
    bones = np.array([bone_of_node[node] for node in skin.joints], np.intp)
    names = tuple(bone_names[bone] for bone in bones)
    rest = file.world_matrices[skin.joints]
    inverse_bind = np.linalg.pinv(rest)
    if skin.inverseBindMatrices is None:
        # glTF's own default: the vertices are given in each joint's frame.
        inverse_bind[:] = np.eye(4)
    else:
        stored = file.floats(skin.inverseBindMatrices, 16).reshape(-1, 4, 4).transpose(0, 2, 1)
        for joint in range(len(skin.joints)):
            usable = joint < len(stored) and np.isfinite(stored[joint]).all()
            if usable and np.linalg.matrix_rank(stored[joint][:3, :3]) == 3:
                inverse_bind[joint] = stored[joint]
            else:
                what = "had no usable bind matrix: bound where it is at rest"
                file.warn(f"bone {names[joint]!r} {what}")
    binding = Binding(
        label=label,
        names=names,
        bones=bones,
        matrices=rest @ inverse_bind,
        origins=np.linalg.pinv(inverse_bind)[:, :3, 3],
    )
    if skin.inverseBindMatrices is not None:
        _say_moved(file, skin.joints, binding)
    return binding


def _say_moved(file: GltfFile, joints: Sequence[int], binding: Binding) -> None:
    """Warn of bones that rest otherwise, seen from their parents, than they were bound."""
    joint_of = {node: joint for joint, node in enumerate(joints)}
    above = [next((joint_of[n] for n in file.ancestors(n) if n in joint_of), -1) for n in joints]
    own = np.flatnonzero(np.array(above) >= 0)
    if len(own) == 0:
        return
    parent = np.array(above)[own]
    change = binding.matrices[own] - binding.matrices[parent]
    turned = np.linalg.norm(change[:, :3, :3], axis=(1, 2))
    size = np.linalg.norm(binding.matrices[parent][:, :3, :3], axis=(1, 2))
    moved = np.einsum("jik,jk->ji", change[:, :3, :3], binding.origins[own]) + change[:, :3, 3]
    far = np.linalg.norm(moved, axis=1)
    reach = float(np.ptp(binding.origins, axis=0).max()) * size
    odd = own[(turned > _MOVED * size) | (far > _MOVED * reach)]
    if len(odd):
        names = listed([binding.names[joint] for joint in odd])
        file.warn(f"bones do not rest where they were bound, and take their skin along: {names}")


def read_primitive(
    file: GltfFile, primitive: Any, binding: Binding, surface: Surface
) -> Mesh | None:
    """One primitive at rest, or None (with a warning) if nothing of it can be drawn.

    Raises BadFileError if its arrays are not in the file.
    """
    label, attributes = binding.label, primitive.attributes
    if attributes.POSITION is None or primitive.mode not in (None, _TRIANGLES, _STRIP, _FAN):
        file.warn(f"{label} has points or lines, which are not drawn: left out")
        return None
    positions = file.floats(attributes.POSITION, 3)
    triangles = _triangles(file, primitive, len(positions), label)
    bones, weights = _influences(file, attributes, binding, positions)

    # (V, 4, 4), the mean of the joints' matrices: linear blend skinning, once and for all.
    blend = np.einsum("vk,vkij->vij", weights, binding.matrices[bones])
    rest = np.einsum("vij,vj->vi", blend[:, :3, :3], positions) + blend[:, :3, 3]
    linear = blend[:, :3, :3]
    turned_inside_out = np.linalg.det(linear) < 0.0
    if len(rest) and turned_inside_out.mean() > 0.5:
        triangles = triangles[:, ::-1]

    sound = np.isfinite(rest).all(axis=1)
    if not sound.all():
        file.warn(f"{label} had {int((~sound).sum())} vertices that are not numbers: left out")
        triangles = triangles[sound[triangles].all(axis=1)]
    # As modelled, not at rest: what the rest pose folds flat may open in another pose.
    triangles = _with_area(file, positions, triangles, label)
    if len(triangles) == 0:
        file.warn(f"{label} has no triangles: left out")
        return None

    normals = np.zeros_like(rest)
    if attributes.NORMAL is not None:
        stored = _per_vertex(file, attributes.NORMAL, 3, len(rest))
        cofactors = np.cross(linear[:, [1, 2, 0]], linear[:, [2, 0, 1]])
        cofactors[turned_inside_out] *= -1.0
        normals = np.nan_to_num(np.einsum("vij,vj->vi", cofactors, stored))
    computed = smooth_normals(rest, triangles)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 1e-12, normals / np.maximum(length, 1e-12), computed)

    uvs = np.zeros((len(rest), 2))
    uv_index = getattr(attributes, f"TEXCOORD_{surface.uv_set}", None)
    if uv_index is not None:
        raw = np.nan_to_num(_per_vertex(file, uv_index, 2, len(rest)))
        uvs = raw @ surface.uv_matrix[:, :2].T + surface.uv_matrix[:, 2]

    used, renumbered = np.unique(triangles, return_inverse=True)
    return Mesh(
        positions=rest[used].astype(np.float32),
        normals=normals[used].astype(np.float32),
        uvs=uvs[used].astype(np.float32),
        bones=np.where(weights > 0.0, binding.bones[bones], 0)[used].astype(np.uint16),
        weights=weights[used].astype(np.float32),
        triangles=renumbered.reshape(-1, 3).astype(np.uint32),
        material=surface.material,
    )


def joined(meshes: list[Mesh]) -> Mesh:
    """Meshes of one material as one mesh."""
    first = np.cumsum([0, *(len(mesh.positions) for mesh in meshes[:-1])])
    return Mesh(
        positions=np.concatenate([mesh.positions for mesh in meshes]),
        normals=np.concatenate([mesh.normals for mesh in meshes]),
        uvs=np.concatenate([mesh.uvs for mesh in meshes]),
        bones=np.concatenate([mesh.bones for mesh in meshes]),
        weights=np.concatenate([mesh.weights for mesh in meshes]),
        triangles=np.concatenate(
            [mesh.triangles + np.uint32(start) for mesh, start in zip(meshes, first, strict=True)]
        ),
        material=meshes[0].material,
    )


def smooth_normals(positions: Floats, triangles: NDArray[np.integer[Any]]) -> Floats:
    """Unit normals, the mean of the faces around each place by area. -> (V, 3)

    Vertices at one place share their normal, so that seams of texture or colour do not show.
    """
    corners = positions[triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    _, place = np.unique(np.nan_to_num(positions), axis=0, return_inverse=True)
    place = place.reshape(-1)
    sums = np.zeros((len(positions), 3))
    for corner in range(3):
        np.add.at(sums, place[triangles[:, corner]], faces)
    sums = sums[place]
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.where(length > 0.0, sums / np.where(length > 0.0, length, 1.0), (0.0, 1.0, 0.0))


def _per_vertex(file: GltfFile, accessor: int, width: int, count: int) -> Floats:
    values = file.floats(accessor, width)
    if len(values) != count:
        raise file.bad(
            f"accessors[{accessor}]",
            "a mesh has attributes of different lengths",
            expected=str(count),
            found=str(len(values)),
        )
    return values


def _triangles(file: GltfFile, primitive: Any, count: int, label: str) -> NDArray[np.int64]:
    """Triangles of any of glTF's three kinds, without those that point at no vertex. -> (T, 3)"""
    if primitive.indices is None:
        index = np.arange(count)
    else:
        index = file.array(primitive.indices)[:, 0].astype(np.int64)
    if primitive.mode in (None, _TRIANGLES):
        triangles = index[: len(index) // 3 * 3].reshape(-1, 3)
    elif len(index) < 3:
        triangles = np.zeros((0, 3), np.int64)
    elif primitive.mode == _FAN:
        triangles = np.stack([np.full(len(index) - 2, index[0]), index[1:-1], index[2:]], axis=1)
    else:
        triangles = np.stack([index[:-2], index[1:-1], index[2:]], axis=1)
        triangles[1::2] = triangles[1::2, [1, 0, 2]]
    inside = ((triangles >= 0) & (triangles < count)).all(axis=1)
    if not inside.all():
        file.warn(f"{label} had {int((~inside).sum())} triangles without vertices: left out")
    kept: NDArray[np.int64] = triangles[inside]
    return kept


def _with_area(
    file: GltfFile, positions: Floats, triangles: NDArray[np.int64], label: str
) -> NDArray[np.int64]:
    corners = positions[triangles]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.ptp(corners.reshape(-1, 3), axis=0).max() if len(corners) else 0.0
    flat = np.linalg.norm(doubled, axis=1) <= 1e-12 * size * size
    if flat.any():
        file.warn(f"{label} had {int(flat.sum())} triangles without area: left out")
    kept: NDArray[np.int64] = triangles[~flat]
    return kept


def _influences(
    file: GltfFile, attributes: Any, binding: Binding, positions: Floats
) -> tuple[NDArray[np.int64], Floats]:
    """The four strongest joints of each vertex, and weights that sum to 1. -> (V, 4), (V, 4)"""
    count, label = len(positions), binding.label
    indices: list[NDArray[np.int64]] = []
    strengths: list[Floats] = []
    while (joints := getattr(attributes, f"JOINTS_{len(indices)}", None)) is not None:
        weights = getattr(attributes, f"WEIGHTS_{len(indices)}", None)
        if weights is None:
            break
        stored = file.array(joints)
        strength = _per_vertex(file, weights, _INFLUENCES, count)
        if stored.shape != strength.shape:
            raise file.bad(f"accessors[{joints}]", "joints and weights do not belong together")
        indices.append(stored.astype(np.int64))
        strengths.append(strength)
    if not indices:
        if not binding.rigid:
            file.warn(f"{label} has a skin, but no weights: it follows its first bone")
        one = np.zeros((count, _INFLUENCES))
        one[:, 0] = 1.0
        return np.zeros((count, _INFLUENCES), np.int64), one

    index, weight = np.concatenate(indices, axis=1), np.concatenate(strengths, axis=1)
    unusable = ~np.isfinite(weight) | (weight < 0.0)
    if unusable.any():
        told = _named(binding, index[unusable])
        file.warn(
            f"{label} had {int(unusable.sum())} weights that are no weights, of {told}: taken as 0"
        )
        weight = np.where(unusable, 0.0, weight)
    nowhere = (index < 0) | (index >= len(binding.bones))
    if (nowhere & (weight > 0.0)).any():
        file.warn(f"{label} had weights for bones that are not in its skin: taken as 0")
    weight = np.where(nowhere, 0.0, weight)
    index = np.where(nowhere, 0, index)

    total = weight.sum(axis=1)
    bare = total <= 1e-6
    if bare.any():
        nearest = [
            int(np.linalg.norm(binding.origins - place, axis=1).argmin())
            for place in np.nan_to_num(positions[bare])
        ]
        index[bare, 0], weight[bare, 0] = nearest, 1.0
        told = _named(binding, index[bare, 0])
        file.warn(
            f"{label} had {int(bare.sum())} vertices without a bone: each took the nearest, {told}"
        )
    # Bytes cannot express a sum of exactly 1, so only what a viewer would show is worth a word.
    if (np.abs(total[~bare] - 1.0) > 0.02).any():
        file.warn(f"{label} had weights that do not sum to 1: scaled")

    strongest = np.argsort(-weight, axis=1, kind="stable")[:, :_INFLUENCES]
    index = np.take_along_axis(index, strongest, axis=1)
    weight = np.take_along_axis(weight, strongest, axis=1)
    return index, weight / weight.sum(axis=1, keepdims=True)


def _named(binding: Binding, joints: NDArray[np.int64]) -> str:
    """The bones of some joints, for people."""
    known = np.unique(joints[(joints >= 0) & (joints < len(binding.names))])
    return listed([binding.names[joint] for joint in known]) or "no bone"
