"""The skin of a puppet, as arrays that a viewer can upload as they are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from puppet.armature import Armature
from puppet.kernel import frozen


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """The part of glTF's metallic-roughness material that the viewer draws.

    color: linear RGBA. emissive: linear RGB. texture: (h, w, 4) uint8 sRGB, or None.
    """

    name: str = ""
    color: tuple[float, float, float, float] = (0.8, 0.8, 0.8, 1.0)
    metallic: float = 0.0
    roughness: float = 0.7
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    double_sided: bool = False
    texture: NDArray[np.uint8] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles of one material, in the armature's frame at rest.

    positions, normals: (V, 3) float32, metres. uvs: (V, 2) float32.
    bones: (V, 4) uint16 indices into the armature. weights: (V, 4) float32, each row sums to 1.
    triangles: (T, 3) uint32.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    bones: NDArray[np.uint16]
    weights: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    material: Material


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """An armature with its skin, and what was repaired while it was read (for people)."""

    armature: Armature
    meshes: tuple[Mesh, ...]
    warnings: tuple[str, ...] = ()

    @property
    def lowest(self) -> float:
        """Metres, the height of its lowest point at rest."""
        return float(self._heights().min())

    @property
    def height(self) -> float:
        """Metres from its lowest point at rest to its highest; of the bones if it has no skin."""
        return float(np.ptp(self._heights()))

    def _heights(self) -> NDArray[Any]:
        points: list[NDArray[Any]] = [
            mesh.positions[:, 1] for mesh in self.meshes if len(mesh.positions)
        ]
        if not points:
            points = [self.armature.rest[0][:, 1], self.armature.rest_tips[:, 1]]
        return np.concatenate(points)

    def scaled(self, factor: float) -> Model:
        """The same model, `factor` times as large about the armature's origin."""
        armature = replace(
            self.armature,
            offsets=frozen(self.armature.offsets * factor),
            tips=frozen(self.armature.tips * factor),
        )
        meshes = tuple(
            replace(mesh, positions=(mesh.positions * factor).astype(np.float32))
            for mesh in self.meshes
        )
        return replace(self, armature=armature, meshes=meshes)
