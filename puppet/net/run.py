"""`puppet run`: starts the processes of one show, watches over them, and ends them together."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import psutil

from puppet.errors import PuppetError, UnavailableError
from puppet.net.bus import Bus
from puppet.net.messages import Decoder, HealthMessage
from puppet.net.track import track_role
from puppet.show import Show

#: A process that stops by itself is started again after pauses that grow from the first to the
#: last of these, seconds; one that lived longer than STEADY starts anew at the first.
PAUSES: Final = (0.5, 1.0, 2.0, 5.0, 10.0)
STEADY: Final = 20.0
#: Seconds that a process gets to end by itself before it is killed.
GRACE: Final = 5.0
#: The first start compiles kernels and may take a while on a slow machine.
START_LIMIT: Final = 180.0
#: The environment variable by which a process knows whom it must not outlive.
SUPERVISOR: Final = "PUPPET_SUPERVISOR"
#: Exit code of a command that has told a person what is wrong: starting it again will not help.
TOLD: Final = 2
MEGABYTE: Final = 1024 * 1024
#: Samples of memory, one a second, until a process counts as started.
EARLY: Final = 11
#: The order in which processes are ended.
_LEAVING: Final = ("view", "track", "stage")


@dataclass
class Child:
    """One process of the show: `puppet ROLE …`."""

    role: str
    arguments: Sequence[str]
    process: subprocess.Popen[bytes] | None = None
    started: float = 0.0
    failures: int = 0
    restart_at: float | None = None
    rss_mb: list[float] = field(default_factory=list)

    def start(self) -> None:
        """Start it, away from the terminal's Ctrl-C: the supervisor ends it in order."""
        self.started = time.monotonic()
        self.restart_at = None
        self.process = subprocess.Popen(
            [sys.executable, "-m", "puppet", self.role, *self.arguments],
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            env={**os.environ, SUPERVISOR: str(os.getpid())},
        )

    def sample_memory(self) -> None:
        """Note how much memory it holds."""
        if self.process is not None and self.process.poll() is None:
            try:
                megabytes = psutil.Process(self.process.pid).memory_info().rss / MEGABYTE
                # After start-up, and now: shows run for weeks.
                self.rss_mb = [*self.rss_mb[:EARLY], megabytes]
            except psutil.Error:
                return

    def stop(self) -> None:
        """Ask it to end, and kill it if it does not."""
        if self.process is None or self.process.poll() is not None:
            return
        self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(GRACE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


class Supervisor:
    """Starts `puppet stage`, `track` and `view` for a show file and keeps them alive.

    say: called with lines for people. arguments: more arguments for each role.
    """

    def __init__(
        self,
        show_path: Path,
        show: Show,
        arguments: dict[str, Sequence[str]],
        say: Callable[[str], None],
    ) -> None:
        self.show = show
        self._say = say
        self.children = {
            role: Child(role, (str(show_path), *arguments.get(role, ())))
            for role in ("stage", "view")
        }
        for source in show.all_sources:
            if not source.remote:
                camera = ("--camera", source.name) if show.sources else ()
                self.children[track_role(source.name if show.sources else "")] = Child(
                    "track", (str(show_path), *arguments.get("track", ()), *camera)
                )
        self._health: dict[str, HealthMessage] = {}
        self._past: dict[str, Counter[str]] = {}
        self._decode = Decoder(HealthMessage)
        self._bus: Bus | None = None
        self._first_drawn: float | None = None
        self._drawn_before = 0
        self._stopped: float | None = None

    def run(
        self,
        stop: threading.Event,
        seconds: float | None = None,
        tell: Callable[[], None] | None = None,
    ) -> int:
        """Until `stop`, a closed window, or `seconds` after the first picture. -> exit code."""
        self.children["stage"].start()
        threading.Thread(target=self._join_bus, daemon=True).start()
        for role, child in self.children.items():
            if role != "stage":
                child.start()
        began = time.monotonic()
        next_sample = began
        code = 0
        try:
            while not stop.wait(0.1):
                now = time.monotonic()
                ended = self._watch(now)
                if ended is not None:
                    code = ended
                    break
                if now >= next_sample:
                    next_sample = now + 1.0
                    if self.has_drawn:
                        for child in self.children.values():
                            child.sample_memory()
                    if tell is not None:
                        tell()
                if self._first_drawn is None:
                    if now - began > START_LIMIT:
                        raise UnavailableError(
                            "the show has not drawn a picture",
                            expected=f"the first picture within {START_LIMIT:.0f} s",
                            found=self._states(),
                        )
                elif seconds is not None and now - self._first_drawn >= seconds:
                    break
        finally:
            self._stopped = time.monotonic()
            self._stop_all()
        return code

    @property
    def has_drawn(self) -> bool:
        """Whether there was a picture yet."""
        return self._first_drawn is not None

    def report(self) -> dict[str, Any]:
        """What happened, in the form that ``--report`` writes."""
        drawn = self._count("view", "frames_drawn")
        view = self._health.get("view")
        gauges = view.gauges if view else {}
        end = self._stopped or time.monotonic()
        elapsed = end - self._first_drawn if self._first_drawn is not None else 0.0
        return {
            "frames_in": self._count("stage", "frames_in"),
            "frames_posed": self._count("stage", "frames_posed"),
            "frames_drawn": drawn,
            "dropped": self._count("stage", "dropped"),
            "latency_ms": {
                "p50": round(gauges.get("latency_p50_ms", 0.0), 2),
                "p99": round(gauges.get("latency_p99_ms", 0.0), 2),
            },
            "fps": round((drawn - self._drawn_before) / elapsed, 2) if elapsed > 0 else 0.0,
            "rss_mb": {
                role: round(child.rss_mb[-1], 1) if child.rss_mb else 0.0
                for role, child in sorted(self.children.items())
            },
            "rss_mb_early": {
                # After start-up, so that growth can be seen.
                role: round(child.rss_mb[min(EARLY - 1, len(child.rss_mb) - 1)], 1)
                if child.rss_mb
                else 0.0
                for role, child in sorted(self.children.items())
            },
            "tracking_ms": {
                role: {
                    gauge.removesuffix("_ms"): round(value, 2)
                    for gauge, value in sorted(health.gauges.items())
                }
                for role, health in sorted(self._health.items())
                if role.startswith("track") and health.gauges
            },
            "seconds": round(elapsed, 2),
            "puppets": [puppet.name for puppet in self.show.puppets],
        }

    def _count(self, role: str, counter: str) -> int:
        """A counter over all processes that have had a role."""
        now = self._health.get(role)
        past = self._past.get(role, Counter())
        return past[counter] + (now.counters.get(counter, 0) if now else 0)

    def status_line(self) -> str:
        """One line for people."""
        report = self.report()
        if self._first_drawn is None:
            return f"starting: {self._states()}"
        stage = self._health.get("stage")
        state = stage.state if stage else "starting"
        for role, health in self._health.items():
            if role.startswith("track") and health.state == "trouble":
                state = health.note
        return (
            f"{report['frames_in']} frames in · {report['frames_drawn']} drawn · "
            f"{report['fps']:.0f} fps · latency {report['latency_ms']['p50']:.0f} ms "
            f"(p99 {report['latency_ms']['p99']:.0f}) · {state}"
        )

    def _join_bus(self) -> None:
        try:
            bus = Bus.join(self.show.bus.endpoint, self.show.key)
        except Exception as error:  # the show goes on without figures
            self._say(f"no figures from the bus: {error}")
            return
        self._bus = bus
        bus.listen("health/*", self._hear)

    def _hear(self, data: bytes) -> None:
        try:
            health = self._decode(data)
        except PuppetError:
            return
        before = self._health.get(health.role)
        if before is not None and before.pid != health.pid:  # it was started again
            self._past.setdefault(health.role, Counter()).update(before.counters)
        self._tell_trouble(before, health)
        self._health[health.role] = health
        if (
            health.role == "view"
            and self._first_drawn is None
            and health.counters.get("frames_drawn")
        ):
            self._drawn_before = health.counters["frames_drawn"]
            self._first_drawn = time.monotonic()
            self._say("the show is on")

    def _tell_trouble(self, before: HealthMessage | None, now: HealthMessage) -> None:
        """A camera that is lost or found again is told once, for those who read the log later."""
        was = before is not None and before.state == "trouble"
        if now.state == "trouble" and not was:
            self._say(f"{now.role}: {now.note}")
        elif was and now.state == "running":
            self._say(f"{now.role}: all is well again")

    def _states(self) -> str:
        known = (f"{role} {self._health[role].state}" for role in sorted(self._health))
        return ", ".join(known) or "nothing has answered yet"

    def _watch(self, now: float) -> int | None:
        """Restart what died. Returns the exit code if the show is over."""
        for role, child in self.children.items():
            if child.restart_at is not None:
                if now >= child.restart_at:
                    self._say(f"starting {role} again")
                    child.start()
                continue
            code = child.process.poll() if child.process is not None else None
            if code is None:
                continue
            if child.role == "view" and code == 0:
                return 0  # its window was closed
            if child.role == "track" and code == 0:
                child.process = None  # a recording that is not repeated has ended
                continue
            if code == TOLD and not self.has_drawn:
                return TOLD  # it has told a person what is wrong; later, the show goes on
            if now - child.started > STEADY:
                child.failures = 0
            pause = PAUSES[min(child.failures, len(PAUSES) - 1)]
            child.failures += 1
            child.restart_at = now + pause
            self._say(f"{role} has stopped (exit code {code}); again in {pause:g} s")
        return None

    def _stop_all(self) -> None:
        # The viewer first, or its last picture would show a stage that the tracker has left; the
        # stage last: it is the hub over which the others give their final figures.
        for role in sorted(self.children, key=lambda role: _LEAVING.index(role.split(".")[0])):
            if role == "stage":
                time.sleep(0.1)
            self.children[role].stop()
        time.sleep(0.1)
        if self._bus is not None:
            self._bus.close()


def write_report(report: dict[str, Any], path: Path) -> None:
    """Write the report as JSON, whole or not at all."""
    temporary = path.with_name(path.name + ".part")
    try:
        temporary.write_text(json.dumps(report, indent=2) + "\n")
        temporary.replace(path)
    except OSError as error:
        raise PuppetError(
            "the report cannot be written", where=path, found=error.strerror or str(error)
        ) from None
