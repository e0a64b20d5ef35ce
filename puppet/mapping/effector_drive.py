"""IK drive: control points of the performer become goals for the puppet's end effectors.

What counts is how a control point has moved since the neutral stance. Its way is taken in two
parts, as the body makes it: what carries the limb (shoulders over hips) and the limb itself; each
is scaled by what the puppet has in its place, length to length, and added to where the effector
rests. Beyond reach the solver gives in softly.

Heads stay level and feet flat, where the chain can still bend without its last bone; wings, which
end at a side, bend to their tips. Feet stand: upwards they count from the floor, and along it they
go as far as the puppet itself goes, so that a planted foot stays planted while the body sways above
it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.mapping.anatomy import anatomy
from puppet.mapping.body_axis import body_axis
from puppet.mapping.human import HUMAN, HUMAN_LIMBS, HumanLimb
from puppet.mapping.placement import Placement
from puppet.mapping.proposal import Pair
from puppet.mapping.stance import UPRIGHT, Stance, heading_of, in_heading
from puppet.mapping.symmetry import sides_of
from puppet.pose import Goal, Intent, Pose
from puppet.skeleton import HUMAN_BONES, Joint, SkeletonFrame

#: The joint that each human limb hangs on, by the limb's name.
ANCHORS: Final = {
    "head": Joint.SHOULDER_CENTER,
    "arm.R": Joint.SHOULDER_RIGHT,
    "arm.L": Joint.SHOULDER_LEFT,
    "leg.R": Joint.HIP_RIGHT,
    "leg.L": Joint.HIP_LEFT,
}
#: A body that is large against its limbs, or the other way round, scales at most so much.
_MOST: Final = 6.0
#: A tip that rests lower than this share of the armature's size stands on the floor.
_NEAR_THE_FLOOR: Final = 0.06
#: So much a head scales at most, for our own hardly moves on its neck.
_NECK: Final = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class _Line:
    """From one control point to one end effector, worked out once.

    Metres of the puppet for each metre of the performer, along (left, up, forward):
    carried: (3, 3) of what carries the limb. limb: (3,) of the limb itself.
    steps: whether a foot drives what stands on the floor. lowest: metres that the effector's tip
    stays above the floor; -inf where there is none.
    turned: (4,) armature_from_bone, how the bone is to stay; None if it bends with the others.
    """

    bone: int
    rest: Floats
    anchor: Joint
    tip: Joint
    carried: Floats
    limb: Floats
    steps: bool
    lowest: float
    turned: Floats | None
    why: str


class EffectorDrive:
    """A `Mapping`: rest as the base pose, and a goal for every end effector that has a partner.

    Pure: the same frame gives the same intent. A control point that is lost loses its influence,
    and its effector goes home.
    """

    def __init__(
        self,
        armature: Armature,
        pairs: Iterable[Pair],
        neutral: Stance,
        placement: Placement | None = None,
        reach: float = 1.0,
    ) -> None:
        """`reach`: multiplies how far the effectors go.

        effectors: the bones with goals; oriented: those whose goals say how they are turned;
        held: bones that are not to bend.
        """
        self.armature = armature
        self.pairs = tuple(pairs)
        self.neutral = neutral
        self.reach = reach
        self.effectors = tuple(bone for pair in self.pairs for bone in pair.bones)
        self._asked = placement or Placement()
        self.placement = _stood(armature, self.pairs, self._asked, reach)
        self._lines = tuple(
            line for pair in self.pairs for line in _lines(armature, pair, self.placement, reach)
        )
        self.oriented = tuple(line.bone for line in self._lines if line.turned is not None)
        self.held = _pelvis(armature, self.pairs)

    def with_neutral(self, neutral: Stance) -> EffectorDrive:
        """The same mapping, counted from another neutral stance."""
        return EffectorDrive(self.armature, self.pairs, neutral, self._asked, self.reach)

    def __call__(self, frame: SkeletonFrame) -> Intent:
        neutral, place = self.neutral, self.placement
        heading = heading_of(frame.positions)
        joints = in_heading(frame.positions, frame.positions[Joint.HIP_CENTER], heading)
        gone = joints - neutral.joints
        risen = float(frame.positions[Joint.HIP_CENTER, 1] - neutral.hip[1])
        translation, rotation = place.root(frame, neutral, heading)
        sunk = float(place.moved(frame, neutral)[1])
        goals = []
        for line in self._lines:
            trust = float(min(frame.influence[line.anchor], frame.influence[line.tip]))
            if line.steps:
                way = line.limb * gone[line.tip]
                way[1] = line.limb[1] * (gone[line.tip, 1] + risen) - sunk
            else:
                way = line.carried @ gone[line.anchor]
                way = way + line.limb * (gone[line.tip] - gone[line.anchor])
            position = line.rest + way * trust
            # Where the floor is does not depend on how far the body has gone down.
            position[1] = max(position[1], line.lowest - sunk)
            goals.append(Goal(line.bone, position, line.turned, why=line.why))
        base = Pose(translation, rotation, self.armature.rotations)
        return Intent(base, tuple(goals))


def _stood(
    armature: Armature, pairs: Iterable[Pair], placement: Placement, reach: float
) -> Placement:
    """The placement of a puppet that may stand on legs of its own."""
    feet = [pair for pair in pairs if _limb(pair).is_leg]
    if not feet or not placement.grounded:
        return placement
    scale = float(np.mean([_leg_scale(armature, pair) for pair in feet])) * reach
    return placement.on_legs(
        scale, all(_folds(armature, bone) for pair in feet for bone in pair.bones)
    )


def _folds(armature: Armature, bone: int) -> bool:
    """Whether the leg that ends in `bone` can become shorter: two bones that bend above the foot.

    A foot lies on the floor. One bone above it is a stilt: a body that sinks would push the heel
    into the floor while the toes stay.
    """
    first, bending = _chain(armature, bone)[0], 0
    low = _NEAR_THE_FLOOR * armature.size
    while True:
        turns = armature.movements[bone] == "turn"
        bending += turns and bool(armature.rest[0][bone, 1] > low)
        if bone == first:
            return bending > 1
        bone = int(armature.parents[bone])


def _limb(pair: Pair) -> HumanLimb:
    """The limb whose tip is the pair's control point."""
    return next(limb for limb in HUMAN_LIMBS if limb.tip == pair.human)


def _lines(armature: Armature, pair: Pair, placement: Placement, reach: float) -> Iterable[_Line]:
    human = _limb(pair)
    anchor, tip = ANCHORS[human.name], HUMAN_BONES[human.tip].end
    sides = sides_of(armature)
    lying = _lying(armature)
    for bone in pair.bones:
        base, length = _chain(armature, bone)
        body = float(np.linalg.norm(armature.rest[0][base] - _body_start(armature, base)))
        carried = np.full(3, _scale(body, _human_body(anchor)) * reach)
        limb = np.full(3, _scale(length, _human_length(human)) * reach)
        if human.side and sides[bone] and sides[bone] != human.side:
            # A master on both sides: what goes outwards for one goes outwards for the other.
            carried[0], limb[0] = -carried[0], -limb[0]
        if human.name == "head":
            limb = np.minimum(limb, _NECK)
        rest = armature.rest_tips[bone]
        on_floor = placement.grounded and rest[1] < _NEAR_THE_FLOOR * armature.size
        steps = placement.grounded and human.is_leg
        if steps:
            limb[0], limb[2] = placement.along[0], placement.along[2]
        if on_floor:
            carried[:] = 0.0  # a foreleg stays where it stands while the body bends above it
        lowest = min(float(rest[1]), _NEAR_THE_FLOOR * armature.size)
        level = steps or not sides[bone]
        yield _Line(
            bone,
            rest,
            anchor,
            tip,
            carried[:, None] * lying,
            limb,
            steps,
            lowest if placement.grounded else -math.inf,
            armature.rest[1][bone] if level and _bends(armature, bone) else None,
            pair.partner,
        )


def _bends(armature: Armature, bone: int) -> bool:
    """Whether enough is left to bend if the last bone of a chain does not: two bones or more."""
    parent = int(armature.parents[bone])
    above = int(armature.parents[parent]) if parent >= 0 else -1
    return above >= 0 and int(armature.parents[above]) >= 0


def _pelvis(armature: Armature, pairs: Iterable[Pair]) -> tuple[int, ...]:
    """What carries the legs that feet move: it goes with the root and does not bend to reach."""
    legs = {pair.bone for pair in pairs if _limb(pair).is_leg}
    hubs = [limb.hub for limb in anatomy(armature).limbs if legs.intersection(limb.bones)]
    held: set[int] = set()
    for hub in hubs:
        bone = hub
        while bone >= 0:
            held.add(bone)
            bone = int(armature.parents[bone])
    return tuple(sorted(held))


def _lying(armature: Armature) -> Floats:
    """(3, 3) the turn from our upright body to the puppet's: what goes forward for us goes down for
    a body that lies along the ground."""
    axis = body_axis(armature, anatomy(armature))
    if axis is None:
        return np.eye(3)
    angle = math.atan2(max(float(axis[2]), 0.0), float(axis[1]))
    sine, cosine = math.sin(angle), math.cos(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])


def _leg_scale(armature: Armature, pair: Pair) -> float:
    lengths = [_chain(armature, bone)[1] for bone in pair.bones]
    return _scale(float(np.mean(lengths)), _human_length(_limb(pair)))


def _scale(ours: float, human: float) -> float:
    return min(ours / human, _MOST)


def _chain(armature: Armature, bone: int) -> tuple[int, float]:
    """The first bone of the chain that ends in `bone`, and metres from there to its tip."""
    shape = anatomy(armature)
    trunk = set(shape.trunk)
    first, length = bone, float(np.linalg.norm(armature.tips[bone]))
    while True:
        parent = int(armature.parents[first])
        # A root does not turn, so it is no part of what reaches.
        if parent < 0 or parent in trunk or armature.parents[parent] < 0:
            return first, length
        length += float(np.linalg.norm(armature.offsets[first]))
        first = parent


def _body_start(armature: Armature, base: int) -> Floats:
    """(3,) where the body begins that carries a limb: the first bone that has limbs on it."""
    hubs = {limb.hub for limb in anatomy(armature).limbs if not limb.is_twig}
    start = bone = base
    while armature.parents[bone] >= 0:
        bone = int(armature.parents[bone])
        if bone in hubs or start == base:
            start = bone
    return np.asarray(armature.rest[0][start])


def _human_length(limb: HumanLimb) -> float:
    """Metres along a limb of an ordinary adult, from its anchor to the control point.

    The performer's own length would be as good; but trackers' feet and hands jump, and lengths of
    limbs are much alike.
    """
    return float(sum(np.linalg.norm(HUMAN.tips[bone]) for bone in limb.playable))


def _human_body(anchor: Joint) -> float:
    """Metres from the hip centre to where a limb hangs."""
    return float(np.linalg.norm(np.subtract(UPRIGHT[anchor], UPRIGHT[Joint.HIP_CENTER])))
