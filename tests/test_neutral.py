"""When somebody's stance is taken for the neutral one, and what it is then."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.kernel import Bytes, Floats
from puppet.mapping.stance import UPRIGHT, stance_of
from puppet.skeleton import HUMAN_BONE_NAMES, JOINT_COUNT, Joint, SkeletonFrame, TrackingState
from puppet.tracking.neutral import NeutralStance
from puppet.tracking.takes.rehearsal import SECTIONS, Rehearsal

TRACKED: Bytes = np.full(JOINT_COUNT, TrackingState.TRACKED, np.uint8)
LEGS = [joint for joint in Joint if joint.name.split("_")[0] in ("KNEE", "ANKLE", "FOOT")]


def standing(left: float, right: float, turn: float = 0.0) -> Floats:
    """Somebody upright whose straight arms are raised sideways by angles (rad; 0 hangs)."""
    points = np.array([UPRIGHT[joint] for joint in Joint])
    for side, angle in (("LEFT", left), ("RIGHT", -right)):
        arm = [Joint[f"{name}_{side}"] for name in ("SHOULDER", "ELBOW", "WRIST", "HAND")]
        raised = Rotation.from_euler("z", angle).apply(points[arm] - points[arm[0]])
        points[arm] = points[arm[0]] + raised
    return np.asarray(Rotation.from_euler("y", turn).apply(points))


def held(
    points: Floats, seconds: float, rate: float = 30.0, states: Bytes = TRACKED
) -> NeutralStance:
    """What is known after somebody has stood so, with a tracker's jitter."""
    find, random = NeutralStance(), np.random.default_rng(0)
    for i in range(int(seconds * rate) + 1):
        jitter = np.clip(random.normal(0.0, 0.006, points.shape), -0.015, 0.015)
        find(SkeletonFrame(i / rate, i, 0, points + jitter, states))
    return find


def rehearsal() -> list[SkeletonFrame]:
    return [moment.frame_of(0) for moment in Rehearsal()]


def moved(
    frames: list[SkeletonFrame], turn: float, place: tuple[float, float, float]
) -> list[SkeletonFrame]:
    spin = Rotation.from_euler("y", turn)
    return [
        SkeletonFrame(f.time, f.sequence, 0, np.array(spin.apply(f.positions) + place), f.states)
        for f in frames
    ]


def turned_apart(a: NeutralStance, points: Floats) -> dict[str, float]:
    """Degrees between the bones of a stance and those of a skeleton, by the bones' names."""
    assert a.stance is not None
    other = stance_of(points)
    apart = Rotation.from_quat(a.stance.swings) * Rotation.from_quat(other.swings).inv()
    return dict(zip(HUMAN_BONE_NAMES, np.degrees(apart.magnitude()).tolist(), strict=True))


def test_standing_still_for_a_moment_is_measured_once() -> None:
    find = NeutralStance()
    changes = [frame.time for frame in rehearsal() if find(frame)]
    assert find.measured
    assert find.kind == "I"
    assert len(changes) == 2  # assumed at first sight, measured at the first stillness
    assert 0.5 < changes[1] < 1.5


def test_the_measured_stance_knows_where_and_which_way() -> None:
    find = NeutralStance()
    for frame in moved(rehearsal()[:60], 0.8, (1.0, 0.0, -3.0)):
        find(frame)
    assert find.stance is not None
    assert abs(find.stance.heading - 0.8) < math.radians(3)
    np.testing.assert_allclose(find.stance.hip[[0, 2]], [1.0, -3.0], atol=0.08)


def test_someone_who_never_stands_still_gets_an_assumed_stance() -> None:
    find = NeutralStance()
    times = {section.name: section for section in SECTIONS}
    walk = next(section for name, section in times.items() if "walk" in name)
    for frame in rehearsal():
        if walk.start + 0.5 < frame.time < walk.end - 0.5:
            find(frame)
    assert find.stance is not None
    assert not find.measured
    assert find.kind is None


@settings(max_examples=15)
@given(st.floats(1.25, 1.85), st.floats(1.25, 1.85), st.floats(-3.1, 3.1))
def test_a_t_gives_the_stance_with_hanging_arms(left: float, right: float, turn: float) -> None:
    find = held(standing(left, right, turn), 1.2)
    assert find.kind == "T"
    apart = turned_apart(find, standing(0.0, 0.0, turn))
    assert max(apart.values()) < 6.0, apart
    assert find.stance is not None
    np.testing.assert_allclose(np.cos(find.stance.heading - turn), 1.0, atol=1e-3)


def test_a_t_has_to_be_held_for_longer_than_hanging_arms() -> None:
    assert held(standing(0.1, 0.1), 0.8).kind == "I"
    assert held(standing(1.6, 1.6), 0.8).kind is None


@pytest.mark.parametrize("arms", [(1.6, 0.0), (2.8, 2.8), (0.9, 2.0)])
def test_two_seconds_of_standing_still_are_enough_whatever_the_arms_do(
    arms: tuple[float, float],
) -> None:
    assert not held(standing(*arms), 1.8).measured
    find = held(standing(*arms), 2.2)
    assert find.kind == "still"
    assert max(turned_apart(find, standing(0.0, 0.0)).values()) < 6.0


def test_arms_that_hang_loosely_are_taken_as_they_are() -> None:
    find = held(standing(0.7, 0.7), 2.2)
    assert find.kind == "still"
    assert turned_apart(find, standing(0.7, 0.7))["upper_arm.L"] < 6.0


def test_a_bow_is_never_neutral() -> None:
    points = standing(0.0, 0.0)
    upper = [joint for joint in Joint if joint not in LEGS and "HIP" not in joint.name]
    pivot = points[Joint.HIP_CENTER].copy()
    points[upper] = Rotation.from_euler("x", 1.0).apply(points[upper] - pivot) + pivot
    find = held(points, 3.0)
    assert not find.measured
    assert find.progress == 0.0


@pytest.mark.parametrize("arms", [0.0, 1.6])
@pytest.mark.parametrize("state", [TrackingState.NOT_TRACKED, TrackingState.INFERRED])
def test_whoever_sits_is_measured_by_the_upper_body(arms: float, state: TrackingState) -> None:
    states = TRACKED.copy()
    states[[*LEGS, Joint.HIP_LEFT, Joint.HIP_RIGHT, Joint.HIP_CENTER]] = TrackingState.INFERRED
    states[LEGS] = state
    points = standing(arms, arms)
    points[LEGS] = 0.0 if state == TrackingState.NOT_TRACKED else points[LEGS] + (0.0, 0.3, 0.4)
    assert not held(points, 0.8, states=states).measured
    find = held(points, 1.2, states=states)
    assert find.kind == ("I" if arms < 1.0 else "T")
    assert max(turned_apart(find, standing(0.0, 0.0)).values()) < 6.0


@pytest.mark.parametrize("rate", [5.0, 10.0, 24.0, 60.0, 240.0])
def test_stillness_is_counted_in_seconds_not_in_frames(rate: float) -> None:
    assert not held(standing(0.0, 0.0), 0.45, rate).measured
    assert held(standing(0.0, 0.0), 0.85, rate).measured


def test_progress_grows_while_somebody_holds_still_and_falls_when_they_move() -> None:
    find, seen = NeutralStance(), []
    for i in range(40):
        points = standing(1.6, 1.6) + (0.5 if i >= 20 else 0.0, 0.0, 0.0)
        find(SkeletonFrame(i / 30.0, i, 0, points, TRACKED))
        seen.append(find.progress)
    assert seen[0] == 0.0
    assert np.all(np.diff(seen[:20]) > 0.0)
    assert seen[20] < 0.1
    assert seen[19] > 0.5


def test_a_saved_stance_holds_until_it_is_to_be_measured_anew() -> None:
    saved = stance_of(standing(0.2, 0.2, 0.5))
    find = NeutralStance(saved)
    for i in range(60):
        assert not find(SkeletonFrame(i / 30.0, i, 0, standing(0.0, 0.0), TRACKED))
    assert find.stance is saved
    find.reset()
    assert not find.measured
    for i in range(60):
        find(SkeletonFrame(i / 30.0, i, 0, standing(0.0, 0.0), TRACKED))
    assert find.kind == "I"
    assert find.stance is not None
    assert find.stance.heading == pytest.approx(0.0, abs=1e-6)


def test_nobody_there_starts_the_counting_anew() -> None:
    find = NeutralStance()
    for i in range(120):
        states = TRACKED if i % 12 else np.zeros_like(TRACKED)
        find(SkeletonFrame(i / 30.0, i, 0, standing(0.0, 0.0), states))
    assert not find.measured
