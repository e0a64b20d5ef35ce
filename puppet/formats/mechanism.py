"""A mechanism, bodies that hang on each other by hinges, as an armature.

MuJoCo's and ROS's files describe machines: +Z is up, +X is forward, and a body turns about axes
that are given one by one. Here each such body becomes a bone whose own frame has the hinges' axes
for its axes, so that a hinge's range is a bone's range about x, y or z.

Several hinges of one body turn one after the other in its file; a bone has them as components of
one rotation vector. For one hinge that is the same, for two or three it is near enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from puppet.armature import Armature, Movement
from puppet.errors import BadFileError
from puppet.formats.bone_ends import bone_ends
from puppet.formats.bone_names import listed
from puppet.kernel import Floats
from puppet.rotation import conjugate, from_axes, multiply, rotate

#: (3, 3) from +Z up and +X forward to +Y up and +Z forward.
STAGE_FROM_FILE: Final = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
#: Hinges of one body whose axes are nearer to each other (the sine) turn it the same way.
_SAME_AXIS: Final = 0.5
#: Sine of the angle by which axes may miss being square before it is worth a word.
_SKEW: Final = 0.1
#: Metres; two places nearer to each other are one place.
_TOUCHING: Final = 1e-6


@dataclass(slots=True, eq=False)
class Hinge:
    """An axis that a body turns about.

    axis, anchor: (3,) its direction and a point on it, at rest, in the file's world.
    lower, upper: radians from rest.
    """

    axis: Floats
    anchor: Floats
    lower: float = -math.inf
    upper: float = math.inf


@dataclass(slots=True, eq=False)
class Body:
    """One part of a machine at rest.

    parent: index of the body that it hangs on, which comes before it; -1 for none.
    place: (3,) metres and turn: (3, 3) its frame, in the file's world.
    hinges, ball (radians from rest; None for none), slides, free: how it moves in its parent.
    marks: (3,) each, places on its surface or in it, in the file's world.
    shown: it has something to see, or at least mass.
    """

    name: str
    parent: int
    place: Floats
    turn: Floats
    hinges: list[Hinge] = field(default_factory=list)
    ball: float | None = None
    slides: bool = False
    free: bool = False
    marks: list[Floats] = field(default_factory=list)
    shown: bool = True

    @property
    def is_free(self) -> bool:
        """It turns as it likes. A root does, unless hinges alone hold it: it carries the puppet,
        whether the file lets it float, slides it along the floor or screws it to the world."""
        jointed = bool(self.hinges) or self.ball is not None
        return self.free or (self.parent < 0 and (self.slides or not jointed))

    @property
    def movement(self) -> Movement:
        """How it moves as a bone, which turns if it can do several things."""
        if self.is_free or self.hinges or self.ball is not None:
            return "turn"
        return "slide" if self.slides else "fixed"


def merged(bodies: Sequence[Body], warn: Callable[[str], None]) -> list[Body]:
    """Bodies where three hinges at one place, with nothing between them, are one joint.

    A body that has nothing to see and nothing but one child, which turns about the same place,
    gives its hinges to that child. More than three axes are never put together.
    """
    children: list[list[int]] = [[] for _ in bodies]
    for index, body in enumerate(bodies):
        if body.parent >= 0:
            children[body.parent].append(index)
    index_now: dict[int, int] = {}
    result: list[Body] = []
    held: dict[int, list[Hinge]] = {}
    parents: dict[int, int] = {}
    gone: list[str] = []
    for index, body in enumerate(bodies):
        above = parents.get(body.parent, body.parent)
        hinges = [*held.get(body.parent, ()), *body.hinges]
        only = bodies[children[index][0]] if len(children[index]) == 1 else None
        if (
            only is not None
            and above >= 0
            and not body.shown
            and _is_hinged(body)
            and _is_hinged(only)
            and np.linalg.norm(body.hinges[0].anchor - only.hinges[0].anchor) < _TOUCHING
            and _independent([*hinges, *only.hinges])
        ):
            held[index], parents[index] = hinges, above
            gone.append(body.name)
            continue
        index_now[index] = len(result)
        result.append(replace(body, parent=index_now.get(above, -1), hinges=hinges))
    if gone:
        warn(f"hinges at one place are one joint: {listed(gone)} became part of the next bone")
    return result


def mechanism_armature(name: str, bodies: Sequence[Body], warn: Callable[[str], None]) -> Armature:
    """The armature of `bodies`: +Y up, facing +Z, standing on y = 0 with its root over the origin.

    warn: called with a sentence for what was repaired. Raises BadFileError if there are no bodies.
    """
    if not bodies:
        raise BadFileError("there are no bodies in it, so there are no bones", where=name)
    count = len(bodies)
    parents = [body.parent for body in bodies]
    origins = np.array([_origin(body, warn) for body in bodies]) @ STAGE_FROM_FILE.T
    marks = [(index, mark) for index, body in enumerate(bodies) for mark in body.marks]
    points = np.array([mark for _, mark in marks]).reshape(-1, 3) @ STAGE_FROM_FILE.T
    ends = bone_ends(parents, origins, points, np.array([index for index, _ in marks], np.intp))

    lower, upper = np.zeros((count, 3)), np.zeros((count, 3))
    limits = np.full(count, np.inf)
    turned = np.empty((count, 4))
    for index, body in enumerate(bodies):
        frame = STAGE_FROM_FILE @ body.turn @ STAGE_FROM_FILE.T
        if body.is_free or body.ball is not None:
            lower[index], upper[index] = -np.inf, np.inf
            limits[index] = np.inf if body.is_free or body.ball is None else body.ball
        elif body.hinges:
            frame, ranges = _hinged(body, ends[index] - origins[index], warn)
            lower[index], upper[index] = ranges.T
        if body.slides and not body.is_free and body.movement == "turn":
            warn(f"bone {body.name!r} slides and turns: it only turns")
        turned[index] = from_axes(*np.ascontiguousarray(frame.T))

    grounded = min(float(places[:, 1].min()) for places in (origins, ends))
    shift = np.array([origins[0, 0], grounded, origins[0, 2]])
    offsets, rotations, tips = origins - shift, turned.copy(), np.empty((count, 3))
    for index, parent in enumerate(parents):
        tips[index] = rotate(conjugate(turned[index]), ends[index] - origins[index])
        if parent >= 0:
            back = conjugate(turned[parent])
            offsets[index] = rotate(back, origins[index] - origins[parent])
            rotations[index] = multiply(back, turned[index])
    return Armature.build(
        name,
        [body.name for body in bodies],
        parents,
        offsets,
        rotations,
        tips,
        limits=limits,
        lower=lower,
        upper=upper,
        movements=[body.movement for body in bodies],
    )


def _is_hinged(body: Body) -> bool:
    return bool(body.hinges) and body.ball is None and not body.slides and not body.is_free


def _independent(hinges: Sequence[Hinge]) -> bool:
    axes = np.array([hinge.axis for hinge in hinges])
    return len(axes) <= 3 and bool(np.linalg.svd(axes, compute_uv=False)[-1] > _SAME_AXIS)


def _origin(body: Body, warn: Callable[[str], None]) -> Floats:
    """The point that the body turns about, in the file's world: where its hinges meet."""
    if body.is_free or not body.hinges:
        return body.place
    anchors = np.array([hinge.anchor for hinge in body.hinges])
    if np.ptp(anchors, axis=0).max() > _TOUCHING and len(anchors) > 1:
        warn(f"bone {body.name!r} has hinges at several places: it turns about their middle")
    middle: Floats = anchors.mean(axis=0)
    return middle


def _hinged(body: Body, along: Floats, warn: Callable[[str], None]) -> tuple[Floats, Floats]:
    """The frame of a bone with hinges, (3, 3) in the stage's axes, and (3, 2) ranges, radians.

    The first hinge is the frame's x, the next one y, and so on. What hinges leave open, the bone's
    own direction `along` decides: a single hinge has the bone along its y.
    """
    axes: list[Floats] = []
    ranges: list[list[float]] = []
    for hinge in body.hinges:
        if not hinge.lower <= 0.0 <= hinge.upper:
            warn(f"bone {body.name!r} rests outside its range: the range now goes as far as rest")
        low, high = min(hinge.lower, 0.0) + 0.0, max(hinge.upper, 0.0)
        axis = STAGE_FROM_FILE @ hinge.axis
        square = axis - sum((np.dot(axis, one) * one for one in axes), np.zeros(3))
        length = float(np.linalg.norm(square))
        if len(axes) == 3 or length < _SAME_AXIS:
            near = max(range(len(axes)), key=lambda i: abs(float(np.dot(axis, axes[i]))))
            same = np.dot(axis, axes[near]) > 0.0
            more = (low, high) if same else (-high, -low)
            ranges[near] = [ranges[near][0] + more[0], ranges[near][1] + more[1]]
            warn(f"bone {body.name!r} has several hinges about nearly one axis: made one")
            continue
        if length < 1.0 - 0.5 * _SKEW**2:
            warn(f"bone {body.name!r} has hinges that are not square to each other: made square")
        axes.append(square / length)
        ranges.append([low, high])
    for wish in (along, *np.eye(3)):
        if len(axes) == 3:
            break
        square = wish - sum((np.dot(wish, one) * one for one in axes), np.zeros(3))
        if np.linalg.norm(square) > 0.1 * np.linalg.norm(wish):
            axes.append(square / np.linalg.norm(square))
            ranges.append([0.0, 0.0])
    if np.dot(np.cross(axes[0], axes[1]), axes[2]) < 0.0:
        # A frame is right-handed, so the last axis points the other way, and so do its angles.
        axes[2] = -axes[2]
        ranges[2] = [-ranges[2][1] + 0.0, -ranges[2][0] + 0.0]
    return np.array(axes).T, np.array(ranges)
