"""One puppet on the graphics card: its triangles, its materials and its bone palette."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from puppet.errors import PuppetError
from puppet.kernel import Floats
from puppet.mesh import Material, Mesh
from puppet.pose import Pose, forward_kinematics
from puppet.render.boxes import BoneBoxes, matrices, turned
from puppet.render.program import TEXTURE_UNITS, load_program
from puppet.render.scene import PuppetOnStage

Resource = TypeVar("Resource", moderngl.Buffer, moderngl.Texture, moderngl.VertexArray)

_VERTEX: Final = np.dtype(
    [("position", "f4", 3), ("normal", "f4", 3), ("bones", "u2", 4), ("weights", "f4", 4)]
)
_SKINNED_BYTES: Final = 24
_SRGB8_ALPHA8: Final = 0x8C43
#: A mesh is a lamp if it emits this much light, from so much surface (in squares of the armature's
#: size): the spark in an eye is none.
_LAMP_LIGHT: Final = 0.5
_LAMP_SURFACE: Final = 0.02


class SkinPrograms:
    """The programs that all puppets share."""

    def __init__(self, ctx: moderngl.Context, shadow: Mapping[str, int]) -> None:
        self.skin = load_program(ctx, "skin", None, varyings=("position", "normal"))
        self.lit = load_program(ctx, "puppet", "puppet", defines=shadow)
        self.shadow = load_program(ctx, "puppet_shadow", "depth")

    def release(self) -> None:
        """Give back what the graphics card holds."""
        for program in (self.skin, self.lit, self.shadow):
            program.release()


@dataclass(frozen=True, slots=True, eq=False)
class Glow:
    """A lamp that a puppet carries: the middle of an emissive mesh, and the bone that holds it.

    center: (3,) metres. radius: metres. color: (3,) linear RGB.
    """

    bone: int
    center: Floats
    radius: float
    color: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """The triangles of one material: a stretch of the puppet's index buffer."""

    material: Material
    texture: moderngl.Texture
    first: int
    count: int
    lamp: bool

    @property
    def translucent(self) -> bool:
        return self.material.color[3] < 0.999

    @property
    def finish(self) -> tuple[float, float, float, float]:
        """Sharpness and strength of the highlight, metallic, gloss."""
        gloss = 1.0 - min(max(self.material.roughness, 0.0), 1.0)
        metallic = min(max(self.material.metallic, 0.0), 1.0)
        return 2.0 ** (1.0 + 8.0 * gloss), 0.04 + 0.5 * gloss**2, metallic, gloss


class Skin:
    """The skin of one puppet: `take` a pose, `bend` to it, then draw."""

    def __init__(
        self, ctx: moderngl.Context, programs: SkinPrograms, puppet: PuppetOnStage
    ) -> None:
        self.puppet = puppet
        self.pairs = puppet.pairs
        self.armature = puppet.model.armature
        count = len(self.armature)
        limit = int(ctx.info["GL_MAX_TEXTURE_SIZE"])
        if count > limit:
            raise PuppetError(
                "the armature has too many bones to draw",
                where=puppet.name,
                expected=f"at most {limit}, what this graphics card can hold",
                found=str(count),
            )
        self._ctx = ctx
        self._lit = programs.lit
        self._resources: list[moderngl.Buffer | moderngl.Texture | moderngl.VertexArray] = []
        self._parts: list[_Part] = []
        self._palette = self._kept(ctx.texture((3, count), 4, dtype="f4"))
        self._palette.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._upload(programs, [mesh for mesh in puppet.model.meshes if len(mesh.triangles)])

        positions, rotations = self.armature.rest
        self._rest_positions, self._rest_frames = positions, matrices(rotations)
        #: Bone origins (B, 3) and frames (B, 3, 3) in the world, as the last pose has them.
        self.origins, self.frames = positions, self._rest_frames
        self._rows = np.zeros((count, 3, 4), np.float32)
        self._boxes = BoneBoxes(puppet.model)
        self._lamps = [
            _glow(mesh) for mesh in puppet.model.meshes if _is_lamp(mesh, self.armature.size)
        ]

    def take(self, pose: Pose) -> bool:
        """Stand as `pose` says; False if it has values that cannot be drawn (nothing changes).

        Raises PuppetError for a pose of another armature.
        """
        if pose.bones.shape != (len(self.armature), 4):
            raise PuppetError(
                "a pose does not fit its puppet",
                where=self.puppet.name,
                expected=f"rotations of {len(self.armature)} bones",
                found=f"an array of shape {pose.bones.shape}",
            )
        origins, rotations = forward_kinematics(self.armature, pose)
        if not (np.isfinite(origins).all() and np.isfinite(rotations).all()):
            return False
        self.origins, self.frames = origins, matrices(rotations)
        world_from_rest = self.frames @ self._rest_frames.transpose(0, 2, 1)
        self._rows[:, :, :3] = world_from_rest
        self._rows[:, :, 3] = origins - turned(world_from_rest, self._rest_positions)
        return True

    @property
    def boxes(self) -> Floats:
        """(N, 2, 3) metres, world: lowest and highest corner of boxes that hold the skin."""
        return self._boxes.at(self.origins, self.frames)

    @property
    def tips(self) -> Floats:
        """(B, 3) metres, where each bone ends in the world."""
        return self.origins + turned(self.frames, self.armature.tips)

    @property
    def glows(self) -> list[Glow]:
        """The lamps that the puppet carries; their centres are in the world."""
        return [
            Glow(
                lamp.bone,
                self._rows[lamp.bone, :, :3] @ lamp.center + self._rows[lamp.bone, :, 3],
                lamp.radius,
                lamp.color,
            )
            for lamp in self._lamps
        ]

    def bend(self) -> None:
        """Skin all vertices to the last pose. A complete framebuffer has to be bound."""
        if self._parts:
            self._palette.write(self._rows)
            self._palette.use(TEXTURE_UNITS["bone_palette"])
            self._skinning.transform(self._skinned, moderngl.POINTS, self._vertices)

    def draw(self, *, translucent: bool) -> None:
        """Draw the opaque or the translucent parts, lit."""
        for part in self._parts:
            if part.translucent != translucent:
                continue
            material = part.material
            self._lit["tint"] = material.color
            self._lit["emissive"] = material.emissive
            self._lit["finish"] = part.finish
            part.texture.use(TEXTURE_UNITS["base_color"])
            self._cull(material)
            self._drawn.render(vertices=part.count, first=part.first)

    def draw_shadow(self) -> None:
        """Draw into the shadow map; a lamp's bulb lets the light through."""
        for part in self._parts:
            if not part.lamp:
                self._cull(part.material)
                self._drawn_dark.render(vertices=part.count, first=part.first)

    def release(self) -> None:
        """Give back what the graphics card holds."""
        for resource in reversed(self._resources):
            resource.release()
        self._resources.clear()
        self._parts = []

    def _kept(self, made: Resource) -> Resource:
        self._resources.append(made)
        return made

    def _cull(self, material: Material) -> None:
        if material.double_sided:
            self._ctx.disable(moderngl.CULL_FACE)
        else:
            self._ctx.enable(moderngl.CULL_FACE)

    def _upload(self, programs: SkinPrograms, meshes: list[Mesh]) -> None:
        if not meshes:
            return
        self._vertices = sum(len(mesh.positions) for mesh in meshes)
        vertices = np.zeros(self._vertices, _VERTEX)
        uvs = np.zeros((self._vertices, 2), np.float32)
        triangles = []
        start = first = 0
        white = self._kept(self._ctx.texture((1, 1), 4, b"\xff" * 4))
        white.filter = (moderngl.NEAREST, moderngl.NEAREST)
        for mesh in meshes:
            own = slice(start, start + len(mesh.positions))
            vertices["position"][own], vertices["normal"][own] = mesh.positions, mesh.normals
            vertices["bones"][own], vertices["weights"][own] = mesh.bones, mesh.weights
            uvs[own] = mesh.uvs
            triangles.append(mesh.triangles.astype(np.uint32) + np.uint32(start))
            image = mesh.material.texture
            texture = white if image is None else self._texture(image)
            lamp = _is_lamp(mesh, self.armature.size)
            self._parts.append(_Part(mesh.material, texture, first, mesh.triangles.size, lamp))
            start, first = own.stop, first + mesh.triangles.size

        ctx = self._ctx
        rest = self._kept(ctx.buffer(vertices.tobytes()))
        index = self._kept(ctx.buffer(np.concatenate(triangles).tobytes()))
        place = self._kept(ctx.buffer(uvs.tobytes()))
        self._skinned = self._kept(ctx.buffer(reserve=self._vertices * _SKINNED_BYTES))
        self._skinning = self._kept(
            ctx.vertex_array(
                programs.skin,
                [(rest, "3f 3f 4u2 4f", "in_position", "in_normal", "in_bones", "in_weights")],
            )
        )
        self._drawn = self._kept(
            ctx.vertex_array(
                programs.lit,
                [(self._skinned, "3f 3f", "in_position", "in_normal"), (place, "2f", "in_uv")],
                index,
            )
        )
        self._drawn_dark = self._kept(
            ctx.vertex_array(programs.shadow, [(self._skinned, "3f 12x", "in_position")], index)
        )

    def _texture(self, image: NDArray[np.uint8]) -> moderngl.Texture:
        height, width = image.shape[:2]
        texture = self._kept(
            self._ctx.texture((width, height), 4, image.tobytes(), internal_format=_SRGB8_ALPHA8)
        )
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return texture


def _is_lamp(mesh: Mesh, size: float) -> bool:
    emitted = max(mesh.material.emissive)
    if emitted < _LAMP_LIGHT:
        return False
    a, b, c = mesh.positions[mesh.triangles].transpose(1, 0, 2)
    surface = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2.0
    return surface > _LAMP_SURFACE * size**2


def _glow(mesh: Mesh) -> Glow:
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    held = np.bincount(mesh.bones.ravel(), weights=mesh.weights.ravel())
    return Glow(
        bone=int(held.argmax()),
        center=(low + high).astype(float) / 2.0,
        radius=float(np.linalg.norm(high - low)) / 2.0,
        color=np.array(mesh.material.emissive, float),
    )
