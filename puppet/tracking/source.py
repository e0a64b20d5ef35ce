"""What every source is: an iterable of moments with a description of itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from puppet.skeleton import Moment

#: The plane ``normal · p + distance = 0`` in the stage frame, normal pointing up: (nx, ny, nz, d).
Plane = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """What a source says of itself; a take keeps it as metadata.

    name: for people, "webcam:0", "cam01.mp4". kind: "video", "webcam", "kinect1-csv", "rehearsal".
    rate: nominal moments a second. synthetic: no person was there. live: they come in real time
    and cannot be asked for again. floor: the floor plane, where it is known. note: one line.
    """

    name: str
    kind: str
    rate: float
    synthetic: bool = False
    live: bool = False
    floor: Plane | None = None
    note: str = ""
    licence: str = ""


class Source(Protocol):
    """Moments in capture order. A live source blocks until its next one; others never wait."""

    @property
    def info(self) -> SourceInfo: ...

    @property
    def trouble(self) -> str:
        """What keeps it from giving moments now, as a sentence for people; empty if all is well."""
        ...

    def __len__(self) -> int:
        """How many moments there are; 0 if that cannot be known."""
        ...

    def __iter__(self) -> Iterator[Moment]: ...

    def close(self) -> None:
        """Let go of the device or file. May be called twice."""
        ...


@runtime_checkable
class Watchful(Protocol):
    """A source that looks for people itself, and can say how that goes.

    milliseconds: what each stage takes, by name. events: how often each kind of thing happened.
    """

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was wrong so far and could be lived with."""
        ...

    @property
    def lens(self) -> tuple[float, float, float] | None:
        """Where the lens is on the calibrated stage, metres; None if that is not known."""
        ...

    @property
    def has_depth(self) -> bool:
        """Whether its camera measures depth."""
        ...

    @property
    def floor(self) -> str:
        """What tells where the floor is, for people: "depth", "feet", "a saved calibration"."""
        ...

    @property
    def milliseconds(self) -> Mapping[str, float]: ...

    @property
    def events(self) -> Mapping[str, int]: ...
