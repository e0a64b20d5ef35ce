"""`puppet view`: scenes → pictures, in a window or without one."""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import moderngl
import numpy as np

from puppet.errors import PuppetError
from puppet.formats.armature_toml import load_puppet
from puppet.net.bus import Bus
from puppet.net.health import Health
from puppet.net.latency import Latency
from puppet.net.messages import CastMessage, Decoder, SceneMessage
from puppet.render.background import BackgroundOutput
from puppet.render.renderer import Renderer
from puppet.render.scene import Picture, PuppetOnStage, Status
from puppet.render.staging import Staging
from puppet.render.window import Window
from puppet.show import PuppetConfig, ViewConfig

#: Seconds to wait for a scene before looking whether it is time to end.
PATIENCE = 0.1
#: Pictures between two looks at the percentiles, which cost more than counting.
FIGURES_EVERY = 15
#: Pictures that are drawn before the first one counts: drivers compile what they draw.
WARM_UP = 5


class Viewer:
    """Draws the newest scene of a show."""

    def __init__(
        self, ctx: moderngl.Context, bus: Bus, view: ViewConfig, puppets: Sequence[PuppetConfig]
    ) -> None:
        self.health = Health(bus, "view")
        self.renderer = Renderer(ctx, (view.width, view.height))
        self.staging = Staging(view, (), view.width / view.height)
        self.overlay = True
        self._ctx = ctx
        self._bus = bus
        self._view = view
        self._places = {puppet.name: np.array(puppet.position, float) for puppet in puppets}
        self._scenes = bus.latest("scene")
        self._decode = Decoder(SceneMessage)
        self._decode_cast = Decoder(CastMessage)
        self._cast = self._mapping = -1
        self._latency = Latency()
        self._figures: tuple[float | None, float | None] = (None, None)
        bus.be_present("view", str(time.monotonic_ns()))

    def next_scene(self, timeout: float) -> SceneMessage | None:
        """The newest scene that has not been drawn, if one comes within `timeout` seconds.

        Something that cannot be understood is told in the viewer's health, and left out.
        """
        data = self._scenes.take(timeout)
        if data is None:
            return None
        try:
            scene = self._decode(data)
            if scene.cast != self._cast:
                self._meet_cast()
                for _ in range(WARM_UP):
                    self.draw(scene)
                return None  # that took a while: the scene is old by now
            if scene.mapping != self._mapping:
                self._meet_mapping(scene.mapping)
        except PuppetError as error:
            self._refuse(error)
            return None
        return scene

    def draw(self, scene: SceneMessage, target: moderngl.Framebuffer | None = None) -> bool:
        """Draw a scene and wait until the picture is finished.

        A scene that makes no sense is told in the viewer's health and left out: False.
        """
        try:
            self.renderer.draw(self._picture(scene), target)
        except PuppetError as error:
            self._refuse(error)
            return False
        self._ctx.finish()
        return True

    def count(self, scene: SceneMessage) -> None:
        """Take note that a new scene was drawn just now."""
        now, sent = time.monotonic_ns(), scene.frame_sent_ns
        self._latency.drawn(now / 1e9, (now - sent) / 1e9 if sent else None)
        self.health.state = "running"
        self.health.counters["frames_drawn"] += 1
        if self.health.counters["frames_drawn"] % FIGURES_EVERY == 0:
            self._give_figures()
            # Figures that change with every picture cannot be read, and drawing them costs.
            self._figures = (self._latency.fps or None, self._latency.recent)

    def close(self) -> None:
        """Give the last figures and let go."""
        self._give_figures()
        self.health.close()
        self.renderer.release()

    def _refuse(self, error: PuppetError) -> None:
        self.health.counters["refused"] += 1
        self.health.note = str(error)

    def _give_figures(self) -> None:
        self.health.gauges.update(
            fps=self._latency.fps,
            latency_p50_ms=1000.0 * self._latency.percentile(50),
            latency_p99_ms=1000.0 * self._latency.percentile(99),
        )

    def _picture(self, scene: SceneMessage) -> Picture:
        poses = {puppet.name: puppet.pose() for puppet in scene.puppets}
        performers = [now.frame(scene.time, scene.sequence) for now in scene.performers]
        idle = [now.performer for now in scene.performers if not now.parts]
        hip, heading = (0.0, 0.0, 0.0), 0.0
        if scene.performers:
            hip, heading = scene.performers[0].neutral_hip, scene.performers[0].neutral_heading
        status = None
        if self.overlay:
            fps, latency = self._figures
            status = Status(fps, latency, scene.source, _notes(scene))
        return self.staging.picture(poses, performers, hip, heading, status, idle)

    def _meet_mapping(self, revision: int) -> None:
        """Ask the stage what drives what now, for the marks; the models stay as they are."""
        reply = self._bus.ask("cast", timeout=0.1)
        if reply is None:
            return
        cast = self._decode_cast(reply)
        if cast.revision == self._cast:
            for member in cast.members:
                self.renderer.set_pairs(member.name, dict(member.pairs))
            self._mapping = revision

    def _meet_cast(self) -> None:
        """Ask the stage who is on it, and load them."""
        reply = self._bus.ask("cast")
        if reply is None:
            return
        cast = self._decode_cast(reply)
        for name in self.renderer.puppets:
            self.renderer.remove_puppet(name)
        extents = []
        for member in cast.members:
            model = load_puppet(Path(member.armature)).model.scaled(member.scale)
            self.renderer.add_puppet(PuppetOnStage(member.name, model, dict(member.pairs)))
            place = self._places.get(member.name, np.zeros(3))
            extents.append(self.renderer.rest_extent(member.name, place))
        width, height = self.renderer.size
        self.staging = Staging(self._view, extents, width / height)
        self._cast = cast.revision
        # What was loaded stays: the collector need not look through it between two pictures.
        gc.collect()
        gc.freeze()


def _notes(scene: SceneMessage) -> tuple[str, ...]:
    if not scene.source:
        return ("waiting for a tracker",)
    notes = ["synthetic"] if scene.synthetic else []
    if scene.performers and not scene.performers[0].measured:
        notes.append("stand still to calibrate")
    return tuple(notes)


def run_headless(
    viewer: Viewer, stop: threading.Event, outputs: Sequence[BackgroundOutput]
) -> None:
    """Draw every scene as it comes, and hand the pictures to the outputs."""
    try:
        while not stop.is_set():
            scene = viewer.next_scene(PATIENCE)
            if scene is not None and viewer.draw(scene):
                viewer.count(scene)
                _hand_on(viewer, outputs)
    finally:
        _close(viewer, outputs)


def run_window(
    viewer: Viewer, window: Window, stop: threading.Event, outputs: Sequence[BackgroundOutput]
) -> None:
    """Draw the newest scene at the display's own rate, until the window is closed."""
    scene: SceneMessage | None = None
    staging: Staging | None = None
    try:
        while not stop.is_set() and window.runs:
            newer = viewer.next_scene(PATIENCE if scene is None else 0.0)
            window.poll()
            if staging is not viewer.staging:  # another cast: look at all of it
                staging = viewer.staging
                window.camera = window.home = staging.home
            staging.camera, staging.show_pairs = window.camera, window.show_pairs
            viewer.overlay = window.overlay
            scene = newer or scene
            if scene is not None and window.framebuffer_size != (0, 0):
                viewer.renderer.resize(window.framebuffer_size)
                drawn = viewer.draw(scene, window.ctx.screen)
                if drawn and newer is not None:
                    viewer.count(newer)
                    _hand_on(viewer, outputs)
            window.swap()
    finally:
        _close(viewer, outputs)


def _hand_on(viewer: Viewer, outputs: Sequence[BackgroundOutput]) -> None:
    now = time.monotonic()
    wanting = [output for output in outputs if output.wants(now)]
    if wanting:
        image = viewer.renderer.read()
        for output in wanting:
            output.write(image, now)


def _close(viewer: Viewer, outputs: Sequence[BackgroundOutput]) -> None:
    for output in outputs:
        output.close()
        if output.failure is not None:
            viewer.health.note = str(output.failure)
    viewer.close()
