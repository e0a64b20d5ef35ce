"""The puppet's hierarchy: bones, their rest pose, and what can be read off its shape."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from puppet.errors import PuppetError
from puppet.kernel import Floats, Ints, frozen
from puppet.rotation import multiply, rotate

Side = Literal["L", "R", ""]
#: How a bone moves in its parent: it turns, it slides along an axis, or it is fixed.
Movement = Literal["turn", "slide", "fixed"]

# Words between separators in any case ("arm_l", "Hand Right"), and words in camel case
# ("LeftArm", "upperArmRight"), but not words that only begin alike ("leftover").
_WORD = re.compile(r"(?:^|[._\-\s:])(left|right|l|r)(?=$|[._\-\s:\d])", re.IGNORECASE)
_CAMEL = re.compile(r"(Left|Right)(?=[A-Z\d]|$)")


def side_of(name: str) -> Side:
    """Left or right as the name of a bone says: ``.L``, ``_r``, ``LeftArm``; "" if it says nothing.

    >>> side_of("fin.L"), side_of("arm_r"), side_of("mixamorig:RightHand"), side_of("tail")
    ('L', 'R', 'R', '')
    """
    match = _WORD.search(name) or _CAMEL.search(name)
    if match is None:
        return ""
    return "L" if match[1].lower().startswith("l") else "R"


@dataclass(frozen=True, eq=False)
class Armature:
    """A hierarchy of bones at rest. Parents come before their children.

    names: B bone names, unique.
    parents: (B,) index of each bone's parent; -1 for a root (there may be several).
    offsets: (B, 3) metres, the bone's origin in its parent's frame (a root's in the armature's).
    rotations: (B, 4) xyzw, rest rotation parent_from_bone.
    tips: (B, 3) metres, where the bone ends, in its own frame.
    limits: (B,) radians, how far a bone may turn from rest in any direction; inf where it is free.
    lower, upper: (B, 3) radians, how far it may turn about each axis of its own rest frame, as
        components of the rotation vector; both 0 about an axis that it cannot turn about.
    movements: B of `Movement`. Poses turn bones: one that slides or is fixed stays at rest.
    """

    name: str
    names: tuple[str, ...]
    parents: Ints
    offsets: Floats
    rotations: Floats
    tips: Floats
    limits: Floats
    lower: Floats
    upper: Floats
    movements: tuple[Movement, ...]

    @classmethod
    def build(
        cls,
        name: str,
        names: Sequence[str],
        parents: Sequence[int],
        offsets: ArrayLike,
        rotations: ArrayLike | None = None,
        tips: ArrayLike | None = None,
        limits: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        movements: Sequence[Movement] | None = None,
    ) -> Armature:
        """Check the hierarchy, put parents first and freeze the arrays.

        Without `rotations` every bone's frame is parallel to the armature's. Without `tips` a bone
        ends at the middle of its children, and a leaf goes on as its parent did.

        Raises PuppetError for no bones, repeated names, a parent that is not there or a cycle.
        """
        count = len(names)
        if count == 0:
            raise PuppetError("the armature has no bones", where=name)
        repeated = sorted(bone for bone, times in Counter(names).items() if times > 1)
        if repeated:
            raise PuppetError("bone names are not unique", where=name, found=", ".join(repeated))
        order = _parents_first(name, names, parents)
        new_index = {old: new for new, old in enumerate(order)}
        new_parents = [-1 if parents[old] < 0 else new_index[parents[old]] for old in order]
        offset = np.asarray(offsets, float).reshape(count, 3)[order]
        if rotations is None:
            rotation = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
        else:
            rotation = np.asarray(rotations, float).reshape(count, 4)[order]
        tip = (
            _guess_tips(new_parents, offset, rotation)
            if tips is None
            else np.asarray(tips, float).reshape(count, 3)[order]
        )
        limit = np.full(count, np.inf) if limits is None else np.asarray(limits, float)[order]
        low = np.full((count, 3), -np.inf) if lower is None else np.asarray(lower, float)[order]
        high = np.full((count, 3), np.inf) if upper is None else np.asarray(upper, float)[order]
        moves: Sequence[Movement] = ["turn"] * count if movements is None else movements
        return cls(
            name=name,
            names=tuple(names[old] for old in order),
            parents=frozen(new_parents, np.int32),
            offsets=frozen(offset),
            rotations=frozen(rotation),
            tips=frozen(tip),
            limits=frozen(limit),
            lower=frozen(low),
            upper=frozen(high),
            movements=tuple(moves[old] for old in order),
        )

    def __len__(self) -> int:
        return len(self.names)

    def index(self, bone: str) -> int:
        """The index of a bone. Raises PuppetError that lists the names there are."""
        try:
            return self._indices[bone]
        except KeyError:
            raise PuppetError(
                "there is no such bone",
                where=self.name,
                expected=f"one of {', '.join(self.names)}",
                found=bone,
            ) from None

    @cached_property
    def _indices(self) -> dict[str, int]:
        return {bone: index for index, bone in enumerate(self.names)}

    def holding(self, bones: Collection[int]) -> Armature:
        """The same armature with these bones fixed at rest."""
        movements = tuple(
            "fixed" if bone in bones else movement for bone, movement in enumerate(self.movements)
        )
        return replace(self, movements=movements)

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """For each bone the indices of its children."""
        lists: list[list[int]] = [[] for _ in self.names]
        for bone, parent in enumerate(self.parents):
            if parent >= 0:
                lists[parent].append(bone)
        return tuple(map(tuple, lists))

    def below(self, bone: int) -> list[int]:
        """A bone and all that hang on it, parents first."""
        bones = [bone]
        for each in bones:
            bones.extend(self.children[each])
        return bones

    @cached_property
    def depths(self) -> Ints:
        """(B,) steps from the root, whose depth is 0."""
        depth = np.zeros(len(self), np.int32)
        for bone, parent in enumerate(self.parents):
            if parent >= 0:
                depth[bone] = depth[parent] + 1
        depth.setflags(write=False)
        return depth

    @cached_property
    def freedoms(self) -> Ints:
        """(B,) degrees of freedom: about how many axes a bone turns; 0 if it slides or is fixed."""
        turning = np.array([movement == "turn" for movement in self.movements])
        return frozen(((self.upper > self.lower).sum(axis=1)) * turning, np.int32)

    @cached_property
    def sides(self) -> tuple[Side, ...]:
        """Left or right for each bone, by its name."""
        return tuple(side_of(name) for name in self.names)

    @cached_property
    def rest(self) -> tuple[Floats, Floats]:
        """Rest pose in the armature's frame: origins (B, 3) and armature_from_bone (B, 4)."""
        positions, rotations = _rest_transforms(self.parents, self.offsets, self.rotations)
        return frozen(positions), frozen(rotations)

    @cached_property
    def rest_tips(self) -> Floats:
        """(B, 3) where each bone ends at rest, in the armature's frame."""
        positions, rotations = self.rest
        return frozen(
            [p + rotate(q, t) for p, q, t in zip(positions, rotations, self.tips, strict=True)]
        )

    @cached_property
    def size(self) -> float:
        """Metres, the longest side of the box around the bones at rest."""
        points = np.vstack([self.rest[0], self.rest_tips])
        return float(np.ptp(points, axis=0).max())


def _parents_first(name: str, names: Sequence[str], parents: Sequence[int]) -> list[int]:
    """Old indices in an order where parents precede children; stable otherwise."""
    order: list[int] = []
    placed = [False] * len(names)
    for bone, parent in enumerate(parents):
        if parent >= len(names) or parent < -1:
            raise PuppetError(
                "a bone has a parent that is not there",
                where=f"{name}: {names[bone]}",
                expected=f"-1 or an index below {len(names)}",
                found=str(parent),
            )
    for bone in range(len(names)):
        path: dict[int, None] = {}  # in order, and quick to look things up in
        node = bone
        while node >= 0 and not placed[node]:
            if node in path:
                line = list(path)
                raise PuppetError(
                    "bones are their own ancestors",
                    where=name,
                    found=" → ".join(names[n] for n in [*line[line.index(node) :], node]),
                )
            path[node] = None
            node = parents[node]
        for node in reversed(path):
            placed[node] = True
            order.append(node)
    return order


def _rest_transforms(
    parents: NDArray[np.int32] | Sequence[int], offsets: Floats, rotations: Floats
) -> tuple[Floats, Floats]:
    positions, turned = np.array(offsets, float), np.array(rotations, float)
    for bone, parent in enumerate(parents):
        if parent >= 0:
            positions[bone] = positions[parent] + rotate(turned[parent], positions[bone])
            turned[bone] = multiply(turned[parent], turned[bone])
    return positions, turned


def _guess_tips(parents: Sequence[int], offsets: Floats, rotations: Floats) -> Floats:
    positions, turned = _rest_transforms(parents, offsets, rotations)
    above = np.asarray(parents, int)
    child = np.flatnonzero(above >= 0)
    sums, counts = np.zeros_like(positions), np.bincount(above[child], minlength=len(above))
    np.add.at(sums, above[child], positions[child])
    tips = np.zeros_like(offsets)
    for bone, parent in enumerate(parents):
        if counts[bone]:
            direction = sums[bone] / counts[bone] - positions[bone]
        elif parent >= 0:
            direction = positions[bone] - positions[parent]
        else:
            direction = np.array([0.0, 0.1, 0.0])
        back = np.array([*-turned[bone][:3], turned[bone][3]])
        tips[bone] = rotate(back, direction)
    return tips
