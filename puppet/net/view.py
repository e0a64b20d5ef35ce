"""`puppet view`: scenes → pictures, in a window or without one."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

import moderngl
import numpy as np

from puppet.errors import BadFileError, BadMessageError
from puppet.formats.armature_toml import load_puppet
from puppet.net.bus import Bus, Latest
from puppet.net.health import Health
from puppet.net.messages import CastMessage, Decoder, SceneMessage
from puppet.pose import Pose, rest_pose
from puppet.render.output import Output
from puppet.render.renderer import Renderer
from puppet.render.scene import Picture, PuppetOnStage, Status
from puppet.render.staging import Staging
from puppet.render.window import Window
from puppet.show import PuppetConfig, ViewConfig
from puppet.skeleton import SkeletonFrame

#: Seconds without a scene after which a headless viewer looks round for the cast again.
PATIENCE = 1.0 / 15.0
#: How many pictures the latency percentiles are taken over.
MEMORY = 20_000


class Latency:
    """Seconds from the tracker's publication to the finished picture."""

    def __init__(self) -> None:
        self._seconds: deque[float] = deque(maxlen=MEMORY)
        self._drawn: deque[float] = deque(maxlen=90)

    def drawn(self, now: float, latency: float | None) -> None:
        """A picture was finished at `now`."""
        self._drawn.append(now)
        if latency is not None:
            self._seconds.append(latency)

    @property
    def fps(self) -> float:
        """Pictures a second, over the last few."""
        if len(self._drawn) < 2:
            return 0.0
        return (len(self._drawn) - 1) / max(self._drawn[-1] - self._drawn[0], 1e-6)

    @property
    def recent(self) -> float | None:
        """Median of the last half second or so."""
        latest = list(self._seconds)[-30:]
        return float(np.median(latest)) if latest else None

    def percentile(self, share: float) -> float:
        """Seconds below which `share` per cent of the pictures are."""
        return float(np.percentile(list(self._seconds), share)) if self._seconds else 0.0


class Viewer:
    """Draws the newest scene."""

    def __init__(
        self,
        ctx: moderngl.Context,
        bus: Bus,
        view: ViewConfig,
        puppets: Sequence[PuppetConfig],
        *,
        samples: int | None = None,
    ) -> None:
        self.health = Health(bus, "view")
        self.renderer = Renderer(ctx, (view.width, view.height), samples)
        self.show_overlay = True
        self._ctx = ctx
        self._bus = bus
        self._view = view
        self._places = {puppet.name: puppet for puppet in puppets}
        self._scenes: Latest = bus.latest("scene")
        self._decode = Decoder(SceneMessage)
        self._decode_cast = Decoder(CastMessage)
        self._cast = -1
        self._latency = Latency()
        self.staging = Staging(view, (), view.width / view.height)

    def next_scene(self, timeout: float) -> SceneMessage | None:
        """The newest scene that has not been drawn, if one comes within `timeout` seconds."""
        data = self._scenes.take(timeout)
        if data is None:
            return None
        try:
            scene = self._decode(data)
            if scene.cast != self._cast:
                self._meet_cast()
            return scene
        except (BadMessageError, BadFileError) as error:
            self.health.counters["refused"] += 1
            self.health.note = str(error)
            return None

    def draw(self, scene: SceneMessage) -> Picture:
        """Draw a scene into the renderer's picture and wait until it is finished."""
        picture = self._picture(scene)
        self.renderer.draw(picture)
        self._ctx.finish()
        self.drawn(scene)
        return picture

    def drawn(self, scene: SceneMessage) -> None:
        """Take note that a scene has been drawn just now."""
        now = time.monotonic_ns()
        sent = scene.frame_sent_ns
        self._latency.drawn(now / 1e9, (now - sent) / 1e9 if sent else None)
        self.health.state = "running"
        self.health.counters["frames_drawn"] += 1
        self.health.gauges.update(
            fps=self._latency.fps,
            latency_p50_ms=1000.0 * self._latency.percentile(50),
            latency_p99_ms=1000.0 * self._latency.percentile(99),
        ) if self.health.counters["frames_drawn"] % 15 == 0 else None

    def close(self) -> None:
        """Give the final figures and let go."""
        self.health.gauges.update(
            fps=self._latency.fps,
            latency_p50_ms=1000.0 * self._latency.percentile(50),
            latency_p99_ms=1000.0 * self._latency.percentile(99),
        )
        self.health.close()
        self.renderer.release()

    def _picture(self, scene: SceneMessage) -> Picture:
        poses: dict[str, Pose] = {puppet.name: puppet.pose() for puppet in scene.puppets}
        performer: SkeletonFrame | None = None
        hip, heading = (0.0, 0.0, 0.0), 0.0
        notes = []
        if scene.performer is not None:
            performer = scene.performer.frame(scene.time, scene.sequence)
            hip, heading = scene.performer.neutral_hip, scene.performer.neutral_heading
            if not performer.present:
                notes.append("nobody on stage")
        elif scene.source:
            notes.append("nobody on stage")
        if not scene.source:
            notes.append("waiting for a tracker")
        if scene.synthetic:
            notes.append("synthetic")
        status = None
        if self.show_overlay:
            status = Status(
                fps=self._latency.fps or None,
                latency=self._latency.recent,
                source=scene.source,
                notes=tuple(notes),
            )
        return self.staging.picture(poses, performer, hip, heading, status)

    def _meet_cast(self) -> None:
        reply = self._bus.ask("cast")
        if reply is None:
            return
        cast = self._decode_cast(reply)
        for name in self.renderer.puppets:
            self.renderer.remove_puppet(name)
        rest: dict[str, Pose] = {}
        for member in cast.members:
            loaded = load_puppet(Path(member.armature))
            self.renderer.add_puppet(PuppetOnStage(member.name, loaded.model, dict(member.pairs)))
            place = self._places.get(member.name)
            still = rest_pose(loaded.model.armature)
            if place is not None:
                still = Pose(np.array(place.position, float), still.rotation, still.bones)
            rest[member.name] = still
        self.staging = Staging(
            self._view,
            [self.renderer.extent(Picture(poses={name: pose})) for name, pose in rest.items()],
            self.renderer.size[0] / self.renderer.size[1],
        )
        self._cast = cast.revision


def run_headless(viewer: Viewer, stop: threading.Event, outputs: Sequence[Output]) -> None:
    """Draw every scene as it comes, and hand the pictures to the outputs."""
    try:
        while not stop.is_set():
            scene = viewer.next_scene(PATIENCE)
            if scene is None:
                continue
            viewer.draw(scene)
            _hand_on(viewer, outputs)
    finally:
        for output in outputs:
            output.close()
        viewer.close()


def run_window(
    viewer: Viewer, window: Window, stop: threading.Event, outputs: Sequence[Output]
) -> None:
    """Draw the newest scene at the display's own rate, until the window is closed."""
    scene: SceneMessage | None = None
    try:
        while not stop.is_set() and not window.closing:
            newer = viewer.next_scene(0.0 if scene is not None else PATIENCE)
            window.update(viewer.staging, viewer)
            if newer is not None or scene is not None:
                scene = newer or scene
                assert scene is not None
                viewer.renderer.resize(window.size)
                viewer.renderer.draw(viewer._picture(scene), window.target)
                if newer is not None:
                    viewer.drawn(newer)
                    _hand_on(viewer, outputs)
            window.swap()
    finally:
        for output in outputs:
            output.close()
        viewer.close()


def _hand_on(viewer: Viewer, outputs: Sequence[Output]) -> None:
    if not outputs:
        return
    now = time.monotonic()
    wanting = [output for output in outputs if output.wants(now)]
    if wanting:
        image = viewer.renderer.read()
        for output in wanting:
            output.write(image, now)


PictureTaker = Callable[[], None]
