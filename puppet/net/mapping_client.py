"""Asking the mapping service of a running show."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from puppet.errors import BadDecisionError, UnavailableError
from puppet.mapping.decisions import Decision
from puppet.mapping.proposal import Mode
from puppet.net.bus import Bus
from puppet.net.mapping_messages import (
    DecideRequest,
    ExplainRequest,
    HistoryRequest,
    ListRequest,
    LoadRequest,
    MappingAnswer,
    ProposeRequest,
    RedoRequest,
    SaveRequest,
    UndoRequest,
)
from puppet.net.messages import Decoder, Message, encode


class MappingClient:
    """Each method asks and waits. What the service refuses is raised as BadDecisionError, and that
    nobody answers as UnavailableError. Results are as `mapping_messages` says."""

    def __init__(self, bus: Bus, timeout: float = 5.0) -> None:
        self._bus = bus
        self._timeout = timeout
        self._decode = Decoder(MappingAnswer)

    def puppets(self) -> list[dict[str, Any]]:
        """The puppets on stage."""
        cards: list[dict[str, Any]] = self._ask(ListRequest())["puppets"]
        return cards

    def propose(self, puppet: str, mode: Mode | None = None, k: int = 1) -> list[dict[str, Any]]:
        """The k best mappings, best first."""
        return self._proposals(ProposeRequest(puppet=puppet, mode=mode, k=k))

    def decide(self, puppet: str, decisions: Iterable[Decision], who: str = "") -> dict[str, Any]:
        """Decide, and get the mapping that follows."""
        request = DecideRequest(puppet=puppet, decisions=tuple(decisions), who=who)
        return self._proposals(request)[0]

    def undo(self, puppet: str) -> dict[str, Any]:
        """Take the last step back, and get the mapping that follows."""
        return self._proposals(UndoRequest(puppet=puppet))[0]

    def redo(self, puppet: str) -> dict[str, Any]:
        """Bring it back, and get the mapping that follows."""
        return self._proposals(RedoRequest(puppet=puppet))[0]

    def explain(self, puppet: str, bone: str, mode: Mode | None = None) -> dict[str, Any] | None:
        """The pair of a bone, or None."""
        pair: dict[str, Any] | None = self._ask(
            ExplainRequest(puppet=puppet, bone=bone, mode=mode)
        )["pair"]
        return pair

    def history(self, puppet: str) -> dict[str, Any]:
        """What was decided."""
        return self._ask(HistoryRequest(puppet=puppet))

    def save(self) -> str:
        """Write the mapping file; where it is."""
        return str(self._ask(SaveRequest())["path"])

    def load(self) -> list[str]:
        """Read the mapping file anew; warnings."""
        warnings: list[str] = self._ask(LoadRequest())["warnings"]
        return warnings

    def _proposals(self, request: Message) -> list[dict[str, Any]]:
        proposals: list[dict[str, Any]] = self._ask(request)["proposals"]
        return proposals

    def _ask(self, request: Message) -> dict[str, Any]:
        tag = request.__struct_config__.tag
        reply = self._bus.ask(f"mapping/{tag}", encode(request), self._timeout)
        if reply is None:
            raise UnavailableError(
                "no stage answers",
                where=f"mapping/{tag}",
                hint="the show may still be starting, and the first start compiles for up to a "
                "minute: try again then. Or it is another show that runs there",
            )
        answer = self._decode(reply)
        if answer.refusal is not None:
            no = answer.refusal
            raise BadDecisionError(
                no.what, where=no.where, expected=no.expected, found=no.found, hint=no.hint
            )
        return answer.result
