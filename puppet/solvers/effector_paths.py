"""What a solver needs to know of an armature and its end effectors, worked out once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from puppet.armature import Armature
from puppet.errors import PuppetError
from puppet.kernel import Floats, Ints, frozen
from puppet.rotation import conjugate, rotate
from puppet.solvers.joint_limits import HELD, Bounds


@dataclass(frozen=True, slots=True, eq=False)
class EffectorPaths:
    """For E effectors the bones that move them, as flat arrays.

    effectors: (E,) bones, whose tips are meant. bases: (E,) the first bone of each path, about
    whose origin an effector's reach is counted. starts: (E + 1,) into `bones`, the paths' bones
    from the base on. shared: (E, E) how many bones two paths have in common from the base on.
    reaches: (E,) metres, how far a tip can be from its base.
    bends: (len(bones), 3) unit or zero, the axis in the bone's rest frame about which a straight
    path bends when it must fold. befores: (E,) the nearest effector on an effector's path, or -1.
    order: (E,) the effectors, each after the one before it.
    """

    effectors: Ints
    bases: Ints
    starts: Ints
    bones: Ints
    shared: Ints
    reaches: Floats
    bends: Floats
    befores: Ints
    order: Ints

    @classmethod
    def of(cls, armature: Armature, effectors: Sequence[int], bounds: Bounds) -> EffectorPaths:
        """Raises PuppetError for an effector that is no bone or that comes twice."""
        paths: list[list[int]] = []
        for effector in effectors:
            if not 0 <= effector < len(armature):
                raise PuppetError(
                    "an end effector is not a bone",
                    where=armature.name,
                    expected=f"an index below {len(armature)}",
                    found=str(effector),
                )
            paths.append(_path(armature, effector, bounds))
        if len(set(effectors)) < len(paths):
            raise PuppetError("an end effector comes twice", where=armature.name)
        shared = [[_common(a, b) for b in paths] for a in paths]
        bends = [
            bend
            for path, tip in zip(paths, effectors, strict=True)
            for bend in _bends(armature, path, tip, bounds)
        ]
        return cls(
            effectors=frozen(effectors, np.int32),
            bases=frozen([path[0] if path else -1 for path in paths], np.int32),
            starts=frozen(np.cumsum([0, *map(len, paths)]), np.int32),
            bones=frozen([bone for path in paths for bone in path], np.int32),
            shared=frozen(np.reshape(shared, (len(paths), len(paths))), np.int32),
            reaches=frozen(
                [_reach(armature, path, tip) for path, tip in zip(paths, effectors, strict=True)]
            ),
            bends=frozen(np.reshape(bends, (-1, 3))),
            befores=frozen([_before(path, paths) for path in paths], np.int32),
            order=frozen(sorted(range(len(paths)), key=lambda e: len(paths[e])), np.int32),
        )


def _path(armature: Armature, effector: int, bounds: Bounds) -> list[int]:
    """The bones that may turn to move a tip, from the root's side; never a root."""
    path: list[int] = []
    bone = effector
    while armature.parents[bone] >= 0:
        if bounds.kinds[bone] != HELD:
            path.append(bone)
        bone = int(armature.parents[bone])
    return path[::-1]


def _common(a: list[int], b: list[int]) -> int:
    count = 0
    for one, other in zip(a, b, strict=False):
        if one != other:
            break
        count += 1
    return count


def _reach(armature: Armature, path: list[int], effector: int) -> float:
    """What lies between two bones of a path is rigid, so their distance at rest stays."""
    points = [armature.rest[0][bone] for bone in path] + [armature.rest_tips[effector]]
    return math.fsum(float(np.linalg.norm(b - a)) for a, b in pairwise(points))


def _before(path: list[int], paths: list[list[int]]) -> int:
    """The effector with the longest path that lies wholly on this path, which goes on after it."""
    within = [
        e for e, its in enumerate(paths) if its and _common(its, path) == len(its) < len(path)
    ]
    return max(within, key=lambda e: len(paths[e]), default=-1)


def _bends(armature: Armature, path: list[int], effector: int, bounds: Bounds) -> list[Floats]:
    """See `EffectorPaths.bends`.

    At rest the axes are as parallel as they can be square to their bones, so that a straight chain
    bends in one plane. A bone that cannot turn about that axis bends square to it, and a bone with
    more room on one side, like a knee, bends to that side.
    """
    points = [armature.rest[0][bone] for bone in path] + [armature.rest_tips[effector]]
    plane = _square_to(points[-1] - points[0], None)
    bends = []
    for bone, here, onwards in zip(path, points, points[1:], strict=False):
        home = conjugate(armature.rest[1][bone])
        low, high = bounds.lower[bone], bounds.upper[bone]
        axis = _square_to(onwards - here, plane)
        bend = rotate(home, axis) * (high > low)
        if np.linalg.norm(bend) < 0.3:
            bend = rotate(home, np.cross(_unit(onwards - here), axis)) * (high > low)
        up, down = np.minimum(high, math.pi), np.minimum(-low, math.pi)
        one_sided = np.abs(up - down) > 0.5 * np.maximum(up + down, 1e-9)
        bends.append(np.where(one_sided, np.abs(bend) * np.sign(up - down), bend))
    return bends


def _square_to(direction: Floats, near: Floats | None) -> Floats:
    """A unit vector at a right angle to `direction`, as near to `near` as can be."""
    along = _unit(direction)
    if near is not None:
        rest = near - along * float(near @ along)
        if np.linalg.norm(rest) > 0.1:
            return _unit(rest)
    return _unit(np.cross(along, np.eye(3)[np.argmin(np.abs(along))]))


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-12))
