"""Who plays which part: what is asked of the stage over the bus, and what it answers."""

from __future__ import annotations

from typing import Literal

import msgspec

from puppet.net.mapping_messages import Refusal
from puppet.net.messages import Message


class PartsRequest(Message, tag="parts", frozen=True, kw_only=True):
    """Asked on ``parts``; answered by a `PartsAnswer`, with the state after what was asked.

    act: "list" changes nothing; "assign" gives `part` to `performer` whatever its rule says;
    "release" takes it away, and its puppets rest until another performer takes it; "reopen" lets
    the rule choose again among everybody.
    """

    act: Literal["list", "assign", "release", "reopen"] = "list"
    part: str = ""
    performer: int = 0


class PartNow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A part: who plays it, and which puppets follow. performer: None while it is free."""

    name: str
    rule: str
    performer: int | None
    puppets: tuple[str, ...]


class PartsAnswer(Message, tag="parts-now", frozen=True, kw_only=True):
    """performers: who is before the camera. refusal: why what was asked was not done."""

    parts: tuple[PartNow, ...] = ()
    performers: tuple[int, ...] = ()
    refusal: Refusal | None = None
