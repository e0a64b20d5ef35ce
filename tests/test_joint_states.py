"""Tracked, inferred, not tracked: late praise, quick doubt, and no flicker."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from puppet.skeleton import Joint, TrackingState
from puppet.tracking.body.joint_states import PATIENCE, JointStates
from puppet.tracking.people.blazepose import LANDMARK_COUNT
from tests.lifted_bodies import HEIGHT, LEFT_WRIST, WIDTH, landmarks, standing_body

FAR = landmarks(standing_body(), (0.0, 0.0, 6.0))
NOT_HIDDEN = np.zeros(LANDMARK_COUNT, bool)


class Watch:
    """Shows one body at 30 frames a second."""

    def __init__(self) -> None:
        self.states = JointStates()
        self.time = 0.0

    def see(self, seconds: float = 0.2, visibility: float = 1.0, presence: float = 1.0) -> int:
        """The state of all joints after so long."""
        for _ in range(max(1, round(30 * seconds))):
            self.time += 1 / 30
            seen = replace(
                FAR,
                visibility=np.full(LANDMARK_COUNT, visibility),
                presence=np.full(LANDMARK_COUNT, presence),
            )
            found = self.states(seen, NOT_HIDDEN, (WIDTH, HEIGHT), self.time)
        assert len(set(found.tolist())) == 1
        return int(found[0])


def test_a_joint_is_tracked_late_and_inferred_early() -> None:
    watch = Watch()
    seen = [watch.see(visibility=visibility) for visibility in (0.75, 0.9, 0.75, 0.65, 0.75, 0.9)]
    assert seen == [1, 2, 2, 1, 1, 2]


def test_a_joint_that_is_nowhere_is_not_tracked() -> None:
    watch = Watch()
    assert [watch.see(presence=presence) for presence in (0.3, 0.5, 0.3, 0.1)] == [0, 2, 2, 0]


def test_doubt_comes_at_once_and_praise_has_to_be_deserved() -> None:
    watch = Watch()
    assert watch.see(1.0) == TrackingState.TRACKED
    assert watch.see(1 / 30, visibility=0.1) == TrackingState.INFERRED
    assert watch.see(1 / 30) == TrackingState.INFERRED
    assert watch.see(PATIENCE) == TrackingState.TRACKED
    assert watch.see(1 / 30, presence=0.0) == TrackingState.NOT_TRACKED


@given(st.lists(st.floats(0.0, 1.0), min_size=60, max_size=60), st.sampled_from([1.0, 30.0, 240.0]))
def test_no_state_gets_better_sooner_than_its_patience(values: list[float], rate: float) -> None:
    """Whatever the network flickers, and however many frames a second there are."""
    states = JointStates()
    before, doubted = 2, -1e9
    for index, value in enumerate(values):
        seen = replace(FAR, visibility=np.full(LANDMARK_COUNT, value))
        now = int(states(seen, NOT_HIDDEN, (WIDTH, HEIGHT), index / rate)[Joint.SPINE])
        if index and now > before:
            assert index / rate - doubted >= PATIENCE - 1e-9
        if value <= 0.7:
            doubted = index / rate
        before = now


def test_what_leaves_the_image_is_inferred_and_then_gone() -> None:
    found = []
    for x in (40.0, -3.0, -200.0):
        pixels = FAR.pixels.copy()
        pixels[LEFT_WRIST] = (x, 100.0)
        seen = replace(FAR, pixels=pixels)
        states = JointStates()(seen, NOT_HIDDEN, (WIDTH, HEIGHT), 0.0)
        found.append(int(states[Joint.WRIST_LEFT]))
        assert (np.delete(states, Joint.WRIST_LEFT) == TrackingState.TRACKED).all()
    assert found == [2, 1, 0]


def test_what_depth_contradicts_is_inferred() -> None:
    hidden = NOT_HIDDEN.copy()
    hidden[LEFT_WRIST] = True
    states = JointStates()(FAR, hidden, (WIDTH, HEIGHT), 0.0)
    assert states[Joint.WRIST_LEFT] == TrackingState.INFERRED
    assert (np.delete(states, Joint.WRIST_LEFT) == TrackingState.TRACKED).all()


def test_from_the_side_the_head_is_seen_all_the_same() -> None:
    visibility = FAR.visibility.copy()
    visibility[[8, 12]] = 0.1
    states = JointStates()(replace(FAR, visibility=visibility), NOT_HIDDEN, (WIDTH, HEIGHT), 0.0)
    assert states[Joint.HEAD] == TrackingState.TRACKED
    assert states[Joint.SHOULDER_CENTER] == TrackingState.INFERRED


def test_landmarks_that_are_no_numbers_are_not_there() -> None:
    pixels = FAR.pixels.copy()
    pixels[LEFT_WRIST] = np.nan
    states = JointStates()(replace(FAR, pixels=pixels), NOT_HIDDEN, (WIDTH, HEIGHT), 0.0)
    assert states[Joint.WRIST_LEFT] == TrackingState.NOT_TRACKED


def cut_off(part: float) -> NDArray[np.uint8]:
    """The states of somebody of whom that part of their height is below the image."""
    top, bottom = FAR.pixels[:, 1].min(), FAR.pixels[:, 1].max()
    height = round(bottom - part * (bottom - top))
    presence = np.where(FAR.pixels[:, 1] > height + 40, 0.1, 1.0)
    seen = replace(FAR, presence=presence)
    return JointStates()(seen, NOT_HIDDEN, (WIDTH, height), 0.0)


LEGS = [joint for joint in Joint if joint.name.split("_")[0] in ("KNEE", "ANKLE", "FOOT")]
TRUNK = [Joint.HIP_CENTER, Joint.SPINE, Joint.HIP_LEFT, Joint.HIP_RIGHT]


def test_close_to_the_camera_hips_are_inferred_and_legs_are_not_there() -> None:
    states = cut_off(0.62)
    assert (states[TRUNK] == TrackingState.INFERRED).all()
    assert (states[LEGS] == TrackingState.NOT_TRACKED).all()
    assert (states[[Joint.SHOULDER_CENTER, Joint.SHOULDER_LEFT, Joint.HEAD]] == 2).all()


def test_of_a_leg_beyond_the_border_the_knee_is_guessed_and_the_foot_is_not() -> None:
    states = cut_off(0.40)
    assert (states[TRUNK] == TrackingState.TRACKED).all()
    assert (states[[Joint.KNEE_LEFT, Joint.KNEE_RIGHT]] == TrackingState.INFERRED).all()
    assert (states[[Joint.FOOT_LEFT, Joint.ANKLE_RIGHT]] == TrackingState.NOT_TRACKED).all()
