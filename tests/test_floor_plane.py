"""The floor in depth: in rooms that are worked out ray by ray, and in a real stereo pair."""

from __future__ import annotations

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.kernel import Floats
from puppet.tracking.calibration.floor_plane import find_floor
from puppet.tracking.calibration.floor_watch import AGREE, PAUSE, FloorWatch
from puppet.tracking.calibration.stage_frame import angle_between
from puppet.tracking.cameras.camera import Depth, Shot
from puppet.tracking.cameras.intrinsics import Intrinsics

WIDTH, HEIGHT = 320, 200
LENS = Intrinsics.assumed(WIDTH, HEIGHT, 260.0)
#: What stereo cameras are off by at a metre: it grows with the square of the distance.
NOISE = 0.002
#: Centre (x, height, z), half width, half depth of a table's top; metres on the stage.
TABLE = ((0.8, 0.75, -2.0), 0.6, 0.4)


def room(
    height: float,
    pitch: float,
    roll: float,
    *,
    floor: bool = True,
    table: bool = False,
    people: int = 2,
    noise: float = NOISE,
    holes: float = 0.15,
    garbage: float = 0.02,
    seed: int = 0,
) -> tuple[Depth, Floats]:
    """What a depth camera sees in a room of 5 m by 4.5 m before it, and up in its axes.

    height: of the camera, metres. pitch: radians up. Two side walls, one behind, a ceiling; people
    are upright rectangles.
    """
    random = np.random.default_rng(seed)
    stage_from_camera = Rotation.from_euler("zx", [roll, pitch])
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    pixels = np.stack([columns, rows], axis=-1).reshape(-1, 2).astype(float)
    rays = np.column_stack([LENS.rays(pixels), np.ones(len(pixels))]) * (1.0, -1.0, -1.0)
    rays, eye = stage_from_camera.apply(rays), np.array([0.0, height, 0.0])
    away = np.full(len(rays), np.inf)

    def meet(axis: int, at: float, *bounds: tuple[int, float, float]) -> None:
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (at - eye[axis]) / rays[:, axis]
            places = eye + distance[:, None] * rays
        hit = (distance > 0.0) & (distance < away)
        for across, low, high in bounds:
            hit &= (places[:, across] > low) & (places[:, across] < high)
        away[hit] = distance[hit]

    if floor:
        meet(1, 0.0)
    meet(1, 2.8)
    meet(2, -4.5)
    meet(0, -2.5)
    meet(0, 2.5)
    if table:
        (x, y, z), wide, deep = TABLE
        meet(1, y, (0, x - wide, x + wide), (2, z - deep, z + deep))
    for x, z in ((-0.6, -2.5), (0.5, -3.2), (-1.4, -1.9), (1.3, -2.8))[:people]:
        meet(2, z, (0, x - 0.25, x + 0.25), (1, 0.0, 1.75))
    away = np.where(np.isfinite(away), away, 0.0)
    away += random.normal(0.0, 1.0, len(away)) * noise * away * away
    away[random.random(len(away)) < holes] = 0.0
    wrong = random.random(len(away)) < garbage
    away[wrong] = random.uniform(0.4, 6.0, int(wrong.sum()))
    millimetres = (np.clip(away, 0.0, 60.0) * 1000).astype(np.uint16).reshape(HEIGHT, WIDTH)
    return millimetres, stage_from_camera.inv().apply([0.0, 1.0, 0.0])


#: Cameras that see two metres of floor or more before the wall behind.
cameras = st.tuples(st.floats(0.7, 2.0), st.floats(-0.7, -0.25), st.floats(-0.3, 0.3))


@settings(max_examples=40)
@given(cameras, st.booleans(), st.integers(0, 4), st.integers(0, 1000))
def test_the_floor_is_found_from_any_height_and_tilt(
    camera: tuple[float, float, float], table: bool, people: int, seed: int
) -> None:
    depth, up = room(*camera, table=table, people=people, seed=seed)
    floor = find_floor(depth, LENS)
    assert floor is not None
    assert floor.confidence > 0.5
    assert math.degrees(angle_between(floor.normal, up)) < 1.5
    assert floor.height == pytest.approx(camera[0], abs=0.05)


@settings(max_examples=20)
@given(cameras)
def test_without_noise_it_is_exact(camera: tuple[float, float, float]) -> None:
    depth, up = room(*camera, noise=0.0, holes=0.0, garbage=0.0)
    floor = find_floor(depth, LENS)
    assert floor is not None
    assert math.degrees(angle_between(floor.normal, up)) < 0.15
    assert floor.height == pytest.approx(camera[0], abs=0.01)


@settings(max_examples=25)
@given(st.floats(0.8, 2.4), st.floats(-0.25, 0.1), st.floats(-0.3, 0.3), st.integers(0, 99))
def test_a_floor_that_is_hardly_seen_is_right_or_not_sure(
    height: float, pitch: float, roll: float, seed: int
) -> None:
    depth, up = room(height, pitch, roll, noise=0.003, seed=seed)
    floor = find_floor(depth, LENS)
    if floor is not None and floor.confidence > 0.6:
        assert math.degrees(angle_between(floor.normal, up)) < 4.0
        assert floor.height == pytest.approx(height, abs=0.2)


def test_the_same_image_gives_the_same_floor() -> None:
    depth, _ = room(1.4, -0.4, 0.1)
    first, second = find_floor(depth, LENS), find_floor(depth.copy(), LENS)
    assert first is not None
    assert second is not None
    np.testing.assert_array_equal(first.normal, second.normal)
    assert first.height == second.height


def test_a_table_is_not_the_floor_though_more_is_seen_of_it() -> None:
    depth, up = room(1.3, -0.5, 0.0, people=0)
    # The camera stands at the edge of a large table that fills the lower half of the image.
    table, _ = room(0.35, -0.5, 0.0, people=0)
    lower = np.zeros(depth.shape, bool)
    lower[140:] = True
    depth[lower] = table[lower]
    floor = find_floor(depth, LENS)
    assert floor is not None
    assert floor.height == pytest.approx(1.3, abs=0.05)
    assert math.degrees(angle_between(floor.normal, up)) < 1.5


@pytest.mark.parametrize("roll", [0.0, 0.35])
def test_walls_are_no_floor(roll: float) -> None:
    depth, _ = room(1.2, -0.1, roll, floor=False, people=0)
    floor = find_floor(depth, LENS)
    assert floor is None or floor.confidence < 0.3


def test_where_up_is_known_a_slanted_floor_is_none() -> None:
    depth, up = room(1.2, -0.5, 0.0)
    askew = Rotation.from_euler("x", math.radians(25.0)).apply(up)
    assert find_floor(depth, LENS, up) is not None
    assert find_floor(depth, LENS, askew) is None


def test_a_camera_that_looks_straight_down_needs_to_be_told_where_up_is() -> None:
    depth, up = room(2.2, -1.5, 0.2, people=0)
    floor = find_floor(depth, LENS, up)
    assert floor is not None
    assert floor.height == pytest.approx(2.2, abs=0.03)
    assert find_floor(depth, LENS) is None


@pytest.mark.parametrize("value", [0, 65535, 1500])
def test_depth_without_anything_in_it_has_no_floor(value: int) -> None:
    assert find_floor(np.full((HEIGHT, WIDTH), value, np.uint16), LENS) is None


def test_a_floor_is_looked_for_now_and_then_until_it_is_sure_and_then_stays() -> None:
    watch, image, changes = FloorWatch(), np.zeros((2 * HEIGHT, 2 * WIDTH, 3), np.uint8), []
    lens = LENS.resized(2.0)  # depth has fewer pixels than colour
    for i in range(150):
        height = 1.4 if i < 100 else 2.0  # late in the show somebody moves the camera
        if i % 12 == 0:
            depth, up = room(height, -0.4, 0.1, seed=i)
        if watch.look(Shot(i / 30.0, i, image, depth, lens)):
            changes.append(i / 30.0)
    assert watch.sure
    assert watch.plane is not None
    assert watch.plane.height == pytest.approx(1.4, abs=0.03)
    assert math.degrees(angle_between(watch.plane.normal, up)) < 0.5
    assert len(changes) == AGREE
    assert np.diff(changes).min() >= PAUSE - 1e-6


def test_planes_that_do_not_agree_make_no_floor_sure() -> None:
    watch, image = FloorWatch(), np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    for i in range(10):
        depth, _ = room(1.0 + 0.12 * i, -0.45, 0.0)
        watch.look(Shot(float(i), i, image, depth, LENS))
    assert watch.plane is not None
    assert not watch.sure


def test_the_floor_of_a_real_overhead_camera(shared: Path) -> None:
    """A tiled floor from above, with chairs, and a table that mirrors the sky."""
    found = []
    for frame in (30, 120):
        depth, lens = stereo_depth(shared / "oak", frame)
        floor = find_floor(depth, lens, np.array([0.0, 0.0, 1.0]), math.radians(35.0))
        assert floor is not None
        assert floor.confidence > 0.4
        # Where there is nothing but tiles.
        rows, columns = np.mgrid[260:460:10, 480:1120:10]
        away = depth[rows, columns].ravel() / 1000.0
        rays = lens.rays(np.stack([columns, rows], axis=-1).reshape(-1, 2).astype(float))
        tiles = np.column_stack([rays, np.ones(len(rays))]) * (1.0, -1.0, -1.0) * away[:, None]
        above = (tiles @ floor.normal + floor.height)[away > 0.0]
        assert abs(float(np.median(above))) < 0.04
        found.append(floor)
    assert math.degrees(angle_between(found[0].normal, found[1].normal)) < 4.0
    assert found[0].height == pytest.approx(found[1].height, abs=0.04)


def stereo_depth(folder: Path, frame: int) -> tuple[Depth, Intrinsics]:
    """Depth of one stereo pair of an OAK-D, by its own calibration, and its lens."""
    cameras = dict(json.loads((folder / "calib.json").read_text())["cameraData"])
    left, right = cameras[1], cameras[2]
    lenses = [np.array(camera["intrinsicMatrix"]) for camera in (left, right)]
    bends = [np.array(camera["distortionCoeff"]) for camera in (left, right)]
    shift = [[left["extrinsics"]["translation"][axis] / 100.0] for axis in "xyz"]  # metres
    turn = np.array(left["extrinsics"]["rotationMatrix"])
    size = (left["width"], left["height"])
    rectified = cv2.stereoRectify(
        lenses[0], bends[0], lenses[1], bends[1], size, turn, np.array(shift), alpha=0
    )
    images = []
    for i, side in enumerate(("left", "right")):
        capture = cv2.VideoCapture(str(folder / f"{side}.mp4"))
        capture.set(cv2.CAP_PROP_POS_FRAMES, frame)
        grey = cv2.cvtColor(capture.read()[1], cv2.COLOR_BGR2GRAY)
        capture.release()
        turned, onto = np.array(rectified[i]), np.array(rectified[2 + i])
        maps = cv2.initUndistortRectifyMap(lenses[i], bends[i], turned, onto, size, cv2.CV_32FC1)
        images.append(cv2.remap(grey, *maps, cv2.INTER_LINEAR))
    first, second = np.array(rectified[2]), np.array(rectified[3])
    lens = Intrinsics(first[0, 0], first[1, 1], first[0, 2], first[1, 2])
    matcher = cv2.StereoSGBM.create(
        numDisparities=64, blockSize=7, P1=400, P2=1600, uniquenessRatio=10,
        speckleWindowSize=200, speckleRange=2, disp12MaxDiff=1,
    )  # fmt: skip
    disparity = matcher.compute(*images).astype(float) / 16.0
    baseline = -second[0, 3] / second[0, 0]
    away = np.where(disparity > 1.0, lens.focal_x * baseline / np.maximum(disparity, 1.0), 0.0)
    return np.clip(1000.0 * away, 0, 65535).astype(np.uint16), lens
