"""The camera: where it looks, how it moves, and that it has everything in the picture."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.render.camera import Camera

SIZE = (1280, 720)

angles = st.floats(-math.pi, math.pi)
pitches = st.floats(-0.1, 1.4)
places = st.tuples(*[st.floats(-5, 5)] * 3)
cameras = st.builds(Camera, yaw=angles, pitch=pitches, distance=st.floats(1, 20), target=places)


@given(camera=cameras)
def test_the_target_is_in_the_middle_of_the_picture(camera: Camera) -> None:
    np.testing.assert_allclose(camera.project([camera.target], SIZE), [[640, 360]], atol=1e-6)


@given(camera=cameras)
def test_its_axes_are_a_right_handed_frame(camera: Camera) -> None:
    np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(camera.axes) == pytest.approx(1.0)
    away = np.linalg.norm(camera.eye - camera.target)
    assert away == pytest.approx(camera.distance)


def test_it_stands_before_the_performers_face_with_their_left_on_its_right() -> None:
    camera = Camera(pitch=0.0, target=(0.0, 1.0, 0.0))
    assert camera.eye[2] > 0
    (left, above) = camera.project([(0.5, 1.0, 0.0), (0.0, 1.5, 0.0)], SIZE)
    assert left[0] > 640
    assert above[1] < 360


@given(
    points=st.lists(st.tuples(*[st.floats(-3, 3)] * 3), min_size=1, max_size=20),
    yaw=angles,
    pitch=pitches,
    aspect=st.floats(0.4, 2.5),
)
def test_frame_all_has_every_point_in_the_picture(
    points: list[tuple[float, float, float]], yaw: float, pitch: float, aspect: float
) -> None:
    camera = Camera(yaw=yaw, pitch=pitch).frame_all(points, aspect)
    assert (camera.yaw, camera.pitch) == (yaw, pitch)
    pixels = camera.project(points, (round(1000 * aspect), 1000))
    assert (pixels > 0).all()
    assert (pixels < (1000 * aspect + 1, 1000)).all()


def test_frame_all_fills_the_picture() -> None:
    box = [(x, y, z) for x in (-2, 2) for y in (0, 2) for z in (-0.5, 0.5)]
    camera = Camera(pitch=0.2).frame_all(box, 16 / 9, margin=0.1)
    pixels = camera.project(box, SIZE)
    spans = np.ptp(pixels, axis=0) / SIZE
    assert spans.max() == pytest.approx(0.9, abs=0.01)
    np.testing.assert_allclose((pixels.max(axis=0) + pixels.min(axis=0)) / 2, (640, 360), atol=25)


def test_frame_all_of_nothing_leaves_the_camera_as_it_is() -> None:
    camera = Camera(yaw=0.3)
    assert camera.frame_all(np.empty((0, 3)), 1.5) == camera
    assert camera.frame_all([(math.nan, 0.0, 0.0)], 1.5) == camera


@given(camera=cameras, right=st.floats(-10, 10), up=st.floats(-10, 10))
def test_orbiting_keeps_the_distance_and_stops_before_the_poles(
    camera: Camera, right: float, up: float
) -> None:
    moved = camera.orbited(right, up)
    assert moved.target == camera.target
    assert moved.distance == camera.distance
    assert abs(moved.pitch) < math.pi / 2
    assert abs(moved.yaw) <= math.pi + 1e-9


@given(camera=cameras, factor=st.floats(0.01, 100))
def test_zooming_stops_at_sensible_distances(camera: Camera, factor: float) -> None:
    assert 0.1 < camera.zoomed(factor).distance < 100


@given(camera=cameras, right=st.floats(-0.4, 0.4), up=st.floats(-0.4, 0.4))
def test_what_is_dragged_stays_under_the_cursor(camera: Camera, right: float, up: float) -> None:
    # Dragging by a part of the height pans the other way, and the target follows the cursor.
    moved = camera.panned(-right, -up)
    pixel = moved.project([camera.target], SIZE)[0]
    np.testing.assert_allclose(pixel, (640 + right * 720, 360 - up * 720), atol=1e-6)


def test_a_point_behind_the_camera_has_no_pixel() -> None:
    assert np.isnan(Camera().project([(0.0, 1.0, 50.0)], SIZE)).all()
