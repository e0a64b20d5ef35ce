"""Conditioning: raw joints to joints that may drive a puppet.

* `follow`: what no body can do is not believed; the rest is filtered by One Euro or Holt, on the
  joint that carries it, and predicted if that is asked for.
* `closing_in`: a lost joint holds its place on the body; what is found again closes in, and what is
  shown is never faster than a body.
* `loss`: the influence of what is lost fades after a while, so that what it drives eases to rest;
  when it comes back it takes over gradually.

All of it runs on capture time, so a take gives the same frames however fast it is replayed.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Bytes, Floats, Ints, frozen, kernel
from puppet.mapping.stance import UPRIGHT, Stance
from puppet.show import ConditioningConfig
from puppet.skeleton import JOINT_COUNT, JOINT_PARENTS, Joint, SkeletonFrame
from puppet.tracking.conditioning.closing_in import UNFELT, close_in
from puppet.tracking.conditioning.follow import follow
from puppet.tracking.conditioning.heading import between, heading_by, yawed
from puppet.tracking.conditioning.holt import holt_knobs
from puppet.tracking.conditioning.loss import weigh
from puppet.tracking.conditioning.memory import BELIEVED, LOST, Memory, empty
from puppet.tracking.conditioning.spring import rate_of
from puppet.tracking.conditioning.steps import ConditioningSteps

_PARENTS: Final[Ints] = frozen(JOINT_PARENTS, np.int32)
#: Who shows these is there; hips may be behind a table.
_NEEDED: Final = [Joint.SHOULDER_CENTER, Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT]
_TIPS: Final = [Joint.HAND_LEFT, Joint.HAND_RIGHT, Joint.FOOT_LEFT, Joint.FOOT_RIGHT]
_UPRIGHT: Final = frozen([UPRIGHT[joint] for joint in Joint])
#: A longer silence counts as this, seconds, so that nothing takes one great step after it.
_LONGEST_STEP: Final = 0.25


@kernel
def _step(
    positions: Floats,
    states: Bytes,
    dt: float,
    parents: Ints,
    slower: Floats,
    knobs: Floats,
    by_holt: bool,
    holt: Floats,
    m: Memory,
) -> None:
    """Advance all joints by `dt`. knobs: those of `follow`, then hold, fade, regain (rates)."""
    predicted_before = m.predicted.copy()
    follow(positions, states, dt, parents, slower, knobs, by_holt, holt, m)
    close_in(predicted_before, dt, parents, knobs[8], m)
    weigh(dt, knobs[6], knobs[7], knobs[8], m)


class Conditioner:
    """The memory of one performer's joints."""

    def __init__(self, config: ConditioningConfig | None = None) -> None:
        config = config or ConditioningConfig()
        self._knobs = np.array(
            [
                config.smoothing,
                config.quickness,
                max(config.inferred, 1.0),
                config.regain,
                config.prediction,
                config.prediction_limit,
                config.hold,
                rate_of(config.fade),
                rate_of(config.regain),
            ]
        )
        self._slower = np.ones(JOINT_COUNT)
        self._slower[_TIPS] = max(config.tips, 1.0)
        self._by_holt = config.filter == "holt"
        self._holt = holt_knobs(config.kinect, config.holt)
        self.reset()

    def reset(self) -> None:
        """Forget the performer."""
        self._time: float | None = None
        self._asleep = True
        self._met = False
        self._memory = empty()
        self._last: SkeletonFrame | None = None

    def count_from(self, neutral: Stance) -> None:
        """Say from where puppets count, which is where the performer was first seen otherwise."""
        self._memory.home[:3] = neutral.hip
        self._memory.home[3] = neutral.heading
        self._met = True

    def __call__(self, frame: SkeletonFrame) -> SkeletonFrame:
        """The frame with smoothed positions and the influence of each joint.

        Until shoulders are seen nobody is there and nothing has influence, and again when all of it
        has faded. A frame that is not later than the one before it changes nothing.
        """
        dt = 0.0 if self._time is None else frame.time - self._time
        self._last = frame
        states = frame.states
        if self._time is None or dt > 1e-6:
            self._time = frame.time
            if self._asleep and (states[_NEEDED] > 0).all():
                self._wake(frame)
            else:
                if self._asleep:
                    states = np.zeros_like(states)  # what else comes in first is nobody
                self._advance(frame.positions, states, dt)
        return SkeletonFrame(
            frame.time,
            frame.sequence,
            frame.performer,
            self._memory.shown.copy(),
            np.zeros_like(frame.states) if self._asleep else frame.states,
            self._memory.influence[:, 0].copy(),
        )

    def _advance(self, positions: Floats, states: Bytes, dt: float) -> None:
        m = self._memory
        m.gap[0] = dt > _LONGEST_STEP
        _step(
            np.array(positions),  # a copy may be written to, so that there is one signature
            np.array(states),
            min(dt, _LONGEST_STEP),
            _PARENTS,
            self._slower,
            self._knobs,
            self._by_holt,
            self._holt,
            m,
        )
        self._asleep = bool((m.status == LOST).all() and (m.influence[:, 0] < UNFELT).all())

    @property
    def steps(self) -> ConditioningSteps | None:
        """What became of the last frame, step by step; None before the first."""
        if self._last is None:
            return None
        m = self._memory
        there = (m.status != LOST)[:, None]
        return ConditioningSteps(
            raw=self._last.positions,
            believed=m.believed.copy(),
            filtered=np.where(there, m.filtered, m.shown),
            predicted=np.where(there, m.predicted, m.shown),
            shown=m.shown.copy(),
            states=self._last.states,
            influence=m.influence[:, 0].copy(),
            trust=m.trust.copy(),
        )

    def _wake(self, frame: SkeletonFrame) -> None:
        """Somebody is there. The puppet rests until now: they take over from there gradually."""
        self._asleep = False
        m = self._memory
        for array in m:
            if array is not m.influence and array is not m.home:
                array[...] = 0
        seen = frame.states > 0
        m.shown[:] = _completed(frame.positions, seen)
        for array in (m.believed, m.filtered, m.ahead, m.predicted):
            array[:] = m.shown
        m.status[:] = np.where(seen, BELIEVED, LOST)
        m.trust[:] = seen
        m.lost[:] = ~seen
        m.times[:] = 1
        m.hung[:] = -2  # all of it anew, and nothing of it felt
        m.framed[0] = 1
        if not self._met:
            m.home[:3] = m.shown[Joint.HIP_CENTER]
            m.home[3] = heading_by(m.shown, True, True)
            self._met = True


def _completed(positions: Floats, seen: NDArray[np.bool_]) -> Floats:
    """(20, 3) the joints, and those that are not seen where they would be on somebody upright.

    With the shoulders seen; so who sits behind a table has hips below them.
    """
    places = np.array(positions)
    heading = between(0.0, heading_by(places, False, True))
    centre = Joint.SHOULDER_CENTER
    for joint, parent in enumerate(JOINT_PARENTS):
        if seen[joint]:
            continue
        carrier = parent if parent >= 0 else centre
        offset = _UPRIGHT[joint] - _UPRIGHT[carrier]
        places[joint] = places[carrier] + yawed(offset, heading)
    return places
