"""What pictures are drawn on: samples, supersampling, the finished picture."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from puppet.errors import PuppetError
from puppet.render.program import TEXTURE_UNITS, load_program


class Canvas:
    """Draw on `scene`, then `finish`; the picture is on `output`.

    size: pixels of the finished picture, width and height. samples: of each pixel's edges, 0 for
    none. supersample: draws so many times as wide and high, and averages.

    background has the form of `scene`, for what can be kept from one picture to the next; it is
    None where there are samples, since those cannot be copied.
    """

    scene: moderngl.Framebuffer
    background: moderngl.Framebuffer | None
    output: moderngl.Framebuffer

    def __init__(
        self, ctx: moderngl.Context, size: tuple[int, int], samples: int, supersample: int
    ) -> None:
        self._ctx = ctx
        self.samples = max(0, min(samples, int(ctx.info["GL_MAX_SAMPLES"])))
        self._supersample = max(1, supersample)
        self._shrinking = load_program(ctx, "screen", "shrink")
        self._shrink = ctx.vertex_array(self._shrinking, [])
        self._held: list[moderngl.Framebuffer | moderngl.Renderbuffer | moderngl.Texture] = []
        self.size = (0, 0)
        self.resize(size)

    @property
    def drawn_size(self) -> tuple[int, int]:
        """Pixels, width and height of what is drawn on."""
        return self.size[0] * self._supersample, self.size[1] * self._supersample

    def resize(self, size: tuple[int, int]) -> None:
        """Make pictures of this size. Raises PuppetError for more than the graphics card can do."""
        size = (max(1, size[0]), max(1, size[1]))
        limit = int(self._ctx.info["GL_MAX_TEXTURE_SIZE"]) // self._supersample
        if max(size) > limit:
            raise PuppetError(
                "the picture is too large to draw",
                expected=f"at most {limit} pixels on a side",
                found=f"{size[0]}×{size[1]}",
            )
        if size == self.size:
            return
        self.size = size
        self._release_targets()
        self.scene = self._framebuffer(self.samples)
        self.background = self._framebuffer(0) if self.samples == 0 else None
        self._resolved = self.scene
        if self.samples > 0 or self._supersample > 1:
            texture = self._ctx.texture(self.drawn_size, 4)
            self._resolved = self._ctx.framebuffer(texture)
            self._held += [self._resolved, texture]
            self._resolved_texture = texture
        self.output = self._resolved
        if self._supersample > 1:
            color = self._ctx.renderbuffer(size, 4)
            self.output = self._ctx.framebuffer(color)
            self._held += [self.output, color]

    def finish(self) -> None:
        """Turn what was drawn on `scene` into the picture on `output`, and leave that bound."""
        if self._resolved is not self.scene:
            self._ctx.copy_framebuffer(self._resolved, self.scene)
        self.output.use()
        if self.output is not self._resolved:
            self._ctx.enable_only(moderngl.NOTHING)
            self._resolved_texture.use(TEXTURE_UNITS["picture"])
            self._shrinking["steps"] = self._supersample
            self._shrink.render(vertices=3)

    def read(self) -> NDArray[np.uint8]:
        """The picture on `output`: (height, width, 3) sRGB, the top row first."""
        width, height = self.size
        data = self.output.read(components=3, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(height, width, 3)[::-1].copy()

    def release(self) -> None:
        """Give back what the graphics card holds."""
        self._release_targets()
        self._shrink.release()
        self._shrinking.release()

    def _framebuffer(self, samples: int) -> moderngl.Framebuffer:
        color = self._ctx.renderbuffer(self.drawn_size, 4, samples=samples)
        depth = self._ctx.depth_renderbuffer(self.drawn_size, samples=samples)
        made = self._ctx.framebuffer(color, depth)
        self._held += [made, color, depth]
        return made

    def _release_targets(self) -> None:
        for held in self._held:
            held.release()
        self._held = []
