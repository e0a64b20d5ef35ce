"""The veil of light around a lamp that a puppet carries, and its shine on the floor below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import moderngl
import numpy as np

from puppet.render.program import load_program
from puppet.render.skin import Glow

#: How far the veil reaches, in radii of the lamp, and how bright it is in the middle.
_REACH: Final = 5.0
_BRIGHTNESS: Final = 0.16


class Halos:
    """Squares that face the camera and add light to what is behind them."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = load_program(ctx, "halo", "halo")
        self._square = ctx.buffer(np.array([-1, -1, 1, -1, -1, 1, 1, 1], np.float32).tobytes())
        self._array = ctx.vertex_array(self._program, [(self._square, "2f", "in_corner")])

    def draw(self, glows: Sequence[Glow]) -> None:
        """Draw a veil around each of these into the bound framebuffer."""
        if not glows:
            return
        ctx = self._ctx
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        ctx.blend_func = moderngl.ONE, moderngl.ONE
        ctx.fbo.depth_mask = False
        for glow in glows:
            self._program["halo"] = (*glow.center, _REACH * glow.radius)
            self._program["shine"] = tuple(_BRIGHTNESS * glow.color / glow.color.max())
            self._array.render(moderngl.TRIANGLE_STRIP)
        ctx.fbo.depth_mask = True
        ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA

    def release(self) -> None:
        """Give back what the graphics card holds."""
        self._array.release()
        self._square.release()
        self._program.release()
