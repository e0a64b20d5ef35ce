"""Conditioning: what is steadied, what is held, what eases to rest and comes back."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from collections.abc import Iterable

import msgspec
import numpy as np
import pytest

from puppet.kernel import Floats
from puppet.mapping.stance import UPRIGHT, heading_of
from puppet.show import ConditioningConfig, HoltConfig, KinectConfig
from puppet.skeleton import Joint, SkeletonFrame, nobody
from puppet.tracking.conditioning.condition import Conditioner
from puppet.tracking.takes.rehearsal import Rehearsal

RATE = 30.0
HAND = Joint.HAND_RIGHT
PERFORMANCE = [
    frame
    for moment in Rehearsal()
    for frame in moment.frames or (nobody(moment.time, moment.sequence),)
]


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


def run(
    raw: Iterable[SkeletonFrame], config: ConditioningConfig | None = None
) -> list[SkeletonFrame]:
    condition = Conditioner(config)
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


def test_time_is_what_drives_it_not_the_number_of_calls() -> None:
    raw = frames([still(), still() + (0.1, 0.0, 0.0), still() + (0.1, 0.0, 0.0)])
    condition = Conditioner()
    first = [condition(frame) for frame in raw]
    again = condition(raw[-1])
    np.testing.assert_array_equal(again.positions, first[-1].positions)


def test_nobody_at_first_gives_no_influence() -> None:
    condition = Conditioner()
    assert condition(nobody(0.0, 0)).influence.max() == 0.0


CONFIGS = {
    "one-euro": ConditioningConfig(prediction=0.05),
    "kinect": ConditioningConfig(filter="holt", kinect=KinectConfig(preset="menus")),
    "holt": ConditioningConfig(filter="holt", holt=HoltConfig(), prediction=0.05),
}
EVERY = pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS)


@EVERY
def test_the_same_frames_give_the_same_result_bit_for_bit(config: ConditioningConfig) -> None:
    raw = PERFORMANCE[:400]
    for a, b in zip(run(raw, config), run(raw, config), strict=True):
        assert a.positions.tobytes() == b.positions.tobytes()
        assert a.influence.tobytes() == b.influence.tobytes()


def test_the_compiled_kernels_do_what_they_do_as_python() -> None:
    script = (
        "from tests.test_condition import CONFIGS, PERFORMANCE, run\n"
        "for config in CONFIGS.values():\n"
        "    last = run(PERFORMANCE[1150:1240:2], config)[-1]\n"
        "    print(*last.positions.ravel().tolist(), *last.influence.tolist())\n"
    )
    command = [sys.executable, "-c", script]
    plain = subprocess.run(
        command,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    for line, config in zip(plain.stdout.splitlines(), CONFIGS.values(), strict=True):
        last = run(PERFORMANCE[1150:1240:2], config)[-1]
        numbers = np.array(line.split(), float)
        np.testing.assert_allclose(
            np.r_[last.positions.ravel(), last.influence], numbers, atol=1e-9
        )


# -- who is there -------------------------------------------------------------------------------


def test_a_hand_that_comes_in_first_moves_nothing() -> None:
    states = np.zeros(20, np.uint8)
    states[[Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, HAND]] = 2
    for frame in run(frames([still()] * 60, [states] * 60)):
        assert frame.influence.max() == 0.0
        assert not frame.present


def test_shoulders_are_enough_to_be_there_and_hips_are_put_below_them() -> None:
    """Somebody behind a table, turned by 40 degrees: hips and legs are never seen."""
    sine, cosine = np.sin(np.radians(40.0)), np.cos(np.radians(40.0))
    turned = still() @ np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
    hidden = [Joint.HIP_CENTER, Joint.SPINE, *range(Joint.HIP_LEFT, Joint.FOOT_RIGHT + 1)]
    places = np.array(turned)
    places[hidden] = 0.0
    result = run(frames([places] * 60, hiding([Joint(j) for j in hidden], 0, 60, 60)))[-1]
    assert result.influence[HAND] > 0.99
    assert result.influence[hidden].max() == 0.0
    trunk = UPRIGHT[Joint.SHOULDER_CENTER][1] - UPRIGHT[Joint.HIP_CENTER][1]
    below = result.positions[Joint.SHOULDER_CENTER] - (0.0, trunk, 0.0)
    np.testing.assert_allclose(result.positions[Joint.HIP_CENTER], below, atol=1e-3)
    assert heading_of(result.positions) == pytest.approx(heading_of(turned), abs=0.02)


def test_hips_that_are_lost_go_along_with_the_shoulders() -> None:
    path = [still() + (0.03 * i, 0.0, 0.0) for i in range(60)]
    hips = [Joint.HIP_CENTER, Joint.SPINE, Joint.HIP_LEFT, Joint.HIP_RIGHT]
    result = run(frames(path, hiding(hips, 20, 60, 60)))[-1]
    np.testing.assert_allclose(result.positions[hips], path[-1][hips], atol=0.02)


def test_a_lost_hand_turns_with_the_body() -> None:
    def turned(angle: float) -> Floats:
        sine, cosine = np.sin(angle), np.cos(angle)
        back = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
        return np.asarray(still() @ back)

    path = [turned(0.04 * max(i - 20, 0)) for i in range(60)]
    result = run(frames(path, hiding([Joint.WRIST_RIGHT, HAND], 20, 60, 60)))[-1]
    np.testing.assert_allclose(result.positions[HAND], path[-1][HAND], atol=0.03)


# -- what is believed -----------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_short_glitch_is_not_believed(count: int) -> None:
    path = [still() for _ in range(60)]
    for places in path[30 : 30 + count]:
        places[[Joint.WRIST_RIGHT, HAND]] += (0.9, 0.4, 0.0)
    for frame in run(frames(path))[20:]:
        np.testing.assert_allclose(frame.positions, still(), atol=0.01)


def test_a_child_of_a_glitch_is_followed_on() -> None:
    path = [still() + (0.0, 0.01 * i, 0.0) for i in range(60)]
    for places in path[40:42]:
        places[Joint.ELBOW_RIGHT] += (0.9, 0.4, 0.0)
    for frame, places in zip(run(frames(path))[40:], path[40:], strict=True):
        np.testing.assert_allclose(frame.positions[HAND], places[HAND], atol=0.02)


# -- steps and prediction -------------------------------------------------------------------------


def test_every_step_of_a_frame_can_be_watched() -> None:
    assert Conditioner().steps is None
    condition = Conditioner(ConditioningConfig(prediction=0.05))
    raw = PERFORMANCE[400]
    for frame in PERFORMANCE[300:401]:
        result = condition(frame)
    steps = condition.steps
    assert steps is not None
    np.testing.assert_array_equal(steps.raw, raw.positions)
    np.testing.assert_array_equal(steps.believed, raw.positions)
    np.testing.assert_array_equal(steps.shown, result.positions)
    np.testing.assert_array_equal(steps.influence, result.influence)
    assert np.abs(steps.filtered - steps.believed).max() > 1e-4
    assert np.abs(steps.predicted - steps.filtered).max() > 1e-4
    assert (steps.trust > 0.99).all()


def reach(way: Floats) -> list[SkeletonFrame]:
    """An arm that is moved towards +Z, metres."""
    path = [still() for _ in way]
    for places, gone in zip(path, way, strict=True):
        places[[Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, HAND], 2] += gone
    return frames(path)


def shown(way: Floats, config: ConditioningConfig) -> Floats:
    start = still()[HAND, 2]
    return np.array([frame.positions[HAND, 2] - start for frame in run(reach(way), config)])


@pytest.mark.parametrize("plainly", [ConditioningConfig(), ConditioningConfig(filter="holt")])
def test_prediction_is_ahead_by_as_much_as_is_asked(plainly: ConditioningConfig) -> None:
    way = np.linspace(0.0, 1.2, 46)
    plain = shown(way, plainly)
    ahead = shown(way, msgspec.structs.replace(plainly, prediction=0.05))
    assert (ahead - plain)[-1] == pytest.approx(0.8 * 0.05, rel=0.05)


@pytest.mark.parametrize("seconds", [0.2, 0.3, 0.5])
def test_who_stops_is_not_carried_far_beyond(seconds: float) -> None:
    t = np.clip(np.arange(60) / RATE / seconds, 0.0, 1.0)
    way = 0.6 * (10 * t**3 - 15 * t**4 + 6 * t**5)  # as hands reach: minimum jerk
    for prediction in (0.05, 0.1, 0.5):
        ahead = shown(way, ConditioningConfig(prediction=prediction, prediction_limit=0.08))
        assert ahead.max() - 0.6 < (0.06 if prediction < 0.1 else 0.08)
        assert ahead[-1] == pytest.approx(0.6, abs=1e-3)


def test_a_hand_that_swings_is_shown_sooner_and_hardly_further() -> None:
    t = np.arange(150) / RATE
    way = 0.25 * np.sin(2.0 * np.pi * t)

    def phase(values: Floats) -> float:
        return float(np.angle((values[60:] * np.exp(-2j * np.pi * t[60:])).sum()))

    plain = shown(way, ConditioningConfig())
    ahead = shown(way, ConditioningConfig(prediction=0.05))
    sooner = (phase(ahead) - phase(plain)) / (2.0 * np.pi)
    assert 0.025 < sooner < 0.05
    assert np.ptp(ahead[60:]) < 1.06 * np.ptp(way[60:])
