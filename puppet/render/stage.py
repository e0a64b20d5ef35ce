"""The stage itself: floor, room, key light with its shadow map, and what all programs know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.render.boxes import corners_of
from puppet.render.camera import Camera
from puppet.render.program import STAGE_BINDING, TEXTURE_UNITS, load_program
from puppet.render.skin import Glow


@dataclass(frozen=True, slots=True)
class ShadowQuality:
    """How finely shadows are drawn: texels on each side of the shadow map, and how it is sampled.

    taps: samples a pixel takes, 1, 2 or 4. spread: texels that they lie from the middle.
    """

    size: int
    taps: int
    spread: int
    floor_taps: int
    floor_spread: int

    @property
    def surface(self) -> dict[str, int]:
        """What programs that draw puppets and performers are built with."""
        return self._defines(self.taps, self.spread)

    @property
    def floor(self) -> dict[str, int]:
        """What the program that draws shadows on the floor is built with: they show best there."""
        return self._defines(self.floor_taps, self.floor_spread)

    def _defines(self, taps: int, spread: int) -> dict[str, int]:
        return {"SHADOW_SIZE": self.size, "SHADOW_TAPS": taps, "SHADOW_SPREAD": spread}


#: For graphics cards and for pictures that nobody waits for; and for processors that draw.
FINE: Final = ShadowQuality(size=1024, taps=2, spread=1, floor_taps=4, floor_spread=3)
QUICK: Final = ShadowQuality(size=512, taps=1, spread=0, floor_taps=2, floor_spread=1)

#: The shadow map covers what is on stage, in steps (metres), so that shadows do not swim.
_SHADOW_STEP: Final = 0.5
_SHADOW_MARGIN: Final = 0.1
#: Metres, half the floor's side; the pool of light ends before.
_FLOOR: Final = 12.0
#: How many lamps of puppets light their surroundings.
_GLOWS: Final = 2
_GLOW_REACH: Final = 2.2
_GLOW_LIGHT: Final = 0.16
#: The side of a cell of the floor, metres; at most so many cells in a row.
_CELL: Final = 0.1
_CELLS: Final = 96
#: Metres around the shadow of a box that its soft edge may need.
_SOFT: Final = 0.04

_KEY: Final = np.array([-0.42, 0.86, 0.56]) / np.linalg.norm([-0.42, 0.86, 0.56])

_UNIFORMS: Final = np.dtype(
    [
        ("clip_from_world", "f4", (4, 4)),
        ("shadow_from_world", "f4", (4, 4)),
        ("eye", "f4", 4),
        ("key_direction", "f4", 4),
        ("key_color", "f4", 4),
        ("sky_color", "f4", 4),
        ("bounce_color", "f4", 4),
        ("pool", "f4", 4),
        ("glow_position", "f4", (2, 4)),
        ("glow_color", "f4", (2, 4)),
        ("viewport", "f4", 4),
    ]
)


class Stage:
    """Floor, room and light. `set` it for a picture, draw the shadows, then draw the rest."""

    def __init__(self, ctx: moderngl.Context, shadows: ShadowQuality = FINE) -> None:
        self._ctx = ctx
        self._shadows = shadows
        self._block = ctx.buffer(reserve=_UNIFORMS.itemsize, dynamic=True)
        self._values = np.zeros((), _UNIFORMS)
        self._values["key_direction"][:3] = _KEY
        self._values["key_color"][:3] = (2.05, 1.90, 1.66)
        self._values["sky_color"][:3] = (0.40, 0.43, 0.50)
        self._values["bounce_color"][:3] = (0.19, 0.155, 0.13)

        self._shadow_map = ctx.depth_texture((shadows.size, shadows.size))
        self._shadow_map.compare_func = "<="
        self._shadow_map.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._shadow_map.repeat_x = self._shadow_map.repeat_y = False
        self._shadow_target = ctx.framebuffer(depth_attachment=self._shadow_map)

        self._programs = (
            load_program(ctx, "screen", "backdrop"),
            load_program(ctx, "floor", "floor"),
            load_program(ctx, "floor", "fallen", defines=shadows.floor),
        )
        room, floor, shaded = self._programs
        corners = _FLOOR * np.array([-1, -1, -1, 1, 1, -1, 1, 1], np.float32)
        self._corners = ctx.buffer(corners.tobytes())
        self._cells = ctx.buffer(reserve=6 * 8 * 64, dynamic=True)
        self._cell_vertices = 0
        self._room = ctx.vertex_array(room, [])
        self._floor = ctx.vertex_array(floor, [(self._corners, "2f", "in_place")])
        self._shaded = ctx.vertex_array(shaded, [(self._cells, "2f", "in_place")])

    def set(
        self, camera: Camera, size: tuple[int, int], boxes: Floats, glows: Sequence[Glow]
    ) -> None:
        """Aim camera and light.

        size: pixels, width and height. boxes: (N, 2, 3) metres, world, lowest and highest corner of
        each thing that throws a shadow. glows: lamps on stage; from the third on they light nothing
        but themselves.
        """
        width, height = size
        values = self._values
        # GL wants columns, numpy has rows.
        values["clip_from_world"] = camera.clip_from_world(width / height).T
        values["eye"][:3] = camera.eye
        values["viewport"] = (
            *(1.0 / width, 1.0 / height, width / height),
            min(len(glows), _GLOWS),
        )
        values["pool"][:3] = (camera.target[0], camera.target[2], 1.0 / _pool_radius(camera) ** 2)
        shadow, texel = _shadow_from_world(corners_of(boxes), self._shadows.size)
        values["shadow_from_world"] = shadow.T
        values["eye"][3] = texel
        for index, glow in enumerate(glows[:_GLOWS]):
            values["glow_position"][index] = (*glow.center, 1.0 / _GLOW_REACH**2)
            values["glow_color"][index, :3] = _GLOW_LIGHT * glow.color
        self._block.write(values.tobytes())
        self._block.bind_to_uniform_block(STAGE_BINDING)

        cells = _shaded_cells(boxes)
        self._cell_vertices = len(cells)
        self._cells.orphan(max(self._cells.size, cells.nbytes))
        self._cells.write(cells.tobytes())

    def begin_shadows(self) -> None:
        """From here everything is drawn into the shadow map."""
        self._shadow_target.use()
        self._shadow_target.clear(depth=1.0)
        self._ctx.enable_only(moderngl.DEPTH_TEST)
        self._ctx.polygon_offset = (1.5, 2.0)

    def end_shadows(self) -> None:
        """The shadow map is done, and is there for the programs that light things."""
        self._ctx.polygon_offset = (0.0, 0.0)
        self._shadow_map.use(TEXTURE_UNITS["shadow_map"])

    def draw_empty(self) -> None:
        """Draw room and floor, without shadows, over all of the bound framebuffer."""
        self._ctx.enable_only(moderngl.NOTHING)
        self._room.render(vertices=3)
        self._ctx.enable_only(moderngl.DEPTH_TEST)
        self._floor.render(moderngl.TRIANGLE_STRIP)

    def draw_shaded(self) -> None:
        """Darken the floor where shadows fall; after all that stands on it."""
        if self._cell_vertices:
            self._ctx.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
            self._ctx.polygon_offset = (-1.0, -1.0)
            self._shaded.render(vertices=self._cell_vertices)
            self._ctx.polygon_offset = (0.0, 0.0)

    def release(self) -> None:
        """Give back what the graphics card holds."""
        for held in (self._room, self._floor, self._shaded, *self._programs):
            held.release()
        for buffer in (self._block, self._corners, self._cells):
            buffer.release()
        self._shadow_target.release()
        self._shadow_map.release()


def _pool_radius(camera: Camera) -> float:
    """Metres: the pool of light fills the picture, whatever it shows."""
    return min(max(1.05 * camera.distance, 1.5), 0.9 * _FLOOR)


def _shadow_from_world(corners: Floats, size: int) -> tuple[Floats, float]:
    """The light's view of these points as texture and depth coordinates, and metres per texel."""
    right = np.cross([0.0, 1.0, 0.0], _KEY)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(_KEY, right), _KEY])
    seen = corners @ axes.T if len(corners) else np.zeros((1, 3))
    low, high = seen.min(axis=0), seen.max(axis=0)
    side = float((high - low)[:2].max()) + 2.0 * _SHADOW_MARGIN
    # In steps, so that a shadow's edge does not shimmer while others move.
    side = float(np.ceil(side / _SHADOW_STEP)) * _SHADOW_STEP
    texel = side / size
    middle = np.round((low + high)[:2] / 2.0 / texel) * texel
    deep = float(high[2] - low[2]) + 2.0 * _SHADOW_MARGIN
    matrix = np.eye(4)
    matrix[:3, :3] = axes / np.array([[side], [side], [-deep]])
    matrix[:2, 3] = 0.5 - middle / side
    matrix[2, 3] = (float(high[2]) + _SHADOW_MARGIN) / deep
    return matrix, texel


def _shaded_cells(boxes: Floats) -> NDArray[np.float32]:
    """The cells of the floor on which the shadow of a box falls, as triangles. -> (6 K, 2) x, z"""
    corners = boxes[:, [0, 0, 1, 1]][:, :, [0, 2]]  # the low end twice, the high end twice
    heights = np.maximum(boxes[:, [0, 1, 0, 1], 1], 0.0)
    # What x and z get from their own end and y from either: four corners bound the shadow.
    fallen = corners - heights[:, :, None] * (_KEY[[0, 2]] / _KEY[1])
    low = np.clip(fallen.min(axis=1) - _SOFT, -_FLOOR, _FLOOR)
    high = np.clip(fallen.max(axis=1) + _SOFT, -_FLOOR, _FLOOR)
    if len(boxes) == 0:
        return np.empty((0, 2), np.float32)
    start = low.min(axis=0)
    side = max(_CELL, float((high.max(axis=0) - start).max()) / _CELLS)
    first = ((low - start) / side).astype(int)
    last = ((high - start) / side).astype(int) + 1
    # Rectangles into a grid by their corners, then summed up along both directions.
    grid = np.zeros((int(last[:, 0].max()) + 1, int(last[:, 1].max()) + 1), int)
    for x, z, sign in (
        (first[:, 0], first[:, 1], 1),
        (last[:, 0], first[:, 1], -1),
        (first[:, 0], last[:, 1], -1),
        (last[:, 0], last[:, 1], 1),
    ):
        np.add.at(grid, (x, z), sign)
    cells = np.argwhere(grid.cumsum(axis=0).cumsum(axis=1) > 0)
    square = np.array([[0, 0], [0, 1], [1, 0], [1, 0], [0, 1], [1, 1]])
    points = start + side * (cells[:, None, :] + square)
    flat: NDArray[np.float32] = points.reshape(-1, 2).astype(np.float32)
    return flat
