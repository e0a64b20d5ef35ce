"""What glTF cannot say of a puppet: a ``.toml`` beside the ``.glb``, with the same stem.

::

    model = "seagull.glb"    # the model, where it does not have this file's stem
    grounded = true          # stands on the floor, and never sinks below it
    forward = "+z"           # where it faces in the file; it is turned to face +Z
                             # (without these two its shape decides)

    [masters]                # one handle that drives several end effectors
    wings = ["wing_tip.L", "wing_tip.R"]

    [preferences]            # of the puppeteer; see puppet/mapping/preferences.py
    leave_out = ["leg.L", "leg.R"]

    [bones."fin.R"]
    limit = 75               # degrees that the bone may turn away from its rest in any direction
    turns = "xz"             # the axes of its own rest frame that it turns about; "" for none
    x = [-10, 60]            # degrees about one of them
    movement = "turn"        # or "slide", or "fixed"
    follow = 0.5             # without a partner, it repeats this share of its parent's turn

Everything is optional, and so is the file. Each key is one field of a struct below.
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

from puppet.armature import Armature, Movement
from puppet.errors import BadFileError
from puppet.formats.model import MODEL_SUFFIXES, load_model
from puppet.kernel import frozen
from puppet.mapping.masters import master_problem
from puppet.mapping.preferences import Preferences
from puppet.mapping.symmetry import facing
from puppet.mesh import Mesh, Model

Record = TypeVar("Record", bound=msgspec.Struct)

Facing = Literal["+x", "-x", "+z", "-z"]
#: A model whose lowest point is so near to y = 0, as a share of its height, stands on the floor.
_ON_THE_FLOOR: Final = 0.02
#: Degrees about +Y that turn each direction to +Z.
_TURNS: Final = {"+z": 0.0, "+x": -90.0, "-z": 180.0, "-x": 90.0}


Degrees = Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)]


class BoneTraits(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One bone.

    limit: degrees that it may turn from rest in any direction; None for free.
    turns: the axes of its own rest frame that it turns about. x, y, z: degrees, from and to, about
        one of them; 0 must lie between. movement: how it moves in its parent.
    follow: the share of its parent's turn that it repeats when nothing drives it.
    """

    limit: Annotated[float, msgspec.Meta(ge=0.0, le=180.0)] | None = None
    turns: Annotated[str, msgspec.Meta(pattern="^x?y?z?$")] = "xyz"
    x: tuple[Degrees, Degrees] | None = None
    y: tuple[Degrees, Degrees] | None = None
    z: tuple[Degrees, Degrees] | None = None
    movement: Movement = "turn"
    follow: Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)] = 0.0

    def __post_init__(self) -> None:
        for axis in "xyz":
            bounds = getattr(self, axis)
            if bounds is not None and not bounds[0] <= 0.0 <= bounds[1]:
                raise ValueError(f"{axis} must go from 0 or less to 0 or more, not {list(bounds)}")

    def bounds(self, axis: str) -> tuple[float, float]:
        """Radians from and to about `axis`."""
        if axis not in self.turns:
            return 0.0, 0.0
        bounds: tuple[float, float] | None = getattr(self, axis)
        if bounds is None:
            return -math.inf, math.inf
        return math.radians(bounds[0]), math.radians(bounds[1])


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The file as it is written; its bones are checked one by one, to name the bad one."""

    model: str | None = None
    grounded: bool | None = None
    forward: Facing | None = None
    masters: dict[str, tuple[str, ...]] = {}
    preferences: dict[str, Any] = {}
    bones: dict[str, dict[str, Any]] = {}


@dataclass(frozen=True, slots=True)
class Traits:
    """What the file says.

    grounded: the puppet stands on the floor (y = 0 at rest) and never sinks below it.
    forward: where it faces in the glTF file. None of either leaves it to the model.
    bones: by name, those that the file mentions.
    masters: by name, the end effectors that each drives. preferences: of the puppeteer.
    """

    grounded: bool | None = None
    forward: Facing | None = None
    bones: Mapping[str, BoneTraits] = field(default_factory=dict)
    masters: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    preferences: Preferences = field(default_factory=Preferences)


@dataclass(frozen=True, slots=True, eq=False)
class Puppet:
    """A puppet as it goes on stage: facing +Z, with its bones' limits, and what else is known."""

    model: Model
    traits: Traits


def load_puppet(path: Path) -> Puppet:
    """A model with the ``.toml`` beside it, if there is one, taken into account.

    `path` may also be such a ``.toml`` itself, which then names its model (``model = …``) or has
    the stem of a model beside it.

    Raises BadFileError for either file (see `load_model` and `load_traits`).
    """
    path = Path(path)
    beside = path.with_suffix(".toml")
    if path.suffix.lower() == ".toml" or (beside.exists() and not path.exists()):
        path = _model_of(beside)
    model = load_model(path)
    traits = load_traits(beside, model.armature) if beside.exists() else Traits()
    traits, warnings = _completed(traits, model)
    model = _limited(_facing(replace(model, warnings=(*model.warnings, *warnings)), traits), traits)
    if beside.stem != path.stem:
        model = replace(model, armature=replace(model.armature, name=beside.stem))
    return Puppet(model, traits)


def _completed(traits: Traits, model: Model) -> tuple[Traits, tuple[str, ...]]:
    """With what the file does not say read off the model, and warnings where that changes it."""
    grounded, forward = traits.grounded, traits.forward
    warnings = []
    if grounded is None:
        grounded = abs(model.lowest) <= _ON_THE_FLOOR * model.height
    if forward is None:
        forward = facing(model.armature)
        if forward != "+z":
            warnings.append(
                f"it looks along {forward} and is turned to face +z; forward in the .toml beside "
                "it says otherwise"
            )
    return replace(traits, grounded=grounded, forward=forward), tuple(warnings)


def _model_of(path: Path) -> Path:
    """The model that a ``.toml`` is about."""
    named = _convert(_document(path), _File, str(path)).model
    if named is None:
        beside = [path.with_suffix(suffix) for suffix in MODEL_SUFFIXES]
        return next((model for model in beside if model.exists()), beside[0])
    model = path.parent / named
    if Path(named).is_absolute() or not model.resolve().is_relative_to(path.parent.resolve()):
        raise BadFileError(
            "the model lies outside of the file's folder", where=f"{path}: model", found=named
        )
    return model


def load_traits(path: Path, armature: Armature) -> Traits:
    """The traits in `path`, checked against the bones that there are.

    Raises BadFileError, which names the place in the file, for anything that is not TOML, an
    unknown key, a value of the wrong type or range, and a bone that the armature does not have.
    """
    file = _convert(_document(path), _File, str(path))
    for name in file.bones:
        _check_bone(name, f"{path}: bones.{name}", armature)
    for master, effectors in file.masters.items():
        where = f"{path}: masters.{master}"
        for name in effectors:
            _check_bone(name, where, armature)
        problem = master_problem(master, effectors, armature)
        if problem is not None:
            raise BadFileError(problem[0], where=where, found=problem[1])
        for other, its in file.masters.items():
            shared = sorted(set(its) & set(effectors))
            if other != master and shared:
                raise BadFileError(
                    "two masters drive the same bone",
                    where=where,
                    found=f"{', '.join(shared)}, also of {other}",
                )
    bones = {
        name: _convert(values, BoneTraits, f"{path}: bones.{name}")
        for name, values in file.bones.items()
    }
    preferences = _convert(file.preferences, Preferences, f"{path}: preferences")
    return Traits(file.grounded, file.forward, bones, file.masters, preferences)


def _document(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadFileError(
            "the puppet's traits cannot be read", where=path, found=str(error)
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadFileError("this is not TOML", where=path, found=str(error)) from error


def _check_bone(name: str, where: str, armature: Armature) -> None:
    if name not in armature.names:
        raise BadFileError(
            "there is no such bone",
            where=where,
            expected=f"one of {', '.join(armature.names)}",
            found=name,
            hint='a name with a dot needs quotes: [bones."fin.R"]',
        )


def _convert(values: object, kind: type[Record], where: str) -> Record:
    try:
        return msgspec.convert(values, kind)
    except msgspec.ValidationError as error:
        raise BadFileError(
            str(error), where=where, expected=f"keys: {', '.join(kind.__struct_fields__)}"
        ) from error


def _limited(model: Model, traits: Traits) -> Model:
    armature = model.armature
    limits = np.array(armature.limits)
    lower, upper = np.array(armature.lower), np.array(armature.upper)
    movements = list(armature.movements)
    for name, bone in traits.bones.items():
        index = armature.index(name)
        if bone.limit is not None:
            limits[index] = math.radians(bone.limit)
        bounds = [bone.bounds(axis) for axis in "xyz"]
        lower[index] = np.maximum(lower[index], [low for low, _ in bounds])
        upper[index] = np.minimum(upper[index], [high for _, high in bounds])
        if bone.movement != "turn":
            movements[index] = bone.movement
    return replace(
        model,
        armature=replace(
            armature,
            limits=frozen(limits),
            lower=frozen(lower),
            upper=frozen(upper),
            movements=tuple(movements),
        ),
    )


def _facing(model: Model, traits: Traits) -> Model:
    """The model turned about +Y so that it faces +Z."""
    if traits.forward is None or traits.forward == "+z":
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
