"""The show: sources, puppets and outputs, as strict TOML.

Unknown keys and wrong types are errors that name the file and the path inside it. Paths are
relative to the show's own file. Lengths are metres, times seconds, angles degrees (for people).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Final, Literal

import msgspec

from puppet.errors import BadShowError
from puppet.oak_config import OakConfig

Triple = tuple[float, float, float]
#: How many people one camera can follow.
MOST_PERFORMERS: Final = 4


class ZoneConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A rectangle on the floor, metres in the stage frame: from and to, along x and along z."""

    x: tuple[float, float]
    z: tuple[float, float]


class PartConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A part that one performer plays at a time; its puppets follow them.

    rule: who takes it while it is free: whoever is nearest to the stage's origin (the camera, until
        it is calibrated), stands in the zone, was the first to raise a hand, or whom the operator
        names.
    zone: with any rule but the operator's, only who stands here may take it; with rule "zone" who
        leaves it loses the part, too.
    release_after: seconds that its performer may be away before it is free again.
    """

    name: str = "lead"
    rule: Literal["nearest", "zone", "raised-hand", "operator"] = "nearest"
    zone: ZoneConfig | None = None
    release_after: float = 3.0


class TrackingConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How people are looked for in pictures. Takes and the rehearsal have been through that.

    performers: how many are followed at most, 1 to 4. seated: only the upper body counts.
    second_look: whoever is alone is looked at twice, also in the mirror: steadier and more often
        right, at the cost of a second core.
    """

    performers: int = 4
    seated: bool = False
    second_look: bool = True


class SourceConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where skeletons come from.

    path: a take, a video file, a raw recording, ``webcam:0``, ``oak:`` or ``rehearsal``.
    name: what tells several cameras of one show apart; it may stay empty if there is one.
    oak: what an OAK camera does on the device itself.
    remote: its tracker is started on another machine, with ``puppet track SHOW --camera NAME``.
    repeat: what a recording does at its end. speed: of a recording; 1 is as it was recorded.
    max_rate: of a recording, at most so many frames a second are used; for slow machines.
    """

    path: str
    repeat: Literal["loop", "ping-pong", "once"] = "loop"
    speed: float = 1.0
    max_rate: float | None = None
    name: str = ""
    remote: bool = False
    oak: OakConfig = OakConfig()


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
    part: whoever plays it drives the puppet; the show's first part if it is empty.
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
    part: str = ""


class KinectConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Holt's smoothing by the names of the Kinect SDK 1.x, which counts in frames of 1/30 s.

    preset: one of the three that its documentation proposes; what is said beside it counts more.
    smoothing: share of the old that is kept from frame to frame. correction: share of the new that
        the trend takes on. prediction: frames that it looks ahead.
    jitter_radius: metres within which a joint is steadied more. max_deviation_radius: metres from
        where a joint is seen that it may be shown at most.
    """

    preset: Literal["gestures", "menus", "smoothest"] = "gestures"
    smoothing: float | None = None
    correction: float | None = None
    prediction: float | None = None
    jitter_radius: float | None = None
    max_deviation_radius: float | None = None


class HoltConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The same by half-lives, seconds: level, of the place; trend, of the velocity."""

    level: float = 0.04
    trend: float = 0.04
    jitter_radius: float = 0.05
    max_deviation_radius: float = 0.04


class ConditioningConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Knobs of conditioning; half-lives and times in seconds, but where it says otherwise.

    filter: One Euro, or Holt's double exponential, which has its knobs in `kinect` or in `holt`.
    smoothing: half-life of a joint at rest. quickness: how much sooner a fast joint is followed:
        at 1 m/s its half-life is divided by 1 + quickness. tips: how many times slower the short
        bones of hands and feet are followed. All three of One Euro.
    inferred: how many times slower an inferred joint is followed.
    prediction: how far ahead of what is seen joints are shown, and prediction_limit, metres, how
        far from it at most.
    hold: how long a lost joint keeps its place before its influence fades.
    fade: half-life of the fading. regain: half-life of taking over again.
    """

    filter: Literal["one-euro", "holt"] = "one-euro"
    smoothing: float = 0.08
    quickness: float = 6.0
    tips: float = 2.5
    inferred: float = 4.0
    prediction: float = 0.0
    prediction_limit: float = 0.1
    hold: float = 0.5
    fade: float = 0.45
    regain: float = 0.25
    kinect: KinectConfig | None = None
    holt: HoltConfig | None = None


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

    source: where skeletons come from; sources: the same for several cameras at once. A show has
        one of the two.
    parts: who drives whom; a show without has one part, which whoever is nearest plays.
    mirror: whether puppets move as a mirror image of the performer.
    mappings: the file where decisions are kept; None is beside the show, with ``.mappings.toml``.
    """

    name: str
    puppets: tuple[PuppetConfig, ...]
    source: SourceConfig | None = None
    sources: tuple[SourceConfig, ...] = ()
    parts: tuple[PartConfig, ...] = ()
    mirror: bool = False
    tracking: TrackingConfig = TrackingConfig()
    conditioning: ConditioningConfig = ConditioningConfig()
    bus: BusConfig = BusConfig()
    view: ViewConfig = ViewConfig()
    mappings: str | None = None

    @property
    def all_sources(self) -> tuple[SourceConfig, ...]:
        """The one source, or the several."""
        return self.sources if self.source is None else (self.source,)

    def source_named(self, camera: str | None) -> SourceConfig:
        """The source of that name; None for the first. Raises BadShowError if there is none."""
        if camera is None:
            return self.all_sources[0]
        for source in self.sources:
            if source.name == camera:
                return source
        raise BadShowError(
            "the show has no such source",
            where=self.name,
            expected=", ".join(source.name for source in self.sources) or "no name: it has but one",
            found=camera,
        )

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
    _check_sources(show, fail)
    _check_parts(show, fail)
    if not 1 <= show.tracking.performers <= MOST_PERFORMERS:
        most = f"must be from 1 to {MOST_PERFORMERS}"
        fail("tracking.performers", most, show.tracking.performers)
    _check_conditioning(show.conditioning, fail)
    for key in ("width", "height"):
        if not 16 <= getattr(show.view, key) <= 8192:
            fail(f"view.{key}", "must be from 16 to 8192 pixels", getattr(show.view, key))


def _check_conditioning(
    conditioning: ConditioningConfig, fail: Callable[[str, str, object], None]
) -> None:
    tables = [key for key in ("kinect", "holt") if getattr(conditioning, key) is not None]
    if len(tables) > 1:
        what = "Holt's knobs are the Kinect's names or half-lives, not both"
        fail("conditioning", what, "[conditioning.kinect] and [conditioning.holt]")
    if tables and conditioning.filter != "holt":
        what = f'[conditioning.{tables[0]}] needs filter = "holt"'
        fail("conditioning.filter", what, conditioning.filter)
    for place, struct in (
        ("conditioning", conditioning),
        ("conditioning.kinect", conditioning.kinect),
        ("conditioning.holt", conditioning.holt),
    ):
        for key in getattr(struct, "__struct_fields__", ()):
            value = getattr(struct, key)
            if isinstance(value, int | float) and not (math.isfinite(value) and value >= 0.0):
                fail(f"{place}.{key}", "must be 0 or more", value)
    kinect = conditioning.kinect or KinectConfig()
    if (kinect.smoothing or 0.0) > 0.99:
        fail("conditioning.kinect.smoothing", "must be from 0 to 0.99", kinect.smoothing)
    if (kinect.correction or 0.0) > 1.0:
        fail("conditioning.kinect.correction", "must be from 0 to 1", kinect.correction)


def _check_sources(show: Show, fail: Callable[[str, str, object], None]) -> None:
    if (show.source is None) == (not show.sources):
        found = "neither" if show.source is None else "both"
        fail("source", "a show has one [source], or several [[sources]]", found)
    names = [source.name for source in show.all_sources]
    for index, source in enumerate(show.all_sources):
        place = "source" if show.source is not None else f"sources[{index}]"
        if show.sources and not re.fullmatch(r"[a-z0-9][a-z0-9-]*", source.name):
            what = "one of several sources needs a name of small letters, digits and -"
            fail(f"{place}.name", what, repr(source.name))
        if source.name in names[:index]:
            fail(f"{place}.name", "two sources have the same name", source.name)
        if not 0.0 < source.speed <= 100.0:
            fail(f"{place}.speed", "the speed must be above 0 and at most 100", source.speed)
        rate = source.max_rate
        if rate is not None and not 1.0 <= rate <= 1000.0:
            fail(f"{place}.max_rate", "the rate must be from 1 to 1000 frames a second", rate)


def _check_parts(show: Show, fail: Callable[[str, str, object], None]) -> None:
    names = [part.name for part in show.parts]
    for index, part in enumerate(show.parts):
        place = f"parts[{index}]"
        if not part.name or part.name in names[:index]:
            fail(f"{place}.name", "each part needs a name of its own", repr(part.name))
        if not 0.0 <= part.release_after < math.inf:
            fail(f"{place}.release_after", "must be 0 or more seconds", part.release_after)
        if part.rule == "zone" and part.zone is None:
            fail(f"{place}.zone", "this rule needs a zone", "none")
        for axis in ("x", "z"):
            low, high = getattr(part.zone, axis, (0.0, 1.0))
            if not low < high:
                fail(f"{place}.zone.{axis}", "must go from less to more", [low, high])
    known = names or [PartConfig().name]
    for index, puppet in enumerate(show.puppets):
        if puppet.part and puppet.part not in known:
            what = f"the show has no such part (there are: {', '.join(known)})"
            fail(f"puppets[{index}].part", what, puppet.part)
