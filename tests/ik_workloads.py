"""The three puppets that inverse kinematics is measured on, and goals that they can reach.

A creature of 25 bones with head, hands and feet to lead; a snake of 60 whose middle and head are
led; an ostrich of 23 with a long neck and legs that bend both ways. Their goals are the tips of a
motion made up of slow waves, a different one for each bone, that begins at rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.pose import Goal, Intent, Pose, forward_kinematics, rest_pose
from puppet.rotation import IDENTITY, conjugate, exp, multiply, rotate

#: Frames a second of every motion here.
RATE = 60.0


@dataclass(frozen=True, eq=False)
class Workload:
    """A puppet, the bones to lead, and its motion.

    middles, swings: (B, 3) rad, about what turn from rest each bone swings, and how far; about the
    armature's axes.
    """

    armature: Armature
    effectors: tuple[int, ...]
    middles: Floats
    swings: Floats

    def truth(self, frame: int) -> Pose:
        """The motion's pose: rest at frame 0, all of the motion from half a second on."""
        seconds = frame / RATE
        ease = min(seconds / 0.5, 1.0)
        ease *= ease * (3.0 - 2.0 * ease)
        number, axis = np.indices(self.swings.shape)
        rates = 0.2 + 0.05 * ((3 * number + axis) % 5)
        waves = np.sin(2.0 * math.pi * rates * seconds - 0.35 * number + 2.0 * axis)
        turns = ease * (self.middles + self.swings * waves)
        local = self.armature.rotations
        frames = self.armature.rest[1]
        bones = [
            multiply(rest, exp(rotate(conjugate(frame), turn)))
            for rest, frame, turn in zip(local, frames, turns, strict=True)
        ]
        return Pose(np.zeros(3), IDENTITY.copy(), np.array(bones))

    def goals(self, frames: int, step: int = 1) -> Floats:
        """(frames, E, 3) metres, in the armature's frame."""
        poses = [self.truth(step * frame) for frame in range(frames)]
        return np.array([tips_of(self.armature, pose, self.effectors) for pose in poses])

    def intent(self, goals: Floats) -> Intent:
        """From rest to (E, 3) goals, all alike in weight."""
        wishes = tuple(Goal(bone, goal) for bone, goal in zip(self.effectors, goals, strict=True))
        return Intent(rest_pose(self.armature), wishes)


def tips_of(armature: Armature, pose: Pose, bones: tuple[int, ...]) -> Floats:
    """(E, 3) where these bones end, in the armature's frame, whatever the root transform."""
    upright = Pose(np.zeros(3), IDENTITY.copy(), pose.bones)
    origins, frames = forward_kinematics(armature, upright)
    return np.array([origins[b] + rotate(frames[b], armature.tips[b]) for b in bones])


class _Body:
    """Bones given by where they begin and end at rest; their frames lie at random."""

    def __init__(self) -> None:
        self.parents: list[int] = []
        self.heads: list[Floats] = []
        self.ends: list[Floats] = []
        self.motion: list[tuple[Floats, Floats]] = []

    def chain(
        self, parent: int, points: ArrayLike, middle: ArrayLike = 0.0, swing: ArrayLike = 0.0
    ) -> int:
        """Bones from each point to the next; the last one's index. middle, swing: a (3,) for all,
        or a row for each bone.
        """
        path = np.asarray(points, float)
        shape = (len(path) - 1, 3)
        middles, swings = np.broadcast_to(middle, shape), np.broadcast_to(swing, shape)
        for (head, end), motion in zip(
            pairwise(path), zip(middles, swings, strict=True), strict=True
        ):
            self.parents.append(parent)
            self.heads.append(head)
            self.ends.append(end)
            self.motion.append(motion)
            parent = len(self.parents) - 1
        return parent

    def workload(self, name: str, effectors: tuple[int, ...]) -> Workload:
        count = len(self.parents)
        frames = np.random.default_rng(len(name)).normal(size=(count, 4))
        frames /= np.linalg.norm(frames, axis=1, keepdims=True)
        offsets, rotations = np.array(self.heads), np.array(frames)
        for bone, parent in enumerate(self.parents):
            if parent >= 0:
                home = conjugate(frames[parent])
                offsets[bone] = rotate(home, self.heads[bone] - self.heads[parent])
                rotations[bone] = multiply(home, frames[bone])
        tips = [
            rotate(conjugate(frame), end - head)
            for frame, head, end in zip(frames, self.heads, self.ends, strict=True)
        ]
        names = [f"{name}.{bone}" for bone in range(count)]
        armature = Armature.build(name, names, self.parents, offsets, rotations, tips)
        middles, swings = (np.array(each) for each in zip(*self.motion, strict=True))
        return Workload(armature, effectors, middles, swings)


def creature() -> Workload:
    """25 bones: hips, five of spine, neck and head, arms, legs, five of tail. +Y up, facing +Z."""
    body = _Body()
    hips = body.chain(-1, [(0, 0.9, 0), (0, 0.95, 0)])
    spine = np.linspace((0, 0.95, 0), (0, 1.4, 0.03), 6)
    chest = body.chain(hips, spine, (0.05, 0, 0), (0.07, 0.06, 0.05))
    neck = [(0, 1.4, 0.03), (0, 1.52, 0.05), (0, 1.7, 0.1)]
    effectors = [body.chain(chest, neck, (0.1, 0, 0), (0.2, 0.3, 0.1))]
    for side in (1.0, -1.0):
        arm = np.array([(0.18, 1.36, 0), (0.46, 1.36, -0.02), (0.71, 1.36, 0), (0.85, 1.34, 0)])
        bent = np.array([(0, 0, -0.6), (0, -1.0, 0), (0, 0, 0)]) * [1, side, side]
        swing = [(0.2, 0.4, 0.5), (0, 0.7, 0), (0.1, 0.2, 0.2)]
        effectors.append(body.chain(chest, arm * [side, 1, 1], bent, swing))
    for side in (1.0, -1.0):
        leg = np.array([(0.1, 0.88, 0), (0.1, 0.48, 0.03), (0.1, 0.08, 0), (0.1, 0.02, 0.16)])
        swing = [(0.4, 0.1, 0.1), (0.4, 0, 0), (0.2, 0, 0)]
        middle = [(-0.3, 0, 0), (0.5, 0, 0), (-0.1, 0, 0)]
        effectors.append(body.chain(hips, leg * [side, 1, 1], middle, swing))
    body.chain(hips, np.linspace((0, 0.9, -0.05), (0, 0.95, -0.6), 6), swing=(0.1, 0.25, 0))
    return body.workload("creature", tuple(effectors))


def snake() -> Workload:
    """60 bones in a straight line along +Z, led at the middle and at the head."""
    body = _Body()
    root = body.chain(-1, [(0, 0.05, 0), (0, 0.05, 0.03)])
    along = np.linspace((0, 0.05, 0.03), (0, 0.05, 1.8), 60)
    wave = np.sin(np.arange(59) / 9.0)[:, None]
    head = body.chain(root, along, wave * (0.02, 0.07, 0), (0.05, 0.05, 0))
    return body.workload("snake", (30, head))


def ostrich() -> Workload:
    """23 bones: hips, two legs of four, a neck and head of fourteen. +Y up, facing +Z."""
    body = _Body()
    hips = body.chain(-1, [(0, 1.0, -0.1), (0, 1.05, 0.1)])
    effectors = []
    for side in (1.0, -1.0):
        leg = [
            (0.12, 0.95, 0),
            (0.12, 0.65, 0.2),
            (0.12, 0.35, -0.1),
            (0.12, 0.05, 0),
            (0.12, 0, 0.2),
        ]
        middle = [(-0.2, 0, 0), (0.3, 0, 0), (-0.2, 0, 0), (0.1, 0, 0)]
        swing = [(0.4, 0.05, 0.1), (0.4, 0, 0), (0.25, 0, 0), (0.2, 0, 0)]
        effectors.append(body.chain(hips, np.array(leg) * [side, 1, 1], middle, swing))
    low = np.linspace((0, 1.05, 0.2), (0, 1.2, 0.5), 5)
    high = np.linspace((0, 1.2, 0.5), (0, 2.1, 0.7), 10)[1:]
    neck = [*low, *high, (0, 2.1, 0.8)]
    effectors.append(body.chain(hips, neck, 0.0, (0.12, 0.09, 0.05)))
    return body.workload("ostrich", tuple(effectors))


WORKLOADS = {"creature": creature, "snake": snake, "ostrich": ostrich}
