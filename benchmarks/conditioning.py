"""Conditioning: what it does to noise, how late it is, how far it overshoots, and what it costs.

    python -m benchmarks.conditioning

The reference is One Euro as Casiez (2012) prints it, on all joints at once in NumPy, with the same
half-lives; it knows nothing of parents, glitches, losses and returns. Rounds alternate and the
median counts.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Final

import numpy as np

from puppet.kernel import Floats
from puppet.show import ConditioningConfig, HoltConfig, KinectConfig
from puppet.skeleton import Joint, SkeletonFrame
from puppet.tracking.conditioning.condition import Conditioner
from puppet.tracking.takes.rehearsal import DURATION, Rehearsal, body

RATE: Final = 30
ARM: Final = [Joint.ELBOW_RIGHT, Joint.WRIST_RIGHT, Joint.HAND_RIGHT]
NOISE: Final = 0.008
ROUNDS: Final = 7
STATES: Final = np.full(len(Joint), 2, np.uint8)

CONFIGS: Final = {
    "One Euro": ConditioningConfig(),
    "One Euro, 50 ms ahead": ConditioningConfig(prediction=0.05),
    "Holt, half-lives": ConditioningConfig(filter="holt", holt=HoltConfig()),
    "Holt, 50 ms ahead": ConditioningConfig(filter="holt", holt=HoltConfig(), prediction=0.05),
    "Kinect, gestures": ConditioningConfig(filter="holt"),
    "Kinect, menus": ConditioningConfig(filter="holt", kinect=KinectConfig(preset="menus")),
}
#: (frames, 20, 3) -> (frames, 20, 3)
Filter = Callable[[Floats], Floats]


class PlainOneEuro:
    """One Euro in NumPy: cut-offs (Hz) that give the half-lives of the defaults."""

    def __init__(self, half_life: float = 0.08, quickness: float = 6.0) -> None:
        self.lowest = np.log(2.0) / (2.0 * np.pi * half_life)
        self.beta = self.lowest * quickness
        self.last: Floats | None = None

    def __call__(self, places: Floats) -> Floats:
        if self.last is None:
            self.last, self.velocity = places, np.zeros_like(places)
            return places
        speed = (places - self.last) * RATE
        self.velocity = self.velocity + _share(1.1) * (speed - self.velocity)
        cutoff = self.lowest + self.beta * np.linalg.norm(self.velocity, axis=1, keepdims=True)
        self.last = self.last + _share(cutoff) * (places - self.last)
        return self.last


def _share(cutoff: Floats | float) -> Floats:
    return np.asarray(1.0 / (1.0 + RATE / (2.0 * np.pi * np.asarray(cutoff))))


def by(config: ConditioningConfig) -> Filter:
    def run(path: Floats) -> Floats:
        condition = Conditioner(config)
        frames = (SkeletonFrame(i / RATE, i, 0, places, STATES) for i, places in enumerate(path))
        return np.array([condition(frame).positions for frame in frames])

    return run


def plainly(path: Floats) -> Floats:
    plain = PlainOneEuro()
    return np.array([plain(places) for places in path])


def moved(way: Floats) -> Floats:
    """(frames, 20, 3) somebody whose arm goes forward."""
    path = np.repeat(Rehearsal().frame(0.0).positions[None], len(way), axis=0)
    path[:, ARM, 2] += way[:, None]
    return path


def hand(run: Filter, way: Floats) -> Floats:
    path = moved(way)
    return np.asarray(run(path)[:, Joint.HAND_RIGHT, 2] - path[0, Joint.HAND_RIGHT, 2])


def kept_noise(run: Filter) -> float:
    """What is left of noise on somebody who stands still."""
    noise = np.random.default_rng(1).normal(scale=NOISE, size=(300, len(Joint), 3))
    return float(run(moved(np.zeros(300)) + noise)[60:].std(axis=0).mean() / NOISE)


def lag(run: Filter, speed: float) -> float:
    """Milliseconds behind a hand that goes on evenly; below zero it is ahead."""
    way = speed * np.arange(round(0.8 / speed * RATE)) / RATE
    return float(1000.0 * (way - hand(run, way))[-1] / speed)


def overshoot(run: Filter) -> float:
    """Millimetres beyond the end of a reach of 0.6 m in 0.4 s (minimum jerk)."""
    t = np.clip(np.arange(60) / RATE / 0.4, 0.0, 1.0)
    return float(1000.0 * (hand(run, 0.6 * (10 * t**3 - 15 * t**4 + 6 * t**5)).max() - 0.6))


def seconds(run: Filter, path: Floats) -> float:
    started = time.perf_counter()
    run(path)
    return (time.perf_counter() - started) / len(path)


def main() -> None:
    runs: dict[str, Filter] = {"plain One Euro, NumPy": plainly}
    runs |= {name: by(config) for name, config in CONFIGS.items()}
    path = np.array([body(i / RATE % DURATION) for i in range(40 * RATE)])
    for run in runs.values():
        run(path[:3])  # compile
    rounds = [{name: seconds(run, path) for name, run in runs.items()} for _ in range(ROUNDS)]
    cost = {name: statistics.median(one[name] for one in rounds) for name in runs}
    print(f"{'':24s}{'noise':>7s}{'lag at 0.4':>12s}{'2 m/s':>7s}{'overshoot':>11s}{'cost':>9s}")
    for name, run in runs.items():
        figures = f"{kept_noise(run):6.2f} {lag(run, 0.4):8.0f} ms {lag(run, 2.0):4.0f} ms"
        ratio = cost["plain One Euro, NumPy"] / cost[name]
        price = f"{overshoot(run):7.0f} mm {1e6 * cost[name]:6.0f} µs  {ratio:4.1f} ×"
        print(f"{name:24s} {figures} {price}")


if __name__ == "__main__":
    main()
