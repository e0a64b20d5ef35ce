from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.kernel import Bytes, Floats
from puppet.skeleton import JOINT_COUNT, Joint, TrackingState
from puppet.tracking.calibration.floor_plane import FloorPlane
from puppet.tracking.calibration.level import Level
from puppet.tracking.calibration.stage_frame import StageFromCamera

TRACKED: Bytes = np.full(JOINT_COUNT, TrackingState.TRACKED, np.uint8)


def standing() -> Floats:
    """Somebody of 1.7 m on the floor, facing +Z, 3 m before a camera at x = z = 0."""
    places = {
        "HIP_CENTER": (0.0, 1.0, 0.0), "SPINE": (0.0, 1.15, 0.0),
        "SHOULDER_CENTER": (0.0, 1.45, 0.0), "HEAD": (0.0, 1.65, 0.02),
        "SHOULDER_LEFT": (0.18, 1.4, 0.0), "ELBOW_LEFT": (0.2, 1.1, 0.0),
        "WRIST_LEFT": (0.2, 0.85, 0.05), "HAND_LEFT": (0.2, 0.78, 0.06),
        "HIP_LEFT": (0.1, 0.95, 0.0), "KNEE_LEFT": (0.1, 0.5, 0.02),
        "ANKLE_LEFT": (0.1, 0.08, 0.0), "FOOT_LEFT": (0.1, 0.0, 0.12),
    }  # fmt: skip
    positions = np.zeros((JOINT_COUNT, 3))
    for name, place in places.items():
        positions[Joint[name]] = place
        mirror = Joint[name.replace("LEFT", "RIGHT")]
        positions[mirror] = np.multiply(place, (-1.0, 1.0, 1.0)) if mirror != Joint[name] else place
    return positions - (0.0, 0.0, 3.0)


def seen_by(camera_height: float, pitch: float, roll: float) -> tuple[Floats, Floats]:
    """The same body and up in the axes of a camera that is tilted down and rolled (rad)."""
    camera_from_stage = Rotation.from_euler("zx", [roll, pitch]).inv()
    body = camera_from_stage.apply(standing() - (0.0, camera_height, 0.0))
    return body, camera_from_stage.apply([0.0, 1.0, 0.0])


tilts = st.tuples(st.floats(0.5, 3.0), st.floats(-0.7, 0.7), st.floats(-0.5, 0.5))


@given(tilts)
def test_a_known_up_and_floor_bring_the_body_back(tilt: tuple[float, float, float]) -> None:
    body, up = seen_by(*tilt)
    found = Level(up * 9.81, floor=tilt[0]).to_stage(body)
    np.testing.assert_allclose(found[:, 1], standing()[:, 1], atol=1e-9)
    # The heading is the camera's own: only lengths are the same for sure.
    np.testing.assert_allclose(np.linalg.norm(found[0] - found[7]), 0.304, atol=1e-3)


@given(st.floats(0.5, 3.0), st.floats(-0.7, 0.7))
def test_whoever_faces_a_camera_that_only_looks_down_faces_z(height: float, pitch: float) -> None:
    body, up = seen_by(height, pitch, 0.0)
    np.testing.assert_allclose(Level(up, height).to_stage(body), standing(), atol=1e-9)


@settings(max_examples=10)
@given(tilts)
def test_standing_people_tell_up_and_floor(tilt: tuple[float, float, float]) -> None:
    body, up = seen_by(*tilt)
    level = Level()
    for _ in range(600):
        level.observe(body, TRACKED)
    level.settle()
    assert math.degrees(math.acos(min(1.0, float(level.up @ up)))) < 2.0
    np.testing.assert_allclose(level.to_stage(body)[:, 1], standing()[:, 1], atol=0.05)


def test_half_a_second_of_standing_settles_a_camera_that_hangs_askew() -> None:
    body, up = seen_by(1.5, -0.5, 0.45)
    level = Level()
    for _ in range(16):
        level.observe(body, TRACKED)
    assert math.degrees(math.acos(float(level.up @ up))) > 5.0
    level.settle()
    assert math.degrees(math.acos(float(level.up @ up))) < 2.0
    np.testing.assert_allclose(level.to_stage(body)[:, 1], standing()[:, 1], atol=0.05)


def test_a_bow_does_not_tilt_the_world() -> None:
    body = standing()
    upper = [joint for joint in Joint if joint.name.split("_")[0] not in ("HIP", "KNEE", "ANKLE")]
    upper = [joint for joint in upper if not joint.name.startswith("FOOT")] + [Joint.HIP_CENTER]
    pivot = body[Joint.HIP_CENTER].copy()
    body[upper] = Rotation.from_euler("x", 1.2).apply(body[upper] - pivot) + pivot
    level = Level()
    for _ in range(300):
        level.observe(body, TRACKED)
    np.testing.assert_array_equal(level.up, [0.0, 1.0, 0.0])


def test_a_jump_does_not_move_the_floor() -> None:
    level = Level(up=(0.0, 1.0, 0.0))
    for frame in range(120):
        lift = 0.4 if 50 <= frame < 65 else 0.0
        level.observe(standing() + np.array([0.0, lift, 0.0]), TRACKED)
    level.settle()
    assert level.to_stage(standing())[:, 1].min() == pytest.approx(0.0, abs=1e-9)


def test_the_floor_does_not_leap_while_it_is_learnt() -> None:
    level = Level(up=(0.0, 1.0, 0.0))
    heights = []
    for frame in range(300):
        drop = 0.3 if frame >= 100 else 0.0
        level.observe(standing() - (0.0, drop, 0.0), TRACKED)
        heights.append(level.stage_from_camera().shift[1])
    assert np.abs(np.diff(heights)).max() < 0.02
    assert heights[-1] == pytest.approx(0.3, abs=0.01)


def test_without_feet_the_hips_tell_the_floor() -> None:
    states = TRACKED.copy()
    states[[Joint.FOOT_LEFT, Joint.FOOT_RIGHT, Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT]] = 0
    level = Level()
    level.observe(standing() - (0.0, 1.0, 0.0), states)
    assert level.to_stage(standing() - (0.0, 1.0, 0.0))[0, 1] == pytest.approx(0.95)


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
def test_a_camera_that_looks_straight_down_or_up_is_levelled(
    up: tuple[float, float, float],
) -> None:
    rotation = Level(up).stage_from_camera().rotation
    np.testing.assert_allclose(rotation @ up, [0.0, 1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_nothing_is_learnt_before_anybody_came() -> None:
    level = Level()
    level.settle()
    np.testing.assert_allclose(level.to_stage(standing()), standing())


def plane(up: Floats, height: float) -> FloorPlane:
    return FloorPlane(up, height, 0.4, 3.0, 0.003, 0.9)


@settings(max_examples=10)
@given(tilts)
def test_a_floor_seen_in_depth_counts_at_once_while_nobody_is_there(
    tilt: tuple[float, float, float],
) -> None:
    body, up = seen_by(*tilt)
    level = Level()
    assert level.origin == "a guess"
    level.see_floor(plane(up, tilt[0]))
    assert level.origin == "depth"
    np.testing.assert_allclose(level.to_stage(body)[:, 1], standing()[:, 1], atol=1e-9)
    for _ in range(100):  # and from then on people teach nothing
        level.observe(body + (0.0, 0.3, 0.0), TRACKED)
    np.testing.assert_allclose(level.to_stage(body)[:, 1], standing()[:, 1], atol=1e-9)


def test_a_floor_seen_in_depth_does_not_move_who_is_there_in_one_go() -> None:
    body, up = seen_by(1.2, -0.3, 0.1)
    level = Level()
    level.observe(body, TRACKED)
    places = [level.to_stage(body)]
    level.see_floor(plane(up, 1.2))
    for _ in range(200):
        places.append(level.to_stage(body))
        level.observe(body, TRACKED)
    assert np.abs(np.diff(places, axis=0)).max() < 0.06
    np.testing.assert_allclose(places[-1][:, 1], standing()[:, 1], atol=1e-3)


def test_a_floor_in_depth_corrects_gravity_and_replaces_feet() -> None:
    body, up = seen_by(1.2, -0.3, 0.0)
    level = Level(up + (0.02, 0.0, 0.0))
    level.observe(body, TRACKED)
    assert level.origin == "gravity and feet"
    level.see_floor(plane(up, 1.2))
    level.settle()
    assert level.origin == "depth"
    np.testing.assert_allclose(level.up, up, atol=1e-9)


def test_a_saved_calibration_is_the_last_word() -> None:
    body, up = seen_by(1.2, -0.3, 0.0)
    saved = StageFromCamera(np.eye(3), np.array([1.0, 2.0, 3.0]))
    level = Level(saved=saved)
    assert level.fixed
    level.see_floor(plane(up, 1.2))
    level.observe(body, TRACKED)
    level.settle()
    assert level.origin == "a saved calibration"
    np.testing.assert_allclose(level.to_stage(body), body + (1.0, 2.0, 3.0))


def test_it_says_what_told_it_the_floor() -> None:
    level = Level()
    states = TRACKED.copy()
    states[[Joint.FOOT_LEFT, Joint.FOOT_RIGHT]] = 0
    level.observe(standing(), states)
    assert level.origin == "hips"
    level.observe(standing(), TRACKED)
    assert level.origin == "feet"
    assert Level(floor=1.2).origin == "a given height"


def test_people_say_about_where_to_look_for_the_floor() -> None:
    body, up = seen_by(1.5, -0.4, 0.3)
    level = Level()
    for _ in range(100):
        level.observe(body, TRACKED)
    found, within = level.about_up
    assert found is not None
    assert within is not None
    assert math.acos(float(found @ up)) < within


def test_before_that_there_is_nothing_but_the_camera_or_gravity() -> None:
    _, up = seen_by(1.5, -0.4, 0.3)
    assert Level().about_up == (None, None)
    found, within = Level(up).about_up
    assert found is not None
    np.testing.assert_allclose(found, up)
    assert within is None
