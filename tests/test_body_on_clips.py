"""Faults of the network, put into what it finds of a real person: the body does not follow them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from puppet.kernel import Floats
from puppet.skeleton import Joint, TrackingState
from puppet.tracking.body.body import Body
from puppet.tracking.body.sides import reversed_in_depth
from puppet.tracking.cameras.camera import Shot
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.people.blazepose import Landmarks
from puppet.tracking.people.people import People
from tests.pose_models import clip_or_skip, models_or_skip

#: Frames that are looked at, sixty a second; and of the fault.
COUNT, FIRST, LAST = 44, 24, 28
LEFT_ARM, RIGHT_ARM = [13, 15, 17, 19, 21], [14, 16, 18, 20, 22]
LEFT_LEG, RIGHT_LEG = [25, 27, 29, 31], [26, 28, 30, 32]
ARMS = [joint for joint in Joint if joint.name.split("_")[0] in ("ELBOW", "WRIST", "HAND")]

Fault = Callable[[Landmarks], Landmarks]
Film = list[tuple[Shot, Landmarks]]


@pytest.fixture(scope="module")
def film() -> Film:
    people, found = People(models_or_skip(), most=1, second_look=False), []
    for shot in VideoFile(clip_or_skip("balance_cam01")):
        if shot.sequence > COUNT:
            break
        found += [(shot, seen.landmarks) for seen in people.look(shot)]
    return found


def tracked(film: Film, fault: Fault, frames: range = range(0)) -> tuple[Floats, Floats]:
    """(F, 20, 3) positions and (F, 20) states, with the fault in those frames."""
    body, out = Body(), []
    for index, (shot, landmarks) in enumerate(film):
        seen = fault(landmarks) if index in frames else landmarks
        out.append(body.joints(seen, shot, lambda _turn: None))
    positions, states = zip(*out, strict=True)
    return np.array(positions), np.array(states)


def exchanged(left: list[int], right: list[int]) -> Fault:
    def fault(landmarks: Landmarks) -> Landmarks:
        order = np.arange(33)
        order[left], order[right] = right, left
        return replace(landmarks, pixels=landmarks.pixels[order], world=landmarks.world[order])

    return fault


def nothing(landmarks: Landmarks) -> Landmarks:
    return landmarks


@pytest.mark.parametrize(
    ("fault", "most"),
    [
        (exchanged(LEFT_ARM, RIGHT_ARM), 0.02),
        (exchanged(LEFT_LEG, RIGHT_LEG), 0.02),
        (reversed_in_depth, 0.15),  # a frame that nothing can be made of is passed over
    ],
    ids=["arms", "legs", "front and back"],
)
def test_sides_that_are_exchanged_for_some_frames_never_show(
    film: Film, fault: Fault, most: float
) -> None:
    plain, _ = tracked(film, nothing)
    kept, _ = tracked(film, fault, range(FIRST, LAST))
    off = np.linalg.norm(kept - plain, axis=2)
    assert off[:FIRST].max() == 0.0
    assert off.max() < most  # of a fault that puts a hand a metre away


@pytest.mark.parametrize("joint", [Joint.WRIST_LEFT, Joint.WRIST_RIGHT, Joint.ANKLE_RIGHT])
def test_a_landmark_that_leaps_for_a_frame_is_doubted_and_does_not_show(
    film: Film, joint: Joint
) -> None:
    landmark = {Joint.WRIST_LEFT: 15, Joint.WRIST_RIGHT: 16, Joint.ANKLE_RIGHT: 28}[joint]

    def fault(landmarks: Landmarks) -> Landmarks:
        pixels, world = landmarks.pixels.copy(), landmarks.world.copy()
        pixels[landmark] += (150.0, -150.0)
        world[landmark] += (0.3, -0.3, 0.3)
        return replace(landmarks, pixels=pixels, world=world)

    plain, _ = tracked(film, nothing)
    kept, states = tracked(film, fault, range(FIRST, FIRST + 1))
    assert states[FIRST, joint] == TrackingState.INFERRED
    assert np.linalg.norm(kept[FIRST, joint] - plain[FIRST, joint]) < 0.10
    assert np.linalg.norm(kept[-1] - plain[-1], axis=1).max() < 0.01


def test_a_glitch_along_the_line_of_sight_hardly_shows(film: Film) -> None:
    def fault(landmarks: Landmarks) -> Landmarks:
        world = landmarks.world.copy()
        world[LEFT_ARM, 2] -= 0.3
        return replace(landmarks, world=world)

    plain, _ = tracked(film, nothing)
    kept, _ = tracked(film, fault, range(FIRST, FIRST + 1))
    assert np.linalg.norm(kept - plain, axis=2)[:, ARMS].max() < 0.12


def test_the_same_film_gives_the_same_joints_bit_for_bit(film: Film) -> None:
    first, again = tracked(film, nothing), tracked(film, nothing)
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])


def test_no_state_flickers(film: Film) -> None:
    _, states = tracked(film, nothing)
    changes = (np.diff(states, axis=0) != 0).sum(axis=0)
    assert changes.max() <= 4  # in three quarters of a second
    assert changes.mean() < 1.0
