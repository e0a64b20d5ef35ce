"""What the operator said: one act on a pair, a limb, a master or the mode.

What is decided in one go is a step of a `Ledger` (`ledger.py`), which knows undo and redo. What
holds after its steps are the `Verdicts` (`verdicts.py`), and nothing else does a mapping builder
look at.

A pair's partner may be a human bone or a control point (``hand.R``), or for a whole limb one of the
performer's limbs (``arm.R``): then it is about the limb that the bone belongs to.
"""

from __future__ import annotations

from typing import Final, Literal

import msgspec

from puppet.mapping.human import CONTROL_POINTS
from puppet.mapping.proposal import Mode
from puppet.skeleton import HUMAN_BONE_NAMES

#: accept: the proposal was right. lock: keep it, whatever else changes. set: by hand, and the human
#: bone may drive others too. reject: it was wrong. forbid: never. clear: nothing was said of it.
#: mode: be driven by FK or IK. group, ungroup: make a master of effectors, or take it apart.
Act = Literal["accept", "lock", "set", "reject", "forbid", "clear", "mode", "group", "ungroup"]
KEEPS: Final = frozenset({"accept", "lock", "set"})
BANS: Final = frozenset({"reject", "forbid"})


class Decision(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """One act of the operator.

    act: see `Act`. mode: which mapping a pair belongs to; for the act "mode", the new one.
    bone: a bone, effector or master. human: its partner; "" with clear means all of the bone's.
    effectors: of a new master. who, when: for the history; ISO 8601.
    """

    act: Act
    mode: Mode
    bone: str = ""
    human: str = ""
    effectors: tuple[str, ...] = ()
    who: str = ""
    when: str = ""

    def sentence(self) -> str:
        """For people."""
        if self.act == "mode":
            return f"drive it by {self.mode.upper()}"
        if self.act == "group":
            return f"join {', '.join(self.effectors)} under the master {self.bone}"
        if self.act == "ungroup":
            return f"take the master {self.bone} apart"
        if self.act == "clear":
            return f"clear what was said of {self.bone}" + (self.human and f" and {self.human}")
        return f"{self.act} {self.bone} = {self.human}"


def partners_of(mode: Mode) -> tuple[str, ...]:
    """What can drive something: 17 human bones, or 5 control points."""
    return HUMAN_BONE_NAMES if mode == "fk" else CONTROL_POINTS
