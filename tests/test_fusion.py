from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.fusion import camera_positions, fused, middle_of, takes
from puppet.kernel import Floats
from puppet.skeleton import (
    HUMAN_BONES,
    JOINT_COUNT,
    Joint,
    Moment,
    SkeletonFrame,
    TrackingState,
)
from puppet.tracking.fusion import Fusion, FusionConfig
from puppet.tracking.fusion_clock import CameraClock, Heard
from puppet.tracking.fusion_joints import EASE, FASTEST, STALE
from puppet.tracking.fusion_weight import add, solve, weigh
from puppet.tracking.rehearsal import body

#: When it arrived, which camera, what it saw.
Arrival = tuple[float, str, Moment]
BALANCE = takes()


def person(number: int, positions: Floats, *lost: Joint, inferred: bool = False) -> SkeletonFrame:
    states = np.full(JOINT_COUNT, TrackingState.INFERRED if inferred else 2, np.uint8)
    states[list(lost)] = TrackingState.NOT_TRACKED
    return SkeletonFrame(0.0, 0, number, positions, states)


def seen(time: float, sequence: int, *people: SkeletonFrame) -> Moment:
    return Moment(0.0, 0, people).at(time, sequence)


def played(fusion: Fusion, arrivals: Iterable[Arrival]) -> list[Moment]:
    """What comes out, in order of arrival."""
    given = [fusion.add(camera, m, at) for at, camera, m in sorted(arrivals, key=lambda a: a[0])]
    return [moment for moment in given if moment is not None]


def film(
    camera: str,
    people: Callable[[float], Sequence[SkeletonFrame]],
    *,
    rate: float = 30.0,
    start: float = 0.0,
    end: float = 4.0,
    clock: float = 0.0,
    late: float = 0.02,
    jitter: float = 0.0,
    drift: float = 0.0,
) -> list[Arrival]:
    """What a camera sees from `start` to `end`, stamped by its own clock."""
    noise = np.random.default_rng(len(camera))
    arrivals = []
    for sequence, time in enumerate(np.arange(start, end, 1.0 / rate)):
        own = seen(float(time) * (1.0 + drift) + clock, sequence, *people(float(time)))
        arrivals.append((float(time) + late + jitter * float(noise.exponential()), camera, own))
    return arrivals


def dancing(
    number: int, away: Sequence[float] = (0.0, 0.0, 0.0)
) -> Callable[[float], Sequence[SkeletonFrame]]:
    """The rehearsal's performer, somewhere else."""
    return lambda time: (person(number, body(time) + np.asarray(away)),)


def numbers(moment: Moment) -> list[int]:
    return [frame.performer for frame in moment.frames]


def of(moments: Sequence[Moment], number: int) -> Floats:
    """(T, 20, 3)"""
    return np.array([moment.frame_of(number).positions for moment in moments])


# -- one camera -------------------------------------------------------------------------------


@pytest.mark.parametrize("camera", BALANCE)
def test_with_one_camera_nothing_is_changed(camera: str) -> None:
    fusion = Fusion(FusionConfig(camera_positions()))
    for moment in BALANCE[camera]:
        out = fusion.add(camera, moment, 5000.0 + moment.time)
        assert out is moment


def test_one_camera_s_numbers_stay_while_people_come_and_go() -> None:
    def people(time: float) -> Sequence[SkeletonFrame]:
        there = [number for number in range(4) if int(time * 3 + number) % 3]
        return [person(number, body(time) + (1.5 * number, 0, 0)) for number in there]

    arrivals = film("one", people, clock=7e4)
    out = played(Fusion(), arrivals)
    assert [numbers(moment) for moment in out] == [numbers(moment) for _, _, moment in arrivals]
    assert [moment.time for moment in out] == [moment.time for _, _, moment in arrivals]


def test_where_a_second_camera_sees_nobody_positions_and_times_stay_bit_for_bit() -> None:
    lead = film("one", dancing(3), jitter=0.002)
    out = played(Fusion(), lead + film("other", lambda _: (), late=0.03))
    assert len(out) == len(lead)
    for moment, (_, _, own) in zip(out, lead, strict=True):
        assert moment.time == own.time
        np.testing.assert_array_equal(moment.frame_of(3).positions, own.frame_of(3).positions)
        np.testing.assert_array_equal(moment.frame_of(3).states, own.frame_of(3).states)


# -- clocks and order -------------------------------------------------------------------------


@given(
    st.lists(st.sampled_from([15.0, 30.0, 60.0]), min_size=2, max_size=4),
    st.floats(-1e5, 1e5),
    st.floats(0.0, 0.05),
    st.integers(0, 99),
)
@settings(max_examples=15)
def test_time_only_runs_forward_at_about_the_rate_of_the_quickest(
    rates: list[float], clock: float, jitter: float, seed: int
) -> None:
    shuffle = np.random.default_rng(seed)
    arrivals = []
    for index, rate in enumerate(rates):
        late = float(shuffle.uniform(0.018, 0.022))
        arrivals += film(
            "x" * (index + 1), dancing(index), rate=rate, clock=clock * index, late=late,
            jitter=jitter * (index > 0), end=3.0,
        )  # fmt: skip
    out = played(Fusion(), arrivals)
    times = np.array([moment.time for moment in out])
    assert (np.diff(times) > 0.0).all()
    assert [moment.sequence for moment in out] == list(range(len(out)))
    assert (np.diff(times) < 0.2).all()
    assert 0.6 * min(rates) * 3.0 <= len(out) <= 1.15 * max(rates) * 3.0
    if jitter == 0.0:
        assert len(out) >= 0.75 * max(rates) * 3.0
    assert all(len(moment.frames) == 1 for moment in out)


@given(st.integers(0, 9999))
@settings(max_examples=15)
def test_moments_that_come_late_or_out_of_order_do_no_harm(seed: int) -> None:
    shuffle = np.random.default_rng(seed)
    arrivals = film("one", dancing(1)) + film("other", dancing(5), clock=9e4, late=0.03)
    arrivals = [
        (at + shuffle.uniform(0.0, 0.15) * (shuffle.random() < 0.2 and at > 0.2), camera, moment)
        for at, camera, moment in arrivals
    ]
    out = played(Fusion(), arrivals)
    times = np.array([moment.time for moment in out])
    assert (np.diff(times) > 0.0).all()
    assert len(out) > 60
    for moment in out[3:]:
        assert numbers(moment) == [1]
        # Old places are moved on by velocities: they are not taken for new ones.
        off = moment.frames[0].positions - body(moment.time)
        assert np.linalg.norm(off, axis=1).max() < 0.15


@pytest.mark.parametrize("clock", [0.0, 7200.0, -4e5])
@pytest.mark.parametrize("drift", [0.0, 1e-4])
def test_another_machine_s_clock_is_found_to_within_a_few_milliseconds(
    clock: float, drift: float
) -> None:
    machine = CameraClock()
    noise = np.random.default_rng(3)
    off = []
    for time in np.arange(0.0, 120.0, 1 / 30):
        arrived = time + 0.3 + noise.exponential(0.01)
        machine.hear(time * (1 + drift) + clock, arrived)
        off.append(machine.delay - (0.3 - clock - drift * time))
    assert np.abs(off[60:]).max() < 0.006


def test_one_wrong_stamp_does_not_set_the_clock() -> None:
    machine = CameraClock()
    for index in range(300):
        wrong = 0.2 if index == 150 else 0.0
        machine.hear(index / 30 + wrong, index / 30 + 50.0)
        assert abs(machine.delay - 50.0) < 0.01


def test_a_clock_that_begins_anew_or_stood_still_is_found_again() -> None:
    machine = CameraClock()
    heard = []
    for time, arrived in (
        *((i / 30, 100 + i / 30) for i in range(90)),  # as it began
        *((i / 30, 110 + i / 30) for i in range(90)),  # started anew
        *((3 + i / 30, 130 + i / 30) for i in range(90)),  # was paused
    ):
        heard.append(machine.hear(time, arrived))
    assert heard.count(Heard.RESTARTED) == 1
    assert heard.count(Heard.JUMPED) == 1
    assert machine.delay == pytest.approx(127.0, abs=0.01)


def test_cameras_on_one_machine_are_compared_by_their_stamps_not_by_their_arrival() -> None:
    quick, slow = np.array([1.0, 0.0, 0.0]), 0.07
    arrivals = film("one", lambda t: (person(0, body(5.0) + quick * t),), late=0.02)
    arrivals += film("other", lambda t: (person(0, body(5.0) + quick * t),), late=slow)
    out = played(Fusion(), arrivals)
    for moment in out[5:]:
        off = moment.frames[0].positions - body(5.0) - quick * moment.time
        assert np.abs(off).max() < 0.01


def test_a_camera_that_starts_anew_adds_at_once_and_time_goes_on() -> None:
    arrivals = film("one", dancing(1), end=6.0, clock=100.0)
    arrivals += film("other", dancing(4), end=3.0, clock=500.0)
    # Its numbers begin anew, too: 4 is somebody else now, and elsewhere.
    anew = film(
        "other",
        lambda time: (*dancing(0)(time), *dancing(4, (3.0, 0.0, 0.0))(time)),
        start=3.5, end=6.0, clock=-3.5,
    )  # fmt: skip
    out = played(Fusion(), arrivals + anew)
    times = np.array([moment.time for moment in out])
    assert (np.diff(times) > 0).all()
    assert np.diff(times).max() < 0.1
    assert numbers(out[60]) == [1]
    assert len(out[-1].frames) == 2
    assert np.abs(out[-1].frame_of(1).positions - body(out[-1].time - 100.0)).max() < 0.05


def test_when_the_leading_camera_starts_anew_time_still_runs_forward() -> None:
    arrivals = film("one", dancing(1), end=3.0, clock=1000.0)
    arrivals += film("one", dancing(1), start=5.0, end=8.0, clock=-5.0)
    for others in ([], film("other", dancing(1), end=8.0, clock=77.0, rate=15.0)):
        out = played(Fusion(), arrivals + others)
        times = np.array([moment.time for moment in out])
        assert (np.diff(times) > 0).all()
        assert times[-1] == pytest.approx(1008.0, abs=0.1)
        assert numbers(out[-1]) == [1]


# -- who is who -------------------------------------------------------------------------------


def test_what_two_cameras_number_differently_is_one_performer() -> None:
    arrivals = film("one", dancing(2), clock=100.0)
    arrivals += film("other", dancing(9, (0.15, 0.0, -0.1)), clock=3e4, rate=25.0)
    out = played(Fusion(), arrivals)
    assert all(numbers(moment) == [2] for moment in out)


def test_a_performer_stays_the_same_while_any_camera_sees_them() -> None:
    def now_and_then(number: int, phase: int) -> Callable[[float], Sequence[SkeletonFrame]]:
        # Each time they come back, for 1.3 of 2 seconds, the camera gives another number.
        def people(time: float) -> Sequence[SkeletonFrame]:
            turn, since = divmod(time + phase, 2.0)
            return dancing(number + int(turn))(time) if since < 1.3 else ()

        return people

    arrivals = film("one", now_and_then(10, 0), end=8.0)
    arrivals += film("other", now_and_then(50, 1), end=8.0, clock=300.0, late=0.03)
    out = played(Fusion(), arrivals)
    assert {tuple(numbers(moment)) for moment in out} == {(10,)}


def test_who_left_all_cameras_is_gone_and_their_number_is_never_another_s() -> None:
    fusion = Fusion()
    arrivals = film("one", dancing(0), end=2.0) + film("other", dancing(0), end=2.0)
    for name in ("one", "other"):
        arrivals += film(name, lambda _: (), start=2.0, end=6.0)
        arrivals += film(name, dancing(7, (2.0, 0.0, 0.0)), start=6.0, end=8.0)
    out = played(fusion, arrivals)
    assert all(numbers(moment) == [0] for moment in out if moment.time < 1.9)
    assert not any(moment.frames for moment in out if 2.1 < moment.time < 5.9)
    last = {number for moment in out if moment.time > 6.1 for number in numbers(moment)}
    assert len(last) == 1
    assert 0 not in last


def test_each_camera_may_see_others_than_the_rest() -> None:
    places = {"a": 0.0, "b": 1.2, "c": 2.6}
    views = {"left": "ab", "right": "bc", "middle": "abc"}
    arrivals = []
    for camera, who in views.items():
        order = {name: index for index, name in enumerate(reversed(who))}
        arrivals += film(
            camera,
            lambda t, who=who, order=order: [  # type: ignore[misc]
                person(order[name], body(t) + (places[name], 0.0, 0.0)) for name in who
            ],
        )
    out = played(Fusion(), arrivals)
    for moment in out[10:]:
        at = sorted(frame.positions[0, 0] - body(moment.time)[0, 0] for frame in moment.frames)
        np.testing.assert_allclose(at, [0.0, 1.2, 2.6], atol=0.03)
    assert len({number for moment in out[10:] for number in numbers(moment)}) == 3


def crossing(
    order: Sequence[int], bias: Sequence[float], hide: tuple[float, float] | None = None
) -> Callable[[float], Sequence[SkeletonFrame]]:
    """Two people, of two real takes, walk past each other: they meet after two seconds."""

    def people(time: float) -> Sequence[SkeletonFrame]:
        frames = []
        for index, (camera, way) in enumerate((("cam01", 1.0), ("cam02", -1.0))):
            moments = BALANCE[camera]
            pose = moments[int(time * 25.0) % len(moments)].frames[0].positions
            there = pose - pose[0] + (way * (time - 2.0), 0.9, 0.35 * way)
            hidden = index == 1 and hide is not None and hide[0] < time < hide[1]
            if not hidden:
                frames.append(person(order[index], there + np.asarray(bias)))
        return frames

    return people


@pytest.mark.parametrize("hide", [None, (1.7, 2.3), (1.9, 3.5)])
def test_two_who_cross_stay_who_they_are(hide: tuple[float, float] | None) -> None:
    arrivals = film("one", crossing((0, 1), (0.06, 0.0, 0.1)), jitter=0.004, start=-0.1)
    arrivals += film("other", crossing((1, 0), (-0.06, 0.0, -0.1), hide), clock=900.0, rate=25.0)
    out = played(Fusion(), arrivals)
    assert {tuple(numbers(moment)) for moment in out} == {(0, 1)}
    for moment in out[5:]:
        for number, way in ((0, 1.0), (1, -1.0)):
            hips = moment.frame_of(number).positions[0]
            assert abs(hips[0] - way * (moment.time - 2.0)) < 0.12


def test_a_camera_that_takes_one_for_the_other_is_overruled_and_found_out() -> None:
    def swapped(time: float) -> Sequence[SkeletonFrame]:
        order = (5, 6) if time < 2.5 else (6, 5)
        return crossing(order, (0.03, 0.0, 0.0))(time)

    arrivals = film("one", crossing((0, 1), (0.0, 0.0, 0.0)))
    arrivals += film("other", swapped, clock=50.0)
    out = played(Fusion(), arrivals)
    assert {tuple(numbers(moment)) for moment in out} == {(0, 1)}
    for moment in out:
        hips = moment.frame_of(0).positions[0]
        assert abs(hips[0] - (moment.time - 2.0)) < 0.06
    assert out[-1].frame_of(0).positions[0, 0] - (out[-1].time - 2.0) > 0.005  # both count again


def test_two_who_turn_out_to_be_one_get_the_older_s_number() -> None:
    def wrong_at_first(time: float) -> Sequence[SkeletonFrame]:
        return dancing(3, (max(0.1, 1.5 - time), 0.0, 0.0))(time)

    out = played(Fusion(), film("one", dancing(0)) + film("other", wrong_at_first, clock=40.0))
    assert len(out[20].frames) == 2
    assert [numbers(moment) for moment in out[-20:]] == [[0]] * 20


# -- joints -----------------------------------------------------------------------------------


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


# -- coming and going -------------------------------------------------------------------------


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
        # Where directions count, two ways may add up to a little more than the longer one.
        most = 1.25 if aware else 1.0
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


# -- the real thing ---------------------------------------------------------------------------


def trembling(moments: Sequence[Moment]) -> float:
    """Median second difference of a joint, metres."""
    joints = np.array([moment.frames[0].positions for moment in moments if moment.present])
    return float(np.median(np.linalg.norm(np.diff(joints, 2, axis=0), axis=-1)))


def breathing(moments: Sequence[Moment]) -> float:
    """How much bones change their lengths, metres."""
    joints = np.array([moment.frames[0].positions for moment in moments if moment.time > 0.3])
    ends = [bone.end for bone in HUMAN_BONES], [bone.start for bone in HUMAN_BONES]
    return float(np.linalg.norm(joints[:, ends[0]] - joints[:, ends[1]], axis=-1).std(0).mean())


def apart(moments: Sequence[Moment], middle: Floats) -> float:
    """Mean distance of joints from the mean of all views, metres."""
    return float(
        np.mean(
            [
                np.linalg.norm(m.frames[0].positions - middle[round(m.time * 60)], axis=-1).mean()
                for m in moments
                if m.time > 0.3
            ]
        )
    )


def test_more_views_of_a_real_person_are_better_than_each_of_them() -> None:
    middle = middle_of(BALANCE)
    alone = [
        (trembling(moments), breathing(moments), apart(moments, middle))
        for moments in BALANCE.values()
    ]
    together = fused(BALANCE)
    assert len(together) > 90
    assert all(numbers(moment) == [0] for moment in together)
    states = np.array([moment.frames[0].states for moment in together])
    assert (states == TrackingState.TRACKED).mean() > 0.99
    for figure, ones in zip(
        (trembling(together), breathing(together), apart(together, middle)),
        zip(*alone, strict=True),
        strict=True,
    ):
        assert figure < 0.75 * min(ones)
    for pair in itertools.combinations(BALANCE, 2):
        two = fused({name: BALANCE[name] for name in pair})
        own = [BALANCE[name] for name in pair]
        assert all(numbers(moment) == [0] for moment in two)
        assert trembling(two) < np.mean([trembling(moments) for moments in own])


def test_a_moment_may_be_read_only() -> None:
    """As those are which come over the bus."""
    fusion = Fusion()
    for time in (0.0, 0.01, 0.02):
        for camera in ("one", "other"):
            frame = person(0, body(1.0))
            frame.positions.setflags(write=False)
            frame.states.setflags(write=False)
            out = fusion.add(camera, seen(time, 0, replace(frame)), time)
    assert out is None
    Fusion.warm_up()
