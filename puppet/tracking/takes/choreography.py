"""What the rehearsal's performer does, and when: key poses, the root's path and the steps.

Angles are degrees, lengths metres, times seconds. Between keys a channel goes with least jerk, so
that it starts and ends each movement at rest; a key that repeats is a pause.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from puppet.kernel import Floats
from puppet.skeleton import Joint


class Section(NamedTuple):
    """A named part of the choreography, in seconds."""

    name: str
    start: float
    end: float


SECTIONS: Final = (
    Section("stand", 0.0, 3.0),
    Section("wave", 3.0, 7.0),
    Section("bow", 7.0, 11.0),
    Section("walk on the spot", 11.0, 15.0),
    Section("squat", 15.0, 18.5),
    Section("jump", 18.5, 21.5),
    Section("turn", 21.5, 26.5),
    Section("arms out and up", 26.5, 32.0),
    Section("lean and twist", 32.0, 38.0),
    Section("hide a hand", 38.0, 42.0),
    Section("leave", 42.0, 47.0),
    Section("away", 47.0, 49.5),
    Section("return", 49.5, 55.8),
    Section("stand again", 55.8, 58.5),
)
DURATION: Final = SECTIONS[-1].end

#: The right edge of the picture, m from the middle, and how wide the doubtful part before it is.
EDGE: Final = (1.75, 0.2)
#: Joints that are hidden, and when they become inferred, lost, inferred again and seen again.
HIDDEN: Final = (
    ((Joint.WRIST_LEFT, Joint.HAND_LEFT), (38.9, 39.5, 40.6, 41.1)),
    ((Joint.ELBOW_LEFT,), (39.2, 40.9, 40.9, 40.9)),
)

Pose = dict[str, float]


def _both(**angles: float) -> Pose:
    """Angles of both arms."""
    return {f"{name}_{side}": value for name, value in angles.items() for side in ("left", "right")}


#: Arms hang a little off the body, elbows a little bent: the stance for calibration.
STAND: Final[Pose] = _both(lift=6.0, swing=2.0, elbow=9.0, twist=0.0)
_HAND_UP: Final[Pose] = {"lift_right": 82.0, "twist_right": 95.0, "tilt": -5.0, "lean": 3.0}
_WAVE_IN: Final[Pose] = {**_HAND_UP, "elbow_right": 112.0}
_WAVE_OUT: Final[Pose] = {**_HAND_UP, "elbow_right": 62.0, "tilt": -2.0}
_BOW: Final[Pose] = {
    "pelvis_bend": 42.0,
    "bend": 28.0,
    "nod": 18.0,
    "back": 0.10,
    "drop": 0.012,
    **_both(swing=30.0),
}
_MARCH: Final[Pose] = {"drop": 0.012, **_both(elbow=35.0)}
_SQUAT: Final[Pose] = {
    "drop": 0.36,
    "back": 0.14,
    "pelvis_bend": 28.0,
    "bend": 12.0,
    "nod": -20.0,
    **_both(swing=88.0),
}
_CROUCH: Final[Pose] = {
    "drop": 0.20,
    "back": 0.08,
    "pelvis_bend": 24.0,
    "bend": 10.0,
    "nod": -14.0,
    **_both(swing=-24.0),
}
_FLIGHT: Final[Pose] = {"drop": -0.22, "nod": -6.0, **_both(swing=62.0, lift=28.0)}
_LAND: Final[Pose] = {
    "drop": 0.16,
    "back": 0.06,
    "pelvis_bend": 18.0,
    "bend": 10.0,
    **_both(swing=30.0, lift=22.0),
}
_T_POSE: Final[Pose] = _both(lift=90.0, elbow=3.0)
_ARMS_UP: Final[Pose] = {"nod": -10.0, **_both(lift=170.0, elbow=6.0)}
_LEAN: Final[Pose] = {
    "lean": 22.0,
    "pelvis_lean": 5.0,
    "tilt": 10.0,
    "shift": -0.03,
    "drop": 0.02,
    "lift_left": 27.0,
    "lift_right": -6.0,
}
_TWIST: Final[Pose] = {
    "turn": 38.0,
    "pelvis_turn": 14.0,
    "look": 18.0,
    "drop": 0.012,
    **_both(lift=45.0, elbow=40.0),
}
_BEHIND: Final[Pose] = {
    "swing_left": -32.0,
    "twist_left": -75.0,
    "elbow_left": 88.0,
    "lift_left": 16.0,
    "look": -12.0,
}
_WALK: Final[Pose] = {"drop": 0.035, "bend": 3.0, **_both(elbow=22.0)}


def _other_way(pose: Pose) -> Pose:
    """The pose in the mirror."""
    swap = {"left": "right", "right": "left"}
    sideways = ("lean", "pelvis_lean", "tilt", "shift", "turn", "pelvis_turn", "look")
    mirrored: Pose = {}
    for name, value in pose.items():
        stem, _, side = name.rpartition("_")
        key = f"{stem}_{swap[side]}" if side in swap else name
        mirrored[key] = -value if name in sideways else value
    return mirrored


#: Key poses; what a pose does not name is as in `STAND`.
KEYS: Final[tuple[tuple[float, Pose], ...]] = (
    (0.0, STAND),
    (3.0, STAND),
    (3.8, _WAVE_IN),
    *((4.15 + 0.35 * i, _WAVE_IN if i % 2 else _WAVE_OUT) for i in range(6)),
    (6.8, STAND),
    (7.3, STAND),
    (8.6, _BOW),
    (9.3, _BOW),
    (10.6, STAND),
    (11.0, STAND),
    (11.5, _MARCH),
    (14.5, _MARCH),
    (15.0, STAND),
    (15.2, STAND),
    (16.5, _SQUAT),
    (17.0, _SQUAT),
    (18.2, STAND),
    (18.7, STAND),
    (19.35, _CROUCH),
    (19.78, _FLIGHT),
    (20.19, _LAND),
    (21.0, STAND),
    (21.6, STAND),
    (22.0, _MARCH),
    (26.0, _MARCH),
    (26.5, STAND),
    (26.9, STAND),
    (28.0, _T_POSE),
    (28.6, _T_POSE),
    (29.7, _ARMS_UP),
    (30.2, _ARMS_UP),
    (31.7, STAND),
    (32.2, STAND),
    (33.2, _LEAN),
    (33.5, _LEAN),
    (34.7, _other_way(_LEAN)),
    (35.0, _other_way(_LEAN)),
    (35.7, STAND),
    (36.5, _TWIST),
    (37.4, _other_way(_TWIST)),
    (38.2, STAND),
    (39.3, _BEHIND),
    (40.7, _BEHIND),
    (41.8, STAND),
    (42.2, STAND),
    (42.8, _WALK),
    (54.9, _WALK),
    (55.6, STAND),
    (DURATION, STAND),
)

#: Where the root goes: time, x, z, yaw. It turns on the spot, and walks out to its left and back.
PATH: Final = (
    (0.0, 0.0, 0.0, 0.0),
    (21.9, 0.0, 0.0, 0.0),
    (26.1, 0.0, 0.0, 360.0),
    (42.6, 0.0, 0.0, 360.0),
    (43.9, 0.0, 0.0, 450.0),
    (48.4, 2.4, 0.0, 450.0),
    (49.5, 2.4, 0.0, 270.0),
    (54.0, 0.0, 0.0, 270.0),
    (55.2, 0.0, 0.0, 360.0),
    (DURATION, 0.0, 0.0, 360.0),
)

#: When the feet step: start, end, seconds a step, how high (m).
STEPPING: Final = (
    (11.3, 14.7, 0.425, 0.22),
    (21.8, 26.2, 0.40, 0.07),
    (42.6, 55.4, 0.40, 0.06),
)
#: Half the distance between the feet when standing.
_STANCE: Final = 0.095


def _ease(u: float) -> float:
    """From 0 to 1 with least jerk."""
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)


class _Track:
    """One channel: values at times, eased in between."""

    def __init__(self, times: Floats, values: Floats) -> None:
        self.times: list[float] = times.tolist()
        self.values: list[float] = values.tolist()

    def __call__(self, time: float) -> float:
        at = bisect_right(self.times, time)
        if at == 0 or at == len(self.times):
            return self.values[min(at, len(self.times) - 1)]
        start, end = self.times[at - 1], self.times[at]
        before, after = self.values[at - 1], self.values[at]
        return before + (after - before) * _ease((time - start) / (end - start))


def _tracks() -> dict[str, _Track]:
    times = np.array([time for time, _ in KEYS])
    names = {name for _, pose in KEYS for name in pose}
    tracks = {
        name: _Track(times, np.array([pose.get(name, STAND.get(name, 0.0)) for _, pose in KEYS]))
        for name in names
    }
    path = np.array(PATH)
    for column, name in enumerate(("x", "z", "yaw"), start=1):
        tracks[name] = _Track(path[:, 0], path[:, column])
    return tracks


_TRACKS: Final = _tracks()


def channel(name: str, time: float) -> float:
    """The value of a channel at `time`, in degrees or metres."""
    return _TRACKS[name](time)


@dataclass(frozen=True, slots=True, eq=False)
class Footing:
    """A foot at one instant: where under it the ground is (3,), yaw (rad), height (m)."""

    ground: Floats
    yaw: float
    lift: float


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    start: float
    end: float
    lift: float
    origin: tuple[float, float, float]
    landing: tuple[float, float, float]


def _under_root(time: float, side: float) -> tuple[float, float, float]:
    """x, z and yaw (rad) of a foot that stands square under the root at `time`."""
    yaw = float(np.radians(channel("yaw", time)))
    x = channel("x", time) + side * _STANCE * np.cos(yaw)
    z = channel("z", time) - side * _STANCE * np.sin(yaw)
    return float(x), float(z), yaw


def _steps() -> tuple[list[_Step], list[_Step]]:
    """The steps of the left and of the right foot. Each lands where the root will be over it."""
    lists: tuple[list[_Step], list[_Step]] = ([], [])
    for start, end, period, lift in STEPPING:
        count = round((end - start) / period)
        period = (end - start) / count  # noqa: PLW2901
        for number in range(count):
            foot = number % 2
            side = 1.0 if foot == 0 else -1.0
            steps = lists[foot]
            begin = start + number * period
            # It stands while the other foot steps; the last steps close the stance.
            over = begin + 1.5 * period if number < count - 2 else end + period
            origin = steps[-1].landing if steps else _under_root(0.0, side)
            landing = _under_root(over, side)
            steps.append(_Step(begin, begin + period, lift, origin, landing))
    return lists


_STEPS: Final = _steps()


def feet(time: float) -> tuple[Footing, Footing]:
    """The left and the right foot at `time`."""
    left, right = (_footing(steps, time) for steps in _STEPS)
    return left, right


def _footing(steps: list[_Step], time: float) -> Footing:
    at = bisect_right([step.start for step in steps], time) - 1
    step = steps[max(at, 0)]
    u = min(max((time - step.start) / (step.end - step.start), 0.0), 1.0)
    x, z, yaw = (a + (b - a) * _ease(u) for a, b in zip(step.origin, step.landing, strict=True))
    return Footing(np.array([x, 0.0, z]), yaw, step.lift * float(np.sin(np.pi * u) ** 2))
