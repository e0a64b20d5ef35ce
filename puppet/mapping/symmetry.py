"""Left and right in an armature: by the names of its bones, or by its shape where they say nothing.

By shape, two limbs are a left and a right one when they mirror each other: siblings of the same
build whose ends lie square to a plane that the other such pairs share. Which of them is the left
one depends on where the character faces: +Z (glTF's convention), but where left and right lie along
z, the way its feet point.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations
from typing import Final, Literal

import numpy as np

from puppet.armature import Armature, Side
from puppet.kernel import Floats

#: How alike the lengths of mirrored bones must be, as a share; and how square, as a cosine.
_ALIKE: Final = 0.1
_SQUARE: Final = 0.94
#: More limbs than this on one bone are a fringe, and no lefts and rights.
_MANY: Final = 32
_UP: Final = np.array([0.0, 1.0, 0.0])


@lru_cache(maxsize=64)
def sides_of(armature: Armature) -> tuple[Side, ...]:
    """Left, right or middle for each bone."""
    if any(armature.sides):
        return armature.sides
    return _by_shape(armature)


def facing(armature: Armature) -> Literal["+x", "-x", "+z", "-z"]:
    """Where a character looks, along the nearest axis; +z where nothing says.

    Its left and right say it, and up is +Y: by the names of its bones whichever way it looks; by
    its shape only where left and right lie along z.
    """
    sides = sides_of(armature)
    ends = {
        side: [p for p, its in zip(armature.rest[0], sides, strict=True) if its == side]
        for side in ("L", "R")
    }
    if not (ends["L"] and ends["R"]):
        return "+z"
    left = np.mean(ends["L"], axis=0) - np.mean(ends["R"], axis=0)
    length = float(np.linalg.norm(left))
    forward = np.cross(left, _UP) / max(length, 1e-12)
    if abs(float(forward[2])) >= _SQUARE:
        return "+z" if forward[2] > 0.0 else "-z"
    if abs(float(forward[0])) >= _SQUARE:
        return "+x" if forward[0] > 0.0 else "-x"
    return "+z"


def _by_shape(armature: Armature) -> tuple[Side, ...]:
    sides: list[Side] = [""] * len(armature)
    pairs = _mirrored(armature)
    across = _shared_direction(armature, pairs)
    if across is None:
        return tuple(sides)
    left = _leftwards(armature, across, pairs)
    for one, other in pairs:
        apart = _middle(armature, one) - _middle(armature, other)
        length = float(np.linalg.norm(apart))
        if length < 1e-9 or abs(float(apart @ left)) < _SQUARE * length:
            continue
        first: Side = "L" if float(apart @ left) > 0.0 else "R"
        second: Side = "R" if first == "L" else "L"
        for start, side in ((one, first), (other, second)):
            for bone in armature.below(start):
                sides[bone] = side
    return tuple(sides)


def _mirrored(armature: Armature) -> list[tuple[int, int]]:
    """Siblings (or roots) of the same build, two by two; three alike are no left and right."""
    families: dict[int, list[int]] = {}
    for bone, parent in enumerate(armature.parents):
        families.setdefault(int(parent), []).append(bone)
    pairs: list[tuple[int, int]] = []
    for family in families.values():
        if 2 <= len(family) <= _MANY:
            for alike in _alike(armature, family):
                pairs += _across(armature, alike) if len(alike) % 2 == 0 else ()
    # In an order that does not depend on that of the bones.
    return sorted(pairs, key=lambda pair: [armature.names[bone] for bone in pair])


def _alike(armature: Armature, family: Sequence[int]) -> list[list[int]]:
    """Siblings by their build."""
    signatures = {bone: _signature(armature, bone) for bone in family}
    groups: list[list[int]] = []
    for bone in family:
        joined = [
            group
            for group in groups
            if any(_same_build(signatures[bone], signatures[other]) for other in group)
        ]
        groups = [group for group in groups if group not in joined]
        groups.append([bone, *(other for group in joined for other in group)])
    return groups


def _across(armature: Armature, alike: Sequence[int]) -> list[tuple[int, int]]:
    """Who of those of the same build is across from whom.

    Fore and hind legs of one hub may all be alike: the nearest in height and depth is the one
    across, and of those as near the one to the side, for most characters face +Z.
    """

    def strain(pair: tuple[int, int]) -> tuple[object, ...]:
        apart = _middle(armature, pair[0]) - _middle(armature, pair[1])
        aside = abs(float(apart[0])) / max(float(np.linalg.norm(apart)), 1e-12)
        names = [armature.names[bone] for bone in pair]
        return round(_crookedness(armature, *pair), 3), -round(aside, 3), names

    by_name = sorted(alike, key=lambda bone: armature.names[bone])
    pairs: list[tuple[int, int]] = []
    for pair in sorted(combinations(by_name, 2), key=strain):
        if not any(bone in taken for taken in pairs for bone in pair):
            pairs.append(pair)
    return pairs


def _signature(armature: Armature, start: int) -> tuple[list[int], Floats]:
    """The build of what hangs on a bone: how many children each has, and how long each is."""
    bones = armature.below(start)
    lengths = np.linalg.norm(armature.tips[bones], axis=1)
    return sorted(len(armature.children[bone]) for bone in bones), np.sort(lengths)


def _same_build(a: tuple[list[int], Floats], b: tuple[list[int], Floats]) -> bool:
    if a[0] != b[0]:
        return False
    scale = max(float(a[1].max()), float(b[1].max()), 1e-12)
    return bool(np.all(np.abs(a[1] - b[1]) <= _ALIKE * scale))


def _crookedness(armature: Armature, one: int, other: int) -> float:
    """How far the line between two limbs is from being square to their common middle."""
    start, end = _middle(armature, one), _middle(armature, other)
    parent = int(armature.parents[one])
    hub = armature.rest[0][parent] if parent >= 0 else np.zeros(3)
    apart = end - start
    length = float(np.linalg.norm(apart))
    return abs(float(apart @ ((start + end) / 2.0 - hub))) / length if length > 1e-9 else np.inf


def _shared_direction(armature: Armature, pairs: Sequence[tuple[int, int]]) -> Floats | None:
    """The line across that most pairs agree on, if it is not the vertical one."""
    lines = []
    for one, other in pairs:
        apart = _middle(armature, one) - _middle(armature, other)
        length = float(np.linalg.norm(apart))
        if length > 1e-9:
            lines.append((apart / length, length))
    if not lines:
        return None
    support = [
        sum(weight for line, weight in lines if abs(float(line @ other)) > _SQUARE)
        for other, _ in lines
    ]
    across = lines[int(np.argmax(support))][0]
    return None if abs(float(across @ _UP)) > 0.7 else np.asarray(across)


def _leftwards(armature: Armature, across: Floats, pairs: Sequence[tuple[int, int]]) -> Floats:
    """`across`, pointing to the character's left."""
    forward = np.cross(across, _UP)
    forward /= max(float(np.linalg.norm(forward)), 1e-9)
    along = float(forward[2])
    if abs(along) < 0.5:
        # It looks along x, against the convention: its feet say which way.
        along = float(_feet(armature, pairs) @ forward) or float(forward[0])
    return np.asarray(np.cross(_UP, forward if along >= 0.0 else -forward))


def _feet(armature: Armature, pairs: Sequence[tuple[int, int]]) -> Floats:
    """The sum of the last bones of those limbs that come down furthest. -> (3,)"""
    positions, tips = armature.rest[0], armature.rest_tips
    limbs = [bone for pair in pairs for start in pair for bone in armature.below(start)]
    ends = [bone for bone in limbs if not armature.children[bone]]
    lowest = min((float(tips[bone][1]) for bone in ends), default=0.0)
    feet = [b for b in ends if tips[b][1] - lowest < 0.15 * max(armature.size, 1e-9)]
    return np.asarray(sum(tips[bone] - positions[bone] for bone in feet))


def _middle(armature: Armature, start: int) -> Floats:
    """The mean of a limb's ends at rest."""
    return np.asarray(armature.rest_tips[armature.below(start)].mean(axis=0))
