"""What is asked of the mapping service over the bus, and what it answers.

Each request goes to the key ``mapping/`` and its own name, as a MessagePack `Message`, and is
answered there by a `MappingAnswer`: with a result, or with a refusal that says what was wrong.
docs/mapping-service.md shows them for other programs.
"""

from __future__ import annotations

from typing import Any

import msgspec

from puppet.errors import PuppetError
from puppet.mapping.decisions import Decision
from puppet.mapping.proposal import Mode
from puppet.net.messages import Message


class ListRequest(Message, tag="list", frozen=True, kw_only=True):
    """Which puppets there are and what drives them: ``{"puppets": [{"name", "mode", …}]}``."""


class ProposeRequest(Message, tag="propose", frozen=True, kw_only=True):
    """The k best mappings around what was decided: ``{"proposals": […]}``, best first.

    mode: None for the one that the puppet is driven by.
    """

    puppet: str
    mode: Mode | None = None
    k: int = 1


class DecideRequest(Message, tag="decide", frozen=True, kw_only=True):
    """Decisions, taken together or not at all: ``{"proposals": [what follows]}``.

    When the answer comes they are on the disk and the stage is on its way to the new mapping.
    who: for the history.
    """

    puppet: str
    decisions: tuple[Decision, ...]
    who: str = ""


class UndoRequest(Message, tag="undo", frozen=True, kw_only=True):
    """Take back the last step: ``{"proposals": [what follows]}``."""

    puppet: str


class RedoRequest(Message, tag="redo", frozen=True, kw_only=True):
    """Bring back what was undone last: ``{"proposals": [what follows]}``."""

    puppet: str


class ExplainRequest(Message, tag="explain", frozen=True, kw_only=True):
    """Why a bone, effector or master has its partner: ``{"pair": {…} or null}``."""

    puppet: str
    bone: str
    mode: Mode | None = None


class HistoryRequest(Message, tag="history", frozen=True, kw_only=True):
    """What was decided: ``{"steps": [sentences], "holds": how many of them}``."""

    puppet: str


class SaveRequest(Message, tag="save", frozen=True, kw_only=True):
    """Write the mapping file once more: ``{"path": …}``. Every decision has done so already."""


class LoadRequest(Message, tag="load", frozen=True, kw_only=True):
    """Read the mapping file anew, after somebody edited it: ``{"warnings": […]}``."""


class Refusal(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Why something was not done; fields as in `PuppetError`."""

    what: str
    where: str | None = None
    expected: str | None = None
    found: str | None = None
    hint: str | None = None

    @classmethod
    def of(cls, error: PuppetError) -> Refusal:
        """The error as it travels."""
        return cls(error.what, error.where, error.expected, error.found, error.hint)


class MappingAnswer(Message, tag="mapping", frozen=True, kw_only=True):
    """Either a result, as the request's description says, or a refusal; then nothing changed."""

    result: dict[str, Any] = msgspec.field(default_factory=dict)
    refusal: Refusal | None = None
