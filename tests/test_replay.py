"""Replay: the frames are the same at any speed, and time never runs backwards."""

from __future__ import annotations

from itertools import islice, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.errors import BadShowError
from puppet.skeleton import Moment, SkeletonFrame
from puppet.tracking.source import SourceInfo
from puppet.tracking.takes.rehearsal import Rehearsal
from puppet.tracking.takes.replay import Repeat, Replay, paced
from puppet.tracking.takes.take import Take

REPEATS: tuple[Repeat, ...] = ("once", "loop", "ping-pong")


def take(times: list[float], rate: float = 25.0) -> Take:
    frames = (
        SkeletonFrame(
            time, 7 + 2 * index, 0, np.full((20, 3), float(index)), np.full(20, 2, np.uint8)
        )
        for index, time in enumerate(times)
    )
    return Take(SourceInfo("a take", "test", rate), tuple(map(Moment.of, frames)))


def shown(moment: Moment | None) -> int:
    """Which moment of the take it is."""
    assert moment is not None
    return int(moment.frame_of(0).positions[0, 0])


takes = st.lists(st.floats(0.001, 3.0), min_size=1, max_size=12).map(
    lambda steps: take(np.cumsum(steps).tolist())
)


@given(takes, st.sampled_from(REPEATS), st.floats(0.01, 100.0), st.integers(1, 40))
def test_any_speed_gives_the_same_frames_bit_for_bit(
    take: Take, repeat: Repeat, speed: float, count: int
) -> None:
    one = list(islice(Replay(take, repeat=repeat), count))
    other = list(islice(Replay(take, repeat=repeat, speed=speed), count))
    assert [(f.time, f.sequence) for f in one] == [(f.time, f.sequence) for f in other]
    assert all(
        a.frame_of(0) is b.frame_of(0) or a.time > take.moments[-1].time
        for a, b in zip(one, other, strict=True)
    )


@given(takes)
def test_once_is_the_take_itself(take: Take) -> None:
    assert tuple(Replay(take)) == take.moments
    assert len(Replay(take)) == len(take)


@given(takes, st.integers(1, 60))
def test_a_loop_goes_round_and_joins_with_a_nominal_step(take: Take, count: int) -> None:
    frames = list(islice(Replay(take, repeat="loop"), count))
    assert [shown(f) for f in frames] == [i % len(take) for i in range(count)]
    for a, b in pairwise(frames):
        recorded = take.moments[shown(b)].time - take.moments[shown(a)].time
        expected = recorded if shown(b) > shown(a) else 1.0 / take.info.rate
        assert b.time - a.time == pytest.approx(expected, abs=1e-9)
        assert b.sequence > a.sequence


@given(takes, st.integers(2, 60))
def test_ping_pong_turns_at_the_ends_and_keeps_the_spacing(take: Take, count: int) -> None:
    frames = list(islice(Replay(take, repeat="ping-pong"), count))
    for a, b in pairwise(frames):
        if len(take) > 1:
            assert abs(shown(a) - shown(b)) == 1
            recorded = abs(take.moments[shown(b)].time - take.moments[shown(a)].time)
            assert b.time - a.time == pytest.approx(recorded, abs=1e-9)
        assert b.sequence > a.sequence


@given(
    takes,
    st.sampled_from(REPEATS),
    st.lists(
        st.one_of(
            st.just("next"),
            st.tuples(st.just("step"), st.integers(-5, 5)),
            st.tuples(st.just("seek"), st.floats(-1.0, 40.0)),
        ),
        max_size=30,
    ),
)
def test_whatever_is_done_time_and_sequence_only_grow(
    take: Take, repeat: Repeat, doings: list[object]
) -> None:
    replay = Replay(take, repeat=repeat)
    frames: list[Moment | None] = [replay.advance()]
    for doing in doings:
        match doing:
            case ("step", int(count)):
                frames.append(replay.step(count))
            case ("seek", float(seconds)):
                replay.seek(seconds)
            case _:
                wait = replay.delay
                frame = replay.advance()
                assert (wait is None) == (frame is None)
                frames.append(frame)
    given_ = [frame for frame in frames if frame is not None]
    for a, b in pairwise(given_):
        assert b.time > a.time
        assert b.sequence > a.sequence


def test_a_recorded_clock_that_runs_back_does_not_in_the_replay() -> None:
    frames = list(Replay(take([0.0, 1.0, 0.5, 0.9])))
    assert [f.time for f in frames] == pytest.approx([0.0, 1.0, 1.04, 1.44])


def test_seek_goes_to_the_first_frame_at_or_after() -> None:
    replay = Replay(take([10.0, 10.5, 11.0, 11.5]))
    replay.seek(0.6)
    assert shown(replay.advance()) == 2
    assert replay.position == pytest.approx(1.0)
    replay.seek(0.5)
    assert shown(replay.advance()) == 1
    replay.seek(99.0)
    assert shown(replay.advance()) == 3
    assert replay.advance() is None
    replay.seek(0.0)
    assert shown(replay.advance()) == 0


def test_step_stops_at_the_ends_but_goes_round_in_a_loop() -> None:
    replay = Replay(take([0.0, 1.0, 2.0]))
    assert [shown(replay.step(n)) for n in (1, 5, -1, -9)] == [1, 2, 1, 0]
    assert shown(replay.advance()) == 1
    around = Replay(take([0.0, 1.0, 2.0]), repeat="loop")
    assert [shown(around.step(n)) for n in (-1, 1, 4)] == [2, 0, 1]


def test_speed_changes_only_when_frames_are_due() -> None:
    replay = Replay(take([5.0, 5.5, 6.5]), speed=2.0)
    assert [due for due, _ in paced(replay)] == pytest.approx([0.0, 0.25, 0.75])


def test_speed_may_change_on_the_way() -> None:
    replay = Replay(take([0.0, 1.0, 2.0, 3.0]))
    dues = []
    for due, frame in paced(replay):
        dues.append(due)
        if shown(frame) == 1:
            replay.speed = 4.0
    assert dues == pytest.approx([0.0, 1.0, 1.25, 1.5])


def test_a_pause_is_not_waited_for_and_goes_on_where_it_was() -> None:
    replay = Replay(take([0.0, 1.0, 2.0]))
    assert shown(replay.advance()) == 0
    replay.paused = True
    assert replay.delay is None
    assert list(paced(replay)) == []
    replay.paused = False
    assert [shown(frame) for frame in replay] == [1, 2]


@pytest.mark.parametrize("repeat", REPEATS)
def test_an_empty_take_is_over_at_once(repeat: Repeat) -> None:
    replay = Replay(take([]), repeat=repeat)
    assert list(replay) == []
    assert replay.step() is None
    replay.seek(3.0)
    assert replay.delay is None


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_speed_is_refused(speed: float) -> None:
    with pytest.raises(BadShowError, match="speed"):
        Replay(take([0.0]), speed=speed)


def test_the_rehearsal_loops_without_a_jump() -> None:
    replay = Replay.of(Rehearsal(), repeat="loop")
    replay.seek(58.0)
    frames = [moment.frame_of(0) for moment in islice(replay, 40)]
    steps = [np.abs(b.positions - a.positions).max() for a, b in pairwise(frames)]
    assert max(steps) < 0.01
