"""Small text in the corner of a picture, redrawn only when it says something new."""

from __future__ import annotations

from functools import cache
from typing import Final

import moderngl
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from PIL.ImageFont import FreeTypeFont

from puppet.render.palette import srgb
from puppet.render.program import TEXTURE_UNITS, load_program
from puppet.render.scene import Picture
from puppet.skeleton import JOINT_COUNT, TrackingState

_DOTS: Final = {
    TrackingState.TRACKED: "#58c08a",
    TrackingState.INFERRED: "#e8b04a",
    TrackingState.NOT_TRACKED: "#85817b",
}
_TEXT: Final = (236, 231, 222, 235)
_FAINT: Final = (236, 231, 222, 150)
_PLATE: Final = (12, 11, 11, 96)
#: Text height as a part of the picture's, and the least that can be read, in pixels.
_HEIGHT: Final = 1.0 / 48.0
_LEAST: Final = 11


def lines(picture: Picture) -> tuple[str, str]:
    """What the overlay says: who is tracked and how fast, and, fainter, where it comes from."""
    status = picture.status
    if status is None:
        return "", ""
    there = len(picture.present)
    facts = [f"{picture.tracked}/{JOINT_COUNT} joints" if there else "nobody on stage"]
    if there > 1:
        facts.append(f"{there} performers")
    if status.fps is not None:
        facts.append(f"{status.fps:.0f} fps")
    if status.latency is not None:
        facts.append(f"{1000.0 * status.latency:.0f} ms")
    said = [word for word in (status.source, *status.notes) if word]
    return "   ".join(facts), "  ·  ".join(said)


@cache
def font(size: int) -> FreeTypeFont:
    """The font that comes with Pillow, `size` pixels high."""
    loaded = ImageFont.load_default(size=size)
    assert isinstance(loaded, FreeTypeFont)
    return loaded


def text_plate(first: str, second: str, state: TrackingState, height: int) -> Image.Image:
    """The overlay as an RGBA image: a coloured dot, a line, and a fainter one below.

    height: of the text, in pixels.
    """
    large, small = font(height), font(max(_LEAST, round(0.82 * height)))
    pad, dot = round(0.75 * height), round(0.62 * height)
    indent = pad + dot + round(0.55 * height)
    step = round(1.42 * height)
    width = indent + pad + round(max(large.getlength(first), small.getlength(second)))
    tall = 2 * pad + (step if second else 0) + height
    image = Image.new("RGBA", (width, tall), (0, 0, 0, 0))
    draw = ImageDraw.Draw(image)
    draw.rounded_rectangle((0, 0, width - 1, tall - 1), radius=0.7 * height, fill=_PLATE)
    draw.text((indent, pad + height / 2), first, _TEXT, large, anchor="lm")
    if second:
        draw.text((indent, pad + step + height / 2), second, _FAINT, small, anchor="lm")
    # Pillow's circles have hard edges: draw it large, then make it small.
    ball = Image.new("L", (8 * dot, 8 * dot))
    ImageDraw.Draw(ball).ellipse((0, 0, 8 * dot - 1, 8 * dot - 1), fill=255)
    mask = ball.resize((dot, dot), Image.Resampling.LANCZOS)
    place = (pad, pad + (height - dot) // 2)
    image.paste(Image.new("RGBA", (dot, dot), (*srgb(_DOTS[state]), 255)), place, mask)
    return image


class Overlay:
    """The overlay on the graphics card."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = load_program(ctx, "overlay", "overlay")
        self._quad = ctx.vertex_array(self._program, [])
        self._texture: moderngl.Texture | None = None
        self._shown: tuple[object, ...] = ()

    def draw(self, picture: Picture, size: tuple[int, int]) -> None:
        """Draw what the picture's status says into the bound framebuffer of `size` pixels."""
        if picture.status is None:
            return
        height = max(_LEAST, round(_HEIGHT * size[1]))
        wanted = (*lines(picture), picture.state, height)
        if wanted != self._shown or self._texture is None:
            self._upload(text_plate(*wanted))
            self._shown = wanted
        assert self._texture is not None
        margin = round(0.9 * height)
        width, tall = self._texture.size
        self._program["box"] = (
            2.0 * margin / size[0] - 1.0,
            2.0 * margin / size[1] - 1.0,
            2.0 * (margin + width) / size[0] - 1.0,
            2.0 * (margin + tall) / size[1] - 1.0,
        )
        self._texture.use(TEXTURE_UNITS["picture"])
        self._ctx.enable_only(moderngl.BLEND)
        self._ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._quad.render(moderngl.TRIANGLE_STRIP, vertices=4)
        self._ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA

    def release(self) -> None:
        """Give back what the graphics card holds."""
        if self._texture is not None:
            self._texture.release()
            self._texture = None
        self._quad.release()
        self._program.release()

    def _upload(self, image: Image.Image) -> None:
        pixels = np.asarray(image, np.uint16).copy()
        pixels[..., :3] = pixels[..., :3] * pixels[..., 3:] // 255
        data = pixels.astype(np.uint8).tobytes()
        if self._texture is None or self._texture.size != image.size:
            if self._texture is not None:
                self._texture.release()
            self._texture = self._ctx.texture(image.size, 4, data)
            self._texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        else:
            self._texture.write(data)
