"""A puppet's bones, skinned parts and materials, written as a ``.glb``.

The same puppet gives the same bytes on every machine: coordinates are rounded to a hundredth of a
millimetre before they are stored, which swallows the last bits in which processors differ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pygltflib as gltf
from numpy.typing import ArrayLike, NDArray

from cast.surface import Floats, Surface, merged, smoothstep

#: For each vertex how much it follows each bone: by name, numbers or (V,) arrays.
Weights = Mapping[str, "float | Floats"]
_INFLUENCES = 4


@dataclass(frozen=True, slots=True)
class Paint:
    """A material. color: sRGB ``#rrggbb``. glow: how strongly it shines by itself."""

    name: str
    color: str
    roughness: float = 0.55
    metallic: float = 0.0
    glow: float = 0.0

    def linear(self) -> list[float]:
        """Linear RGB, as glTF wants it."""
        value = np.array([int(self.color[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
        curve = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
        return [round(float(x), 5) for x in curve]


def _shares(surface: Surface, weights: str | Weights | Callable[[Surface], Weights]) -> Weights:
    """Shares by bone's name, from any of the ways in which they may be given."""
    if isinstance(weights, str):
        return {weights: 1.0}
    return weights(surface) if callable(weights) else weights


@dataclass(slots=True)
class PuppetFile:
    """A puppet in the making. bones: name -> (parent or "", origin in metres), parents first."""

    name: str
    bones: Mapping[str, tuple[str, tuple[float, float, float]]]
    parts: list[tuple[Surface, Paint, Floats]] = field(default_factory=list)

    def origin(self, bone: str) -> Floats:
        """(3,) where a bone begins."""
        return np.array(self.bones[bone][1])

    def add(
        self,
        surface: Surface,
        paint: Paint,
        weights: str | Weights | Callable[[Surface], Weights],
    ) -> None:
        """Put a surface on the puppet. weights: one bone's name, or shares by bone's name."""
        weights = _shares(surface, weights)
        table = np.zeros((len(surface.positions), len(self.bones)))
        names = list(self.bones)
        for bone, share in weights.items():
            table[:, names.index(bone)] += share
        self.parts.append((surface, paint, table / table.sum(axis=1, keepdims=True)))

    def add_both(
        self,
        surface: Surface,
        paint: Paint,
        weights: str | Weights | Callable[[Surface], Weights],
    ) -> None:
        """Put a part of the left side on the puppet, and its mirror image on the right."""
        weights = _shares(surface, weights)
        self.add(surface, paint, weights)
        swapped = {other_side(bone): share for bone, share in weights.items()}
        self.add(surface.mirrored(), paint, swapped)

    def glb(self) -> bytes:
        """The file."""
        names = list(self.bones)
        paints = list(dict.fromkeys(paint for _, paint, _ in self.parts))
        writer = _Writer()
        primitives = []
        for paint in paints:
            mine = [(surface, table) for surface, other, table in self.parts if other == paint]
            surface = merged([surface for surface, _ in mine])
            primitives.append(
                _primitive(
                    writer,
                    surface,
                    np.concatenate([table for _, table in mine]),
                    paints.index(paint),
                )
            )
        origins = np.round(np.array([origin for _, origin in self.bones.values()], float), 5)
        parents = [names.index(parent) if parent else -1 for parent, _ in self.bones.values()]
        bind = np.tile(np.eye(4), (len(names), 1, 1))
        bind[:, :3, 3] = -origins
        count = len(names)
        nodes = [
            gltf.Node(
                name=name,
                translation=_plain(origins[i] - (origins[parents[i]] if parents[i] >= 0 else 0.0)),
                children=[child for child in range(count) if parents[child] == i],
            )
            for i, name in enumerate(names)
        ]
        nodes.append(gltf.Node(name=self.name, mesh=0, skin=0))
        roots = [i for i in range(count) if parents[i] < 0]
        skin = gltf.Skin(
            name=self.name,
            joints=list(range(count)),
            skeleton=roots[0],
            inverseBindMatrices=writer.add(bind.transpose(0, 2, 1).reshape(-1, 16), "MAT4"),
        )
        document = gltf.GLTF2(
            asset=gltf.Asset(version="2.0", generator="make_cast"),
            scene=0,
            scenes=[gltf.Scene(name=self.name, nodes=[*roots, count])],
            nodes=nodes,
            meshes=[gltf.Mesh(name=self.name, primitives=primitives)],
            skins=[skin],
            materials=[_material(paint) for paint in paints],
            accessors=writer.accessors,
            bufferViews=writer.views,
            buffers=[gltf.Buffer(byteLength=len(writer.data))],
        )
        document.set_binary_blob(bytes(writer.data))
        return b"".join(document.save_to_bytes())


def other_side(bone: str) -> str:
    """The bone on the right for one on the left; itself for one in the middle."""
    return f"{bone[:-2]}.R" if bone.endswith(".L") else bone


def along(
    values: ArrayLike, bones: Sequence[str], joints: Sequence[float], softness: float
) -> dict[str, Floats]:
    """Weights for a chain of bones: bone k runs from ``joints[k - 1]`` to ``joints[k]``.

    values: (V,) how far along the chain each vertex is; joints rise. softness: how far to either
    side of a joint its two bones share the skin.
    """
    value = np.asarray(values, float)
    passed = [smoothstep(value, joint - softness, joint + softness) for joint in joints]
    passed = [np.ones_like(value), *passed, np.zeros_like(value)]
    return {bone: passed[k] * (1.0 - passed[k + 1]) for k, bone in enumerate(bones)}


class _Writer:
    """The one buffer of a .glb, growing."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.accessors: list[gltf.Accessor] = []
        self.views: list[gltf.BufferView] = []

    def add(self, values: NDArray[Any], kind: str, target: int | None = None) -> int:
        if values.dtype == np.float64:
            values = (np.round(values, 5) + 0.0).astype(np.float32)  # + 0.0: no negative zeros
        component = {"f": gltf.FLOAT, "B": gltf.UNSIGNED_BYTE, "H": gltf.UNSIGNED_SHORT}
        accessor = gltf.Accessor(
            bufferView=len(self.views),
            componentType=component[values.dtype.char],
            count=len(values),
            type=kind,
        )
        if target == gltf.ARRAY_BUFFER and kind == "VEC3":
            accessor.min = [float(x) for x in values.min(axis=0)]
            accessor.max = [float(x) for x in values.max(axis=0)]
        raw = np.ascontiguousarray(values).tobytes()
        self.views.append(
            gltf.BufferView(buffer=0, byteOffset=len(self.data), byteLength=len(raw), target=target)
        )
        self.data += raw + b"\0" * (-len(raw) % 4)
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _primitive(writer: _Writer, surface: Surface, table: Floats, material: int) -> gltf.Primitive:
    # Cutting leaves slivers that rounding makes flat, and vertices that nothing uses any more.
    positions = np.round(surface.positions, 5)
    corners = positions[surface.triangles]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    solid = surface.triangles[np.linalg.norm(doubled, axis=1) > 1e-9]
    used, renumbered = np.unique(solid, return_inverse=True)
    triangles, table = renumbered.reshape(-1, 3), table[used]
    if len(used) > 65_535:
        raise ValueError("one material has too many vertices for 16-bit indices")
    strongest = np.argsort(-np.round(table, 5), axis=1, kind="stable")[:, :_INFLUENCES]
    weights = np.take_along_axis(table, strongest, axis=1)
    weights = np.pad(weights, ((0, 0), (0, _INFLUENCES - weights.shape[1])))
    strongest = np.pad(strongest, ((0, 0), (0, _INFLUENCES - strongest.shape[1])))
    weights /= weights.sum(axis=1, keepdims=True)
    strongest[np.round(weights, 5) == 0.0] = 0
    vertices = gltf.ARRAY_BUFFER
    attributes = gltf.Attributes(
        POSITION=writer.add(positions[used], "VEC3", vertices),
        NORMAL=writer.add(surface.normals[used], "VEC3", vertices),
        JOINTS_0=writer.add(strongest.astype(np.uint8), "VEC4", vertices),
        WEIGHTS_0=writer.add(weights, "VEC4", vertices),
    )
    indices = writer.add(
        triangles.reshape(-1, 1).astype(np.uint16), "SCALAR", gltf.ELEMENT_ARRAY_BUFFER
    )
    return gltf.Primitive(attributes=attributes, indices=indices, material=material)


def _material(paint: Paint) -> gltf.Material:
    color = paint.linear()
    return gltf.Material(
        name=paint.name,
        pbrMetallicRoughness=gltf.PbrMetallicRoughness(
            baseColorFactor=[*color, 1.0],
            metallicFactor=paint.metallic,
            roughnessFactor=paint.roughness,
        ),
        emissiveFactor=[round(min(channel * paint.glow, 1.0), 5) for channel in color],
    )


def _plain(vector: Floats) -> list[float]:
    return [round(float(x), 5) + 0.0 for x in vector]
