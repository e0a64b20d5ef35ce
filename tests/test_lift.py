from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.skeleton import JOINT_COUNT, Joint, TrackingState
from puppet.tracking.blazepose import LANDMARK_COUNT, Landmarks, Region
from puppet.tracking.lift import Intrinsics, Lift

WIDTH, HEIGHT = 1280, 720
LENS = Intrinsics.assumed(WIDTH, HEIGHT)
LEFT_WRIST = 15


def body(seed: int, place: tuple[float, float, float], visibility: float = 1.0) -> Landmarks:
    """Landmarks of a random body whose hips are at `place` (x right, y down, z away), metres."""
    world = np.random.default_rng(seed).normal(0.0, [0.15, 0.3, 0.12], (LANDMARK_COUNT, 3))
    at = world + place
    pixels = at[:, :2] / at[:, 2:] * LENS.focal + (LENS.centre_x, LENS.centre_y)
    return Landmarks(
        pixels,
        world,
        np.full(LANDMARK_COUNT, visibility),
        np.ones(LANDMARK_COUNT),
        1.0,
        Region(np.zeros(2), 1.0, 0.0),
    )


def test_the_assumed_lens_sees_sixty_degrees_along_the_longer_side() -> None:
    for width, height in ((1280, 720), (720, 1280)):
        lens = Intrinsics.assumed(width, height)
        assert math.degrees(2 * math.atan(640 / lens.focal)) == pytest.approx(60.0)
    assert Intrinsics.assumed(100, 50, focal=70.0).focal == 70.0


@given(
    seed=st.integers(0, 1000),
    x=st.floats(-0.5, 0.5),
    y=st.floats(-0.3, 0.3),
    z=st.floats(2.5, 8.0),
)
def test_a_body_is_put_where_it_was(seed: int, x: float, y: float, z: float) -> None:
    seen = body(seed, (x, y, z))
    positions, _ = Lift(LENS, WIDTH, HEIGHT).joints(seen, 0.0)
    camera = (seen.world + np.array([x, y, z])) * (1.0, -1.0, -1.0)
    np.testing.assert_allclose(positions[Joint.WRIST_LEFT], camera[LEFT_WRIST], atol=1e-6)
    np.testing.assert_allclose(positions[Joint.HEAD], camera[[7, 8]].mean(0), atol=1e-6)
    hips, shoulders = camera[[23, 24]].mean(0), camera[[11, 12]].mean(0)
    np.testing.assert_allclose(
        positions[Joint.SHOULDER_CENTER], hips + 1.1 * (shoulders - hips), atol=1e-6
    )


def test_left_is_left() -> None:
    seen = body(1, (0.0, 0.0, 3.0))
    pixels = seen.pixels.copy()
    pixels[LEFT_WRIST] += (200.0, -100.0)
    before, _ = Lift(LENS, WIDTH, HEIGHT).joints(seen, 0.0)
    after, _ = Lift(LENS, WIDTH, HEIGHT).joints(replace(seen, pixels=pixels), 0.0)
    moved = after - before
    assert moved[Joint.WRIST_LEFT, 0] > 0.2  # right in the image is +X, where his left hand is
    assert moved[Joint.WRIST_LEFT, 1] > 0.1  # up in the image is +Y
    others = np.arange(JOINT_COUNT) != Joint.WRIST_LEFT
    assert np.abs(moved[others, :2]).max() < 0.1


def test_a_hidden_landmark_keeps_the_shape_of_the_body() -> None:
    seen = body(2, (0.0, 0.0, 3.0))
    pixels, visibility = seen.pixels.copy(), seen.visibility.copy()
    pixels[LEFT_WRIST] += 300.0
    visibility[LEFT_WRIST] = 0.0
    expected, _ = Lift(LENS, WIDTH, HEIGHT).joints(seen, 0.0)
    hidden = replace(seen, pixels=pixels, visibility=visibility)
    found, _ = Lift(LENS, WIDTH, HEIGHT).joints(hidden, 0.0)
    np.testing.assert_allclose(found, expected, atol=0.02)


def test_the_distance_moves_smoothly_and_arrives() -> None:
    lift = Lift(LENS, WIDTH, HEIGHT)
    lift.joints(body(3, (0.0, 0.0, 3.0)), 0.0)
    places = [
        lift.joints(body(3, (0.0, 0.0, 4.0)), (frame + 1) / 30)[0][Joint.HIP_CENTER, 2]
        for frame in range(30)
    ]
    assert (np.diff(places) <= 1e-9).all()
    assert abs(places[0] - places[-1]) > 0.5
    fresh, _ = Lift(LENS, WIDTH, HEIGHT).joints(body(3, (0.0, 0.0, 4.0)), 0.0)
    assert places[-1] == pytest.approx(fresh[Joint.HIP_CENTER, 2], abs=0.01)


def test_landmarks_that_make_no_sense_give_finite_joints() -> None:
    seen = body(4, (0.0, 0.0, 3.0))
    for pixels in (np.zeros_like(seen.pixels), -seen.pixels, seen.pixels * 1e6):
        positions, _ = Lift(LENS, WIDTH, HEIGHT).joints(replace(seen, pixels=pixels), 0.0)
        assert np.isfinite(positions).all()
        assert (positions[:, 2] < 0.0).all()


def states(lift: Lift, visibility: float, presence: float = 1.0) -> int:
    seen = body(5, (0.0, 0.0, 6.0), visibility)
    _, found = lift.joints(replace(seen, presence=np.full(LANDMARK_COUNT, presence)), 0.0)
    assert len(set(found.tolist())) == 1
    return int(found[0])


def test_a_joint_is_tracked_late_and_inferred_early() -> None:
    lift = Lift(LENS, WIDTH, HEIGHT)
    seen = [states(lift, visibility) for visibility in (0.7, 0.9, 0.7, 0.5, 0.7, 0.9)]
    assert seen == [1, 2, 2, 1, 1, 2]
    lift.reset()
    assert states(lift, 0.7) == TrackingState.INFERRED


def test_a_joint_outside_of_all_images_is_not_tracked() -> None:
    lift = Lift(LENS, WIDTH, HEIGHT)
    seen = [states(lift, 1.0, presence) for presence in (0.3, 0.5, 0.3, 0.1)]
    assert seen == [0, 2, 2, 0]


def test_what_is_outside_of_the_image_is_inferred_at_best() -> None:
    seen = body(6, (0.0, 0.0, 6.0))
    pixels = seen.pixels.copy()
    pixels[LEFT_WRIST] = (-30.0, 100.0)
    _, found = Lift(LENS, WIDTH, HEIGHT).joints(replace(seen, pixels=pixels), 0.0)
    assert found[Joint.WRIST_LEFT] == TrackingState.INFERRED
    assert (np.delete(found, Joint.WRIST_LEFT) == TrackingState.TRACKED).all()


def test_from_the_side_the_head_is_seen_all_the_same() -> None:
    seen = body(7, (0.0, 0.0, 6.0))
    visibility = seen.visibility.copy()
    visibility[[8, 12]] = 0.1
    _, found = Lift(LENS, WIDTH, HEIGHT).joints(replace(seen, visibility=visibility), 0.0)
    assert found[Joint.HEAD] == TrackingState.TRACKED
    assert found[Joint.SHOULDER_CENTER] == TrackingState.INFERRED
