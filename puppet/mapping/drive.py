"""FK drive: a set of pairs and a neutral stance become a mapping, frame to intent."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from puppet.armature import Armature
from puppet.kernel import Floats, Ints, frozen
from puppet.mapping.body_axis import stands_upright
from puppet.mapping.human import SPINE
from puppet.mapping.placement import Placement
from puppet.mapping.proposal import Pair
from puppet.mapping.stance import CARRIERS, Stance, measure_into
from puppet.pose import Intent, Pose
from puppet.skeleton import HUMAN_BONES, SkeletonFrame
from puppet.solvers.retarget import retarget

#: How far each human bone swings from hanging or standing, degrees; ordinary, not athletic, ranges.
HUMAN_RANGES: Final = {
    "pelvis": 60.0,
    "chest": 60.0,
    "head": 50.0,
    "shoulder": 25.0,
    "upper_arm": 170.0,
    "forearm": 145.0,
    "hand": 70.0,
    "thigh": 100.0,
    "shin": 130.0,
    "foot": 45.0,
}


#: Radians that pelvis and chest of a body that lies along the ground turn, if nobody says.
LYING: Final = math.radians(20.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Plan:
    """The constants of the kernel, worked out once for a set of pairs."""

    humans: Ints
    anchors: Ints
    path_starts: Ints
    path: Ints
    gains: Floats
    follows: Floats


class ForwardDrive:
    """A `Mapping`: each mapped bone turns as its human bone turns from the neutral stance.

    Pure: the same frame gives the same intent. A bone without a partner keeps its rest rotation
    in its parent, or repeats a share of its parent's turn (follows: bone and share). Where the
    armature limits a bone, the human range is scaled into the limit.
    """

    def __init__(
        self,
        armature: Armature,
        pairs: Iterable[Pair],
        neutral: Stance,
        placement: Placement | None = None,
        follows: Iterable[tuple[int, float]] = (),
    ) -> None:
        self.armature = armature
        self.pairs = tuple(pairs)
        self.neutral = neutral
        self.placement = placement or Placement()
        self.follows = tuple(follows)
        self._plan = _plan(armature, self.pairs, self.follows)

    def with_neutral(self, neutral: Stance) -> ForwardDrive:
        """The same mapping, counted from another neutral stance."""
        return ForwardDrive(self.armature, self.pairs, neutral, self.placement, self.follows)

    def __call__(self, frame: SkeletonFrame) -> Intent:
        count = len(HUMAN_BONES)
        swings, frames = np.empty((count, 4)), np.empty((count, 4))
        heading = measure_into(frame.positions, swings, frames)
        bones, turned = np.empty((len(self.armature), 4)), np.empty((len(self.armature), 4))
        plan, neutral = self._plan, self.neutral
        retarget(
            swings,
            neutral.swings,
            neutral.frames,
            np.minimum(frame.influence[_STARTS], frame.influence[_ENDS]),
            CARRIERS,
            self.armature.parents,
            self.armature.rest[1],
            self.armature.rotations,
            plan.humans,
            plan.anchors,
            plan.path_starts,
            plan.path,
            plan.gains,
            plan.follows,
            turned,
            bones,
        )
        translation, rotation = self.placement.root(frame, self.neutral, heading)
        return Intent(Pose(translation, rotation, bones))


_STARTS: Final = frozen([bone.start for bone in HUMAN_BONES], np.int32)
_ENDS: Final = frozen([bone.end for bone in HUMAN_BONES], np.int32)


def _carriers_of(human: int) -> list[int]:
    """The human bone and all that carry it, from the body outwards."""
    chain = [human]
    while CARRIERS[chain[-1]] >= 0:
        chain.append(int(CARRIERS[chain[-1]]))
    return chain[::-1]


def _plan(armature: Armature, pairs: Iterable[Pair], follows: Iterable[tuple[int, float]]) -> _Plan:
    count = len(armature)
    humans = np.full(count, -1, np.int32)
    for pair in pairs:
        humans[pair.bone] = pair.human
    anchors = np.full(count, -1, np.int32)
    gains, shares = np.ones(count), np.zeros(count)
    for bone, share in follows:
        shares[bone] = share
    path: list[int] = []
    starts = [0]
    for bone in range(count):
        if humans[bone] >= 0:
            human = int(humans[bone])
            carriers = _carriers_of(human)
            ancestor = int(armature.parents[bone])
            while ancestor >= 0 and humans[ancestor] not in carriers[:-1]:
                ancestor = int(armature.parents[ancestor])
            anchors[bone] = ancestor
            first = 0 if ancestor < 0 else carriers.index(int(humans[ancestor])) + 1
            path += carriers[first:]
            human_range = math.radians(HUMAN_RANGES[HUMAN_BONES[human].name.split(".")[0]])
            limit = float(armature.limits[bone])
            if not math.isfinite(limit) and human in SPINE[:2] and not stands_upright(armature):
                # A body that lies along the ground stands on its head if it bows as deep as we do.
                limit = LYING
            gains[bone] = min(1.0, limit / human_range)
        starts.append(len(path))
    return _Plan(
        frozen(humans, np.int32),
        frozen(anchors, np.int32),
        frozen(starts, np.int32),
        frozen(path, np.int32),
        frozen(gains),
        frozen(shares),
    )
