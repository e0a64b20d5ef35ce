"""Conditioning: raw joints to joints that may drive a puppet.

* One Euro (Casiez 2012) on every joint: still joints are smoothed, quick ones are let through.
* A joint's state is respected. An inferred joint moves less freely. A lost joint holds its place on
  the body, and after a while its influence fades, so that what it drives eases to rest; when it
  comes back it takes over gradually.

All of it runs on capture time, so a take gives the same frames however fast it is replayed.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from puppet.kernel import Bytes, Floats, Ints, frozen, kernel
from puppet.show import ConditioningConfig
from puppet.skeleton import JOINT_COUNT, JOINT_PARENTS, SkeletonFrame

_PARENTS: Final[Ints] = frozen(JOINT_PARENTS, np.int32)
#: Longer silences than this are not filtered across: the joints start anew where they are seen.
_LONGEST_STEP: Final = 0.25
#: Half-life of the velocities that tell quick joints from shaking ones, seconds.
_VELOCITY_HALF_LIFE: Final = 0.1


@kernel
def _blend(half_life: float, dt: float) -> float:
    """The share of the way that is gone in `dt`."""
    return 1.0 - 2.0 ** (-dt / half_life) if half_life > 1e-6 else 1.0


@kernel
def _step(
    positions: Floats,
    states: Bytes,
    dt: float,
    parents: Ints,
    knobs: Floats,
    held: Floats,
    seen: Floats,
    velocity: Floats,
    trust: Floats,
    lost: Floats,
    influence: Floats,
) -> None:
    """Advance all joints by `dt`. What follows the knobs is the memory.

    positions, held, seen: (20, 3), the joints now, as given out, as last seen. velocity: (20, 3)
    m/s, smoothed. trust: (20,) 0..1, how freely a joint may move now. lost: (20,) seconds without
    the joint. influence: (20,) 0..1.
    """
    smoothing, quickness, slower = knobs[0], knobs[1], knobs[2]
    hold, fade, regain = knobs[3], knobs[4], knobs[5]
    before = held.copy()
    for joint in range(len(parents)):
        if states[joint] == 0:
            lost[joint] += dt
            trust[joint] = 0.0
            velocity[joint] = 0.0
            if lost[joint] > hold:
                influence[joint] -= influence[joint] * _blend(fade, dt)
            parent = parents[joint]
            if parent >= 0:  # parents come first: they are already where they are now
                held[joint] = before[joint] + held[parent] - before[parent]
            continue
        if lost[joint] == 0.0:  # else it was somewhere else, which is no speed
            velocity[joint] += ((positions[joint] - seen[joint]) / dt - velocity[joint]) * _blend(
                _VELOCITY_HALF_LIFE, dt
            )
        lost[joint] = 0.0
        seen[joint] = positions[joint]
        freedom = 1.0 if states[joint] == 2 else 1.0 / slower
        trust[joint] += (freedom - trust[joint]) * _blend(regain, dt)
        influence[joint] += (1.0 - influence[joint]) * _blend(regain, dt)
        v = velocity[joint]
        speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        # Little trust makes a joint slow, and deaf to its own speed: what was just found again, or
        # is only inferred, closes in and does not jump.
        free = max(trust[joint], 0.1)
        half_life = smoothing / (free * free * (1.0 + quickness * speed * free))
        held[joint] = before[joint] + (positions[joint] - before[joint]) * _blend(half_life, dt)


class Conditioner:
    """The memory of one performer's joints."""

    def __init__(self, config: ConditioningConfig | None = None) -> None:
        config = config or ConditioningConfig()
        self._knobs = np.array(
            [
                config.smoothing,
                config.quickness,
                max(config.inferred, 1.0),
                config.hold,
                config.fade,
                config.regain,
            ]
        )
        self.reset()

    def reset(self) -> None:
        """Forget the performer."""
        self._time: float | None = None
        self._held = np.zeros((JOINT_COUNT, 3))
        self._seen = np.zeros((JOINT_COUNT, 3))
        self._velocity = np.zeros((JOINT_COUNT, 3))
        self._trust = np.zeros(JOINT_COUNT)
        self._lost = np.zeros(JOINT_COUNT)
        self._influence = np.zeros(JOINT_COUNT)

    def __call__(self, frame: SkeletonFrame) -> SkeletonFrame:
        """The frame with smoothed positions and the influence of each joint.

        Before anybody was seen the frame goes through with an influence of 0. A frame that is not
        later than the one before it changes nothing.
        """
        if self._time is None:
            if not frame.present:
                return self._result(frame, frame.positions)
            self._begin(frame)
            return self._result(frame, self._held)
        dt = frame.time - self._time
        if dt > 1e-6:
            self._time = frame.time
            if dt > _LONGEST_STEP and frame.present and bool((self._influence < 0.05).all()):
                self._begin(frame)  # nothing is driven by the old place any more
            else:
                _step(
                    np.ascontiguousarray(frame.positions),
                    frame.states,
                    dt,
                    _PARENTS,
                    self._knobs,
                    self._held,
                    self._seen,
                    self._velocity,
                    self._trust,
                    self._lost,
                    self._influence,
                )
        return self._result(frame, self._held)

    def _begin(self, frame: SkeletonFrame) -> None:
        seen = frame.states > 0
        self._time = frame.time
        self._held[:] = frame.positions
        for joint, parent in enumerate(JOINT_PARENTS):
            if not seen[joint] and parent >= 0:
                self._held[joint] = self._held[parent]
        self._trust[:] = np.where(seen, 1.0, 0.0)
        self._lost[:] = 0.0
        self._seen[:] = frame.positions
        self._velocity[:] = 0.0
        # The puppet stands at rest until now: whoever appears takes over from there gradually.
        self._influence[:] = 0.0

    def _result(self, frame: SkeletonFrame, positions: Floats) -> SkeletonFrame:
        return SkeletonFrame(
            frame.time,
            frame.sequence,
            frame.performer,
            positions.copy(),
            frame.states,
            self._influence.copy(),
        )
