"""One performer's body: all steps together, seated too, at any frame rate and image size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from puppet.skeleton import Joint, SkeletonFrame, TrackingState
from puppet.tracking.body.body import Body
from puppet.tracking.body.seated import USUAL_TRUNK
from puppet.tracking.cameras.camera import Shot
from puppet.tracking.conditioning.condition import Conditioner
from puppet.tracking.people.blazepose import LANDMARK_COUNT, Landmarks
from tests.lifted_bodies import LENS, camera_axes, depth_of, landmarks, shot, standing_body

BODY, PLACE = standing_body(), (0.2, 0.0, 3.0)
LEGS = [joint for joint in Joint if joint.name.split("_")[0] in ("KNEE", "ANKLE", "FOOT")]
HIPS = [Joint.HIP_CENTER, Joint.SPINE, Joint.HIP_LEFT, Joint.HIP_RIGHT]
UPPER = [joint for joint in Joint if joint not in LEGS and joint not in HIPS]


def never(_turn: float) -> Landmarks | None:
    return None


@pytest.mark.parametrize("rate", [1.0, 30.0, 240.0])
def test_a_still_body_is_where_it_is_at_any_frame_rate(rate: float) -> None:
    body, truth = Body(), camera_axes(BODY, PLACE)
    for index in range(40):
        positions, states = body.joints(landmarks(BODY, PLACE), shot(index / rate), never)
    assert (states == TrackingState.TRACKED).all()
    np.testing.assert_allclose(positions[Joint.WRIST_LEFT], truth[15], atol=0.02)
    np.testing.assert_allclose(positions[Joint.ANKLE_RIGHT], truth[28], atol=0.02)


def test_images_that_change_their_size_change_nothing_else() -> None:
    body = Body()
    for index in range(20):
        seen, now = landmarks(BODY, PLACE), shot(index / 30)
        if index >= 10:  # half as many pixels along each side, through the same lens
            assert now.intrinsics is not None
            seen = replace(
                seen,
                pixels=(seen.pixels + 0.5) / 2 - 0.5,
                region=replace(
                    seen.region,
                    centre=(seen.region.centre + 0.5) / 2 - 0.5,
                    side=seen.region.side / 2,
                ),
            )
            now = Shot(
                now.time, index, now.colour[::2, ::2], intrinsics=now.intrinsics.resized(0.5)
            )
        positions, states = body.joints(seen, now, never)
        assert (states == TrackingState.TRACKED).all()
    np.testing.assert_allclose(positions[Joint.WRIST_LEFT], camera_axes(BODY, PLACE)[15], atol=0.02)


def at_a_table() -> Landmarks:
    """The network guesses hips that nobody sees, and legs that are out of the picture."""
    seen = landmarks(BODY, PLACE)
    visibility, presence = np.ones(LANDMARK_COUNT), np.ones(LANDMARK_COUNT)
    visibility[23:] = 0.1
    presence[25:] = 0.05
    world = seen.world.copy()
    world[23:] += (0.3, -0.2, 0.3)
    return replace(seen, world=world, visibility=visibility, presence=presence)


def test_who_sits_at_a_table_has_a_trunk_below_the_shoulders() -> None:
    body = Body(seated=True)
    for index in range(30):
        positions, states = body.joints(at_a_table(), shot(index / 30), never)
    assert (states[LEGS] == TrackingState.NOT_TRACKED).all()
    assert (states[HIPS] == TrackingState.INFERRED).all()
    assert (states[UPPER] == TrackingState.TRACKED).all()
    trunk = positions[Joint.SHOULDER_CENTER] - positions[Joint.HIP_CENTER]
    np.testing.assert_allclose(trunk, (0.0, USUAL_TRUNK, 0.0), atol=1e-9)
    assert positions[Joint.HIP_LEFT, 0] > positions[Joint.HIP_RIGHT, 0]


def test_up_is_where_gravity_says_for_the_seated() -> None:
    body, up = Body(seated=True), np.array([0.6, -0.8, 0.0])
    positions, _ = body.joints(at_a_table(), shot(0.0, up=up), never)
    trunk = positions[Joint.SHOULDER_CENTER] - positions[Joint.HIP_CENTER]
    np.testing.assert_allclose(trunk / np.linalg.norm(trunk), (0.6, 0.8, 0.0), atol=1e-9)


@pytest.mark.parametrize("seated", [True, False], ids=["seated", "only close to the camera"])
def test_conditioning_wakes_up_for_half_a_body(seated: bool) -> None:
    body, condition = Body(seated), Conditioner()
    for index in range(60):
        positions, states = body.joints(at_a_table(), shot(index / 30), never)
        frame = condition(SkeletonFrame(index / 30, index, 0, positions, states))
    assert (frame.influence[UPPER] > 0.9).all()
    assert (frame.influence[LEGS] < 0.05).all()


def test_who_stands_is_seen_whole_in_seated_mode_but_for_the_legs() -> None:
    body = Body(seated=True)
    positions, states = body.joints(landmarks(BODY, PLACE), shot(0.0), never)
    assert (states[HIPS] == TrackingState.TRACKED).all()
    assert (states[LEGS] == TrackingState.NOT_TRACKED).all()
    np.testing.assert_allclose(positions[Joint.HIP_LEFT], camera_axes(BODY, PLACE)[23], atol=0.02)


def test_an_outstretched_arm_goes_where_depth_sees_it() -> None:
    """The network often takes what points at the camera for hanging down before the body."""
    truth = BODY + PLACE
    truth[[13, 15, 17, 19, 21], 2] -= [0.10, 0.22, 0.24, 0.24, 0.24]
    seen = replace(landmarks(BODY, PLACE), pixels=LENS.pixels(truth))
    z = {}
    for name, depth in (("plain", None), ("deep", depth_of(truth))):
        body = Body()
        for index in range(30):
            positions, _ = body.joints(seen, shot(index / 30, depth), never)
        z[name] = float(positions[Joint.WRIST_LEFT, 2])
    assert abs(z["deep"] + truth[15, 2]) < 0.06
    assert abs(z["plain"] + truth[15, 2]) > 0.15


def test_a_wall_beside_a_thin_arm_is_not_taken_for_it() -> None:
    """Landmarks lie a little beside what they mean, and there depth sees the wall."""
    depth = depth_of(BODY + PLACE, wall=4.2)
    depth[:, round((LENS.pixels((BODY + PLACE)[[13]])[0, 0] - 8) / 4) :] = 4200
    body = Body()
    for index in range(30):
        positions, _ = body.joints(landmarks(BODY, PLACE), shot(index / 30, depth), never)
    truth = camera_axes(BODY, PLACE)
    np.testing.assert_allclose(positions[Joint.WRIST_LEFT], truth[15], atol=0.05)


@pytest.mark.parametrize("step", [1.0, 1 / 30, 1 / 240])
def test_depth_that_comes_and_goes_moves_nothing_by_more_than_it_knows_better(step: float) -> None:
    body, depth = Body(), depth_of(BODY + PLACE)
    truth = camera_axes(BODY, PLACE)
    for index in range(60):
        now = shot(index * step, depth if index // 7 % 2 else None)
        positions, states = body.joints(landmarks(BODY, PLACE), now, never)
        assert (states == TrackingState.TRACKED).all()
        assert np.abs(positions[Joint.HAND_LEFT] - truth[[17, 19]].mean(axis=0)).max() < 0.05
