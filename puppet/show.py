"""The show: sources, puppets and outputs, as strict TOML.

Unknown keys and wrong types are errors that name the file and the path inside it. Paths are
relative to the show's own file. Lengths are metres, times seconds, angles degrees (for people).
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Literal

import msgspec

from puppet.errors import BadShowError

Triple = tuple[float, float, float]


class SourceConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where skeletons come from.

    path: a take, a video file, ``webcam:0`` or ``rehearsal``.
    repeat: what a recording does at its end. speed: of a recording; 1 is as it was recorded.
    max_rate: of a recording, at most so many frames a second are used; for slow machines.
    """

    path: str
    repeat: Literal["loop", "ping-pong", "once"] = "loop"
    speed: float = 1.0
    max_rate: float | None = None


class PuppetConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One puppet on stage.

    armature: its model, or the ``.toml`` that names one. mode: how it is driven, bone to bone (fk)
        or by its end effectors (ik), until somebody decides otherwise. position, yaw: where it
        stands.
    follow: how far it goes along with the performer. Three numbers, (left, up, forward), hold as
        they are. One number holds for all directions; but a puppet that stands on legs that IK
        moves goes up and down as far as its legs bend. None is 0.3, or as far as its steps go
        if it stands on such legs. What stands on the floor without legs that bend never
        goes down.
    reach: multiplies how far IK lets its end effectors go.
    turn: how much of the performer's turning on the spot it takes over.
    height: how tall it is made, whatever the size of the model; None leaves it as modelled.
    """

    name: str
    armature: str
    mode: Literal["fk", "ik"] = "fk"
    position: Triple = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    follow: float | Triple | None = None
    turn: float = 1.0
    height: float | None = None
    reach: float = 1.0


class ConditioningConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Knobs of conditioning; every one of them a half-life or a time in seconds.

    smoothing: half-life of a joint at rest. quickness: how much sooner a fast joint is followed:
        at 1 m/s its half-life is divided by 1 + quickness.
    inferred: how many times slower an inferred joint is followed.
    hold: how long a lost joint keeps its place before its influence fades.
    fade: half-life of the fading. regain: half-life of taking over again.
    tips: how many times slower the short bones of hands and feet are followed.
    """

    smoothing: float = 0.08
    quickness: float = 6.0
    inferred: float = 4.0
    hold: float = 0.5
    fade: float = 0.35
    regain: float = 0.12
    tips: float = 2.5


class BusConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where the processes meet: the address on which the stage listens."""

    endpoint: str = "tcp/127.0.0.1:7447"


class ViewConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The picture. performer: where the performer's skeleton stands in it; absent, it is hidden."""

    width: int = 1280
    height: int = 720
    performer: Triple | None = None
    show_pairs: bool = True


class Show(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A whole show, as one file says it.

    mappings: the file where decisions are kept; None is beside the show, with ``.mappings.toml``.
    """

    name: str
    source: SourceConfig
    puppets: tuple[PuppetConfig, ...]
    conditioning: ConditioningConfig = ConditioningConfig()
    bus: BusConfig = BusConfig()
    view: ViewConfig = ViewConfig()
    mappings: str | None = None

    @property
    def key(self) -> str:
        """The show's name as a part of keys on the bus."""
        return re.sub(r"[^a-z0-9]+", "-", self.name.lower()).strip("-") or "show"


def load_show(path: Path) -> Show:
    """Read and check a show.

    Raises BadShowError for a file that is missing, is not TOML, has an unknown key, a wrong type or
    a value that is not possible.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise BadShowError(
            "the show cannot be opened",
            where=path,
            found=error.strerror or str(error),
            hint="configs/shows holds shows to start from",
        ) from None
    try:
        show = msgspec.toml.decode(text, type=Show)
    except msgspec.ValidationError as error:
        what, _, place = str(error).partition(" - at ")
        raise BadShowError(
            what[:1].lower() + what[1:],
            where=f"{path}: {place.strip('`').removeprefix('$').lstrip('.') or 'the whole file'}",
            hint="docs/formats.md lists the keys of a show",
        ) from None
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise BadShowError("this is not TOML", where=path, found=str(error)) from None
    _check(show, path)
    return show


def _check(show: Show, path: Path) -> None:
    def fail(place: str, what: str, found: object) -> None:
        raise BadShowError(what, where=f"{path}: {place}", found=str(found))

    if not show.puppets:
        fail("puppets", "a show needs at least one puppet", "none")
    names = [puppet.name for puppet in show.puppets]
    for index, puppet in enumerate(show.puppets):
        if not puppet.name:
            fail(f"puppets[{index}].name", "a puppet needs a name", repr(puppet.name))
        if puppet.name in names[:index]:
            fail(f"puppets[{index}].name", "two puppets have the same name", puppet.name)
        follow = puppet.follow if isinstance(puppet.follow, tuple) else (puppet.follow or 0.0,)
        for key, numbers in (
            ("position", puppet.position),
            ("yaw", (puppet.yaw,)),
            ("follow", follow),
            ("turn", (puppet.turn,)),
            ("reach", (puppet.reach,)),
            ("height", () if puppet.height is None else (puppet.height,)),
        ):
            if not all(map(math.isfinite, numbers)):
                fail(f"puppets[{index}].{key}", "not a finite number", numbers)
        if puppet.height is not None and not 0.01 <= puppet.height <= 100.0:
            fail(f"puppets[{index}].height", "must be from 0.01 to 100 metres", puppet.height)
        if not 0.0 <= puppet.reach <= 100.0:
            fail(f"puppets[{index}].reach", "must be from 0 to 100", puppet.reach)
    if not 0.0 < show.source.speed <= 100.0:
        fail("source.speed", "the speed must be above 0 and at most 100", show.source.speed)
    rate = show.source.max_rate
    if rate is not None and not 1.0 <= rate <= 1000.0:
        fail("source.max_rate", "the rate must be from 1 to 1000 frames a second", rate)
    for key in show.conditioning.__struct_fields__:
        value = getattr(show.conditioning, key)
        if not (math.isfinite(value) and value >= 0.0):
            fail(f"conditioning.{key}", "must be 0 or more", value)
    for key in ("width", "height"):
        if not 16 <= getattr(show.view, key) <= 8192:
            fail(f"view.{key}", "must be from 16 to 8192 pixels", getattr(show.view, key))
