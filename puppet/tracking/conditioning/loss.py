"""What becomes of a joint's influence: hold, ease to rest, come back, without a jolt.

Influence is continuous in value and slope. The hip's comes and goes more slowly the further it is
from where puppets count from, for it moves a whole puppet across the stage and turns it round; and
that of the legs with it, for they stand under it.
"""

from __future__ import annotations

from typing import Final

from puppet.kernel import kernel
from puppet.skeleton import Joint
from puppet.tracking.conditioning.closing_in import CLOSING_SPEED, CLOSING_TURN
from puppet.tracking.conditioning.heading import between, heading_by
from puppet.tracking.conditioning.memory import DOUBTED, LOST, Memory
from puppet.tracking.conditioning.rows import length_of
from puppet.tracking.conditioning.spring import damped, gentle

_HIP: Final = int(Joint.HIP_CENTER)
_FIRST_OF_LEGS: Final = int(Joint.HIP_LEFT)


@kernel
def weigh(dt: float, hold: float, fade: float, regain: float, m: Memory) -> None:
    """Bring influence up to date. hold: seconds. fade, regain: rates, 1/s."""
    away = m.shown[_HIP] - m.home[:3]
    turned = between(m.home[3], heading_by(m.shown, True, True))
    for joint in range(len(m.status)):
        falls = m.status[joint] == LOST and m.lost[joint] > hold
        rate = fade if falls else regain
        if joint == _HIP or joint >= _FIRST_OF_LEGS:
            rate = gentle(rate, length_of(away), CLOSING_SPEED)
            rate = gentle(rate, abs(turned), CLOSING_TURN)
        value, velocity = m.influence[joint, 0], m.influence[joint, 1]
        # Fast enough to stop before the end, if it was on its way there.
        room = 1.0 - value if velocity > 0.0 else value
        rate = max(rate, abs(velocity) / max(room, 1e-9))
        goal = 0.0 if falls else 1.0
        if not falls and m.status[joint] <= DOUBTED:
            goal = value + velocity / rate  # it coasts to a stop
        value, velocity = damped(value, velocity, goal, rate, dt)
        m.influence[joint, 0] = min(max(value, 0.0), 1.0)
        m.influence[joint, 1] = velocity
