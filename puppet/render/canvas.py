"""What pictures are drawn on: samples, supersampling, the finished picture."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from puppet.errors import PuppetError
from puppet.render.program import TEXTURE_UNITS, load_program

Resource = moderngl.Framebuffer | moderngl.Renderbuffer | moderngl.Texture


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
        self._program = load_program(ctx, "screen", "shrink")
        self._shrink = ctx.vertex_array(self._program, [])
        self._held: list[Resource] = []
        self.size = (0, 0)
        self.resize(size)

    @property
    def drawn_size(self) -> tuple[int, int]:
        """Pixels, width and height of what is drawn on."""
        return self.size[0] * self._supersample, self.size[1] * self._supersample

    @property
    def fine(self) -> bool:
        """Whether quality was asked for."""
        return self.samples > 0 or self._supersample > 1

    def resize(self, size: tuple[int, int]) -> bool:
        """Make pictures of this size; False if it already is so.

        Raises PuppetError for more than the graphics card can do.
        """
        size = (max(1, size[0]), max(1, size[1]))
        limit = int(self._ctx.info["GL_MAX_TEXTURE_SIZE"]) // self._supersample
        if max(size) > limit:
            raise PuppetError(
                "the picture is too large to draw",
                expected=f"at most {limit} pixels on a side",
                found=f"{size[0]}×{size[1]}",
            )
        if size == self.size:
            return False
        self.size = size
        old, self._held = self._held, []
        drawn = self.drawn_size
        self.scene, self._drawn = self._framebuffer(drawn, samples=self.samples)
        self.background = None
        if self.samples == 0:
            self.background, _ = self._framebuffer(drawn)
        self._resolved = self.scene
        if self.samples > 0:
            self._resolved, self._drawn = self._framebuffer(drawn, depth=False)
        self.output, self._shown = self._resolved, self._drawn
        if self._supersample > 1:
            self.output, self._shown = self._framebuffer(size, depth=False)
        self._let_go(old)
        return True

    def finish(self) -> None:
        """Turn what was drawn on `scene` into the picture on `output`, and leave that bound."""
        if self._resolved is not self.scene:
            self._ctx.copy_framebuffer(self._resolved, self.scene)
        self.output.use()
        if self.output is not self._resolved:
            self._shrink_into(self._drawn, self._supersample)

    def show(self, target: moderngl.Framebuffer) -> None:
        """Draw the picture into `target`, from its lower left corner on.

        It is drawn, not copied, since a window's own framebuffer never learns that it was resized.
        """
        target.use()
        target.viewport = (0, 0, *self.size)
        self._shrink_into(self._shown, 1)

    def read(self) -> NDArray[np.uint8]:
        """The picture on `output`: (height, width, 3) sRGB, the top row first."""
        width, height = self.size
        data = self.output.read(components=3, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(height, width, 3)[::-1].copy()

    def release(self) -> None:
        """Give back what the graphics card holds."""
        self._let_go(self._held)
        self._held = []
        self._shrink.release()
        self._program.release()

    def _shrink_into(self, texture: moderngl.Texture, steps: int) -> None:
        self._ctx.enable_only(moderngl.NOTHING)
        texture.use(TEXTURE_UNITS["picture"])
        self._program["steps"] = steps
        self._shrink.render(vertices=3)

    def _framebuffer(
        self, size: tuple[int, int], *, samples: int = 0, depth: bool = True
    ) -> tuple[moderngl.Framebuffer, moderngl.Texture]:
        color = self._ctx.texture(size, 4, samples=samples)
        buffer = self._ctx.depth_renderbuffer(size, samples=samples) if depth else None
        made = self._ctx.framebuffer(color, buffer)
        self._held += [made, color, *([] if buffer is None else [buffer])]
        return made, color

    def _let_go(self, resources: list[Resource]) -> None:
        # The context binds again what was bound last, whether or not it is still there.
        self._ctx.detect_framebuffer(0).use()
        for resource in resources:
            resource.release()
