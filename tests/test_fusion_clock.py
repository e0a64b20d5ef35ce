from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from puppet.tracking.fusion.clock import CameraClock, Heard
from puppet.tracking.fusion.fusion import Fusion
from puppet.tracking.takes.rehearsal import body
from tests.fusion_films import dancing, film, numbers, person, played


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
