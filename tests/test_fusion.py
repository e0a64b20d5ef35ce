from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.fusion import camera_positions, fused, middle_of
from puppet.kernel import Floats
from puppet.skeleton import HUMAN_BONES, Moment, SkeletonFrame, TrackingState
from puppet.tracking.fusion.fusion import Fusion, FusionConfig
from puppet.tracking.takes.rehearsal import body
from tests.fusion_films import BALANCE, dancing, film, numbers, person, played, seen


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
    tremble, breathe, away = zip(*alone, strict=True)
    assert trembling(together) < 0.75 * min(tremble)
    assert apart(together, middle) < 0.75 * min(away)
    # A view alone holds its bones at their lengths; the mean of several can only come near to that.
    assert breathing(together) < 1.3 * min(breathe)
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
