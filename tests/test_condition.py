"""Conditioning: what is steadied, what is held, what eases to rest and comes back."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from puppet.kernel import Floats
from puppet.skeleton import Joint, SkeletonFrame, nobody
from puppet.tracking.condition import Conditioner
from puppet.tracking.rehearsal import Rehearsal

RATE = 30.0
HAND = Joint.HAND_RIGHT
PERFORMANCE = list(Rehearsal())


def still() -> Floats:
    return np.array(PERFORMANCE[0].positions)


def frames(
    positions: Iterable[Floats], states: Iterable[np.ndarray] | None = None
) -> list[SkeletonFrame]:
    places = list(positions)
    known = list(states) if states is not None else [np.full(20, 2, np.uint8)] * len(places)
    return [
        SkeletonFrame(i / RATE, i, 0, p, s)
        for i, (p, s) in enumerate(zip(places, known, strict=True))
    ]


def run(raw: Iterable[SkeletonFrame]) -> list[SkeletonFrame]:
    condition = Conditioner()
    return [condition(frame) for frame in raw]


def hiding(
    joints: list[Joint], start: int, end: int, count: int, state: int = 0
) -> list[np.ndarray]:
    states = [np.full(20, 2, np.uint8) for _ in range(count)]
    for row in states[start:end]:
        row[joints] = state
    return states


def test_noise_on_a_still_joint_is_mostly_gone() -> None:
    rng = np.random.default_rng(1)
    raw = frames(still() + rng.normal(scale=0.008, size=(150, 20, 3)))
    before = np.std([f.positions[HAND] for f in raw[30:]], axis=0).mean()
    after = np.std([f.positions[HAND] for f in run(raw)[30:]], axis=0).mean()
    assert after < 0.65 * before


def test_a_quick_joint_is_hardly_delayed() -> None:
    speed = 2.0  # metres a second
    path = [still() + (speed * i / RATE, 0.0, 0.0) for i in range(60)]
    lag = path[-1][HAND, 0] - run(frames(path))[-1].positions[HAND, 0]
    assert lag / speed < 0.012


def test_an_inferred_joint_moves_less_freely_than_a_tracked_one() -> None:
    reached = still()
    reached[[Joint.WRIST_RIGHT, HAND]] += (0.15, 0.0, 0.0)
    path = [still()] * 10 + [reached] * 5
    wrist = Joint.WRIST_RIGHT
    tracked = run(frames(path))[11].positions[wrist, 0]
    guessed = run(frames(path, hiding([wrist], 0, 15, 15, state=1)))[11].positions[wrist, 0]
    start = still()[wrist, 0]
    assert tracked - start > 2 * (guessed - start) > 0


def test_a_lost_hand_holds_and_then_its_influence_eases_away() -> None:
    count = 120
    result = run(frames([still()] * count, hiding([HAND], 30, count, count)))
    held = result[30 + 12]
    np.testing.assert_allclose(held.positions[HAND], still()[HAND], atol=0.01)
    assert held.influence[HAND] > 0.95
    fading = [f.influence[HAND] for f in result[50:]]
    assert all(b < a for a, b in itertools.pairwise(fading))
    assert fading[-1] < 0.05
    assert result[-1].influence[Joint.HAND_LEFT] > 0.99


def test_a_lost_hand_stays_on_the_body_that_walks_on() -> None:
    count = 40
    path = [still() + (0.02 * i, 0.0, 0.0) for i in range(count)]
    result = run(frames(path, hiding([Joint.WRIST_RIGHT, HAND], 20, count, count)))
    arm = result[-1].positions[HAND] - result[-1].positions[Joint.ELBOW_RIGHT]
    np.testing.assert_allclose(arm, (still()[HAND] - still()[Joint.ELBOW_RIGHT]), atol=0.03)


def test_who_comes_back_elsewhere_takes_over_gradually() -> None:
    away = still() + (1.5, 0.0, 0.0)
    path = [still()] * 40 + [still() * 0] * 60 + [away] * 60
    states = hiding(list(Joint), 40, 100, 160)
    result = run(frames(path, states))
    assert result[99].influence.max() < 0.15
    influence = np.array([f.influence for f in result])
    assert np.abs(np.diff(influence, axis=0)).max() < 0.25
    np.testing.assert_allclose(result[-1].positions, away, atol=0.02)
    assert result[-1].influence.min() > 0.95


@settings(max_examples=25)
@given(
    start=st.integers(5, 60),
    length=st.integers(1, 90),
    joints=st.sets(st.sampled_from(list(Joint)), min_size=1),
)
def test_no_joint_ever_jumps_whatever_is_hidden_when(
    start: int, length: int, joints: set[Joint]
) -> None:
    raw = PERFORMANCE[60:240]
    hidden = [
        SkeletonFrame(
            f.time,
            f.sequence,
            0,
            f.positions,
            np.where(
                np.isin(np.arange(20), list(joints)) & (start <= i < start + length), 0, f.states
            ).astype(np.uint8),
        )
        for i, f in enumerate(raw)
    ]
    result = run(hidden)
    places = np.array([f.positions for f in result])
    felt = np.array([f.influence for f in result])[1:, :, None]
    hips = places[:, :1]
    fastest = np.abs(np.diff(np.array([f.positions for f in raw]), axis=0)).max() * RATE
    # Nothing that is felt moves on the body faster than the performer did, closing in included.
    assert (felt * np.abs(np.diff(places - hips, axis=0))).max() * RATE < max(2.0 * fastest, 6.0)


def test_time_is_what_drives_it_not_the_number_of_calls() -> None:
    raw = frames([still(), still() + (0.1, 0.0, 0.0), still() + (0.1, 0.0, 0.0)])
    condition = Conditioner()
    first = [condition(frame) for frame in raw]
    again = condition(raw[-1])
    np.testing.assert_array_equal(again.positions, first[-1].positions)


def test_nobody_at_first_gives_no_influence() -> None:
    condition = Conditioner()
    assert condition(nobody(0.0, 0)).influence.max() == 0.0


@pytest.mark.parametrize("repeat", [1, 2])
def test_the_same_frames_give_the_same_result_bit_for_bit(repeat: int) -> None:
    raw = PERFORMANCE[: 200 * repeat]
    for a, b in zip(run(raw), run(raw), strict=True):
        assert a.positions.tobytes() == b.positions.tobytes()
        assert a.influence.tobytes() == b.influence.tobytes()
