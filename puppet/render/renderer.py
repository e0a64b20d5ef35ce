"""Pictures from poses: the same for a window, a file and a test."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.pose import Pose, rest_pose
from puppet.render.boxes import corners_of
from puppet.render.canvas import Canvas
from puppet.render.context import is_software
from puppet.render.halo import Halos
from puppet.render.overlay import Overlay
from puppet.render.palette import HUMAN_BONE_COLORS
from puppet.render.performer import Figure, figure, together
from puppet.render.program import load_program
from puppet.render.rods import Manner, RodBatch, Rods, boxes_of, no_rods, rods
from puppet.render.scene import Picture, PuppetOnStage
from puppet.render.skin import Skin, SkinPrograms
from puppet.render.stage import FINE, QUICK, Stage

#: How thick a mark on a puppet is, as a part of the armature's size, and how much it covers.
_MARK_RADIUS: Final = 0.011
_MARK_ALPHA: Final = 0.55


class Renderer:
    """Draws pictures of the puppets that were added to it.

    size: pixels, width and height. samples: of each pixel's edges, 0 for none; None takes 4 where
    there is a graphics card, and none where the processor draws. supersample: draws so many times
    as wide and high and averages, for pictures that nobody waits for.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        size: tuple[int, int],
        samples: int | None = None,
        *,
        supersample: int = 1,
    ) -> None:
        self._ctx = ctx
        if samples is None:
            samples = 0 if is_software(ctx) else 4
        self._canvas = Canvas(ctx, size, samples, supersample)
        shadows = FINE if self._canvas.fine else QUICK
        self._stage = Stage(ctx, shadows)
        self._programs = SkinPrograms(ctx, shadows.surface)
        self._rod_shadow = load_program(ctx, "rod", "depth", defines={"INTO_SHADOW_MAP": 1})
        self._rod_lit = {manner: manner.program(ctx, shadows.surface) for manner in Manner}
        # Bones end inside their joints, so they need no caps of their own.
        self._bones = self._batch(Manner.SOLID, 12, 0)
        self._joints = self._batch(Manner.SOLID, 12, 3)
        self._head = self._batch(Manner.SOLID, 28, 8)
        self._hollow = self._batch(Manner.HOLLOW, 14, 4)
        self._marks = self._batch(Manner.MARK, 10, 2)
        self._halos = Halos(ctx)
        self._overlay = Overlay(ctx)
        self._skins: dict[str, Skin] = {}
        #: What the kept picture of the empty stage was drawn for.
        self._empty_for: object = None

    def _batch(self, manner: Manner, sides: int, rings: int) -> RodBatch:
        lit = self._rod_lit[manner]
        return RodBatch(self._ctx, lit, self._rod_shadow, sides=sides, rings=rings)

    # -- what is on stage ------------------------------------------------------------------------

    @property
    def puppets(self) -> tuple[str, ...]:
        """The names of the puppets that pictures may show."""
        return tuple(self._skins)

    def add_puppet(self, puppet: PuppetOnStage) -> None:
        """Upload a puppet; one of the same name is replaced.

        Raises PuppetError if the graphics card cannot hold it.
        """
        skin = Skin(self._ctx, self._programs, puppet)
        self.remove_puppet(puppet.name)
        self._skins[puppet.name] = skin

    def set_pairs(self, name: str, pairs: Mapping[int, int]) -> None:
        """Show another mapping on a puppet that is on stage: bone -> human bone."""
        self._skins[name].pairs = dict(pairs)

    def remove_puppet(self, name: str) -> None:
        """Take a puppet off; one that is not there is no mistake."""
        skin = self._skins.pop(name, None)
        if skin is not None:
            skin.release()

    def extent(self, picture: Picture) -> Floats:
        """(N, 3) metres, points around all that the picture shows: for `Camera.frame_all`."""
        boxes = [skin.boxes for skin in self._posed(picture)]
        parts = self._figure(picture)
        boxes += [boxes_of(parts.solid), boxes_of(parts.hollow)]
        return corners_of(np.concatenate(boxes))

    def rest_extent(self, name: str, place: Floats) -> Floats:
        """(N, 3) metres, points around a puppet that rests at `place` (3,): for the staging."""
        rest = rest_pose(self._skins[name].armature)
        return self.extent(Picture(poses={name: Pose(place, rest.rotation, rest.bones)}))

    # -- pictures --------------------------------------------------------------------------------

    @property
    def size(self) -> tuple[int, int]:
        """Pixels, width and height of the pictures."""
        return self._canvas.size

    @property
    def samples(self) -> int:
        """Samples of each pixel's edges; 0 for none."""
        return self._canvas.samples

    def resize(self, size: tuple[int, int]) -> None:
        """Draw pictures of this size (width, height in pixels) from now on.

        Raises PuppetError if the graphics card cannot draw so many pixels.
        """
        if self._canvas.resize(size):
            self._empty_for = None

    def draw(self, picture: Picture, target: moderngl.Framebuffer | None = None) -> None:
        """Draw a picture; `target` gets a copy of it.

        Raises PuppetError for a pose that does not fit its puppet.
        """
        skins = self._posed(picture)
        parts = self._figure(picture)
        for batch, some in (
            (self._bones, parts.bones),
            (self._joints, parts.joints),
            (self._head, parts.head),
            (self._hollow, parts.hollow),
            (self._marks, _marks(skins) if picture.show_pairs else no_rods()),
        ):
            batch.take(some)
        boxes = np.concatenate([*(skin.boxes for skin in skins), boxes_of(parts.solid)])
        glows = [glow for skin in skins for glow in skin.glows]
        self._stage.set(picture.camera, self._canvas.drawn_size, boxes, glows)

        self._draw_shadows(skins)
        self._draw_empty(picture)
        self._draw_solid(skins)
        self._stage.draw_shaded()
        self._draw_blended(skins)
        self._halos.draw(glows)
        self._canvas.finish()
        self._overlay.draw(picture, self.size)
        if target is not None:
            self._canvas.show(target)

    def read(self) -> NDArray[np.uint8]:
        """The last picture: (height, width, 3) sRGB, the top row first."""
        return self._canvas.read()

    def release(self) -> None:
        """Give back what the graphics card holds."""
        for name in self.puppets:
            self.remove_puppet(name)
        for batch in (self._bones, self._joints, self._head, self._hollow, self._marks):
            batch.release()
        for program in (self._rod_shadow, *self._rod_lit.values()):
            program.release()
        self._programs.release()
        self._halos.release()
        self._overlay.release()
        self._stage.release()
        self._canvas.release()

    # -- parts of a picture ----------------------------------------------------------------------

    def _posed(self, picture: Picture) -> list[Skin]:
        return [
            skin
            for name, skin in self._skins.items()
            if name in picture.poses and skin.take(picture.poses[name])
        ]

    def _figure(self, picture: Picture) -> Figure:
        mapped = {human for skin in self._skins.values() for human in skin.pairs.values()}
        return together(
            [
                figure(
                    picture.in_world(frame),
                    frame.states,
                    () if frame.performer in picture.idle else mapped,
                )
                for frame in picture.present
            ]
        )

    def _draw_shadows(self, skins: list[Skin]) -> None:
        self._stage.begin_shadows()
        for skin in skins:
            skin.bend()
            skin.draw_shadow()
        self._ctx.enable(moderngl.CULL_FACE)
        for batch in (self._bones, self._joints, self._head):
            batch.draw_shadow()
        self._stage.end_shadows()

    def _draw_empty(self, picture: Picture) -> None:
        """Room and floor change only with the camera: on the processor a copy is far cheaper."""
        wanted = picture.camera
        if self._canvas.background is None:
            self._canvas.scene.use()
            self._canvas.scene.clear()
            self._stage.draw_empty()
            return
        if wanted != self._empty_for:
            self._canvas.background.use()
            self._canvas.background.clear()
            self._stage.draw_empty()
            self._empty_for = wanted
        self._ctx.copy_framebuffer(self._canvas.scene, self._canvas.background)
        self._canvas.scene.use()

    def _draw_solid(self, skins: list[Skin]) -> None:
        self._ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        for skin in skins:
            skin.draw(translucent=False)
        self._ctx.enable(moderngl.CULL_FACE)
        for batch in (self._bones, self._joints, self._head):
            batch.draw()

    def _draw_blended(self, skins: list[Skin]) -> None:
        self._ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE | moderngl.BLEND)
        for skin in skins:
            skin.draw(translucent=True)
        self._ctx.enable(moderngl.CULL_FACE)
        self._hollow.draw()
        # Marks show through the skin, since a bone is inside of it.
        self._ctx.disable(moderngl.DEPTH_TEST)
        self._marks.draw()


def _marks(skins: list[Skin]) -> Rods:
    """A slim rod along each mapped bone in the colour of its human bone."""
    starts, ends, radii, colors = [], [], [], []
    for skin in skins:
        thick = _MARK_RADIUS * skin.armature.size
        tips = skin.tips
        for bone, human in skin.pairs.items():
            starts.append(skin.origins[bone])
            ends.append(tips[bone])
            radii.append((1.5 * thick, 0.6 * thick))
            colors.append((*HUMAN_BONE_COLORS[human], _MARK_ALPHA))
    if not starts:
        return no_rods()
    return rods(np.array(starts), np.array(ends), np.array(radii), np.array(colors))
