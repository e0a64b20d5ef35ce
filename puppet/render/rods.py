"""Rods: capsules and spheres, many in one call. The performer is made of them, and so are marks."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.render.program import load_program

_ROD: Final = np.dtype([("start", "f4", 4), ("end", "f4", 4), ("color", "f4", 4)])
Rods = NDArray[np.void]
#: A slanted rod is not lost in one large box.
_SLICES: Final = 3


class Manner(IntEnum):
    """How rods are drawn."""

    SOLID = 0
    HOLLOW = 1
    MARK = 2

    def program(self, ctx: moderngl.Context, shadow: Mapping[str, int]) -> moderngl.Program:
        """A program that draws in this manner; `shadow` is what the shadow map is read with."""
        manners = {manner.name: int(manner) for manner in Manner}
        return load_program(ctx, "rod", "rod", defines={**manners, "MANNER": self, **shadow})


def rods(starts: Floats, ends: Floats, radii: Floats, colors: Floats) -> Rods:
    """Rods from starts (N, 3) to ends (N, 3), metres, world; spheres where the two are the same.

    radii: (N, 2) metres, at start and end. colors: (N, 4) linear RGBA.
    """
    made = np.zeros(len(starts), _ROD)
    made["start"][:, :3], made["start"][:, 3] = starts, radii[:, 0]
    made["end"][:, :3], made["end"][:, 3] = ends, radii[:, 1]
    made["color"] = colors
    return made


def no_rods() -> Rods:
    """None at all."""
    return np.zeros(0, _ROD)


def boxes_of(made: Rods) -> Floats:
    """Boxes around rods, several along each: lowest and highest corner. -> (N, 2, 3) metres"""
    start, end = made["start"].astype(float), made["end"].astype(float)
    steps = np.linspace(0.0, 1.0, _SLICES + 1)[:, None, None]
    spheres = start + (end - start) * steps
    low, high = spheres[..., :3] - spheres[..., 3:], spheres[..., :3] + spheres[..., 3:]
    boxes = np.stack([np.minimum(low[:-1], low[1:]), np.maximum(high[:-1], high[1:])], axis=2)
    return boxes.reshape(-1, 2, 3)


def unit_capsule(sides: int, rings: int) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """A capsule along +Y: rows of normal (3) and along (1), and triangles seen from outside.

    rings: how many steps each of its two half spheres has from pole to rim; 0 leaves them away.
    """
    slopes = np.linspace(0.0, -np.pi / 2.0, rings + 1)[::-1]
    slopes = np.concatenate([slopes, -slopes[::-1]])
    along = np.repeat([0.0, 1.0], rings + 1)
    turns = np.arange(sides) * (2.0 * np.pi / sides)
    vertices = np.empty((len(slopes), sides, 4), np.float32)
    vertices[..., 0] = np.cos(slopes)[:, None] * np.cos(turns)
    vertices[..., 1] = np.sin(slopes)[:, None]
    vertices[..., 2] = np.cos(slopes)[:, None] * np.sin(turns)
    vertices[..., 3] = along[:, None]
    row, side = np.meshgrid(np.arange(len(slopes) - 1), np.arange(sides), indexing="ij")
    a, b = row * sides + side, row * sides + (side + 1) % sides
    quads = np.stack([a, a + sides, b, b, a + sides, b + sides], axis=-1)
    return vertices.reshape(-1, 4), quads.reshape(-1, 3).astype(np.uint32)


class RodBatch:
    """Rods of one shape and manner on the graphics card.

    sides, rings: how round they are. lit and shadow are programs that others may use as well.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        lit: moderngl.Program,
        shadow: moderngl.Program,
        *,
        sides: int,
        rings: int,
    ) -> None:
        vertices, triangles = unit_capsule(sides, rings)
        self._shape = ctx.buffer(vertices.tobytes())
        self._index = ctx.buffer(triangles.tobytes())
        self._instances = ctx.buffer(reserve=64 * _ROD.itemsize, dynamic=True)
        self._count = 0
        self._lit = self._array(ctx, lit)
        self._shadow = self._array(ctx, shadow)

    def _array(self, ctx: moderngl.Context, program: moderngl.Program) -> moderngl.VertexArray:
        colored = "in_color" in program
        instances = (
            ("4f 4f 4f/i", "in_start", "in_end", "in_color")
            if colored
            else ("4f 4f 16x/i", "in_start", "in_end")
        )
        content = [
            (self._shape, "3f 1f", "in_normal", "in_along"),
            (self._instances, *instances),
        ]
        return ctx.vertex_array(program, content, self._index)

    def take(self, made: Rods) -> None:
        """Hold these rods, and no others."""
        self._count = len(made)
        if self._count:
            self._instances.orphan(max(self._instances.size, made.nbytes))
            self._instances.write(made.tobytes())

    def draw(self) -> None:
        """Draw them lit."""
        if self._count:
            self._lit.render(instances=self._count)

    def draw_shadow(self) -> None:
        """Draw them into the shadow map."""
        if self._count:
            self._shadow.render(instances=self._count)

    def release(self) -> None:
        """Give back what the graphics card holds."""
        for held in (self._lit, self._shadow, self._instances, self._index, self._shape):
            held.release()
