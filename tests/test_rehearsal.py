"""The synthetic performer: a body that keeps its bones, moves smoothly and does what it says."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from puppet.skeleton import JOINT_PARENTS, Joint
from puppet.tracking.takes.choreography import HIDDEN, STEPPING, feet
from puppet.tracking.takes.rehearsal import DURATION, SECTIONS, Rehearsal, body
from puppet.tracking.takes.take import read_take
from tests.moments import frames_of

RATE = 60
TIMES = np.arange(round(DURATION * RATE) + 1) / RATE
TAKE = Path(__file__).parent / "recorded_streams" / "rehearsal.mcap"


@pytest.fixture(scope="module")
def bodies() -> np.ndarray:
    """(F, 20, 3) the whole choreography, nothing hidden."""
    return np.array([body(float(time)) for time in TIMES])


def part(bodies: np.ndarray, name: str) -> np.ndarray:
    section = next(section for section in SECTIONS if section.name == name)
    inside: np.ndarray = bodies[(section.start <= TIMES) & (section.end >= TIMES)]
    return inside


def test_it_is_a_synthetic_source_of_more_than_forty_seconds() -> None:
    source = Rehearsal()
    assert source.info.synthetic
    assert source.info.kind == "rehearsal"
    assert not source.info.live
    assert len(source) / source.info.rate >= 40.0
    assert len(list(source)) == len(source)


def test_sections_follow_each_other() -> None:
    assert SECTIONS[0].start == 0.0
    assert all(a.end == b.start for a, b in pairwise(SECTIONS))
    assert all(section.start < section.end for section in SECTIONS)


def test_bones_keep_their_lengths(bodies: np.ndarray) -> None:
    for joint, parent in enumerate(JOINT_PARENTS):
        if parent >= 0:
            lengths = np.linalg.norm(bodies[:, joint] - bodies[:, parent], axis=1)
            assert np.ptp(lengths) < 1e-6, Joint(joint).name


def test_it_is_as_tall_as_a_person(bodies: np.ndarray) -> None:
    assert 1.60 < bodies[0, Joint.HEAD, 1] < 1.70
    assert 0.85 < bodies[0, Joint.HIP_LEFT, 1] < 0.95


def test_nothing_is_faster_than_people_are(bodies: np.ndarray) -> None:
    speed = np.linalg.norm(np.diff(bodies, axis=0), axis=2) * RATE
    assert speed.max() < 7.0
    change = np.linalg.norm(np.diff(bodies, 2, axis=0), axis=2) * RATE**2
    assert change.max() < 250.0  # knees when jumping; all else stays below 100
    quiet = np.abs(TIMES[1:-1] - 20.0) > 1.5
    assert change[quiet].max() < 100.0


def test_it_begins_and_ends_in_the_same_stance(bodies: np.ndarray) -> None:
    np.testing.assert_allclose(bodies[0], bodies[-1], atol=1e-9)
    np.testing.assert_allclose(
        Rehearsal().frame(3.7).positions, Rehearsal().frame(3.7 + DURATION).positions, atol=1e-9
    )


def test_the_first_two_seconds_are_a_quiet_stance_that_faces_the_audience(
    bodies: np.ndarray,
) -> None:
    first = bodies[TIMES <= 2.0]
    assert np.ptp(first, axis=0).max() < 0.02
    place = first[0]
    for left, right in zip(
        (Joint.HAND_LEFT, Joint.FOOT_LEFT), (Joint.HAND_RIGHT, Joint.FOOT_RIGHT), strict=True
    ):
        assert place[left, 0] > 0.0 > place[right, 0]
    assert place[Joint.FOOT_LEFT, 2] > place[Joint.ANKLE_LEFT, 2]
    assert place[Joint.HAND_LEFT, 1] < place[Joint.HIP_LEFT, 1]


def test_feet_stand_on_the_floor_and_do_not_slide(bodies: np.ndarray) -> None:
    assert bodies[..., 1].min() > -1e-9
    stepping = np.zeros(len(TIMES), bool)
    for start, end, _, _ in STEPPING:
        stepping |= (start <= TIMES) & (end >= TIMES)
    jump = next(section for section in SECTIONS if section.name == "jump")
    stepping |= (jump.start <= TIMES) & (jump.end >= TIMES)
    for foot in (Joint.FOOT_LEFT, Joint.FOOT_RIGHT):
        standing = bodies[~stepping, foot]
        assert np.abs(standing[:, 1]).max() < 1e-6
        assert np.abs(standing - standing[0]).max() < 1e-6


def test_a_foot_on_the_ground_stays_where_it_is_in_every_step(bodies: np.ndarray) -> None:
    for time, place in zip(TIMES, bodies, strict=True):
        for side, footing in zip(("LEFT", "RIGHT"), feet(float(time)), strict=True):
            if footing.lift == 0.0 and not 18.5 < time < 21.5:
                ankle = place[Joint[f"ANKLE_{side}"]]
                np.testing.assert_allclose(ankle[[0, 2]], footing.ground[[0, 2]], atol=1e-6)


def test_each_section_does_what_it_is_called(bodies: np.ndarray) -> None:
    stand = bodies[0]
    head, hips = stand[Joint.HEAD, 1], stand[Joint.HIP_CENTER, 1]
    wave = part(bodies, "wave")
    assert wave[:, Joint.HAND_RIGHT, 1].max() > stand[Joint.HEAD, 1]
    assert wave[:, Joint.HAND_LEFT, 1].max() < stand[Joint.ELBOW_LEFT, 1]
    turns = np.diff(np.sign(np.diff(wave[:, Joint.HAND_RIGHT, 0])))
    assert np.count_nonzero(turns) >= 6
    bow = part(bodies, "bow")
    assert bow[:, Joint.HEAD, 1].min() < 0.75 * head
    assert bow[:, Joint.HEAD, 2].max() > 0.4
    walk = part(bodies, "walk on the spot")
    for knee in (Joint.KNEE_LEFT, Joint.KNEE_RIGHT):
        assert walk[:, knee, 1].max() > stand[knee, 1] + 0.1
    assert np.abs(walk[:, Joint.HIP_CENTER, [0, 2]]).max() < 0.05
    assert part(bodies, "squat")[:, Joint.HIP_CENTER, 1].min() < 0.7 * hips
    jump = part(bodies, "jump")
    assert jump[:, [Joint.FOOT_LEFT, Joint.FOOT_RIGHT], 1].min(axis=1).max() > 0.05
    turn = part(bodies, "turn")
    across = turn[:, Joint.SHOULDER_LEFT] - turn[:, Joint.SHOULDER_RIGHT]
    heading = np.unwrap(np.arctan2(-across[:, 2], across[:, 0]))
    assert heading[-1] - heading[0] == pytest.approx(2.0 * np.pi, abs=0.05)
    arms = part(bodies, "arms out and up")
    assert np.ptp(arms[:, [Joint.HAND_LEFT, Joint.HAND_RIGHT], 0], axis=1).max() > 1.6
    assert arms[:, [Joint.HAND_LEFT, Joint.HAND_RIGHT], 1].min(axis=1).max() > head + 0.2
    lean = part(bodies, "lean and twist")
    assert lean[:, Joint.HEAD, 0].max() > 0.15
    assert lean[:, Joint.HEAD, 0].min() < -0.15
    hide = part(bodies, "hide a hand")
    assert hide[:, Joint.HAND_LEFT, 2].min() < -0.1


def test_a_hidden_hand_is_inferred_then_lost_then_found() -> None:
    (_, (start, lost, found, end)), *_ = HIDDEN
    states = [
        int(Rehearsal().frame(time).states[Joint.HAND_LEFT])
        for time in (start - 0.1, start + 0.1, lost + 0.1, found + 0.1, end + 0.1)
    ]
    assert states == [2, 1, 0, 1, 2]


def test_who_leaves_is_nobody_for_two_seconds_and_comes_back() -> None:
    frames = frames_of(Rehearsal())
    away = [frame.time for frame in frames if not frame.present]
    assert away[-1] - away[0] >= 2.0
    assert len(away) == round((away[-1] - away[0]) * 30) + 1
    assert frames[-1].present
    leaving = next(frame for frame in frames if frame.time > away[0] - 0.3)
    assert set(leaving.states.tolist()) & {0, 1}


def test_the_recorded_stream_is_what_the_source_gives() -> None:
    assert TAKE.stat().st_size < 1_000_000
    take = read_take(TAKE)
    assert take.info.synthetic
    assert not take.warnings
    for recorded, frame in zip(frames_of(take), frames_of(Rehearsal()), strict=True):
        np.testing.assert_allclose(recorded.positions, frame.positions, atol=1e-4)
        np.testing.assert_array_equal(recorded.states, frame.states)
