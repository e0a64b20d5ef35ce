"""``.glb`` and ``.gltf`` to a puppet: glTF joints become bones, and the skin is baked at rest.

The armature is free of scales, and its frame is that of the file's scene (metres, +Y up). What can
be repaired is repaired, with a warning that names the bone or the mesh; what cannot is a
BadFileError.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.errors import BadFileError
from puppet.formats.bone_ends import bone_ends
from puppet.formats.bone_names import listed, unique_names
from puppet.formats.gltf_file import GltfFile
from puppet.formats.gltf_material import Surface, read_surface
from puppet.formats.gltf_skin import Binding, bind_skin, joined, read_primitive
from puppet.formats.idle_bones import without_idle_bones
from puppet.formats.loose_bones import with_loose_bones_attached
from puppet.kernel import Floats
from puppet.mesh import Mesh, Model

_NO_SKIN: Final = "in Blender: parent the mesh to an armature, and export with Skinning on"
#: Scales that are nearer to 1 than this are rounding.
_SCALED: Final = 0.01
#: What 16-bit joint indices can tell apart.
MOST_BONES: Final = 65_535


def load_model(path: Path) -> Model:
    """The armature of a glTF file with its skin at rest, and what had to be repaired.

    Bones that move no part of the skin are left out.

    Raises BadFileError if the file is missing, empty, cut off, foreign or without a skin, or if it
    refers to anything outside its folder.
    """
    path = Path(path)
    file = GltfFile(path)
    try:
        return with_loose_bones_attached(without_idle_bones(_load(file)))
    except (AttributeError, ArithmeticError, IndexError, KeyError, TypeError, ValueError) as error:
        # The document is any JSON that somebody wrote: a list where a number should be surfaces
        # as one of these, wherever it is first used.
        raise BadFileError(
            "the glTF document does not make sense",
            where=path,
            found=f"{type(error).__name__}: {error}",
            hint="export it again, or run it through a glTF validator",
        ) from error


def _load(file: GltfFile) -> Model:
    document = file.document
    mesh_nodes = [node for node in file.shown if document.nodes[node].mesh is not None]
    skins = list(dict.fromkeys(document.nodes[n].skin for n in mesh_nodes))
    used = [skin for skin in skins if skin is not None] or list(range(len(document.skins or ())))
    joints = _parents_first(
        file, (node for s in used for node in file.item(document.skins, s, "skins").joints)
    )
    if not joints:
        raise BadFileError("there is no skin in it", where=file.path, hint=_NO_SKIN)
    if len(joints) > MOST_BONES:
        raise BadFileError("it has too many bones", where=file.path, found=str(len(joints)))
    bone_of_node = {node: bone for bone, node in enumerate(joints)}
    names = unique_names(
        [document.nodes[node].name for node in joints],
        [f"bone_{node}" for node in joints],
        file.warn,
    )

    parts: dict[int | None, list[Mesh]] = {}
    surfaces: dict[int | None, Surface] = {}
    for node_index in mesh_nodes:
        node = document.nodes[node_index]
        mesh = file.item(document.meshes, node.mesh, "meshes")
        label = f"mesh {(mesh.name or node.name or f'mesh_{node.mesh}')!r}"
        if node.skin is None:
            binding = _bind_rigid(file, node_index, bone_of_node, names, label)
        else:
            binding = bind_skin(file, node.skin, bone_of_node, names, label)
        if any(mesh.weights or ()):
            file.warn(f"{label} has shape keys that are switched on: they are not used")
        for primitive in mesh.primitives:
            if primitive.material not in surfaces:
                surfaces[primitive.material] = read_surface(file, primitive.material)
            part = read_primitive(file, primitive, binding, surfaces[primitive.material])
            if part is not None:
                parts.setdefault(primitive.material, []).append(part)
    meshes = tuple(joined(parts[material]) for material in parts)
    armature = _armature(file, joints, bone_of_node, names, meshes)
    return Model(armature, meshes, file.warnings)


def _parents_first(file: GltfFile, joints: Iterable[int]) -> list[int]:
    """The joints once each, in the file's order but with ancestors before descendants."""
    wanted = list(dict.fromkeys(joints))
    for node in wanted:
        file.item(file.document.nodes, node, "nodes")
    known = set(wanted)
    order: dict[int, None] = {}
    for node in wanted:
        above = itertools.takewhile(lambda n: n not in order, file.ancestors(node))
        for ancestor in reversed([n for n in above if n in known]):
            order.setdefault(ancestor)
        order.setdefault(node)
    return list(order)


def _bind_rigid(
    file: GltfFile, node: int, bone_of_node: dict[int, int], names: list[str], label: str
) -> Binding:
    """A mesh without a skin follows the nearest bone above it."""
    line = itertools.chain((node,), file.ancestors(node))
    bone = next((bone_of_node[n] for n in line if n in bone_of_node), -1)
    if bone < 0:
        file.warn(f"{label} hangs on no bone: it follows {names[0]!r}")
        bone = 0
    return Binding(
        label=label,
        names=(names[bone],),
        bones=np.array([bone]),
        matrices=file.world_matrices[node][None],
        origins=np.zeros((1, 3)),
        rigid=True,
    )


def _armature(
    file: GltfFile,
    joints: list[int],
    bone_of_node: dict[int, int],
    names: list[str],
    meshes: tuple[Mesh, ...],
) -> Armature:
    world = file.world_matrices[joints]
    if not np.isfinite(world).all():
        bone = int(np.flatnonzero(~np.isfinite(world).all(axis=(1, 2)))[0])
        raise file.bad(f"nodes[{joints[bone]}]", f"bone {names[bone]!r} is infinitely far away")
    origins, turns = world[:, :3, 3], _nearest_rotations(world[:, :3, :3])
    parents = [
        next((bone_of_node[n] for n in file.ancestors(node) if n in bone_of_node), -1)
        for node in joints
    ]
    _say_odd(file, names, parents, world)
    offsets, local = origins.copy(), turns.copy()
    for bone, parent in enumerate(parents):
        if parent >= 0:
            offsets[bone] = turns[parent].T @ (origins[bone] - origins[parent])
            local[bone] = turns[parent].T @ turns[bone]
    ends = bone_ends(parents, origins, *_skin_points(meshes))
    return Armature.build(
        file.path.stem,
        names,
        parents,
        offsets,
        Rotation.from_matrix(local).as_quat(canonical=True),
        np.einsum("bji,bj->bi", turns, ends - origins),
    )


def _say_odd(file: GltfFile, names: list[str], parents: list[int], world: Floats) -> None:
    """Warn of several roots and of scales, which do no harm any more."""
    roots = [name for name, parent in zip(names, parents, strict=True) if parent < 0]
    if len(roots) > 1:
        file.warn(f"it has {len(roots)} roots, which are moved as one: {listed(roots)}")
    scale = np.linalg.norm(world[:, :3, :3], axis=1).mean(axis=1)
    above = np.array(parents)
    own = scale / np.where(above >= 0, np.maximum(scale[above], 1e-12), 1.0)
    odd = np.flatnonzero(np.abs(own - 1.0) > _SCALED)
    if len(odd):
        most = own[odd][np.abs(np.log(np.maximum(own[odd], 1e-12))).argmax()]
        told = listed([names[bone] for bone in odd])
        file.warn(f"bones were scaled, by up to ×{most:.3g}, which is baked away: {told}")


def _nearest_rotations(matrices: Floats) -> Floats:
    """What is left of (B, 3, 3) linear maps without scale, shear and mirroring. -> (B, 3, 3)"""
    u, _, vt = np.linalg.svd(matrices)
    mirrored = np.linalg.det(u @ vt) < 0.0
    u[mirrored, :, 2] *= -1.0
    turns: Floats = u @ vt
    return turns


def _skin_points(meshes: tuple[Mesh, ...]) -> tuple[Floats, NDArray[np.intp]]:
    """Where the skin is, and the bone that has most to say at each place. -> (V, 3), (V,)"""
    points, owners = [np.zeros((0, 3))], [np.zeros(0, np.intp)]
    for mesh in meshes:
        points.append(mesh.positions.astype(float))
        strongest = mesh.weights.argmax(axis=1)[:, None]
        owners.append(np.take_along_axis(mesh.bones, strongest, axis=1)[:, 0].astype(np.intp))
    return np.concatenate(points), np.concatenate(owners)
