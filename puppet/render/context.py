"""A GL context without a window."""

from __future__ import annotations

import os
from typing import Any

import moderngl

from puppet.errors import UnavailableError

#: Renderers that draw on the processor, where every sample is paid in full.
_SOFTWARE = ("llvmpipe", "softpipe", "swiftshader", "software rasterizer")


def headless_context() -> moderngl.Context:
    """A fresh GL 3.3 context on no display, by EGL; without a graphics card Mesa draws in software.

    Raises UnavailableError where there is no EGL or no GL 3.3.
    """
    # With as many threads as cores, Mesa's software renderer lets a core wait whenever the thread
    # that feeds it is busy; one more took the 99th percentile of the live show from 40 to 28 ms.
    os.environ.setdefault("LP_NUM_THREADS", str(min((os.cpu_count() or 1) + 1, 16)))
    try:
        settings: dict[str, Any] = {"backend": "egl"}
        return moderngl.create_context(standalone=True, require=330, **settings)
    # glcontext raises bare Exceptions, and what it says depends on the library that is missing.
    except Exception as error:
        raise UnavailableError(
            "there is no GL to draw with",
            expected="OpenGL 3.3 by EGL",
            found=str(error) or type(error).__name__,
            hint="apt install libegl1 libgl1 (and libgl1-mesa-dri to draw without a graphics card)",
        ) from error


def is_software(ctx: moderngl.Context) -> bool:
    """Whether the processor does the drawing."""
    name = str(ctx.info.get("GL_RENDERER", "")).lower()
    return any(word in name for word in _SOFTWARE)
