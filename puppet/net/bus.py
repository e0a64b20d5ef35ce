"""The bus: Zenoh, with the few patterns that a show needs.

The stage is the hub: it opens a Zenoh router inside its own process, on the loopback address unless
the show says otherwise, and everything else connects to it as a client and keeps trying until it is
there. So any process may be started, killed and replaced in any order. Multicast is off.

Newest wins: a subscription keeps the last message only, and whoever is late reads that.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self, cast

import zenoh

from puppet.errors import BadShowError, UnavailableError

#: Milliseconds after which a peer that has gone silent counts as gone.
LEASE_MS = 2000


class Latest:
    """A box for the newest message of each key."""

    def __init__(self) -> None:
        self._arrived = threading.Condition()
        self._data: dict[str, bytes] = {}

    def put(self, data: bytes, key: str = "") -> None:
        """Replace what is in the box under that key."""
        with self._arrived:
            self._data[key] = data
            self._arrived.notify()

    def take(self, timeout: float | None = None) -> bytes | None:
        """Wait up to `timeout` seconds (None: forever) and take out one message, of the key that
        has waited longest; None if nothing came."""
        with self._arrived:
            if not self._data:
                self._arrived.wait(timeout)
            return self._data.pop(next(iter(self._data))) if self._data else None


class Bus:
    """One process's connection. Keys are relative to the show."""

    def __init__(self, session: zenoh.Session, prefix: str) -> None:
        self._session = session
        self._prefix = prefix
        self._kept: list[Any] = []  # declarations live as long as somebody holds them

    @classmethod
    def host(cls, endpoint: str, show: str) -> Bus:
        """Open the hub. Raises UnavailableError if its address cannot be listened on."""
        config = _config(endpoint, "router")
        config.insert_json5("listen/endpoints", json.dumps([endpoint]))
        try:
            return cls(zenoh.open(config), f"puppet/{show}")
        except zenoh.ZError as error:
            taken = "in use" in str(error)
            raise UnavailableError(
                "the bus cannot listen on its address",
                where=endpoint,
                found="the port is in use" if taken else str(error).split(" at /")[0],
                hint="another show may be running: stop it, or set another bus.endpoint in the "
                "show (or --port)",
            ) from None

    @classmethod
    def join(cls, endpoint: str, show: str, wait: float | None = None) -> Bus:
        """Connect to the hub; waits until there is one, at most `wait` seconds.

        Raises UnavailableError if there is none by then.
        """
        config = _config(endpoint, "client")
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        config.insert_json5("connect/timeout_ms", "-1" if wait is None else str(int(1000 * wait)))
        config.insert_json5("connect/exit_on_failure", "false" if wait is None else "true")
        config.insert_json5(
            "connect/retry",
            "{period_init_ms: 100, period_max_ms: 1000, period_increase_factor: 1.5}",
        )
        try:
            return cls(zenoh.open(config), f"puppet/{show}")
        except zenoh.ZError as error:
            raise UnavailableError(
                "no show is running there",
                where=endpoint,
                found=str(error).split(" at /")[0],
                hint="start it first: puppet run SHOW",
            ) from None

    def publisher(self, key: str) -> Callable[[bytes], None]:
        """A function that publishes on `key`, at once and without ever waiting for a reader."""
        publisher = self._session.declare_publisher(
            f"{self._prefix}/{key}",
            express=True,
            congestion_control=zenoh.CongestionControl.DROP,
        )
        self._kept.append(publisher)
        return cast("Callable[[bytes], None]", publisher.put)

    def latest(self, key: str) -> Latest:
        """The newest message on `key`; where that has a wildcard (``*``), of each key it names."""
        box = Latest()

        def put(sample: zenoh.Sample) -> None:
            box.put(bytes(sample.payload), str(sample.key_expr))

        self._kept.append(self._session.declare_subscriber(f"{self._prefix}/{key}", put))
        return box

    def listen(self, key: str, handler: Callable[[bytes], None]) -> None:
        """Call `handler` for every message on `key`, on the bus's own thread."""
        self._kept.append(
            self._session.declare_subscriber(
                f"{self._prefix}/{key}", lambda sample: handler(bytes(sample.payload))
            )
        )

    def answer(self, key: str, reply: Callable[[bytes], bytes]) -> None:
        """Answer requests on `key`, on the bus's own thread."""

        def handle(query: zenoh.Query) -> None:
            payload = b"" if query.payload is None else bytes(query.payload)
            query.reply(query.key_expr, reply(payload))

        self._kept.append(self._session.declare_queryable(f"{self._prefix}/{key}", handle))

    def ask(self, key: str, payload: bytes = b"", timeout: float = 2.0) -> bytes | None:
        """Ask on `key`; None if nobody answers in `timeout` seconds."""
        for reply in self._session.get(f"{self._prefix}/{key}", payload=payload, timeout=timeout):
            if reply.ok is not None:
                return bytes(reply.ok.payload)
        return None

    def be_present(self, role: str, name: str) -> None:
        """Show that this process is alive, until it closes, dies or hangs."""
        token = self._session.liveliness().declare_token(f"{self._prefix}/alive/{role}/{name}")
        self._kept.append(token)

    def watch_presence(self, handler: Callable[[str, str, bool], None]) -> None:
        """Call `handler(role, name, alive)` for whoever is there, comes or goes."""

        def handle(sample: zenoh.Sample) -> None:
            role, name = str(sample.key_expr).split("/")[-2:]
            handler(role, name, sample.kind == zenoh.SampleKind.PUT)

        self._kept.append(
            self._session.liveliness().declare_subscriber(
                f"{self._prefix}/alive/**", handle, history=True
            )
        )

    def close(self) -> None:
        """Leave the bus. May be called twice."""
        self._kept.clear()
        if not self._session.is_closed():
            self._session.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _config(endpoint: str, mode: str) -> zenoh.Config:
    protocol, _, address = endpoint.partition("/")
    if protocol not in ("tcp", "tls", "quic", "unixsock-stream") or not address:
        raise BadShowError(
            "this is not an address of the bus",
            where="bus.endpoint",
            expected="PROTOCOL/HOST:PORT, as tcp/127.0.0.1:7447",
            found=endpoint,
        )
    config = zenoh.Config()
    config.insert_json5("mode", json.dumps(mode))
    config.insert_json5("listen/endpoints", "[]")
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("scouting/gossip/enabled", "false")
    config.insert_json5("transport/link/tx/lease", str(LEASE_MS))
    return config
