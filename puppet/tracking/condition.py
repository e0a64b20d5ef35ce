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
from puppet.skeleton import JOINT_COUNT, JOINT_PARENTS, Joint, SkeletonFrame

_PARENTS: Final[Ints] = frozen(JOINT_PARENTS, np.int32)
_OF_TRUNK, _OF_LIMB, _TIP = 0, 1, 2
_TRUNK: Final = [
    Joint.HIP_CENTER,
    Joint.SPINE,
    Joint.SHOULDER_CENTER,
    Joint.SHOULDER_LEFT,
    Joint.SHOULDER_RIGHT,
]


def _kind(joint: Joint) -> int:
    if joint in (Joint.HAND_LEFT, Joint.HAND_RIGHT, Joint.FOOT_LEFT, Joint.FOOT_RIGHT):
        return _TIP
    return _OF_TRUNK if joint in (*_TRUNK, Joint.HIP_LEFT, Joint.HIP_RIGHT) else _OF_LIMB


_KINDS: Final[Ints] = frozen([_kind(joint) for joint in Joint], np.int32)
#: A limb joint of less influence than this may go anywhere at once: nobody would see it.
_UNFELT: Final = 0.03
#: On the body, no joint goes faster than this, metres a second, but for so many metres of noise.
_FASTEST: Final = 5.0
_SLACK: Final = 0.03
#: After longer than this a joint that was not believed counts as found again, seconds.
_LONGEST_GLITCH: Final = 0.1
#: A longer silence counts as this, seconds, so that nothing takes one great step after it.
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
    kinds: Ints,
    knobs: Floats,
    held: Floats,
    seen: Floats,
    velocity: Floats,
    trust: Floats,
    lost: Floats,
    unseen: Floats,
    influence: Floats,
) -> None:
    """Advance all joints by `dt`. What follows the knobs is the memory.

    positions, held, seen: (20, 3), the joints now, as given out, as last believed. velocity:
    (20, 3) m/s on the parent, smoothed. trust: (20,) 0..1, how freely a joint may move now. lost:
    (20,) seconds without the joint. unseen: (20,) seconds since it was last believed. influence:
    (20,) 0..1.
    """
    smoothing, quickness, slower = knobs[0], knobs[1], knobs[2]
    hold, fade, regain, tips = knobs[3], knobs[4], knobs[5], knobs[6]
    before, seen_before, lost_before = held.copy(), seen.copy(), lost.copy()
    nowhere = np.zeros(3)
    for joint in range(len(parents)):
        parent = parents[joint]
        moved = held[parent] - before[parent] if parent >= 0 else nowhere
        step = positions[joint] - seen_before[joint]
        # A joint is followed where it sits on its parent, so that the noise of neither turns the
        # bone between them more than it must, and a body that jumps stays whole; the more so, the
        # more the parent is trusted.
        bond = trust[parent] if parent >= 0 and states[parent] > 0 else 0.0
        target = positions[joint] * 1.0
        if bond > 0.0:
            target += bond * (held[parent] - positions[parent])
        if parent >= 0 and states[parent] > 0 and lost_before[parent] == 0.0:
            step -= positions[parent] - seen_before[parent]
        carried = before[joint] + bond * moved
        unseen[joint] += dt
        length = math.sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2])
        found_again = lost[joint] > 0.0
        if states[joint] == 0:
            lost[joint] += dt
            trust[joint] = 0.0
            velocity[joint] = 0.0
            if lost[joint] > hold:
                influence[joint] -= influence[joint] * _blend(fade, dt)
            held[joint] = before[joint] + moved
            continue
        if not found_again and length > _SLACK + _FASTEST * unseen[joint]:
            # Further than a body can move: not believed until time has made it possible.
            held[joint] = carried
            continue
        if found_again or unseen[joint] > _LONGEST_GLITCH:
            trust[joint] = 0.0  # it was somewhere else meanwhile, which is no speed
            velocity[joint] = 0.0
        else:
            share = _blend(_VELOCITY_HALF_LIFE, unseen[joint])
            velocity[joint] += (step / unseen[joint] - velocity[joint]) * share
        lost[joint] = 0.0
        unseen[joint] = 0.0
        seen[joint] = positions[joint]
        freedom = 1.0 if states[joint] == 2 else 1.0 / slower
        trust[joint] += (freedom - trust[joint]) * _blend(regain, dt)
        v = velocity[joint]
        speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        # Little trust makes a joint slow, and deaf to its own speed: what was just found again, or
        # is only inferred, closes in and does not jump.
        free = max(trust[joint], 0.1)
        half_life = smoothing / (free * free * (1.0 + quickness * speed * free))
        if kinds[joint] == _TIP:
            half_life *= tips
        # A trunk joint is felt in all that hangs on it, so it may not go anywhere at once.
        unfelt = kinds[joint] != _OF_TRUNK and influence[joint] < _UNFELT
        share = 1.0 if unfelt else _blend(half_life, dt)
        held[joint] = carried + (target - carried) * share
        influence[joint] += (1.0 - influence[joint]) * _blend(regain, dt)


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
                max(config.tips, 1.0),
            ]
        )
        self.reset()

    def reset(self) -> None:
        """Forget the performer."""
        self._time: float | None = None
        self._asleep = True
        self._held = np.zeros((JOINT_COUNT, 3))
        self._seen = np.zeros((JOINT_COUNT, 3))
        self._velocity = np.zeros((JOINT_COUNT, 3))
        self._trust = np.zeros(JOINT_COUNT)
        self._lost = np.zeros(JOINT_COUNT)
        self._unseen = np.zeros(JOINT_COUNT)
        self._influence = np.zeros(JOINT_COUNT)

    def __call__(self, frame: SkeletonFrame) -> SkeletonFrame:
        """The frame with smoothed positions and the influence of each joint.

        Until a trunk is seen nothing has influence, and again when all of it has faded. A frame
        that is not later than the one before it changes nothing.
        """
        dt = 0.0 if self._time is None else frame.time - self._time
        if self._asleep:
            self._time = frame.time
            if (frame.states[_TRUNK] > 0).all():
                self._wake(frame)
        elif dt > 1e-6:
            self._time = frame.time
            _step(
                np.ascontiguousarray(frame.positions),
                frame.states,
                min(dt, _LONGEST_STEP),
                _PARENTS,
                _KINDS,
                self._knobs,
                self._held,
                self._seen,
                self._velocity,
                self._trust,
                self._lost,
                self._unseen,
                self._influence,
            )
            self._asleep = bool((self._influence < _UNFELT).all())
        return self._result(frame, self._held)

    def _wake(self, frame: SkeletonFrame) -> None:
        """Somebody is there. The puppet rests until now: they take over from there gradually."""
        self._asleep = False
        seen = frame.states > 0
        self._held[:] = frame.positions
        for joint, parent in enumerate(JOINT_PARENTS):
            if not seen[joint] and parent >= 0:
                self._held[joint] = self._held[parent]
        self._seen[:] = self._held
        self._velocity[:] = 0.0
        self._trust[:] = np.where(seen, 1.0, 0.0)
        self._lost[:] = 0.0
        self._unseen[:] = 0.0
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
