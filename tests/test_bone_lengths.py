"""Bones keep the lengths that they were learned to have."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.kernel import Floats
from puppet.skeleton import JOINT_COUNT, OTHER_SIDE, Joint
from puppet.tracking.body.bone_lengths import LEARN_SECONDS, BoneLengths
from puppet.tracking.takes.rehearsal import Rehearsal
from tests.moments import frames_of

ALL = np.full(JOINT_COUNT, 2, np.uint8)
#: What a camera has of the rehearsal three metres before it.
PERFORMED = [
    frame.positions + (0.0, -1.0, -3.0)
    for frame in frames_of(Rehearsal())
    if (frame.states == 2).all()
]
_PARENTS = [0, 0, 0, 2, 2, 4, 5, 6, 2, 8, 9, 10, 0, 12, 13, 14, 0, 16, 17, 18]
BONES = [joint for joint in range(1, JOINT_COUNT) if joint != Joint.SPINE]


def bones(positions: Floats) -> Floats:
    return np.asarray(np.linalg.norm(positions - positions[_PARENTS], axis=1)[BONES])


def along_sight(positions: Floats, metres: Floats) -> Floats:
    """The same image, with each joint so much farther away or nearer."""
    return positions * ((positions[:, 2:] + metres[:, None]) / positions[:, 2:])


def taught(seconds: float = LEARN_SECONDS + 1.0) -> BoneLengths:
    lengths = BoneLengths()
    for index, positions in enumerate(PERFORMED[: round(30 * seconds)]):
        lengths(positions, ALL, index / 30)
    return lengths


def test_the_lengths_of_a_steady_body_are_learned_and_change_nothing() -> None:
    lengths = taught()
    assert lengths.learned
    for index, positions in enumerate(PERFORMED[300:600:20]):
        held = lengths(positions, ALL, 20.0 + index)
        # The rehearsal's figure is not quite usual, and what is usual counts a little.
        assert np.linalg.norm(held - positions, axis=1).max() < 0.05
    np.testing.assert_allclose(lengths.lengths, lengths.lengths[list(OTHER_SIDE)])


@given(st.integers(0, 1000), st.integers(0, len(PERFORMED) - 1))
def test_wrong_guesses_of_distance_come_nearer_to_the_truth(seed: int, index: int) -> None:
    lengths = taught()
    truth = PERFORMED[index]
    noise = np.random.default_rng(seed).normal(0.0, 0.1, JOINT_COUNT)
    noise[0] = 0.0
    guess = along_sight(truth, noise)
    held = lengths(guess, ALL, 30.0)
    # Each bone is nearer to its length, and no joint has left its line of sight.
    before, after = (np.abs(bones(points) - bones(truth)) for points in (guess, held))
    assert after.mean() < 0.6 * before.mean()
    seen = np.delete(held, Joint.SPINE, axis=0)
    expected = np.delete(truth, Joint.SPINE, axis=0)
    np.testing.assert_allclose(
        seen[:, :2] / seen[:, 2:], expected[:, :2] / expected[:, 2:], atol=1e-9
    )


@pytest.mark.parametrize(("rate", "most"), [(1.0, 1.2), (30.0, 0.75), (240.0, 0.75)])
def test_trembling_along_the_line_of_sight_is_not_made_worse(rate: float, most: float) -> None:
    """Also not by bones that lie across it, whose length says nothing of their distance; unless
    nothing is known of the last half second."""
    lengths, rng = taught(), np.random.default_rng(0)
    truth, off, before = PERFORMED[0], [], []
    for index in range(100):
        guess = along_sight(truth, rng.normal(0.0, 0.03, JOINT_COUNT))
        held = lengths(guess, ALL, 30.0 + index / rate)
        off.append(held - held[0] - (truth - truth[0]))
        before.append(guess - guess[0] - (truth - truth[0]))
    assert np.std(off, axis=0).mean() < most * np.std(before, axis=0).mean()


def test_a_joint_that_is_not_seen_keeps_its_direction_and_gets_its_length() -> None:
    lengths, states = taught(), ALL.copy()
    states[Joint.WRIST_LEFT] = 1
    guess = PERFORMED[0].copy()
    guess[Joint.WRIST_LEFT] = guess[Joint.ELBOW_LEFT] + (0.0, -0.6, 0.0)
    held = lengths(guess, states, 30.0)
    bone = held[Joint.WRIST_LEFT] - held[Joint.ELBOW_LEFT]
    assert np.linalg.norm(bone) == pytest.approx(lengths.lengths[Joint.WRIST_LEFT])
    np.testing.assert_allclose(bone / np.linalg.norm(bone), (0.0, -1.0, 0.0), atol=1e-9)


def test_a_bone_that_was_never_seen_is_left_as_it_is() -> None:
    states = ALL.copy()
    states[[Joint.KNEE_LEFT, Joint.KNEE_RIGHT]] = 1
    lengths = BoneLengths()
    for index, positions in enumerate(PERFORMED[:120]):
        held = lengths(positions, states, index / 30)
    assert lengths.lengths[Joint.KNEE_LEFT] == 0.0
    np.testing.assert_allclose(held[Joint.KNEE_LEFT], PERFORMED[119][Joint.KNEE_LEFT], atol=0.05)


def test_somebody_else_s_bones_are_learned_anew_and_a_few_bad_frames_are_not() -> None:
    lengths = taught()
    known = lengths.lengths.copy()
    for index, positions in enumerate(PERFORMED[:20]):
        lengths(positions * 1.5, ALL, 30.0 + index / 30)
    np.testing.assert_array_equal(lengths.lengths, known)
    for index, positions in enumerate(PERFORMED[:400]):
        lengths(positions * 1.5, ALL, 40.0 + index / 30)
    assert lengths.lengths[Joint.KNEE_LEFT] == pytest.approx(1.5 * known[Joint.KNEE_LEFT], rel=0.05)


def test_no_arm_is_as_long_as_a_body() -> None:
    lengths = BoneLengths()
    for index, positions in enumerate(PERFORMED[:120]):
        wrong = positions.copy()
        wrong[Joint.WRIST_LEFT] += (0.0, 0.0, 1.5)
        wrong[Joint.WRIST_RIGHT] += (0.0, 0.0, 1.5)
        lengths(wrong, ALL, index / 30)
    assert lengths.lengths[Joint.WRIST_LEFT] < 0.5


@pytest.mark.parametrize("rate", [1.0, 30.0, 240.0])
def test_any_frame_rate_teaches_the_same(rate: float) -> None:
    lengths = BoneLengths()
    for index in range(int(40 * max(rate / 30.0, 1.0))):
        lengths(PERFORMED[0], ALL, index / rate)
    np.testing.assert_allclose(lengths.lengths[BONES], bones(PERFORMED[0]), rtol=0.35)
    assert lengths.lengths[Joint.KNEE_LEFT] == pytest.approx(bones(PERFORMED[0])[11], rel=0.01)


def other_side(positions: Floats, joint: Joint) -> Floats:
    """The same image and length of the bone, which points to the camera instead of away."""
    ray = positions[joint] / positions[joint, 2]
    parent = positions[_PARENTS[joint]]
    nearest = float(ray @ parent) / float(ray @ ray)
    moved = positions.copy()
    moved[joint] = ray * (2.0 * nearest - positions[joint, 2])
    return moved


@pytest.mark.parametrize("rate", [10.0, 30.0, 240.0])
def test_a_bone_turns_to_the_other_side_if_the_network_insists_and_not_for_a_moment(
    rate: float,
) -> None:
    lengths = taught()
    before = PERFORMED[0].copy()
    before[Joint.ELBOW_LEFT] = before[Joint.SHOULDER_LEFT] + (0.1, -0.15, 0.2)
    after = other_side(before, Joint.ELBOW_LEFT)
    away = abs(after[Joint.ELBOW_LEFT, 2] - before[Joint.ELBOW_LEFT, 2])
    assert away > 0.3
    time, z = 30.0, []
    for seconds, seen in ((1.0, before), (0.1, after), (0.5, before), (1.0, after)):
        for _ in range(max(1, round(rate * seconds))):
            time += 1.0 / rate
            held = lengths(seen, ALL, time)
        z.append(abs(held[Joint.ELBOW_LEFT, 2] - before[Joint.ELBOW_LEFT, 2]))
    assert z[1] < 0.6 * away
    assert z[2] < 0.1
    assert z[3] > away - 0.1
