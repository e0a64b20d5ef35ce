"""A window on the stage: glfw opens it, the mouse turns the camera, a few keys do the rest."""

from __future__ import annotations

import ctypes
import os
import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Final, Self

import moderngl

from puppet.errors import UnavailableError
from puppet.render.camera import Camera

#: Radians for a drag over the window's whole height; how much nearer a notch of the wheel brings.
_DRAG: Final = 4.0
_NOTCH: Final = 0.9

KEYS: Final = """\
drag        turn around the stage
right drag  move it
wheel       nearer, farther
R           the camera back to where it was
O           overlay on, off
B           colours of the mapping on, off
P           picture of what is seen
Esc         close"""


def display_available() -> bool:
    """Whether there is a display on which a window could open."""
    if sys.platform in {"win32", "darwin"}:
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


class _Loader:
    """GL's functions as glfw finds them: right for X11, Wayland, Windows and macOS alike."""

    def __init__(self, glfw: Any) -> None:
        self._glfw = glfw

    def load_opengl_function(self, name: str) -> int:
        """The address of a function of GL; 0 if there is none."""
        address = self._glfw.get_proc_address(name)
        return int(ctypes.cast(address, ctypes.c_void_p).value or 0)

    load = load_opengl_function

    def release(self) -> None:
        """The window owns the context."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Nothing to undo: the context stays current in its thread."""


class Window:
    """A window with a GL context of its own. It has to live in the main thread.

    While it `runs`: `poll`, draw into ``window.ctx.screen`` at `framebuffer_size`, then `swap`.
    The camera follows the mouse; `overlay` and `show_pairs` follow their keys; `on_picture` is
    called when a picture is asked for.
    """

    def __init__(
        self,
        title: str = "puppet",
        size: tuple[int, int] = (1280, 720),
        camera: Camera | None = None,
        *,
        vsync: bool = True,
        on_picture: Callable[[], None] | None = None,
    ) -> None:
        """Open it. Raises UnavailableError without a display, or without GL 3.3 on it."""
        import glfw

        self._glfw = glfw
        self._window: Any = None
        self.home = camera or Camera()
        self.camera = self.home
        self.overlay = True
        self.show_pairs = True
        self.on_picture = on_picture
        self._cursor = (0.0, 0.0)
        if not display_available():
            raise _no_window("there is no display")
        with _reasons(glfw) as reasons:
            if not glfw.init():
                raise _no_window("; ".join(reasons))
            for hint, value in (
                (glfw.CONTEXT_VERSION_MAJOR, 3),
                (glfw.CONTEXT_VERSION_MINOR, 3),
                (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
                (glfw.OPENGL_FORWARD_COMPAT, True),
                (glfw.SCALE_TO_MONITOR, True),
            ):
                glfw.window_hint(hint, value)
            self._window = glfw.create_window(*size, title, None, None)
            if not self._window:
                glfw.terminate()
                raise _no_window("; ".join(reasons))
        glfw.make_context_current(self._window)
        glfw.swap_interval(1 if vsync else 0)
        settings: dict[str, Any] = {"context": _Loader(glfw)}
        self.ctx = moderngl.create_context(require=330, **settings)
        glfw.set_cursor_pos_callback(self._window, self._moved)
        glfw.set_scroll_callback(self._window, self._scrolled)
        glfw.set_key_callback(self._window, self._pressed)

    # -- the loop --------------------------------------------------------------------------------

    @property
    def runs(self) -> bool:
        """Whether nobody has closed it yet."""
        return self._window is not None and not self._glfw.window_should_close(self._window)

    @property
    def framebuffer_size(self) -> tuple[int, int]:
        """Pixels, width and height; on a display of high density more than the window's own size.

        (0, 0) while the window is minimised: there is nothing to draw.
        """
        width, height = self._glfw.get_framebuffer_size(self._window)
        return int(width), int(height)

    @property
    def title(self) -> str:
        """What the frame of the window says."""
        return str(self._glfw.get_window_title(self._window))

    @title.setter
    def title(self, text: str) -> None:
        self._glfw.set_window_title(self._window, text)

    def poll(self) -> None:
        """Let mouse and keys do what they were asked for since the last time."""
        self._glfw.poll_events()
        size = self.framebuffer_size
        if size != (0, 0):
            self.ctx.screen.viewport = (0, 0, *size)

    def swap(self) -> None:
        """Show what was drawn, at the display's next refresh."""
        if self.framebuffer_size == (0, 0):
            # No refresh comes for a minimised window: without a pause the loop would spin.
            time.sleep(0.02)
        self._glfw.swap_buffers(self._window)

    def ask_to_close(self) -> None:
        """As if somebody had closed it."""
        self._glfw.set_window_should_close(self._window, True)

    def close(self) -> None:
        """Close it. May be called twice."""
        if self._window is not None:
            window, self._window = self._window, None
            self.ctx.release()
            self._glfw.destroy_window(window)
            self._glfw.terminate()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # -- mouse and keys --------------------------------------------------------------------------

    def _moved(self, window: Any, x: float, y: float) -> None:
        glfw = self._glfw
        height = max(1, glfw.get_window_size(window)[1])
        right, down = (x - self._cursor[0]) / height, (y - self._cursor[1]) / height
        self._cursor = (x, y)

        def held(button: int) -> bool:
            return bool(glfw.get_mouse_button(window, button) == glfw.PRESS)

        if held(glfw.MOUSE_BUTTON_LEFT):
            self.camera = self.camera.orbited(-_DRAG * right, _DRAG * down)
        elif held(glfw.MOUSE_BUTTON_RIGHT) or held(glfw.MOUSE_BUTTON_MIDDLE):
            self.camera = self.camera.panned(-right, down)

    def _scrolled(self, window: Any, across: float, notches: float) -> None:  # noqa: ARG002
        self.camera = self.camera.zoomed(_NOTCH**notches)

    def _pressed(self, window: Any, key: int, code: int, action: int, mods: int) -> None:  # noqa: ARG002
        glfw = self._glfw
        if action != glfw.PRESS:
            return
        if key == glfw.KEY_ESCAPE:
            self.ask_to_close()
        elif key == glfw.KEY_R:
            self.camera = self.home
        elif key == glfw.KEY_O:
            self.overlay = not self.overlay
        elif key == glfw.KEY_B:
            self.show_pairs = not self.show_pairs
        elif key == glfw.KEY_P and self.on_picture is not None:
            self.on_picture()


class _reasons:  # noqa: N801 - used as a block
    """Collects what glfw says is wrong; it would warn, or print, by itself."""

    def __init__(self, glfw: Any) -> None:
        self._glfw = glfw
        self._found: list[str] = []

    def __enter__(self) -> list[str]:
        self._glfw.set_error_callback(self._take)
        return self._found

    def __exit__(self, *_: object) -> None:
        self._glfw.set_error_callback(None)

    def _take(self, code: int, said: bytes | str) -> None:
        text = said.decode(errors="replace") if isinstance(said, bytes) else said
        self._found.append(f"{text} ({code:#x})")


def _no_window(reason: str) -> UnavailableError:
    return UnavailableError(
        "no window can be opened",
        expected="a display with OpenGL 3.3",
        found=reason or "glfw does not say why",
        hint="draw without one: --headless, with --png, --mp4 or --gif",
    )
