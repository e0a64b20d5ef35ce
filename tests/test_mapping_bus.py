"""The mapping service over a real bus: every request is answered, and a bad one ends nothing."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import pytest

from puppet.errors import BadDecisionError, BadMessageError, UnavailableError
from puppet.formats.armature_toml import load_puppet
from puppet.mapping.decisions import Decision
from puppet.mapping.proposal import Mode, Proposal
from puppet.mapping.service import MappingService, Rig
from puppet.net import mapping_messages
from puppet.net.bus import Bus
from puppet.net.mapping_client import MappingClient
from puppet.net.mapping_endpoint import answer_mapping
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
from puppet.net.messages import VERSION, Decoder, Message, encode
from tests.shows import ARMATURES

PAIR_KEYS = {
    "bone", "human", "score", "confidence", "certainty", "margin", "reasons", "runners_up"
}  # fmt: skip
REQUESTS = (
    ListRequest(),
    ProposeRequest(puppet="fish"),
    DecideRequest(puppet="fish", decisions=(Decision("lock", "fk", "fin.R", "hand.L"),)),
    UndoRequest(puppet="fish"),
    RedoRequest(puppet="fish"),
    ExplainRequest(puppet="fish", bone="fin.R"),
    HistoryRequest(puppet="fish"),
    SaveRequest(),
    LoadRequest(),
)


@cache
def rig(name: str) -> Rig:
    return Rig(load_puppet(ARMATURES / f"{name}.glb").model.armature)


def lock(bone: str, human: str, mode: Mode = "fk") -> Decision:
    return Decision("lock", mode, bone, human)


def partners(answer: dict[str, Any]) -> dict[str, str]:
    return {pair["bone"]: pair["human"] for pair in answer["pairs"]}


@dataclass
class Served:
    """A service on a bus of its own, and somebody else on that bus."""

    service: MappingService
    endpoint: str
    guest: Bus
    client: MappingClient
    path: Path

    def ask(self, key: str, data: bytes) -> MappingAnswer:
        """What comes back for these bytes, which need not be a request at all."""
        reply = self.guest.ask(f"mapping/{key}", data, timeout=10.0)
        assert reply is not None, "nobody answered"
        return Decoder(MappingAnswer)(reply)


@pytest.fixture(scope="module")
def bus(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One bus for all tests of this file: to open one takes half a second."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    path = tmp_path_factory.mktemp("served") / "show.mappings.toml"
    service = MappingService({"fish": rig("fish"), "lamp": rig("lamp")}, path=path)
    with Bus.host(endpoint, "show") as hub:
        answer_mapping(hub, service)
        with Bus.join(endpoint, "show", wait=10.0) as guest:
            yield Served(service, endpoint, guest, MappingClient(guest, 10.0), path)


@pytest.fixture
def served(bus: Served) -> Served:
    """A service for which nothing has been decided."""
    bus.service.on_change = None
    bus.path.unlink(missing_ok=True)
    bus.service.load()
    return bus


def test_every_request_that_is_described_is_answered(served: Served) -> None:
    described = {
        kind
        for kind in vars(mapping_messages).values()
        if isinstance(kind, type)
        and issubclass(kind, Message)
        and kind.__name__.endswith("Request")
    }
    assert {type(request) for request in REQUESTS} == described
    wanted = [
        {"puppets"}, {"proposals"}, {"proposals"}, {"proposals"}, {"proposals"},
        {"pair"}, {"steps", "holds"}, {"path"}, {"warnings"},
    ]  # fmt: skip
    for request, keys in zip(REQUESTS, wanted, strict=True):
        answer = served.ask(str(request.__struct_config__.tag), encode(request))
        assert answer.refusal is None, request
        assert set(answer.result) == keys, request


def test_the_client_sees_what_the_service_says(served: Served) -> None:
    client, service = served.client, served.service
    assert client.puppets() == [
        {
            "name": name,
            "armature": name,
            "mode": "fk",
            "pairs": len(service.current(name).pairs),
            "doubtful": sum(p.certainty == "doubtful" for p in service.current(name).pairs),
            "unmapped": list(service.current(name).unmapped),
            "warnings": [],
        }
        for name in ("fish", "lamp")
    ]
    proposed = client.propose("fish", "ik", 3)
    assert proposed == [one.as_json(explain=True) for one in service.propose("fish", "ik", 3)]
    decided = client.decide("fish", [lock("fin.R", "hand.L")], "Ann")
    assert partners(decided)["fin.R"] == "hand.L"
    assert decided == service.current("fish").as_json(explain=True)
    pair = client.explain("fish", "fin.R")
    assert pair is not None
    assert set(pair) == {*PAIR_KEYS, "decided"}
    assert (pair["human"], pair["decided"]) == ("hand.L", "lock")
    assert client.explain("fish", service.current("fish").unmapped[0]) is None
    assert client.history("fish") == {"steps": ["lock fin.R = hand.L (Ann)"], "holds": 1}
    assert partners(client.undo("fish"))["fin.R"] == "upper_arm.R"
    assert client.history("fish")["holds"] == 0
    assert client.redo("fish") == decided
    assert client.save() == str(served.path)
    served.path.write_text(served.path.read_text().replace('"hand.L"', '"forearm.L"'))
    assert client.load() == []
    assert partners(client.propose("fish")[0])["fin.R"] == "forearm.L"


def test_two_clients_see_the_same_state(served: Served) -> None:
    with Bus.join(served.endpoint, "show", wait=10.0) as other:
        second = MappingClient(other, 10.0)
        decided = served.client.decide("lamp", [lock("shade", "hand.L")], "one")
        assert second.propose("lamp")[0] == decided
        second.decide("lamp", [Decision("mode", "ik")], "two")
        for client in (served.client, second):
            assert client.puppets()[1]["mode"] == "ik"
            assert client.history("lamp")["steps"] == [
                "lock shade = hand.L (one)",
                "drive it by IK (two)",
            ]
        assert served.client.undo("lamp") == decided
        assert second.propose("lamp")[0] == decided


def test_when_the_answer_comes_the_decision_is_told_and_on_the_disk(served: Served) -> None:
    heard: list[tuple[str, Proposal]] = []
    served.service.on_change = lambda puppet, proposal: heard.append((puppet, proposal))
    for number in range(1, 4):
        served.client.decide("fish", [lock("fin.R", "hand.L")])
        assert len(heard) == number
        again = MappingService({"fish": rig("fish")}, path=served.path)
        assert again.history("fish").holds == number


@pytest.mark.parametrize(
    ("request_", "refusal"),
    [
        (UndoRequest(puppet="dog"),
         Refusal("there is no such puppet on stage", None, "one of fish, lamp", "dog")),
        (DecideRequest(puppet="lamp", decisions=(lock("shode", "hand.L"),)),
         Refusal("there is no such bone", "lamp",
                 "one of base, lower_arm, elbow, upper_arm, shade", "shode")),
        (ExplainRequest(puppet="lamp", bone="shode"),
         Refusal("there is no such bone", "lamp",
                 "one of base, lower_arm, elbow, upper_arm, shade", "shode")),
        (DecideRequest(puppet="lamp", decisions=(lock("base", "head"), lock("base", "chest"))),
         Refusal("a bone cannot be locked to two things at once", "base", None, "head and chest")),
        (DecideRequest(puppet="lamp", decisions=(lock("base", "head"), lock("shade", "head"))),
         Refusal("head drives another bone already", "lock shade = head", None, "lock base = head",
                 "clear base first, or set shade by hand: then both follow it")),
        (DecideRequest(puppet="lamp", decisions=()),
         Refusal("nothing was decided", "lamp")),
        (ProposeRequest(puppet="lamp", k=0),
         Refusal("so many proposals cannot be made", "k", "1 to 50", "0")),
        (UndoRequest(puppet="lamp"), Refusal("there is nothing to undo", "lamp")),
        (RedoRequest(puppet="lamp"), Refusal("there is nothing to redo", "lamp")),
    ],
)  # fmt: skip
def test_what_is_not_possible_is_refused_with_all_that_helps(
    served: Served, request_: Message, refusal: Refusal
) -> None:
    before = served.client.propose("lamp")
    answer = served.ask(str(request_.__struct_config__.tag), encode(request_))
    assert answer.refusal == refusal
    assert answer.result == {}
    assert served.client.propose("lamp") == before
    assert served.client.history("lamp")["steps"] == []


def test_a_refusal_arrives_as_an_error_that_says_everything(served: Served) -> None:
    served.client.decide("lamp", [lock("base", "head")])
    with pytest.raises(BadDecisionError) as caught:
        served.client.decide("lamp", [lock("shade", "head")])
    error = caught.value
    assert (error.what, error.where) == ("head drives another bone already", "lock shade = head")
    assert error.found == "lock base = head"
    assert "clear base first" in str(error.hint)


def _raw(**fields: object) -> bytes:
    return msgspec.msgpack.encode({"type": "decide", "version": VERSION, **fields})


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "cannot be understood"),
        (b"\x00\xff garbage", "cannot be understood"),
        (b"\x91" * 5000, ""),  # nested deeper than anything that is meant
        (bytes(range(256)) * 40, "cannot be understood"),
        (encode(UndoRequest(puppet="fish")), "cannot be understood"),
        (encode(DecideRequest(version=99, puppet="fish", decisions=())), "of another version"),
        (_raw(version=99, shape="new"), "of another version"),
        (_raw(puppet="fish"), "cannot be understood"),
        (_raw(puppet=3, decisions=[]), "cannot be understood"),
        (_raw(puppet="fish", decisions=[{"act": "glue", "mode": "fk"}]), "cannot be understood"),
        (_raw(puppet="fish", decisions=[], colour=1), "cannot be understood"),
    ],
)
def test_what_is_no_request_is_refused_and_the_service_goes_on(
    served: Served, data: bytes, says: str
) -> None:
    answer = served.ask("decide", data)
    assert answer.refusal is not None
    assert says in answer.refusal.what
    assert answer.refusal.where
    assert answer.refusal.found
    if "version" in says:
        assert (answer.refusal.expected, answer.refusal.found) == (str(VERSION), "99")
        assert answer.refusal.hint
    decided = served.client.decide("fish", [lock("fin.R", "hand.L")])
    assert partners(decided)["fin.R"] == "hand.L"


def test_a_failure_inside_is_answered_too(
    served: Served, capfd: pytest.CaptureFixture[str]
) -> None:
    """Whoever asked must not wait in vain, and whoever runs the stage must see what failed."""

    def fail(_puppet: str, _proposal: Proposal) -> None:
        raise ZeroDivisionError("on purpose")

    served.service.on_change = fail
    with pytest.raises(BadDecisionError, match="the mapping service failed") as caught:
        served.client.decide("fish", [lock("fin.R", "hand.L")])
    assert caught.value.found == "ZeroDivisionError: on purpose"
    assert "ZeroDivisionError: on purpose" in capfd.readouterr().err
    served.service.on_change = None
    assert len(served.client.puppets()) == 2


def test_an_answer_of_another_version_is_told(free_port: int) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    with Bus.host(endpoint, "show") as hub:
        hub.answer("mapping/list", lambda _: encode(MappingAnswer(version=VERSION + 1)))
        with (
            Bus.join(endpoint, "show", wait=10.0) as guest,
            pytest.raises(BadMessageError, match="of another version"),
        ):
            MappingClient(guest).puppets()


def test_without_a_stage_it_is_told_in_time(free_port: int) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    started = time.monotonic()
    with pytest.raises(UnavailableError, match="no show is running") as caught:
        Bus.join(endpoint, "show", wait=0.5)
    assert (caught.value.where, caught.value.hint) == (
        endpoint,
        "start it first: puppet run SHOW",
    )
    with (
        Bus.host(endpoint, "another show"),
        Bus.join(endpoint, "show", wait=10.0) as guest,
        pytest.raises(UnavailableError, match="no stage answers") as silent,
    ):
        MappingClient(guest, 1.0).puppets()
    assert "may still be starting" in str(silent.value.hint)
    assert time.monotonic() - started < 30.0


def test_a_stage_that_hangs_is_not_waited_for_without_end(free_port: int) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"

    def hang(_request: bytes) -> bytes:
        time.sleep(2.0)
        return b""

    with Bus.host(endpoint, "show") as hub:
        hub.answer("mapping/list", hang)
        with (
            Bus.join(endpoint, "show", wait=10.0) as guest,
            pytest.raises(UnavailableError, match="no stage answers"),
        ):
            MappingClient(guest, 0.5).puppets()
