"""How far bones may turn, as a kernel, and a finisher that keeps any pose within it.

A bone's turn is the rotation vector ``log(rest⁻¹ · local)``, read the short way round, in the
bone's own rest frame. It must lie in a box (lower and upper, for each axis) and in a cone (its
length, whatever the axis). Both are convex, so there is always a nearest way back in, and a turn
that moves on without a jump comes back in without a jump.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from puppet.armature import Armature
from puppet.kernel import Floats, Ints, frozen, kernel
from puppet.pose import Pose
from puppet.rotation import conjugate, exp, log, multiply, shortest

#: What a bone may do: nothing, any turn, or turns within bounds.
HELD, FREE, BOUNDED = 0, 1, 2
#: Radians. A turn this little outside its limits is inside: rounding is not a reason to change it.
_SLACK = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """An armature's limits as kernels take them.

    lower, upper: (B, 3) radians, within half a turn, because a turn is read the short way round;
    an axis without stops keeps its infinities. limits: (B,) radians, inf for none.
    kinds: (B,) of HELD, FREE, BOUNDED.
    """

    lower: Floats
    upper: Floats
    limits: Floats
    kinds: Ints

    @classmethod
    def of(cls, armature: Armature) -> Bounds:
        """Bones that slide or are fixed are held at rest; a limit of half a turn is none."""
        lower = np.where(armature.lower <= -math.pi, -np.inf, armature.lower)
        upper = np.where(armature.upper >= math.pi, np.inf, armature.upper)
        limits = np.where(armature.limits >= math.pi, np.inf, armature.limits)
        turning = np.array([movement == "turn" for movement in armature.movements])
        lower[~turning] = upper[~turning] = 0.0
        free = np.isinf(lower).all(axis=1) & np.isinf(upper).all(axis=1) & np.isinf(limits)
        held = ((lower == 0.0) & (upper == 0.0)).all(axis=1) | (limits == 0.0)
        kinds = np.where(held, HELD, np.where(free, FREE, BOUNDED))
        return cls(frozen(lower), frozen(upper), frozen(limits), frozen(kinds, np.int32))


@kernel
def clamp(turn: Floats, lower: Floats, upper: Floats, limit: float) -> bool:
    """Bring `turn` within its limits, in place; whether that changed it.

    turn, lower, upper: (3,) radians. What is outside the box goes to its nearest face; what is then
    outside the cone goes straight towards the box's point nearest to rest, until it is inside.
    """
    changed = False
    outside, inside, across = 0.0, 0.0, 0.0
    for i in range(3):
        held = min(max(turn[i], lower[i]), upper[i])
        if abs(held - turn[i]) > _SLACK:
            changed = True
            turn[i] = held
        home = min(max(0.0, lower[i]), upper[i])
        outside += turn[i] * turn[i]
        inside += home * home
        across += turn[i] * home
    if outside <= (limit + _SLACK) ** 2:
        return changed
    # |home + share · (turn - home)| = limit, for the share in 0..1.
    a = outside - 2.0 * across + inside
    b = across - inside
    c = inside - limit * limit
    share = 0.0 if c >= 0.0 else (math.sqrt(b * b - a * c) - b) / a
    for i in range(3):
        home = min(max(0.0, lower[i]), upper[i])
        turn[i] = home + share * (turn[i] - home)
    return True


@kernel
def clamp_bones(
    rests: Floats,
    lower: Floats,
    upper: Floats,
    limits: Floats,
    kinds: Ints,
    bones: Floats,
) -> None:
    """Bring each of `bones`, (B, 4) parent_from_bone, within its limits, in place.

    A bone that is within them already is not touched, to the last bit.
    """
    for bone in range(len(bones)):
        if kinds[bone] == FREE:
            continue
        turn = log(shortest(multiply(conjugate(rests[bone]), bones[bone])))
        if clamp(turn, lower[bone], upper[bone], limits[bone]):
            bones[bone] = multiply(rests[bone], exp(turn))


class JointLimits:
    """A finisher: no bone turns further than its armature says, whatever drives it."""

    def __init__(self, armature: Armature) -> None:
        self._rests = armature.rotations
        self._bounds = Bounds.of(armature)

    def __call__(self, pose: Pose) -> Pose:
        """The pose with every bone within its limits; bones within them pass bit for bit."""
        bones = np.array(pose.bones, float, order="C")
        bounds = self._bounds
        clamp_bones(self._rests, bounds.lower, bounds.upper, bounds.limits, bounds.kinds, bones)
        return Pose(pose.translation, pose.rotation, bones)
