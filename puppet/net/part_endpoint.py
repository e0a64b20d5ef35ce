"""Who plays which part, on the bus: requests answered, and asked.

What is asked is done between two frames, on the stage's own thread; the answer tells what is then.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue

from puppet.errors import BadDecisionError, PuppetError, UnavailableError
from puppet.line import Line
from puppet.net.bus import Bus
from puppet.net.mapping_messages import Refusal
from puppet.net.messages import Decoder, encode
from puppet.net.part_messages import PartNow, PartsAnswer, PartsRequest

#: Seconds within which the stage gets round to it, or something is badly wrong.
PATIENCE = 2.0


class PartEndpoint:
    """Answers `PartsRequest`s for a line that belongs to another thread."""

    def __init__(self, bus: Bus, line: Line) -> None:
        self._line = line
        self._waiting: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._decode = Decoder(PartsRequest)
        bus.answer("parts", self._answer)

    def take_over(self) -> bool:
        """Do what was asked since the last call; on the line's thread. True if there was any."""
        done = False
        while True:
            try:
                self._waiting.get_nowait()()
            except Empty:
                return done
            done = True

    def _answer(self, data: bytes) -> bytes:
        answers: list[PartsAnswer] = []
        finished = threading.Event()
        try:
            request = self._decode(data)
        except PuppetError as error:
            return encode(PartsAnswer(refusal=Refusal.of(error)))

        def do() -> None:
            answers.append(self._do(request))
            finished.set()

        self._waiting.put(do)
        if not finished.wait(PATIENCE):
            return encode(PartsAnswer(refusal=Refusal("the stage is stuck", "parts")))
        return encode(answers[0])

    def _do(self, request: PartsRequest) -> PartsAnswer:
        parts = self._line.parts
        refusal = None
        try:
            if request.act == "assign":
                parts.assign(request.part, request.performer)
            elif request.act == "release":
                parts.release(request.part)
            elif request.act == "reopen":
                parts.reopen(request.part)
        except PuppetError as error:
            refusal = Refusal.of(error)
        now = tuple(
            PartNow(config.name, config.rule, holder, self._line.puppets_of(config.name))
            for config, holder in zip(parts.configs, parts.holders.values(), strict=True)
        )
        return PartsAnswer(parts=now, performers=parts.there, refusal=refusal)


def ask_parts(bus: Bus, request: PartsRequest, timeout: float = 5.0) -> PartsAnswer:
    """Ask a running stage. Raises BadDecisionError for what it refuses, UnavailableError if nobody
    answers."""
    reply = bus.ask("parts", encode(request), timeout)
    if reply is None:
        raise UnavailableError(
            "no stage answers", where="parts", hint="the show may still be starting: try again then"
        )
    answer = Decoder(PartsAnswer)(reply)
    if answer.refusal is not None:
        no = answer.refusal
        raise BadDecisionError(
            no.what, where=no.where, expected=no.expected, found=no.found, hint=no.hint
        )
    return answer
