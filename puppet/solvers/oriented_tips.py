"""Goals with a rotation: heads that stay level and feet that stay flat, wherever the rest goes.

The last bone of such a chain is not bent to reach; the bone before it is led to where the last one
has to begin, and the last one is then turned as its goal says.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from puppet.armature import Armature
from puppet.kernel import frozen
from puppet.pose import Goal, Intent, Pose, place_bones
from puppet.rotation import IDENTITY, conjugate, multiply, rotate
from puppet.solvers.damped_jacobian import DampedJacobian

_ORIGIN = frozen(np.zeros(3))


class OrientedTips:
    """A solver: `DampedJacobian`, for goals of which some also say how their bone is turned.

    effectors: bones, by index. oriented: those of them whose goals' rotations are heeded; a bone
    whose parent is an end effector too, or carries another such bone, or cannot turn, is led by its
    tip alone.
    """

    def __init__(
        self, armature: Armature, effectors: Sequence[int], oriented: Collection[int] = ()
    ) -> None:
        self.armature = armature
        self.oriented: dict[int, int] = {}
        taken = set(effectors)
        tips = np.array(armature.tips)
        for bone in oriented:
            parent = int(armature.parents[bone])
            if parent < 0 or armature.parents[parent] < 0 or parent in taken:
                continue
            if armature.movements[parent] != "turn":
                continue
            taken.add(parent)
            self.oriented[bone] = parent
            tips[parent] = armature.offsets[bone]
        led = [self.oriented.get(effector, effector) for effector in effectors]
        self._solver = DampedJacobian(replace(armature, tips=frozen(tips)), led)

    def __call__(self, intent: Intent) -> Pose:
        """The pose nearest to the goals; see `DampedJacobian`."""
        pose = self._solver(Intent(intent.base, tuple(map(self._led, intent.goals))))
        if not self.oriented:
            return pose
        armature = self.armature
        origins, frames = np.empty((len(armature), 3)), np.empty((len(armature), 4))
        place_bones(
            armature.parents, armature.offsets, _ORIGIN, IDENTITY, pose.bones, origins, frames
        )
        for goal in intent.goals:
            if goal.bone in self.oriented and goal.rotation is not None:
                above = frames[self.oriented[goal.bone]]
                pose.bones[goal.bone] = multiply(conjugate(above), goal.rotation)
        return pose

    def _led(self, goal: Goal) -> Goal:
        """The goal of the bone that is led in this one's place."""
        if goal.bone not in self.oriented or goal.rotation is None:
            return goal
        start = goal.position - rotate(goal.rotation, self.armature.tips[goal.bone])
        return Goal(self.oriented[goal.bone], start, weight=goal.weight, why=goal.why)
