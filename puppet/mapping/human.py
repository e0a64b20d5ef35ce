"""The performer as an armature: the 17-bone graph with an ordinary adult's measures, and its limbs.

What is compared with it is compared as one armature with another, so every block of the mapping
takes two.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from puppet.armature import Armature
from puppet.mapping.preferences import LimbName
from puppet.mapping.stance import UPRIGHT
from puppet.skeleton import HUMAN_BONE_NAMES, HUMAN_BONES, HUMAN_PARENTS


def _human() -> Armature:
    starts = np.array([UPRIGHT[bone.start] for bone in HUMAN_BONES])
    ends = np.array([UPRIGHT[bone.end] for bone in HUMAN_BONES])
    carried = np.array([starts[parent] if parent >= 0 else np.zeros(3) for parent in HUMAN_PARENTS])
    # A tracker of points sees the direction of a bone, which is two degrees of freedom; only the
    # pelvis also has a line across. It is the one penalty that figure A.1 prints.
    free = np.array([[True, True, name == "pelvis"] for name in HUMAN_BONE_NAMES])
    return Armature.build(
        "human",
        HUMAN_BONE_NAMES,
        HUMAN_PARENTS,
        starts - carried,
        tips=ends - starts,
        lower=np.where(free, -np.inf, 0.0),
        upper=np.where(free, np.inf, 0.0),
    )


HUMAN: Final = _human()


@dataclass(frozen=True, slots=True)
class HumanLimb:
    """A limb of the performer.

    bones: human bones from the body outwards. tip: the last one; under IK its end is the control
    point. playable: those that a puppeteer moves well by themselves, from the body outwards.
    alone: the place in `playable` of the one that drives a single bone: the forearm before the
        upper arm, and both before the shoulder (section 3.7).
    """

    name: LimbName
    side: str
    bones: tuple[int, ...]
    playable: tuple[int, ...]
    alone: int

    @property
    def tip(self) -> int:
        """The human bone whose end is the control point."""
        return self.bones[-1]

    @property
    def is_arm(self) -> bool:
        """Whether it is played with a hand."""
        return self.name.startswith("arm")

    @property
    def is_leg(self) -> bool:
        """Whether the performer stands on it."""
        return self.name.startswith("leg")


def _limbs() -> tuple[HumanLimb, ...]:
    index = HUMAN_BONE_NAMES.index
    head = (index("head"),)
    limbs = [HumanLimb("head", "", head, head, 0)]
    names: tuple[LimbName, ...] = ("arm.R", "arm.L", "leg.R", "leg.L")
    for name in names:
        kind, side = name.split(".")
        words = ("upper_arm", "forearm", "hand") if kind == "arm" else ("thigh", "shin", "foot")
        playable = tuple(index(f"{word}.{side}") for word in words)
        bones = (index(f"shoulder.{side}"), *playable) if kind == "arm" else playable
        limbs.append(HumanLimb(name, side, bones, playable, 1 if kind == "arm" else 0))
    return tuple(limbs)


#: Head, right arm, left arm, right leg, left leg.
HUMAN_LIMBS: Final = _limbs()
LIMB_NAMES: Final[tuple[str, ...]] = tuple(limb.name for limb in HUMAN_LIMBS)
#: What says a whole limb and nothing else; "head" is a human bone and a control point too.
WHOLE_LIMBS: Final = tuple(name for name in LIMB_NAMES if name not in HUMAN_BONE_NAMES)
#: The column of each human bone's limb; pelvis and chest have none.
LIMB_OF_BONE: Final = {bone: i for i, limb in enumerate(HUMAN_LIMBS) for bone in limb.bones}
#: The names of the control points, in the order of the limbs whose tips they are.
CONTROL_POINTS: Final = tuple(HUMAN_BONE_NAMES[limb.tip] for limb in HUMAN_LIMBS)
SPINE: Final = tuple(HUMAN_BONE_NAMES.index(name) for name in ("pelvis", "chest", "head"))
