"""Trunk and limbs: what a puppeteer sees first in an armature, read off its hierarchy.

The trunk is what carries others: the bones in the middle (on neither side) with more than one
chain below them, and whatever lies between those and the root. All else is limbs, each a chain that
hangs on the trunk. An armature without branches has no trunk: it is one limb, as a lamp's arm or
a snake's body is.

Ears, fingers and jaws branch off too, but a head does not become a trunk by having ears: chains
that are short against the others (twigs) are looked at last, and carry nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from puppet.armature import Armature, Side
from puppet.kernel import Floats
from puppet.mapping.symmetry import sides_of

#: A chain shorter than this share of the longest one is a twig; one at a side, of the longest
#: at the sides: small fins are all that a fish has.
TWIG: Final = 0.25
#: So many chains side by side at the end of a limb are fingers or toes.
BUNCH: Final = 3


@dataclass(frozen=True, slots=True)
class Limb:
    """A chain from where it leaves the trunk to its tip; what branches off it belongs to no limb.

    bones: from the body outwards. hub: the bone that it hangs on, -1 for none.
    reach: metres along its bones at rest. is_twig: whether that is little against the others'.
    """

    bones: tuple[int, ...]
    side: Side
    hub: int
    reach: float
    is_twig: bool = False


@dataclass(frozen=True, slots=True)
class Anatomy:
    """trunk: bones from the root outwards. limbs: those that reach furthest first, twigs last.

    Neither depends on the order of bones in the armature. sides: of all bones.
    """

    trunk: tuple[int, ...]
    limbs: tuple[Limb, ...]
    sides: tuple[Side, ...]

    @property
    def has_sides(self) -> bool:
        """Whether any limb is a left or a right one."""
        return any(limb.side for limb in self.limbs)

    @property
    def pieces(self) -> tuple[Limb, ...]:
        """The limbs as FK drives them: a lone chain of more than three bones is cut into its last
        three, for one arm, and the others, for the other arm."""
        if self.trunk or len(self.limbs) != 1 or len(self.limbs[0].bones) <= 3:
            return self.limbs
        whole = self.limbs[0]
        return (
            replace(whole, bones=whole.bones[-3:]),
            replace(whole, bones=whole.bones[:-3]),
        )


def limb_rows(armature: Armature, limbs: Sequence[Limb]) -> dict[int, int]:
    """For each bone of a limb, and each that branches off one, the place of that limb."""
    owner = {bone: row for row, limb in enumerate(limbs) for bone in limb.bones}
    for bone, parent in enumerate(armature.parents):
        if bone not in owner and int(parent) in owner:
            owner[bone] = owner[int(parent)]
    return owner


@lru_cache(maxsize=64)
def anatomy(armature: Armature) -> Anatomy:
    """The trunk and limbs of an armature."""
    sides = sides_of(armature)
    lengths = np.linalg.norm(armature.tips, axis=1)
    if not lengths.any():  # a bare hierarchy: every bone is as long as any other
        lengths = np.ones(len(armature))
    plain = _split(armature, sides, lengths, frozenset())
    longest = _longest_way(armature, plain, lengths)
    widest = max((limb.reach for limb in plain.limbs if limb.side), default=0.0)
    short = [
        limb
        for limb in plain.limbs
        if all(t.reach < TWIG * (widest if t.side else longest) for t in _twins(limb, plain))
    ]
    twigs = tuple(limb for limb in short if not _goes_on(limb, plain, short))
    left_out = frozenset(bone for limb in twigs for bone in armature.below(limb.bones[0]))
    if not left_out:
        return plain
    bare = _split(armature, sides, lengths, left_out)
    marked = tuple(replace(limb, is_twig=True) for limb in twigs)
    return Anatomy(bare.trunk, (*bare.limbs, *marked), sides)


def _longest_way(armature: Armature, shape: Anatomy, lengths: Floats) -> float:
    """Metres from where the body begins to its furthest tip: what a tongue is short against."""
    ways = np.array(lengths)
    for bone in reversed(range(len(armature))):
        ways[bone] += max((ways[child] for child in armature.children[bone]), default=0.0)
    starts = [child for bone in shape.trunk for child in armature.children[bone]]
    starts += [limb.bones[0] for limb in shape.limbs]
    return float(ways[starts].max())


def _goes_on(limb: Limb, shape: Anatomy, short: Sequence[Limb]) -> bool:
    """Whether it is the only way on from its hub, as a small head is between two ears."""
    beside = [other for other in shape.limbs if other.hub == limb.hub]
    ways = [other for other in beside if not other.side]
    return not limb.side and len(ways) == 1 and all(other in short for other in beside)


def _twins(limb: Limb, shape: Anatomy) -> list[Limb]:
    """The limb and those on the other side that hang with it: they are twigs together, or none."""
    across = {"L": "R", "R": "L"}.get(limb.side)
    hub = limb.hub
    return [limb, *(t for t in shape.limbs if across and t.side == across and t.hub == hub)]


def _split(
    armature: Armature, sides: tuple[Side, ...], lengths: Floats, left_out: frozenset[int]
) -> Anatomy:
    count = len(armature)
    children = [
        [child for child in armature.children[bone] if child not in left_out]
        for bone in range(count)
    ]
    in_trunk = [False] * count
    reach: list[tuple[int, float]] = [(0, 0.0)] * count  # bones and metres of the longest chain
    for bone in reversed(range(count)):
        branches = len(children[bone]) > 1 or any(in_trunk[child] for child in children[bone])
        in_trunk[bone] = branches and not sides[bone]
        below = max((reach[child] for child in children[bone]), default=(0, 0.0))
        reach[bone] = (below[0] + 1, below[1] + float(lengths[bone]))
    limbs = []
    for start in range(count):
        parent = int(armature.parents[start])
        if start in left_out or in_trunk[start] or (parent >= 0 and not in_trunk[parent]):
            continue
        chain = [start]
        while children[chain[-1]]:
            if len(chain) > 1 and len(children[chain[-2]]) >= BUNCH:
                break  # fingers: the first bone of one of them is still the hand
            # Of equal ones the name decides: the order of bones means nothing.
            chain.append(
                max(children[chain[-1]], key=lambda child: (*reach[child], armature.names[child]))
            )
        named = [sides[bone] for bone in chain if sides[bone]]
        side: Side = named[0] if named else ""
        limbs.append(Limb(tuple(chain), side, parent, reach[start][1]))
    longest = max((limb.reach for limb in limbs), default=0.0) or 1.0
    limbs.sort(
        key=lambda limb: (
            -round(limb.reach / longest, 6),
            -len(limb.bones),
            # Of two that are alike in every way, one that is called a head is one.
            "head" not in armature.names[limb.bones[-1]].lower(),
            armature.names[limb.bones[-1]],
        )
    )
    trunk = [bone for bone in range(count) if in_trunk[bone] and bone not in left_out]
    trunk.sort(key=lambda bone: (armature.depths[bone], armature.names[bone]))
    return Anatomy(tuple(trunk), tuple(limbs), sides)
