"""glTF materials: the metallic-roughness factors and the base colour texture."""

from __future__ import annotations

import io
import math
import warnings
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from puppet.errors import BadFileError
from puppet.formats.gltf_file import GltfFile
from puppet.kernel import Floats
from puppet.mesh import Material

#: Pixels along the longer side; larger textures are reduced, which no stage shows.
_LARGEST_TEXTURE: Final = 2048
_LARGEST_IMAGE: Final = 100_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A material, and where its texture takes its coordinates: the set, and (2, 3) uv_from_set."""

    material: Material
    uv_set: int
    uv_matrix: Floats


def read_surface(file: GltfFile, index: int | None) -> Surface:
    """Material `index` of the file; glTF's plain white one for None.

    A texture that cannot be decoded becomes a warning, and the colour stays.
    """
    uv_matrix = np.eye(2, 3)
    if index is None:
        return Surface(Material("default", (0.8, 0.8, 0.8, 1.0), 0.0, 0.8), 0, uv_matrix)
    source = file.item(file.document.materials, index, "materials")
    pbr = source.pbrMetallicRoughness
    extensions = source.extensions or {}
    color, texture = [1.0, 1.0, 1.0, 1.0], None
    metallic = roughness = 1.0
    if pbr is not None:
        color = pbr.baseColorFactor or color
        metallic = 1.0 if pbr.metallicFactor is None else pbr.metallicFactor
        roughness = 1.0 if pbr.roughnessFactor is None else pbr.roughnessFactor
        texture = pbr.baseColorTexture
        if getattr(pbr, "metallicRoughnessTexture", None) is not None:
            metallic = 0.0  # a factor that only makes sense times its texture, which is not drawn
    glossy = extensions.get("KHR_materials_pbrSpecularGlossiness")
    if glossy is not None:
        color = glossy.get("diffuseFactor", color)
        metallic, roughness = 0.0, 1.0 - float(glossy.get("glossinessFactor", 1.0))
    emissive = np.array(source.emissiveFactor or (0.0, 0.0, 0.0), float).reshape(3)
    if source.emissiveTexture is not None:
        emissive[:] = 0.0  # likewise
    strength = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
    uv_set, pixels = 0, None
    if texture is not None:
        uv_set = texture.texCoord or 0
        transform = (texture.extensions or {}).get("KHR_texture_transform")
        if transform is not None:
            uv_set = transform.get("texCoord", uv_set)
            uv_matrix = _uv_matrix(transform)
        pixels = _decode(file, texture.index, source.name or f"material_{index}")
    r, g, b, a = (float(value) for value in color)
    alpha = 1.0 if source.alphaMode in (None, "OPAQUE") else a
    material = Material(
        name=source.name or f"material_{index}",
        color=(r, g, b, alpha),
        metallic=float(metallic),
        roughness=float(roughness),
        emissive=tuple(float(value) for value in emissive * strength),  # type: ignore[arg-type]
        double_sided=bool(source.doubleSided),
        texture=pixels,
    )
    return Surface(material, int(uv_set), uv_matrix)


def _uv_matrix(transform: dict[str, Any]) -> Floats:
    (dx, dy), (sx, sy) = transform.get("offset", (0, 0)), transform.get("scale", (1, 1))
    angle = float(transform.get("rotation", 0.0))
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c * sx, s * sy, dx], [-s * sx, c * sy, dy]], float)


def _decode(file: GltfFile, index: int, name: str) -> NDArray[np.uint8] | None:
    """The texture's pixels. -> (h, w, 4) sRGB, row 0 at the top, where glTF has v = 0."""
    try:
        texture = file.item(file.document.textures, index, "textures")
        data = file.image_bytes(texture.source)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's about odd palettes and large images
            with Image.open(io.BytesIO(data)) as image:
                if image.width * image.height > _LARGEST_IMAGE:
                    raise ValueError(f"{image.width} × {image.height} pixels are too many")
                image.draft("RGB", (_LARGEST_TEXTURE, _LARGEST_TEXTURE))
                image.thumbnail((_LARGEST_TEXTURE, _LARGEST_TEXTURE))
                return np.asarray(image.convert("RGBA"), np.uint8)
    except BadFileError as error:
        file.warn(f"material {name!r} lost its texture: {error.what}")
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        file.warn(f"material {name!r} lost its texture, which cannot be decoded: {error}")
    return None
