"""What no body can do is not believed: leaps of joints, and limbs that change sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.skeleton import Joint, TrackingState
from puppet.tracking.body.leaps import FASTEST, NOISE, Leaps
from puppet.tracking.body.limb_swaps import INSISTENCE, LimbSwaps
from puppet.tracking.takes.rehearsal import Rehearsal
from puppet.tracking.takes.take import read_take
from tests.lifted_bodies import landmarks, standing_body
from tests.moments import frames_of
from tests.test_take import RECORDED

ALL = np.full(20, 2, np.uint8)
PERFORMED = [
    frame.positions + (0.0, -1.0, -3.0)
    for frame in frames_of(Rehearsal())
    if (frame.states == 2).all()
][:600]
LIMBS = [joint for joint in Joint if joint not in (Joint.HIP_CENTER, Joint.SPINE)]


def test_honest_movement_passes_untouched() -> None:
    leaps = Leaps()
    for index, positions in enumerate(PERFORMED):
        held, states = leaps.held_back(positions, ALL, index / 30)
        np.testing.assert_allclose(held, positions, atol=1e-12)
        assert (states == ALL).all()


def test_the_fastest_punches_and_kicks_pass_but_for_glitches_of_the_kinect(shared: object) -> None:
    from pathlib import Path

    from puppet.tracking.takes.recording import import_recording

    for name in ("Seq1_1", "Seq1_5", "Seq4_1"):
        path = Path(str(shared)) / "recordings/kinect1_precog" / f"{name}.csv"
        leaps, inferred, count = Leaps(), 0, 0
        for frame in frames_of(import_recording(path).take):
            if (frame.states == 2).all():
                _, states = leaps.held_back(frame.positions - (0, 0, 3), frame.states, frame.time)
                inferred += int((states < 2).sum())
                count += 20
        assert inferred < 0.003 * count


@given(st.sampled_from(LIMBS), st.integers(20, 500), st.integers(0, 1))
def test_a_joint_that_leaps_stays_on_the_body_and_is_inferred(
    joint: Joint, when: int, axis: int
) -> None:
    leaps = Leaps()
    for index in range(when - 5, when + 4):
        positions = PERFORMED[index].copy()
        if index == when:
            positions[joint, axis] += 2.0
        held, states = leaps.held_back(positions, ALL, index / 30)
        if index == when:
            assert states[joint] == TrackingState.INFERRED
            assert np.linalg.norm(held[joint] - PERFORMED[index][joint]) < NOISE + FASTEST / 30
        elif index < when:
            assert (states == 2).all()
    np.testing.assert_allclose(held, PERFORMED[when + 3], atol=1e-9)
    assert (states == 2).all()


@pytest.mark.parametrize("rate", [60.0, 120.0, 240.0])
def test_a_hand_s_breadth_off_for_a_frame_is_no_movement(rate: float) -> None:
    """Slow enough for a body on the whole, but no muscle throws and stops a hand like that."""
    leaps, off = Leaps(), PERFORMED[0].copy()
    off[Joint.HAND_LEFT, 1] += 0.18
    seen = [
        leaps.held_back(off if index == 5 else PERFORMED[0], ALL, index / rate)[1][Joint.HAND_LEFT]
        for index in range(10)
    ]
    assert [int(state) for state in seen] == [2] * 5 + [1] + [2] * 4


@pytest.mark.parametrize("rate", [30.0, 60.0, 240.0])
def test_a_punch_passes(rate: float) -> None:
    """From rest to 9 m/s within 60 ms, and back again."""
    leaps = Leaps()
    for index in range(round(rate / 2)):
        time = index / rate
        speed = 9.0 * max(0.0, 1.0 - abs(time - 0.2) / 0.06)
        way = 9.0 * 0.06 * min(1.0, max(0.0, (time - 0.14) / 0.12)) if speed or time > 0.2 else 0.0
        fist = PERFORMED[0].copy()
        fist[Joint.HAND_LEFT, 0] += way
        assert (leaps.held_back(fist, ALL, time)[1] == 2).all()


def test_a_leap_that_stays_is_believed_when_time_has_made_it_possible() -> None:
    leaps, moved = Leaps(), PERFORMED[0].copy()
    moved[Joint.HAND_LEFT, 1] += 1.4
    leaps.held_back(PERFORMED[0], ALL, 0.0)
    seen = [int(leaps.held_back(moved, ALL, i / 30)[1][Joint.HAND_LEFT]) for i in range(1, 8)]
    assert seen[0] == 1
    assert seen[-1] == 2
    assert sorted(seen) == seen


def test_a_glitch_along_the_line_of_sight_is_held_back_and_keeps_its_pixel() -> None:
    leaps, moved = Leaps(), PERFORMED[0].copy()
    moved[Joint.HAND_LEFT] *= 0.75
    leaps.held_back(PERFORMED[0], ALL, 0.0)
    held, _ = leaps.held_back(moved, ALL, 1 / 60)
    hand = held[Joint.HAND_LEFT]
    assert abs(hand[2] - PERFORMED[0][Joint.HAND_LEFT, 2]) < 0.16
    np.testing.assert_allclose(hand[:2] / hand[2], moved[7, :2] / moved[7, 2], atol=1e-9)


@pytest.mark.parametrize("path", RECORDED, ids=lambda path: path.stem)
def test_recorded_people_hardly_leap(path: object) -> None:
    """What is doubted is the network's: joints that go a hand's breadth off for a frame."""
    from pathlib import Path

    for number in range(4):
        leaps, doubted, count = Leaps(), 0, 0
        for frame in frames_of(read_take(Path(str(path))), number):
            if frame.present:
                positions = frame.positions - (0.0, 1.0, 4.0)
                _, states = leaps.held_back(positions, frame.states, frame.time)
                doubted += int((states < frame.states).sum())
                count += 20
        assert doubted <= 0.015 * count


BODY = standing_body()
LEFT_ARM, RIGHT_ARM = [13, 15, 17, 19, 21], [14, 16, 18, 20, 22]


def test_arms_that_change_sides_for_a_moment_are_put_back() -> None:
    swaps = LimbSwaps()
    for index in range(60):
        seen = landmarks(BODY + (0.0, 0.0, 0.0), (0.01 * index, 0.0, 3.0))
        given = seen
        if 20 <= index < 24:
            order = np.arange(33)
            order[LEFT_ARM], order[RIGHT_ARM] = RIGHT_ARM, LEFT_ARM
            given = replace(seen, pixels=seen.pixels[order], world=seen.world[order])
        undone = swaps.undone(given, index / 30)
        np.testing.assert_array_equal(undone.pixels, seen.pixels)
        np.testing.assert_array_equal(undone.world, seen.world)


def test_a_network_that_insists_on_the_other_side_is_believed() -> None:
    swaps, order = LimbSwaps(), np.arange(33)
    order[LEFT_ARM], order[RIGHT_ARM] = RIGHT_ARM, LEFT_ARM
    seen = landmarks(BODY, (0.0, 0.0, 3.0))
    other = replace(seen, pixels=seen.pixels[order], world=seen.world[order])
    swaps.undone(seen, 0.0)
    given = [swaps.undone(other, i / 30) for i in range(1, round(30 * INSISTENCE) + 4)]
    assert (given[0].pixels == seen.pixels).all()
    assert (given[-1].pixels == other.pixels).all()


def test_arms_that_cross_slowly_are_left_alone() -> None:
    swaps = LimbSwaps()
    for index in range(60):
        body = BODY.copy()
        body[LEFT_ARM, 0] -= 0.012 * index
        body[RIGHT_ARM, 0] += 0.012 * index
        seen = landmarks(body, (0.0, 0.0, 3.0))
        np.testing.assert_array_equal(swaps.undone(seen, index / 30).pixels, seen.pixels)
