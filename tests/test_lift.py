"""From landmarks to joints in metres, with and without depth."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.skeleton import JOINT_COUNT, Joint
from puppet.tracking.body.lift import Lift, Lifted
from puppet.tracking.cameras.camera import Depth
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.people.blazepose import LANDMARK_COUNT, Landmarks
from tests.lifted_bodies import (
    LEFT_WRIST,
    LENS,
    camera_axes,
    depth_of,
    landmarks,
    random_body,
    shot,
    standing_body,
)

places = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.3, 0.3), st.floats(2.5, 8.0))
STANDING = standing_body()


def lift(seen: Landmarks, time: float = 0.0, depth: Depth | None = None) -> Lifted:
    return Lift()(seen, shot(time, depth), LENS)


def test_the_assumed_lens_sees_sixty_degrees_along_the_longer_side() -> None:
    for width, height in ((1280, 720), (720, 1280)):
        lens = Intrinsics.assumed(width, height)
        assert math.degrees(2 * math.atan(640 / lens.focal_x)) == pytest.approx(60.0)
    assert Intrinsics.assumed(100, 50, focal=70.0).focal_y == 70.0


@given(st.floats(0.1, 3.0), st.floats(0.0, 1279.0), st.floats(0.0, 719.0))
def test_the_lens_of_a_resized_image_sees_the_same_rays(factor: float, x: float, y: float) -> None:
    pixel = np.array([[x, y]])
    small = LENS.resized(factor)
    np.testing.assert_allclose(
        small.rays((pixel + 0.5) * factor - 0.5), LENS.rays(pixel), atol=1e-9
    )
    ahead = np.column_stack([LENS.rays(pixel), [[1.0]]])
    np.testing.assert_allclose(LENS.pixels(3.0 * ahead), pixel, atol=1e-9)


@given(st.integers(0, 1000), places)
def test_a_body_is_put_where_it_was(seed: int, place: tuple[float, float, float]) -> None:
    """Anywhere in the image: the network looks at it straight ahead, and that is turned back."""
    world = random_body(seed)
    positions = lift(landmarks(world, place)).positions
    camera = camera_axes(world, place)
    np.testing.assert_allclose(positions[Joint.WRIST_LEFT], camera[LEFT_WRIST], atol=1e-5)
    np.testing.assert_allclose(positions[Joint.HEAD], camera[[7, 8]].mean(0), atol=1e-5)
    hips, shoulders = camera[[23, 24]].mean(0), camera[[11, 12]].mean(0)
    np.testing.assert_allclose(
        positions[Joint.SHOULDER_CENTER], hips + 1.1 * (shoulders - hips), atol=1e-5
    )


def test_left_is_left() -> None:
    seen = landmarks(random_body(1), (0.0, 0.0, 3.0))
    pixels = seen.pixels.copy()
    pixels[LEFT_WRIST] += (200.0, -100.0)
    moved = lift(replace(seen, pixels=pixels)).positions - lift(seen).positions
    assert moved[Joint.WRIST_LEFT, 0] > 0.2  # right in the image is +X, where his left hand is
    assert moved[Joint.WRIST_LEFT, 1] > 0.1  # up in the image is +Y
    others = np.arange(JOINT_COUNT) != Joint.WRIST_LEFT
    assert np.abs(moved[others, :2]).max() < 0.1


def test_a_hidden_landmark_keeps_the_shape_of_the_body() -> None:
    seen = landmarks(random_body(2), (0.0, 0.0, 3.0))
    pixels, visibility = seen.pixels.copy(), seen.visibility.copy()
    pixels[LEFT_WRIST] += 300.0
    visibility[LEFT_WRIST] = 0.0
    hidden = replace(seen, pixels=pixels, visibility=visibility)
    np.testing.assert_allclose(lift(hidden).positions, lift(seen).positions, atol=0.02)


def test_the_distance_moves_smoothly_and_arrives() -> None:
    one = Lift()
    world = random_body(3)
    one(landmarks(world, (0.0, 0.0, 3.0)), shot(0.0), LENS)
    places = []
    for frame in range(30):
        seen = landmarks(world, (0.0, 0.0, 4.0))
        lifted = one(seen, shot((frame + 1) / 30), LENS)
        places.append(lifted.positions[Joint.HIP_CENTER, 2])
    assert (np.diff(places) <= 1e-9).all()
    assert abs(places[0] - places[-1]) > 0.5
    fresh = lift(landmarks(world, (0.0, 0.0, 4.0))).positions
    assert places[-1] == pytest.approx(fresh[Joint.HIP_CENTER, 2], abs=0.01)


def test_landmarks_that_make_no_sense_give_finite_joints() -> None:
    seen = landmarks(random_body(4), (0.0, 0.0, 3.0))
    for pixels in (np.zeros_like(seen.pixels), -seen.pixels, seen.pixels * 1e6):
        for depth in (None, depth_of(STANDING + (0.0, 0.0, 3.0))):
            positions = lift(replace(seen, pixels=pixels), depth=depth).positions
            assert np.isfinite(positions).all()
            assert (positions[:, 2] < 0.0).all()


@given(st.floats(0.55, 1.5), places)
def test_depth_tells_how_large_and_how_far_away_somebody_is(
    size: float, place: tuple[float, float, float]
) -> None:
    """The network takes a child for an adult who is farther away; depth knows better."""
    at = STANDING * size + place
    lifted = lift(landmarks(STANDING, place, size=size), depth=depth_of(at, wall=10.0))
    truth = camera_axes(STANDING * size, place)
    assert lifted.positions[Joint.HIP_LEFT, 2] == pytest.approx(truth[23, 2], abs=0.08)
    trunk = np.linalg.norm(lifted.positions[Joint.SHOULDER_LEFT] - lifted.positions[Joint.HIP_LEFT])
    assert trunk == pytest.approx(np.linalg.norm(truth[11] - truth[23]), rel=0.05)
    assert not lifted.hidden.any()


def test_what_stands_before_a_joint_hides_it() -> None:
    at = STANDING + (0.0, 0.0, 3.0)
    depth = depth_of(at)
    x, y = ((LENS.pixels(at)[LEFT_WRIST] + 0.5) / 4).astype(int)
    depth[y - 12 : y + 12, x - 12 : x + 12] = 1800
    hidden = lift(landmarks(STANDING, (0.0, 0.0, 3.0)), depth=depth).hidden
    assert hidden[LEFT_WRIST]
    assert not hidden[[11, 12, 23, 24, 16, 27, 28]].any()


NOTHING = np.zeros((180, 320), np.uint16)
NONSENSE = (np.random.default_rng(0).random((180, 320)) * 65535).astype(np.uint16)


@pytest.mark.parametrize(
    "depth",
    [NOTHING, np.full((180, 320), 400, np.uint16), np.full((180, 320), 60000, np.uint16), NONSENSE],
    ids=["zeros", "all too near", "all too far", "noise"],
)
def test_depth_that_says_nothing_is_no_worse_than_none(depth: Depth) -> None:
    seen = landmarks(STANDING, (0.2, 0.0, 3.0))
    with_it, without = lift(seen, depth=depth), lift(seen)
    away = np.linalg.norm(with_it.positions - without.positions, axis=1)
    assert np.median(away) < 0.02


def test_the_size_that_depth_has_told_stays_when_depth_is_gone() -> None:
    one = Lift()
    for frame in range(60):
        at = STANDING * 0.7 + (0.0, 0.0, 3.0)
        seen = landmarks(STANDING, (0.0, 0.0, 3.0), size=0.7)
        depth = depth_of(at) if frame < 30 else None
        lifted = one(seen, shot(frame / 30, depth), LENS)
    assert one.size == pytest.approx(0.7, abs=0.02)
    assert lifted.positions[Joint.HIP_LEFT, 2] == pytest.approx(-3.0, abs=0.08)
    assert len(lifted.hidden) == LANDMARK_COUNT
