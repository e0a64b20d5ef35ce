"""Pictures from a real GL context without a window."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from puppet.errors import PuppetError, UnavailableError
from puppet.mesh import Material, Model
from puppet.pose import Pose, rest_pose
from puppet.render.camera import Camera
from puppet.render.context import headless_context, is_software
from puppet.render.palette import HUMAN_BONE_COLORS, HUMAN_BONE_HEX
from puppet.render.renderer import Renderer
from puppet.render.scene import Picture, PuppetOnStage, Status
from puppet.render.window import Window, display_available
from puppet.rotation import exp
from puppet.skeleton import HUMAN_BONE_NAMES, Joint, TrackingState
from tests.stage_models import standing, tower

SIZE = (320, 240)
CAMERA = Camera(pitch=0.25, distance=4.0, target=(0.0, 0.6, 0.0))

Pixels = NDArray[np.uint8]


@pytest.fixture(scope="module")
def ctx() -> Iterator[moderngl.Context]:
    try:
        made = headless_context()
    except UnavailableError as error:
        pytest.skip(f"no GL without a window here: {error}")
    yield made
    made.release()


@pytest.fixture
def renderer(ctx: moderngl.Context) -> Iterator[Renderer]:
    made = Renderer(ctx, SIZE, samples=0)
    yield made
    made.release()
    assert ctx.error == "GL_NO_ERROR"


def shot(renderer: Renderer, picture: Picture) -> Pixels:
    renderer.draw(picture)
    return renderer.read()


def differ(a: Pixels, b: Pixels, by: int = 8) -> NDArray[np.bool_]:
    """(h, w) where two pictures are visibly not the same."""
    found: NDArray[np.bool_] = np.abs(a.astype(int) - b.astype(int)).max(axis=2) > by
    return found


def bent(model: Model, bone: int, vector: tuple[float, float, float]) -> Pose:
    pose = rest_pose(model.armature)
    pose.bones[bone] = exp(np.array(vector))
    return pose


def lifted(pose: Pose, to: tuple[float, float, float]) -> Pose:
    return replace(pose, translation=np.array(to))


def test_the_rest_pose_is_drawn_where_the_mesh_is(renderer: Renderer) -> None:
    model = tower(2)
    renderer.add_puppet(PuppetOnStage("tower", model))
    empty = shot(renderer, Picture(camera=CAMERA))
    drawn = shot(renderer, Picture({"tower": rest_pose(model.armature)}, camera=CAMERA))
    inside = CAMERA.project([(0.0, y, 0.1) for y in (0.1, 0.5, 0.9)], SIZE).astype(int)
    assert differ(empty, drawn)[inside[:, 1], inside[:, 0]].all()
    beside = CAMERA.project([(0.3, 0.8, 0.1), (-0.3, 0.8, 0.1), (0.0, 1.2, 0.0)], SIZE).astype(int)
    assert not differ(empty, drawn)[beside[:, 1], beside[:, 0]].any()


def test_a_bone_that_turns_moves_exactly_its_pixels(renderer: Renderer) -> None:
    model = tower(2)
    renderer.add_puppet(PuppetOnStage("tower", model))
    # High above the floor, so that its shadow is out of the picture.
    high = (0.0, 40.0, 0.0)
    camera = replace(CAMERA, target=(0.0, 40.5, 0.0), pitch=0.0)
    straight = Picture({"tower": lifted(rest_pose(model.armature), high)}, camera=camera)
    turned = Picture({"tower": lifted(bent(model, 1, (0, 0, -1.2)), high)}, camera=camera)
    moved = np.argwhere(differ(shot(renderer, straight), shot(renderer, turned)))
    joint = camera.project([(0.0, 40.5, 0.1)], SIZE)[0]
    reach = camera.project([(0.6, 41.1, 0.1), (-0.25, 40.3, 0.1)], SIZE)
    assert len(moved) > 300
    # Only the upper box, and only to the side to which it turns.
    assert moved[:, 0].max() < joint[1] + 12
    assert (moved[:, 1] > reach[1, 0]).all()
    assert (moved[:, 1] < reach[0, 0]).all()
    assert (moved[:, 0] > reach[0, 1]).all()


@pytest.mark.parametrize("height", [0.5, 1.5])
def test_a_shadow_darkens_the_ground_where_the_light_is_blocked(
    renderer: Renderer, height: float
) -> None:
    model = tower(1, height=0.3, width=0.4)
    renderer.add_puppet(PuppetOnStage("box", model))
    camera = Camera(pitch=0.6, distance=6.0, target=(0.0, 0.5, 0.0))
    empty = shot(renderer, Picture(camera=camera))
    pose = lifted(rest_pose(model.armature), (0.0, height, 0.0))
    drawn = shot(renderer, Picture({"box": pose}, camera=camera))
    # The key light comes from the left, from above and from the front.
    middle = height + 0.15
    fallen = camera.project([(0.42 / 0.86 * middle, 0.0, -0.56 / 0.86 * middle)], SIZE)[0]
    x, y = fallen.astype(int)
    assert drawn[y, x].mean() < 0.75 * empty[y, x].mean()
    # And it darkens nothing that the light reaches.
    lit = camera.project([(-1.0, 0.0, 0.5), (1.5, 0.0, 0.8)], SIZE).astype(int)
    assert not differ(empty, drawn, 2)[lit[:, 1], lit[:, 0]].any()


def test_a_puppet_out_of_sight_changes_nothing(renderer: Renderer) -> None:
    model = tower(2)
    renderer.add_puppet(PuppetOnStage("tower", model, {0: 0, 1: 1}))
    empty = shot(renderer, Picture(camera=CAMERA))
    behind = lifted(rest_pose(model.armature), (0.0, 0.0, 30.0))
    assert not differ(empty, shot(renderer, Picture({"tower": behind}, camera=CAMERA)), 0).any()


def test_a_puppet_without_a_pose_is_not_drawn_and_one_unknown_is_no_mistake(
    renderer: Renderer,
) -> None:
    model = tower(2)
    renderer.add_puppet(PuppetOnStage("tower", model))
    empty = shot(renderer, Picture(camera=CAMERA))
    stranger = Picture({"stranger": rest_pose(model.armature)}, camera=CAMERA)
    assert not differ(empty, shot(renderer, stranger), 0).any()
    renderer.remove_puppet("tower")
    renderer.remove_puppet("tower")
    assert renderer.puppets == ()
    gone = Picture({"tower": rest_pose(model.armature)}, camera=CAMERA)
    assert not differ(empty, shot(renderer, gone), 0).any()


def test_a_pose_with_values_that_are_not_numbers_is_left_out(renderer: Renderer) -> None:
    model = tower(2)
    renderer.add_puppet(PuppetOnStage("tower", model))
    empty = shot(renderer, Picture(camera=CAMERA))
    pose = rest_pose(model.armature)
    pose.bones[0] = np.nan
    assert not differ(empty, shot(renderer, Picture({"tower": pose}, camera=CAMERA)), 0).any()


def test_a_pose_of_another_armature_is_an_error_that_names_the_puppet(renderer: Renderer) -> None:
    renderer.add_puppet(PuppetOnStage("tower", tower(2)))
    with pytest.raises(PuppetError, match="tower") as caught:
        renderer.draw(Picture({"tower": rest_pose(tower(3).armature)}, camera=CAMERA))
    assert caught.value.expected == "rotations of 2 bones"


def test_an_armature_of_600_bones_is_drawn(renderer: Renderer) -> None:
    model = tower(600)
    renderer.add_puppet(PuppetOnStage("long", model, {599: 2}))
    empty = shot(renderer, Picture(camera=CAMERA))
    straight = shot(renderer, Picture({"long": rest_pose(model.armature)}, camera=CAMERA))
    curl = rest_pose(model.armature)
    curl.bones[:] = exp(np.array([0.0, 0.0, -0.005]))
    curled = shot(renderer, Picture({"long": curl}, camera=CAMERA))
    # 600 bones of 5 mrad each make an arc of 3 rad, whose tip hangs beside the root.
    tip = CAMERA.project([(0.66, 0.1, 0.05)], SIZE)[0].astype(int)
    assert differ(empty, straight).sum() > 500
    assert differ(straight, curled)[tip[1], tip[0]]


def test_an_armature_without_skin_shows_its_marks_alone(renderer: Renderer) -> None:
    bare = Model(tower(2).armature, ())
    renderer.add_puppet(PuppetOnStage("bare", bare, {1: HUMAN_BONE_NAMES.index("forearm.L")}))
    pose = {"bare": rest_pose(bare.armature)}
    without = shot(renderer, Picture(pose, camera=CAMERA, show_pairs=False))
    assert not differ(shot(renderer, Picture(camera=CAMERA)), without, 0).any()
    changed = differ(without, shot(renderer, Picture(pose, camera=CAMERA)))
    rows = np.argwhere(changed)[:, 0]
    assert len(rows) > 10
    assert rows.max() < CAMERA.project([(0.0, 0.45, 0.0)], SIZE)[0, 1]


def test_the_performers_left_hand_is_on_the_viewers_right(renderer: Renderer) -> None:
    left_only = standing(0)
    for joint in (Joint.SHOULDER_LEFT, Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT):
        left_only.states[joint] = TrackingState.TRACKED
    empty = shot(renderer, Picture(camera=CAMERA))
    drawn = differ(empty, shot(renderer, Picture(performers=[left_only], camera=CAMERA)))
    above = drawn[: SIZE[1] // 2]
    assert np.argwhere(above)[:, 1].min() > SIZE[0] // 2


def test_the_performer_stands_and_faces_where_the_picture_says(renderer: Renderer) -> None:
    frame = standing()
    half_turn = Picture(
        performers=[frame], performer_offset=(0.5, 0.0, -1.0), performer_yaw=np.pi, camera=CAMERA
    )
    joints = half_turn.in_world(frame)
    np.testing.assert_allclose(joints[Joint.HIP_CENTER], (0.5, 0.95, -1.0), atol=1e-9)
    assert joints[Joint.HAND_LEFT][0] < 0.5
    empty = shot(renderer, Picture(camera=CAMERA))
    x, y = CAMERA.project([joints[Joint.HEAD]], SIZE)[0].astype(int)
    assert differ(empty, shot(renderer, half_turn))[y, x]


def test_a_mapped_human_bone_has_its_colour_and_the_others_are_grey(renderer: Renderer) -> None:
    forearm = HUMAN_BONE_NAMES.index("forearm.L")
    renderer.add_puppet(PuppetOnStage("tower", tower(2), {0: forearm}))
    camera = replace(CAMERA, target=(0.48, 1.1, 0.0), distance=1.5, pitch=0.0)
    drawn = shot(renderer, Picture(performers=[standing()], camera=camera)).astype(int)
    frame = standing().positions
    for start, end, colored in (("ELBOW", "WRIST", True), ("SHOULDER", "ELBOW", False)):
        middle = (frame[Joint[f"{start}_LEFT"]] + frame[Joint[f"{end}_LEFT"]]) / 2
        x, y = camera.project([middle], SIZE)[0].astype(int)
        red, _, blue = drawn[y, x]
        assert (blue > red + 40) == colored


def test_an_inferred_joint_is_fainter_and_a_lost_one_is_left_out(renderer: Renderer) -> None:
    empty = shot(renderer, Picture(camera=CAMERA)).astype(int)

    def strength(state: TrackingState) -> int:
        picture = Picture(performers=[standing(state)], camera=CAMERA)
        return int(np.abs(shot(renderer, picture).astype(int) - empty).sum())

    tracked, inferred, lost = (strength(state) for state in reversed(TrackingState))
    assert lost == 0
    assert 0 < 3 * inferred < tracked


def test_joints_that_are_not_numbers_are_left_out(renderer: Renderer) -> None:
    frame = standing()
    frame.positions[Joint.HAND_LEFT] = np.nan
    picture = Picture(performers=[frame], camera=CAMERA)
    assert np.isfinite(renderer.extent(picture)).all()
    lost = standing()
    lost.states[Joint.HAND_LEFT] = 0
    expected = shot(renderer, replace(picture, performers=[lost]))
    assert not differ(shot(renderer, picture), expected, 0).any()


def test_the_extent_holds_all_that_is_drawn(renderer: Renderer) -> None:
    model = tower(3, height=1.2)
    renderer.add_puppet(PuppetOnStage("tower", model))
    pose = lifted(bent(model, 1, (0.3, 0, 0.7)), (0.8, 0.0, 0.0))
    picture = Picture({"tower": pose}, [standing()], performer_offset=(-0.8, 0, 0))
    for yaw in (0.0, 0.7, -2.0):
        camera = replace(Camera(), yaw=yaw).frame_all(renderer.extent(picture), SIZE[0] / SIZE[1])
        drawn = shot(renderer, replace(picture, camera=camera))
        empty = shot(renderer, Picture(camera=camera))
        solid = np.argwhere((drawn.astype(int) - empty).max(axis=2) > 50)
        assert solid.min() > 0
        assert (solid.max(axis=0) < (SIZE[1] - 1, SIZE[0] - 1)).all()
        assert np.ptp(solid[:, 0]) > 0.5 * SIZE[1]


def test_the_top_row_comes_first(renderer: Renderer) -> None:
    drawn = shot(renderer, Picture(performers=[standing()], camera=replace(CAMERA, pitch=0.1)))
    assert drawn.shape == (SIZE[1], SIZE[0], 3)
    assert drawn.dtype == np.uint8
    # The lit floor is below, the dark room above.
    assert drawn[-20:].mean() > 1.5 * drawn[:20].mean()


def test_the_same_picture_is_drawn_the_same_again(renderer: Renderer) -> None:
    model = tower(2)
    renderer.add_puppet(PuppetOnStage("tower", model, {1: 4}))
    picture = Picture({"tower": rest_pose(model.armature)}, [standing()], camera=CAMERA)
    first = shot(renderer, picture)
    shot(renderer, Picture(camera=replace(CAMERA, yaw=1.0)))
    assert (shot(renderer, picture) == first).all()


def test_samples_smooth_the_edges_and_change_little_else(ctx: moderngl.Context) -> None:
    model = tower(2)
    pictures = []
    for samples, supersample in ((0, 1), (4, 1), (0, 2)):
        renderer = Renderer(ctx, SIZE, samples, supersample=supersample)
        renderer.add_puppet(PuppetOnStage("tower", model))
        pose = bent(model, 1, (0.0, 0.0, 0.3))
        pictures.append(shot(renderer, Picture({"tower": pose}, camera=CAMERA)))
        renderer.release()
    for smooth in pictures[1:]:
        changed = differ(pictures[0], smooth, 12)
        assert 20 < changed.sum() < 0.03 * changed.size


def test_the_processor_gets_no_samples_unless_it_is_told_to(ctx: moderngl.Context) -> None:
    renderer = Renderer(ctx, (16, 16))
    assert renderer.samples == (0 if is_software(ctx) else 4)
    renderer.release()


def test_a_resized_renderer_draws_pictures_of_the_new_size(renderer: Renderer) -> None:
    renderer.resize((200, 100))
    assert shot(renderer, Picture(camera=CAMERA)).shape == (100, 200, 3)
    renderer.resize((0, 0))
    assert shot(renderer, Picture(camera=CAMERA)).shape == (1, 1, 3)
    with pytest.raises(PuppetError, match="too large"):
        renderer.resize((10**6, 10))


def test_the_target_gets_a_copy(ctx: moderngl.Context, renderer: Renderer) -> None:
    target = ctx.simple_framebuffer(SIZE)
    renderer.draw(Picture(performers=[standing()], camera=CAMERA), target)
    data = target.read(components=3, alignment=1)
    copied = np.frombuffer(data, np.uint8).reshape(SIZE[1], SIZE[0], 3)[::-1]
    assert (copied == renderer.read()).all()
    target.release()


def test_a_lamp_glows_and_a_spark_does_not(renderer: Renderer) -> None:
    shining = Material("glass", (1.0, 0.8, 0.4, 1.0), emissive=(1.0, 0.7, 0.2))
    camera = replace(CAMERA, target=(0.0, 20.0, 0.0), pitch=0.0)
    around = camera.project([(0.25, 20.5, 0.0)], SIZE)[0].astype(int)
    empty = shot(renderer, Picture(camera=camera))
    for name, material, glows in (("bulb", shining, True), ("post", Material(), False)):
        model = tower(1, material=material)
        renderer.add_puppet(PuppetOnStage(name, model))
        pose = lifted(rest_pose(model.armature), (0.0, 20.0, 0.0))
        drawn = shot(renderer, Picture({name: pose}, camera=camera))
        assert differ(empty, drawn, 4)[around[1], around[0]] == glows


def test_a_texture_is_drawn_the_right_way_round_and_a_clear_skin_lets_light_through(
    renderer: Renderer,
) -> None:
    green = np.zeros((4, 4, 4), np.uint8)
    green[..., 1] = green[..., 3] = 255
    model = tower(1, material=Material("green", (1.0, 1.0, 1.0, 1.0), texture=green))
    renderer.add_puppet(PuppetOnStage("tower", model))
    pose = {"tower": rest_pose(model.armature)}
    x, y = CAMERA.project([(0.0, 0.5, 0.1)], SIZE)[0].astype(int)
    red, seen, blue = shot(renderer, Picture(pose, camera=CAMERA))[y, x].astype(int)
    assert seen > red + 60
    assert seen > blue + 60
    glass = tower(1, material=Material("glass", (1.0, 1.0, 1.0, 0.2)))
    renderer.add_puppet(PuppetOnStage("tower", glass))
    clear = shot(renderer, Picture(pose, camera=CAMERA))[y, x].astype(int)
    empty = shot(renderer, Picture(camera=CAMERA))[y, x].astype(int)
    assert 0 < clear.mean() - empty.mean() < 90


def test_the_overlay_speaks_in_the_lower_left_corner_and_nowhere_else(renderer: Renderer) -> None:
    plain = Picture(performers=[standing()], camera=CAMERA)
    spoken = replace(plain, status=Status(60.0, 0.021, "webcam:0", ("rehearsal · synthetic",)))
    changed = np.argwhere(differ(shot(renderer, plain), shot(renderer, spoken)))
    assert len(changed) > 100
    assert changed[:, 0].min() > 0.7 * SIZE[1]
    assert changed[:, 1].max() < 0.8 * SIZE[0]


def test_every_human_bone_has_a_colour_of_its_own() -> None:
    assert tuple(HUMAN_BONE_HEX) == HUMAN_BONE_NAMES
    apart = np.linalg.norm(HUMAN_BONE_COLORS[:, None] - HUMAN_BONE_COLORS[None], axis=2)
    assert apart[~np.eye(len(apart), dtype=bool)].min() > 0.05


def test_without_gl_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(**_: object) -> None:
        raise Exception("libEGL.so.1 not loaded")

    monkeypatch.setattr(moderngl, "create_context", broken)
    with pytest.raises(UnavailableError) as caught:
        headless_context()
    assert "libEGL.so.1 not loaded" in str(caught.value)
    assert "apt install libegl1 libgl1" in str(caught.value)


def test_without_a_display_the_window_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    assert not display_available()
    with pytest.raises(UnavailableError, match="no display"):
        Window()


def test_a_display_that_does_not_answer_is_an_error_and_no_crash(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", ":9347")
    monkeypatch.setattr(sys, "platform", "linux")
    with pytest.raises(UnavailableError, match="no window") as caught:
        Window()
    assert "--headless" in str(caught.value)


IN_A_WINDOW = """
import glfw, numpy as np
from puppet.render.renderer import Renderer
from puppet.render.scene import Picture
from puppet.render.window import Window, display_available
from tests.stage_models import standing

assert display_available()
asked = []
with Window("a test", (320, 240), vsync=False, on_picture=lambda: asked.append(1)) as window:
    assert window.title == "a test" and window.framebuffer_size == (320, 240)
    renderer = Renderer(window.ctx, window.framebuffer_size)
    for size in (320, 240), (480, 300), (200, 160):
        glfw.set_window_size(window._window, *size)
        while window.framebuffer_size != size:
            window.poll()
        window.poll()
        renderer.resize(size)
        renderer.draw(Picture(performers=[standing()], camera=window.camera), window.ctx.screen)
        assert window.ctx.error == "GL_NO_ERROR"
        seen = window.ctx.screen.read((0, 0, *size), components=3, alignment=1)
        shown = np.frombuffer(seen, np.uint8)
        window.ctx.error  # asking a window for what it shows leaves one behind
        assert (shown.reshape(size[1], size[0], 3)[::-1] == renderer.read()).all()
        assert shown.std() > 10
        window.swap()
    window.poll()
    press = lambda key: window._pressed(window._window, key, 0, glfw.PRESS, 0)
    press(glfw.KEY_B), press(glfw.KEY_O), press(glfw.KEY_P)
    assert (window.show_pairs, window.overlay, asked) == (False, False, [1])
    window._scrolled(window._window, 0.0, 2.0)
    assert window.camera.distance < window.home.distance
    press(glfw.KEY_R)
    assert window.camera == window.home and window.runs
    press(glfw.KEY_ESCAPE)
    assert not window.runs
    renderer.release()
window.close()
assert not window.runs
print("fine")
"""


def test_a_window_shows_the_picture_and_listens_to_its_keys() -> None:
    xvfb = shutil.which("xvfb-run")
    if xvfb is None:
        pytest.skip("xvfb-run is not installed")
    environment = {k: v for k, v in os.environ.items() if k not in {"DISPLAY", "WAYLAND_DISPLAY"}}
    done = subprocess.run(
        [xvfb, "-a", sys.executable, "-W", "error", "-c", IN_A_WINDOW],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=environment,
    )
    assert done.stdout.strip() == "fine", done.stderr
