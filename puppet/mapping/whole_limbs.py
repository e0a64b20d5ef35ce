"""Decisions about whole limbs: what they are about, in terms of bones and control points."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from puppet.armature import Armature
from puppet.errors import BadDecisionError
from puppet.mapping.anatomy import anatomy, limb_rows
from puppet.mapping.decisions import Decision
from puppet.mapping.human import (
    CONTROL_POINTS,
    HUMAN_LIMBS,
    LIMB_NAMES,
    WHOLE_LIMBS,
    HumanLimb,
)
from puppet.skeleton import HUMAN_BONE_NAMES


def said_of(
    decision: Decision, armature: Armature, masters: Mapping[str, tuple[str, ...]]
) -> Decision:
    """A decision about a whole limb, said of what stands for the limb.

    Under FK that is its first bone, whichever bone of it was named; under IK the effector at its
    end, or the master that holds it, and the control point. Others are returned as they are.

    Raises BadDecisionError for a bone that belongs to no limb.
    """
    if decision.human not in LIMB_NAMES:
        return decision
    if decision.mode == "fk":
        if decision.human not in WHOLE_LIMBS:
            return decision
        first = first_of_limb(armature, decision.bone)
        if first is None:
            raise _no_limb(decision)
        return msgspec.structs.replace(decision, bone=first)
    point = CONTROL_POINTS[LIMB_NAMES.index(decision.human)]
    bone = decision.bone
    if decision.human in WHOLE_LIMBS and bone in armature.names:
        limbs = anatomy(armature).limbs
        row = limb_rows(armature, limbs).get(armature.index(bone))
        if row is None:
            raise _no_limb(decision)
        tip = armature.names[limbs[row].bones[-1]]
        bone = next((name for name, effectors in masters.items() if tip in effectors), tip)
    return msgspec.structs.replace(decision, bone=bone, human=point)


def first_of_limb(armature: Armature, bone: str) -> str | None:
    """The first bone of the limb that FK drives and `bone` belongs to; None for the trunk."""
    limbs = anatomy(armature).pieces
    row = limb_rows(armature, limbs).get(armature.index(bone)) if bone in armature.names else None
    return None if row is None else armature.names[limbs[row].bones[0]]


def inside(decision: Decision, armature: Armature) -> tuple[set[str], set[str]]:
    """All bones and partners that a decision is about, with the limbs that they belong to."""
    if decision.mode == "ik":
        return {decision.bone}, {decision.human}
    limb = next(
        (
            limb
            for limb in HUMAN_LIMBS
            if decision.human == limb.name or decision.human in bones_of(limb)
        ),
        None,
    )
    if decision.human in WHOLE_LIMBS and limb is not None:
        limbs = anatomy(armature).pieces
        rows = limb_rows(armature, limbs)
        row = rows[armature.index(decision.bone)]
        bones = {armature.names[bone] for bone, its in rows.items() if its == row}
        return bones, {limb.name, *bones_of(limb)}
    first = first_of_limb(armature, decision.bone)
    return {decision.bone, first or decision.bone}, {decision.human, limb.name if limb else ""}


def _no_limb(decision: Decision) -> BadDecisionError:
    return BadDecisionError(
        "this bone belongs to the trunk, and no limb drives it whole",
        where=decision.bone,
        found=decision.sentence(),
        hint="give it a bone of the performer: pelvis, chest, head …",
    )


def bones_of(limb: HumanLimb) -> set[str]:
    """The names of a limb's bones."""
    return {HUMAN_BONE_NAMES[bone] for bone in limb.bones}
