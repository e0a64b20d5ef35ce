"""What glTF cannot say of a puppet: a ``.toml`` beside the ``.glb``, with the same stem.

::

    grounded = true          # stands on the floor, and never sinks below it
    forward = "+z"           # where it faces in the file; it is turned to face +Z

    [bones."fin.R"]
    limit = 75               # degrees that the bone may swing away from its rest

Everything is optional, and so is the file. Each key is one field of a struct below, so what a later
version wants to know of a bone (degrees of freedom, movement type) or of a puppet (master bones,
preferences) is one field more.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.errors import BadFileError
from puppet.formats.gltf import load_model
from puppet.kernel import frozen
from puppet.mesh import Mesh, Model

Record = TypeVar("Record", bound=msgspec.Struct)

#: Degrees about +Y that turn each direction to +Z.
_TURNS: Final = {"+z": 0.0, "+x": -90.0, "-z": 180.0, "-x": 90.0}


class BoneTraits(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One bone. limit: degrees that it may swing from rest in any direction; None for free."""

    limit: Annotated[float, msgspec.Meta(ge=0.0, le=180.0)] | None = None


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The file as it is written; its bones are checked one by one, to name the bad one."""

    grounded: bool = False
    forward: Literal["+x", "-x", "+z", "-z"] = "+z"
    bones: dict[str, dict[str, Any]] = {}


@dataclass(frozen=True, slots=True)
class Traits:
    """What the file says.

    grounded: the puppet stands on the floor (y = 0 at rest) and never sinks below it.
    forward: where it faces in the glTF file. bones: by name, those that the file mentions.
    """

    grounded: bool = False
    forward: Literal["+x", "-x", "+z", "-z"] = "+z"
    bones: Mapping[str, BoneTraits] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Puppet:
    """A puppet as it goes on stage: facing +Z, with its bones' limits, and what else is known."""

    model: Model
    traits: Traits


def load_puppet(path: Path) -> Puppet:
    """A ``.glb`` or ``.gltf`` with the ``.toml`` beside it, if there is one, taken into account.

    Raises BadFileError for either file (see `load_model` and `load_traits`).
    """
    model = load_model(path)
    beside = Path(path).with_suffix(".toml")
    traits = load_traits(beside, model.armature) if beside.exists() else Traits()
    return Puppet(_limited(_facing(model, traits), traits), traits)


def load_traits(path: Path, armature: Armature) -> Traits:
    """The traits in `path`, checked against the bones that there are.

    Raises BadFileError, which names the place in the file, for anything that is not TOML, an
    unknown key, a value of the wrong type or range, and a bone that the armature does not have.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadFileError(
            "the puppet's traits cannot be read", where=path, found=str(error)
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadFileError("this is not TOML", where=path, found=str(error)) from error
    file = _convert(document, _File, str(path))
    for name in file.bones:
        if name not in armature.names:
            raise BadFileError(
                "there is no such bone",
                where=f"{path}: bones.{name}",
                expected=f"one of {', '.join(armature.names)}",
                found=name,
                hint='a name with a dot needs quotes: [bones."fin.R"]',
            )
    bones = {
        name: _convert(values, BoneTraits, f"{path}: bones.{name}")
        for name, values in file.bones.items()
    }
    return Traits(file.grounded, file.forward, bones)


def _convert(values: object, kind: type[Record], where: str) -> Record:
    try:
        return msgspec.convert(values, kind)
    except msgspec.ValidationError as error:
        raise BadFileError(
            str(error), where=where, expected=f"keys: {', '.join(kind.__struct_fields__)}"
        ) from error


def _limited(model: Model, traits: Traits) -> Model:
    limits = np.array(model.armature.limits)
    for name, bone in traits.bones.items():
        if bone.limit is not None:
            limits[model.armature.index(name)] = math.radians(bone.limit)
    return replace(model, armature=replace(model.armature, limits=frozen(limits)))


def _facing(model: Model, traits: Traits) -> Model:
    """The model turned about +Y so that it faces +Z."""
    if traits.forward == "+z":
        return model
    turn = Rotation.from_euler("y", _TURNS[traits.forward], degrees=True)
    armature = model.armature
    roots = armature.parents < 0
    offsets, rotations = np.array(armature.offsets), np.array(armature.rotations)
    offsets[roots] = turn.apply(offsets[roots])
    rotations[roots] = (turn * Rotation.from_quat(rotations[roots])).as_quat(canonical=True)
    turned = replace(armature, offsets=frozen(offsets), rotations=frozen(rotations))
    return replace(
        model, armature=turned, meshes=tuple(_turned(mesh, turn) for mesh in model.meshes)
    )


def _turned(mesh: Mesh, turn: Rotation) -> Mesh:
    return replace(
        mesh,
        positions=turn.apply(mesh.positions).astype(np.float32),
        normals=turn.apply(mesh.normals).astype(np.float32),
    )
