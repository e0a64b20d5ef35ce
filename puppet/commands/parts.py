"""`puppet parts`: who drives whom in a running show."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec
from rich.console import Console
from rich.table import Table

from puppet.errors import BadDecisionError
from puppet.net.bus import Bus
from puppet.net.part_endpoint import ask_parts
from puppet.net.part_messages import PartsAnswer, PartsRequest
from puppet.show import BusConfig, load_show

#: Seconds to wait for a show that should be running.
PATIENCE = 3.0


def parts_live(
    path: Path,
    part: str | None,
    port: int | None,
    *,
    give: int | None,
    release: bool,
    reopen: bool,
) -> None:
    """List the parts, after one of them was changed if that was asked."""
    show = load_show(path)
    if port is not None:
        show = msgspec.structs.replace(show, bus=BusConfig(endpoint=f"tcp/127.0.0.1:{port}"))
    request = _request(part, give, release, reopen)
    with Bus.join(show.bus.endpoint, show.key, PATIENCE) as bus:
        _print(ask_parts(bus, request))


def _request(part: str | None, give: int | None, release: bool, reopen: bool) -> PartsRequest:
    asked = [give is not None, release, reopen]
    if not any(asked):
        return PartsRequest()
    if sum(asked) > 1 or part is None:
        raise BadDecisionError(
            "one thing at a time, for one part",
            expected="puppet parts SHOW PART --give N, or --release, or --reopen",
            found="no part" if part is None else "several options",
        )
    act: Literal["assign", "release", "reopen"] = "release" if release else "reopen"
    if give is not None:
        act = "assign"
    return PartsRequest(act=act, part=part, performer=give or 0)


def _print(now: PartsAnswer) -> None:
    table = Table("part", "rule", "performer", "puppets")
    for part in now.parts:
        performer = "free" if part.performer is None else str(part.performer)
        table.add_row(part.name, part.rule, performer, ", ".join(part.puppets))
    console = Console()
    console.print(table)
    there = ", ".join(map(str, now.performers)) or "nobody"
    console.print(f"before the camera: {there}")
