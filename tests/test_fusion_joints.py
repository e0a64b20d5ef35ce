from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.fusion import camera_positions
from puppet.skeleton import JOINT_COUNT, Joint, SkeletonFrame, TrackingState
from puppet.tracking.fusion.fusion import Fusion, FusionConfig
from puppet.tracking.fusion.joints import EASE, FASTEST, STALE
from puppet.tracking.fusion.weight import add, solve, weigh
from puppet.tracking.takes.rehearsal import body
from tests.fusion_films import BALANCE, dancing, film, numbers, of, person, played, seen


@given(st.integers(0, 9999), st.integers(1, 4))
def test_information_adds_up_as_least_squares_does(seed: int, cameras: int) -> None:
    random = np.random.default_rng(seed)
    total, weight, value = np.zeros(9), np.zeros(6), np.zeros(3)
    matrix, right = np.zeros((3, 3)), np.zeros(3)
    for _ in range(cameras):
        point, place = random.normal(size=3), 3.0 * random.normal(size=3)
        across, along = random.uniform(0.01, 0.05), random.uniform(0.05, 0.2)
        sight = (point - place) / np.linalg.norm(point - place)
        covariance = across**2 * np.eye(3) + (along**2 - across**2) * np.outer(sight, sight)
        matrix += np.linalg.inv(covariance)
        right += np.linalg.inv(covariance) @ point
        weigh(point, place, True, across, along, weight)
        add(total, weight, point)
    solve(total, value)
    np.testing.assert_allclose(value, np.linalg.solve(matrix, right), rtol=1e-7, atol=1e-7)


def test_two_cameras_at_right_angles_correct_each_other_s_depth() -> None:
    # One looks along x, the other along z; each is wrong by 10 cm in depth.
    places = {"x": (4.0, 1.0, 0.0), "z": (0.0, 1.0, 4.0)}
    standing = body(1.0)
    arrivals = film("x", lambda _: (person(0, standing + (0.1, 0.0, 0.0)),))
    arrivals += film("z", lambda _: (person(0, standing + (0.0, 0.0, 0.1)),))
    known = played(Fusion(FusionConfig(places)), arrivals)[-1].frames[0].positions
    unknown = played(Fusion(), arrivals)[-1].frames[0].positions
    assert np.linalg.norm(known - standing, axis=1).mean() < 0.02
    assert np.linalg.norm(unknown - standing, axis=1).mean() > 0.06


def test_an_arm_that_one_camera_alone_sees_stays_on_its_shoulder() -> None:
    arm = (Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT)
    standing = body(1.0)
    arrivals = film("one", lambda _: (person(0, standing, *arm),))
    arrivals += film("other", lambda _: (person(0, standing + (0.25, 0.0, 0.0)),))
    out = played(Fusion(), arrivals)[-1].frames[0]
    assert (out.states == TrackingState.TRACKED).all()
    upper = out.positions[Joint.ELBOW_LEFT] - out.positions[Joint.SHOULDER_LEFT]
    np.testing.assert_allclose(
        upper, standing[Joint.ELBOW_LEFT] - standing[Joint.SHOULDER_LEFT], atol=1e-3
    )


@pytest.mark.parametrize(
    ("a", "b", "fused"), [(2, 1, 2), (1, 1, 1), (0, 1, 1), (0, 2, 2), (0, 0, 0)]
)
def test_a_joint_is_known_as_well_as_by_the_camera_that_knows_it_best(
    a: int, b: int, fused: int
) -> None:
    def view(state: int) -> Callable[[float], Sequence[SkeletonFrame]]:
        frame = person(0, body(1.0))
        frame.states[Joint.HAND_LEFT] = state
        return lambda _: (frame,)

    out = played(Fusion(), film("one", view(a)) + film("other", view(b)))[-1].frames[0]
    assert out.states[Joint.HAND_LEFT] == fused
    others = np.arange(JOINT_COUNT) != Joint.HAND_LEFT
    assert (out.states[others] == TrackingState.TRACKED).all()


def test_what_is_tracked_outweighs_what_is_inferred() -> None:
    frames = person(0, body(1.0)), person(0, body(1.0))
    frames[1].positions[Joint.HAND_LEFT] += (0.2, 0.0, 0.0)
    frames[1].states[Joint.HAND_LEFT] = TrackingState.INFERRED
    arrivals = film("one", lambda _: frames[:1]) + film("other", lambda _: frames[1:])
    out = played(Fusion(), arrivals)[-1].frames[0]
    off = out.positions[Joint.HAND_LEFT] - body(1.0)[Joint.HAND_LEFT]
    assert 0.0 < off[0] < 0.03


def hand_off(time: float, away: float) -> SkeletonFrame:
    frame = person(0, body(1.0))
    frame.positions[Joint.HAND_LEFT] += (away if time > 1.0 else 0.0, 0.0, 0.0)
    return frame


def test_of_two_that_disagree_who_fits_the_past_is_right_but_not_for_long() -> None:
    arrivals = film("one", lambda t: (hand_off(t, 0.6),)) + film(
        "other", lambda t: (hand_off(t, 0),)
    )
    out = played(Fusion(), arrivals)
    for moment in out:
        off = moment.frames[0].positions[Joint.HAND_LEFT] - body(1.0)[Joint.HAND_LEFT]
        assert np.linalg.norm(off) < 0.02
        state = moment.frames[0].states[Joint.HAND_LEFT]
        if moment.time < 1.4:
            assert state == TrackingState.TRACKED
        if moment.time > 1.7:
            assert state == TrackingState.INFERRED


def test_of_three_the_one_that_two_contradict_is_wrong() -> None:
    arrivals = [
        *film("one", lambda t: (hand_off(t, 0.6),)),
        *film("other", lambda t: (hand_off(t, 0.0),)),
        *film("third", lambda t: (hand_off(t, 0.0),)),
    ]
    for moment in played(Fusion(), arrivals):
        off = moment.frames[0].positions[Joint.HAND_LEFT] - body(1.0)[Joint.HAND_LEFT]
        assert np.linalg.norm(off) < 0.02
        assert moment.frames[0].states[Joint.HAND_LEFT] == TrackingState.TRACKED


@given(
    st.sampled_from(list(itertools.permutations(BALANCE, 2))),
    st.lists(st.tuples(st.integers(5, 90), st.integers(1, 40)), min_size=1, max_size=3),
    st.sampled_from(["camera", "performer", "arm"]),
    st.booleans(),
)
@settings(max_examples=25)
def test_a_camera_that_comes_or_goes_moves_no_joint_faster_than_the_bound(
    cameras: tuple[str, str], gaps: list[tuple[int, int]], what: str, aware: bool
) -> None:
    """A fused joint goes no further in a step than it went in the cameras, and FASTEST."""
    arm = [Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, Joint.HAND_RIGHT]
    arrivals = []
    steps = np.zeros((100, JOINT_COUNT))
    for index, camera in enumerate(cameras):
        poses = np.array([moment.frames[0].positions for moment in BALANCE[camera]])
        steps[1:] = np.maximum(steps[1:], np.linalg.norm(np.diff(poses, axis=0), axis=-1))
        for number, pose in enumerate(poses):
            gone = index == 1 and any(a <= number < a + n for a, n in gaps)
            frame = person(0, pose, *(arm if gone and what == "arm" else ()))
            people = () if gone and what == "performer" else (frame,)
            if not (gone and what == "camera"):
                moment = seen(number / 60.0, number, *people)
                arrivals.append((number / 60.0 + 0.01 - 0.005 * index, camera, moment))
    out = played(Fusion(FusionConfig(camera_positions() if aware else {})), arrivals)
    joints, times = of(out, 0), np.array([moment.time for moment in out])
    for before, after in itertools.pairwise(range(len(out))):
        moved = np.linalg.norm(joints[after] - joints[before], axis=-1)
        number = round(60.0 * times[after])
        # What is moved on by its velocity may go on for a while after the camera saw it move.
        own = steps[max(0, number - 6) : number + 1].max(axis=0)
        dt = times[after] - times[before]
        frames = max(1.0, 60.0 * dt)
        # Two ways may add up to a little more than the longer one; and to more where directions
        # count: each camera then tells the way across its own line of sight, and holds back along.
        most = 2.0 if aware else 1.25
        assert (moved <= most * frames * own + FASTEST * dt + 1e-9).all()


def still(away: float, *lost: Joint) -> Callable[[float], Sequence[SkeletonFrame]]:
    return lambda _: (person(0, body(1.0) + (away, 0.0, 0.0), *lost),)


@pytest.mark.parametrize("away", [0.05, 0.2, 0.34])
def test_of_a_still_performer_no_joint_is_faster_than_the_bound(away: float) -> None:
    arrivals = film("one", still(0.0), end=10.0)
    for start in (1.0, 2.5, 4.0, 7.0):
        arrivals += film("other", still(away), start=start, end=start + 1.2, clock=40.0)
    arrivals += film("third", still(-away), start=3.0, end=5.1, rate=15.0)
    out = played(Fusion(), arrivals)
    joints, times = of(out, 0), np.array([moment.time for moment in out])
    speed = np.linalg.norm(np.diff(joints, axis=0), axis=-1) / np.diff(times)[:, None]
    assert speed.max() <= FASTEST + 1e-6
    assert np.ptp(joints[:, 0, 0]) > 0.3 * away  # and yet it went to where all agree
    assert np.abs(joints[-1] - body(1.0)).max() < 0.01  # and back


def test_what_is_left_after_a_camera_is_gone_fades_within_a_second() -> None:
    arrivals = film("one", still(0.0)) + film("other", still(0.1), end=2.0)
    out = played(Fusion(), arrivals)
    off = np.array([moment.frames[0].positions[0, 0] for moment in out]) - body(1.0)[0, 0]
    times = np.array([moment.time for moment in out])
    assert off[times < 1.9][-1] == pytest.approx(0.05, abs=0.005)
    assert off[times > 2.0 + STALE + 6 * EASE].max() < 0.003


def test_a_camera_that_stops_for_ten_seconds_is_missed_and_welcomed_back() -> None:
    both = dancing(0), lambda t: (*dancing(8)(t), *dancing(2, (2.0, 0.0, 0.0))(t))
    arrivals = film("one", both[0], end=15.0)
    stopping = film("other", both[1], end=15.0, rate=60.0, clock=5000.0)
    arrivals += [arrival for arrival in stopping if not 2.0 < arrival[0] < 12.0]
    fusion = Fusion()
    out = played(fusion, arrivals)
    times = np.array([moment.time for moment in out])
    assert (np.diff(times) > 0).all()
    assert np.diff(times).max() < 0.11
    who = [tuple(numbers(m)) for m in out]
    started = times[0]
    between = (times - started > 2.5) & (times - started < 11.5)
    assert {who[i] for i in np.flatnonzero(between)} == {(0,)}
    assert sorted(who[-1]) == sorted(who[40])  # the same two again
    assert len(who[-1]) == 2
    assert fusion.lead == "other"  # twice as fresh
