"""Any file with an armature in it to a puppet's model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from puppet.armature import Armature
from puppet.errors import BadFileError
from puppet.formats import gltf
from puppet.formats.bone_mesh import bone_meshes
from puppet.formats.bvh import read_bvh
from puppet.formats.bvh_armature import bvh_armature
from puppet.formats.mjcf import read_mjcf
from puppet.formats.urdf import read_urdf
from puppet.formats.xml_tree import read_xml
from puppet.kernel import frozen
from puppet.mesh import Model

#: What a file without a skin gives: its armature, and what had to be repaired.
Bare = tuple[Armature, tuple[str, ...]]


def load_model(path: Path) -> Model:
    """The model in a ``.glb``, ``.gltf``, ``.bvh``, ``.urdf`` or MuJoCo ``.xml`` file.

    An armature without a skin gets rods and balls to be seen by, and stands on the floor.

    Raises BadFileError for another kind of file, and for one that cannot be read.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind in _SKINNED:
        return gltf.load_model(path)
    reader = _BARE.get(kind)
    if reader is None:
        raise BadFileError(
            "armatures of this kind cannot be read",
            where=path,
            expected=f"a file that ends in {', '.join(MODEL_SUFFIXES)}",
            found=path.suffix or "no ending",
            hint="in Blender: import it, then File, Export, glTF 2.0 (.glb)",
        )
    return _visible(path, *reader(path))


def _visible(path: Path, armature: Armature, warnings: tuple[str, ...]) -> Model:
    if len(armature) > gltf.MOST_BONES:
        raise BadFileError("it has too many bones", where=path, found=str(len(armature)))
    meshes = bone_meshes(armature)
    lowest = min(float(mesh.positions[:, 1].min()) for mesh in meshes)
    up = np.array([0.0, -lowest, 0.0])
    offsets = np.array(armature.offsets)
    offsets[armature.parents < 0] += up
    return Model(
        replace(armature, offsets=frozen(offsets)),
        tuple(replace(mesh, positions=mesh.positions + up.astype(np.float32)) for mesh in meshes),
        warnings,
    )


def _read_bvh(path: Path) -> Bare:
    motion, notes = read_bvh(path), list[str]()
    armature = bvh_armature(motion, notes.append)
    return armature, (*motion.warnings, *notes)


def _read_xml(path: Path) -> Bare:
    root = read_xml(path).tag
    readers: dict[str, Callable[[Path], Bare]] = {"mujoco": read_mjcf, "robot": read_urdf}
    if root not in readers:
        raise BadFileError(
            "this XML file has no armature in it",
            where=path,
            expected="<mujoco> (MuJoCo) or <robot> (URDF)",
            found=f"<{root}>",
        )
    return readers[root](path)


_SKINNED: Final = (".glb", ".gltf")
_BARE: Final[dict[str, Callable[[Path], Bare]]] = {
    ".bvh": _read_bvh,
    ".urdf": _read_xml,
    ".xml": _read_xml,
    ".mjcf": _read_xml,
}
#: What names of files with an armature end in.
MODEL_SUFFIXES: Final = (*_SKINNED, *_BARE)
