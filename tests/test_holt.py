"""Holt's smoothing: what the Kinect SDK computes, at its rate and at others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from puppet.errors import BadShowError
from puppet.kernel import Floats
from puppet.show import ConditioningConfig, HoltConfig, KinectConfig, load_show
from puppet.skeleton import JOINT_PARENTS, Joint, SkeletonFrame
from puppet.tracking.conditioning.condition import Conditioner
from puppet.tracking.conditioning.holt import KINECT_PRESETS, half_life_of
from puppet.tracking.takes.rehearsal import Rehearsal, body

TRACKED = np.full(20, 2, np.uint8)


@dataclass
class Textbook:
    """One joint as the SDK's documentation and samples have it, frame by frame."""

    smoothing: float
    correction: float
    prediction: float
    jitter_radius: float
    max_deviation_radius: float

    def __call__(self, raws: Floats) -> Floats:
        """(frames, 3) -> (frames, 3)"""
        out = [raws[0]]
        filtered, trend, last = raws[0], np.zeros(3), raws[0]
        for count, raw in enumerate(raws[1:], start=1):
            if count == 1:
                now = 0.5 * (raw + last)
            else:
                length = np.linalg.norm(raw - filtered)
                now = raw
                if length <= self.jitter_radius:
                    heard = length / self.jitter_radius
                    now = raw * heard + filtered * (1.0 - heard)
                now = now * (1.0 - self.smoothing) + (filtered + trend) * self.smoothing
            trend = (now - filtered) * self.correction + trend * (1.0 - self.correction)
            filtered, last = now, raw
            predicted = filtered + trend * self.prediction
            length = np.linalg.norm(predicted - raw)
            if length > self.max_deviation_radius:
                share = self.max_deviation_radius / length
                predicted = predicted * share + raw * (1.0 - share)
            out.append(predicted)
        return np.array(out)


def conditioned(raws: Floats, config: ConditioningConfig, rate: float = 30.0) -> Floats:
    """(frames, 20, 3) -> the same"""
    condition = Conditioner(config)
    return np.array(
        [
            condition(SkeletonFrame(i / rate, i, 0, places, TRACKED)).positions
            for i, places in enumerate(raws)
        ]
    )


def rehearsed(start: float, seconds: float, rate: float = 30.0) -> Floats:
    return np.array([body(start + i / rate) for i in range(round(seconds * rate))])


shares = st.floats(0.0, 0.95)
radii = st.floats(0.005, 1.0)


@settings(max_examples=20)
@given(
    knobs=st.tuples(shares, shares, st.floats(0.0, 2.0), radii, radii),
    start=st.floats(0.0, 50.0),
    seed=st.integers(0, 1000),
)
def test_by_the_names_of_the_kinect_it_is_what_the_kinect_does(
    knobs: tuple[float, float, float, float, float], start: float, seed: int
) -> None:
    noise = np.random.default_rng(seed).normal(scale=0.004, size=(60, 20, 3))
    raws = rehearsed(start, 2.0) + noise
    smoothing, correction, prediction, jitter, deviation = knobs
    kinect = KinectConfig(
        smoothing=smoothing,
        correction=correction,
        prediction=prediction,
        jitter_radius=jitter,
        max_deviation_radius=deviation,
    )
    result = conditioned(raws, ConditioningConfig(filter="holt", kinect=kinect))
    textbook = Textbook(*knobs)
    for joint in Joint:
        parent = JOINT_PARENTS[joint]
        if parent < 0:
            np.testing.assert_allclose(result[:, joint], textbook(raws[:, joint]), atol=1e-9)
        else:
            bone = textbook(raws[:, joint] - raws[:, parent])
            ours = result[:, joint] - result[:, parent]
            np.testing.assert_allclose(ours, bone, atol=1e-9)


@pytest.mark.parametrize("preset", KINECT_PRESETS)
def test_a_preset_is_what_the_documentation_says(preset: str) -> None:
    raws = rehearsed(10.0, 2.0)
    config = ConditioningConfig(filter="holt", kinect=KinectConfig(preset=preset))  # type: ignore[arg-type]
    textbook = Textbook(*KINECT_PRESETS[preset])
    result = conditioned(raws, config)[:, Joint.HIP_CENTER]
    np.testing.assert_allclose(result, textbook(raws[:, Joint.HIP_CENTER]), atol=1e-9)


@settings(max_examples=10, phases=[Phase.explicit, Phase.generate])
@given(
    level=st.floats(0.03, 0.08),
    trend=st.floats(0.04, 0.1),
    start=st.floats(0.0, 48.0),
)
def test_the_rate_of_frames_hardly_matters(level: float, trend: float, start: float) -> None:
    config = ConditioningConfig(filter="holt", holt=HoltConfig(level=level, trend=trend))
    thirty, sixty, hundred_and_twenty = (
        conditioned(rehearsed(start, 3.0, rate), config, rate)[:: round(rate / 30)]
        for rate in (30.0, 60.0, 120.0)
    )
    for other in (sixty, hundred_and_twenty):
        apart = np.linalg.norm(other - thirty, axis=2)[10:]
        assert apart.max() < 0.08
        assert np.sqrt((apart**2).mean()) < 0.02


def test_a_share_kept_in_each_frame_is_a_half_life() -> None:
    assert half_life_of(0.5) == pytest.approx(1.0 / 30.0)
    assert half_life_of(0.25) == pytest.approx(0.5 / 30.0)
    assert half_life_of(0.0) == 0.0


def test_an_inferred_joint_is_steadied_more() -> None:
    noise = np.random.default_rng(1).normal(scale=0.01, size=(90, 20, 3))
    condition, doubtful = (Conditioner(ConditioningConfig(filter="holt")) for _ in range(2))
    still = Rehearsal().frame(0.0).positions
    states = TRACKED.copy()
    states[Joint.HAND_RIGHT] = 1
    shown = []
    for i, shaken in enumerate(still + noise):
        known = condition(SkeletonFrame(i / 30, i, 0, shaken, TRACKED))
        guessed = doubtful(SkeletonFrame(i / 30, i, 0, shaken, states))
        shown.append([known.positions[Joint.HAND_RIGHT], guessed.positions[Joint.HAND_RIGHT]])
    known_trembles, guessed_trembles = np.array(shown)[40:].std(axis=0).mean(axis=1)
    assert guessed_trembles < 0.95 * known_trembles


# -- in a show --------------------------------------------------------------------------------

SHOW = """
name = "x"
[source]
path = "rehearsal"
[[puppets]]
name = "fish"
armature = "fish.glb"
"""


@pytest.mark.parametrize(
    ("text", "place", "what"),
    [
        ('filter = "holt"\n[conditioning.kinect]\n[conditioning.holt]\n', "conditioning", "both"),
        ("[conditioning.kinect]\n", "conditioning.filter", "holt"),
        ('filter = "holt"\n[conditioning.kinect]\nsmoothing = 1.0\n', "kinect.smoothing", "0.99"),
        ('filter = "holt"\n[conditioning.kinect]\ncorrection = 2\n', "kinect.correction", "0 to 1"),
        ('filter = "holt"\n[conditioning.holt]\nlevel = -1.0\n', "conditioning.holt.level", "0 or"),
        ('filter = "kalman"\n', "conditioning.filter", "kalman"),
        ("prediction = nan\n", "conditioning.prediction", "0 or more"),
    ],
)
def test_knobs_that_do_not_go_together_are_an_error(
    tmp_path: Path, text: str, place: str, what: str
) -> None:
    path = tmp_path / "show.toml"
    path.write_text(SHOW + "[conditioning]\n" + text)
    with pytest.raises(BadShowError) as error:
        load_show(path)
    assert place in str(error.value)
    assert what in str(error.value)


def test_the_kinect_s_names_may_be_said_beside_a_preset(tmp_path: Path) -> None:
    path = tmp_path / "show.toml"
    path.write_text(
        SHOW
        + '[conditioning]\nfilter = "holt"\n[conditioning.kinect]\npreset = "menus"\n'
        + "smoothing = 0.6\n"
    )
    kinect = load_show(path).conditioning.kinect
    assert kinect == KinectConfig(preset="menus", smoothing=0.6)
