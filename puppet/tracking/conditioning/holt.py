"""Holt's double exponential smoothing, as the Kinect SDK 1.x has it.

Its five parameters and their order of work: a jitter filter, level and trend, prediction, and a
bound on how far the prediction may be from what was seen (Azimi, Skeletal Joint Smoothing White
Paper, 2012). The SDK counts in frames; here shares of a frame are half-lives, and at 30 frames a
second the two are the same.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from puppet.kernel import Floats, kernel
from puppet.show import HoltConfig, KinectConfig
from puppet.tracking.conditioning.one_euro import blend
from puppet.tracking.conditioning.rows import length_of

#: The frames in which the Kinect counts, a second.
KINECT_RATE: Final = 30.0
#: What the SDK's documentation proposes: smoothing, correction, prediction, jitter radius, maximal
#: deviation radius.
KINECT_PRESETS: Final = {
    "gestures": (0.5, 0.5, 0.5, 0.05, 0.04),
    "menus": (0.5, 0.1, 0.5, 0.1, 0.1),
    "smoothest": (0.7, 0.3, 1.0, 1.0, 1.0),
}


@kernel
def holt(
    raw: Floats,
    before: Floats,
    trend: Floats,
    count: int,
    knobs: Floats,
    trust: float,
    wide: float,
    dt: float,
    level: Floats,
    predicted: Floats,
) -> None:
    """One joint, `dt` after it was filtered last. Fills `level` and `predicted`, changes `trend`.

    All (3,): raw, where it is seen; before, its level then; trend, m/s. count: how often it was
    filtered before, at least once. knobs: as `holt_knobs` gives them. trust: 0.1..1, less makes
    half-lives longer. wide: what both radii are multiplied by.
    """
    radius, deviation = knobs[3] * wide, knobs[4] * wide
    away = raw - before
    if count == 1:
        gain, coasting = 0.5, 0.0
    else:
        length = length_of(away)
        half_life = knobs[0] / (trust * trust)
        gain = blend(half_life, 1.0 / KINECT_RATE)
        if length <= radius and radius > 0.0:
            gain *= length / radius
        gain = 1.0 - (1.0 - gain) ** (dt * KINECT_RATE)
        coasting = dt * (1.0 - blend(half_life, dt))
    corrected = blend(knobs[1], dt)
    for axis in range(3):
        level[axis] = before[axis] + away[axis] * gain + trend[axis] * coasting
        trend[axis] += ((level[axis] - before[axis]) / dt - trend[axis]) * corrected
        predicted[axis] = level[axis] + trend[axis] * knobs[2]
    length = length_of(predicted - raw)
    if length > deviation:
        for axis in range(3):
            predicted[axis] = raw[axis] + (predicted[axis] - raw[axis]) * (deviation / length)


def half_life_of(kept: float) -> float:
    """Seconds after which half is left of what the Kinect keeps so much of in each frame."""
    if kept <= 0.0:
        return 0.0
    return -1.0 / (KINECT_RATE * math.log2(kept)) if kept < 1.0 else math.inf


def holt_knobs(kinect: KinectConfig | None, half_lives: HoltConfig | None) -> Floats:
    """(5,) half-lives of level and trend (s), prediction (s), jitter and deviation radius (m).

    With neither of the two it is what the SDK does if nobody says.
    """
    if half_lives is not None:
        own = half_lives
        return np.array([own.level, own.trend, 0.0, own.jitter_radius, own.max_deviation_radius])
    kinect = kinect or KinectConfig()
    said = (
        kinect.smoothing,
        kinect.correction,
        kinect.prediction,
        kinect.jitter_radius,
        kinect.max_deviation_radius,
    )
    preset = KINECT_PRESETS[kinect.preset]
    smoothing, correction, prediction, jitter, deviation = (
        usual if own is None else own for own, usual in zip(said, preset, strict=True)
    )
    return np.array(
        [
            half_life_of(smoothing),
            half_life_of(1.0 - correction),
            prediction / KINECT_RATE,
            jitter,
            deviation,
        ]
    )
