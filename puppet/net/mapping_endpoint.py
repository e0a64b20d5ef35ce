"""The mapping service on the bus: each request to its key, each answer back.

Answers are given on the bus's own threads; the frames that arrive meanwhile are posed as before.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any, TypeVar

from puppet.errors import PuppetError
from puppet.mapping.proposal import Proposal, pair_json
from puppet.mapping.service import MappingService
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
    Refusal,
    SaveRequest,
    UndoRequest,
)
from puppet.net.messages import Decoder, Message, encode

R = TypeVar("R", bound=Message)


def answer_mapping(bus: Bus, service: MappingService) -> None:
    """Answer everything that `mapping_messages` lists, for as long as the bus is open."""

    def serve(kind: type[R], reply: Callable[[R], dict[str, Any]]) -> None:
        decode = Decoder(kind)
        tag = kind.__struct_config__.tag

        def answer(data: bytes) -> bytes:
            try:
                return encode(MappingAnswer(result=reply(decode(data))))
            except PuppetError as error:
                return encode(MappingAnswer(refusal=Refusal.of(error)))
            except Exception as error:  # whoever asked must not wait for an answer in vain
                traceback.print_exc()
                found = f"{type(error).__name__}: {error}"
                refusal = Refusal("the mapping service failed", f"mapping/{tag}", found=found)
                return encode(MappingAnswer(refusal=refusal))

        bus.answer(f"mapping/{tag}", answer)

    serve(ListRequest, lambda _: {"puppets": [_card(service, name) for name in service.names]})
    serve(ProposeRequest, lambda r: _proposals(service.propose(r.puppet, r.mode, r.k)))
    serve(DecideRequest, lambda r: _proposals([service.decide(r.puppet, r.decisions, r.who)]))
    serve(UndoRequest, lambda r: _proposals([service.undo(r.puppet)]))
    serve(RedoRequest, lambda r: _proposals([service.redo(r.puppet)]))
    serve(ExplainRequest, lambda r: _explanation(service, r))
    serve(HistoryRequest, lambda r: _history(service, r.puppet))
    serve(SaveRequest, lambda _: {"path": str(service.save())})
    serve(LoadRequest, lambda _: {"warnings": list(service.load())})


def _card(service: MappingService, name: str) -> dict[str, Any]:
    current = service.current(name)
    return {
        "name": name,
        "armature": current.armature.name,
        "mode": current.mode,
        "pairs": len(current.pairs),
        "doubtful": sum(pair.certainty == "doubtful" for pair in current.pairs),
        "unmapped": list(current.unmapped),
        "warnings": list(service.warnings(name)),
    }


def _proposals(proposals: list[Proposal]) -> dict[str, Any]:
    return {"proposals": [proposal.as_json(explain=True) for proposal in proposals]}


def _explanation(service: MappingService, request: ExplainRequest) -> dict[str, Any]:
    pair, proposal = service.explained(request.puppet, request.bone, request.mode)
    return {"pair": pair and pair_json(pair, proposal, explain=True)}


def _history(service: MappingService, puppet: str) -> dict[str, Any]:
    history = service.history(puppet)
    return {"steps": list(history.steps), "holds": history.holds}
