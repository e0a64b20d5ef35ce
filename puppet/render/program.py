"""Shader files to linked programs."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from types import MappingProxyType
from typing import Final

import moderngl

_FOLDER: Final = files("puppet.render") / "shaders"
_HEADER: Final = "#version 330 core\n"
#: Shared by several shaders; they say ``#include "light.glsl"``.
_SHARED: Final = ("light.glsl", "shadow.glsl", "fill.glsl")

#: Binding point of the uniform block that every program shares.
STAGE_BINDING: Final = 0
#: Texture units, the same in all programs.
TEXTURE_UNITS: Final = {"shadow_map": 0, "base_color": 1, "bone_palette": 2, "picture": 3}


def load_program(
    ctx: moderngl.Context,
    vertex: str,
    fragment: str | None,
    *,
    varyings: tuple[str, ...] = (),
    defines: Mapping[str, int] = MappingProxyType({}),
) -> moderngl.Program:
    """Link ``vertex.vert`` with ``fragment.frag``, or with nothing where `varyings` are caught.

    `defines` become ``#define NAME value`` in both. Texture units and the stage's uniform block are
    bound to their fixed places.
    """
    header = _HEADER + "".join(f"#define {name} {value}\n" for name, value in defines.items())

    def source(name: str) -> str:
        text = (_FOLDER / name).read_text(encoding="utf-8")
        for shared in _SHARED:
            text = text.replace(
                f'#include "{shared}"', (_FOLDER / shared).read_text(encoding="utf-8")
            )
        return header + text

    program = ctx.program(
        vertex_shader=source(f"{vertex}.vert"),
        fragment_shader=None if fragment is None else source(f"{fragment}.frag"),
        varyings=varyings,
    )
    for name, unit in TEXTURE_UNITS.items():
        if name in program:
            program[name] = unit
    block = program.get("Stage", None)
    if isinstance(block, moderngl.UniformBlock):
        block.binding = STAGE_BINDING
    return program
