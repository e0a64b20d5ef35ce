"""What a puppeteer would rather have (Sanna 2015, section 3.7)."""

from __future__ import annotations

from typing import Literal

import msgspec

#: The parts of the performer that drive a puppet, as people name them.
LimbName = Literal["head", "arm.R", "arm.L", "leg.R", "leg.L"]


class Preferences(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Wishes that the mapping follows where the shape of the armature leaves a choice.

    leave_out: limbs of the performer that are not to be used.
    hand: the hand that leads, where an armature has no sides.
    shoulders: whether shoulders may drive a bone; they hardly move by themselves.
    leftovers: whether bones that got no partner get one of the human bones that are left over;
        else they follow their parents.
    """

    leave_out: tuple[LimbName, ...] = ()
    hand: Literal["R", "L"] = "R"
    shoulders: bool = False
    leftovers: bool = False
