"""Trunk and limbs: what a puppeteer sees first in an armature, read off its hierarchy.

The trunk is what carries others: the bones in the middle (on neither side) with more than one
chain below them, and whatever lies between those and the root. All else is limbs, each a chain that
hangs on the trunk. An armature without branches has no trunk: it is one limb, as a lamp's arm or
a snake's body is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from puppet.armature import Armature, Side


@dataclass(frozen=True, slots=True)
class Limb:
    """A chain from where it leaves the trunk to its tip; twigs beside it belong to no limb."""

    bones: tuple[int, ...]
    side: Side


@dataclass(frozen=True, slots=True)
class Anatomy:
    """trunk: bones from the root outwards. limbs: in the order of their first bones."""

    trunk: tuple[int, ...]
    limbs: tuple[Limb, ...]

    @property
    def has_sides(self) -> bool:
        """Whether any limb is a left or a right one."""
        return any(limb.side for limb in self.limbs)


def anatomy(armature: Armature) -> Anatomy:
    """The trunk and limbs of an armature."""
    count = len(armature)
    in_trunk = [False] * count
    for bone in reversed(range(count)):
        children = armature.children[bone]
        branches = len(children) > 1 or any(in_trunk[child] for child in children)
        in_trunk[bone] = branches and not armature.sides[bone]
    parents = armature.parents
    starts = [
        bone
        for bone in range(count)
        if not in_trunk[bone] and (parents[bone] < 0 or in_trunk[parents[bone]])
    ]
    reach = _longest_chain_below(armature)
    limbs = []
    for start in starts:
        chain = [start]
        while armature.children[chain[-1]]:
            chain.append(max(armature.children[chain[-1]], key=lambda child: reach[child]))
        sides = [armature.sides[bone] for bone in chain if armature.sides[bone]]
        limbs.append(Limb(tuple(chain), sides[0] if sides else ""))
    return Anatomy(tuple(bone for bone in range(count) if in_trunk[bone]), tuple(limbs))


def _longest_chain_below(armature: Armature) -> list[tuple[int, float]]:
    """For each bone how many bones, and how many metres, its longest chain still has."""
    lengths = np.linalg.norm(armature.tips, axis=1)
    reach: list[tuple[int, float]] = [(0, 0.0)] * len(armature)
    for bone in reversed(range(len(armature))):
        below = max((reach[child] for child in armature.children[bone]), default=(0, 0.0))
        reach[bone] = (below[0] + 1, below[1] + float(lengths[bone]))
    return reach
