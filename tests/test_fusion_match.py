from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from puppet.skeleton import SkeletonFrame
from puppet.tracking.fusion.fusion import Fusion
from puppet.tracking.takes.rehearsal import body
from tests.fusion_films import BALANCE, dancing, film, numbers, person, played


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
