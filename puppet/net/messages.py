"""Every message on the bus, in one place. MessagePack on the wire; arrays travel as bytes.

A change to any of these is a new VERSION; a process that meets another version says so and goes on
with what it understands. tests/test_messages.py fails when a layout changes without that.

Time stamps that end in ``_ns`` are the machine's monotonic clock: they compare across processes of
one machine, and only there.
"""

from __future__ import annotations

from typing import Any, Final, Generic, Literal, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from puppet.errors import BadMessageError
from puppet.kernel import Floats
from puppet.mapping.proposal import Mode
from puppet.pose import Pose
from puppet.skeleton import JOINT_COUNT, Moment, SkeletonFrame

VERSION: Final = 3

M = TypeVar("M", bound="Message")
EventKind = Literal["entered", "left", "took", "lost"]


class Message(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What every message begins with."""

    version: int = VERSION


class Skeleton(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One performer at one instant. positions: 20 × 3 float64. states: 20 × uint8."""

    performer: int
    positions: bytes
    states: bytes


class SkeletonMessage(Message, tag="skeleton", frozen=True, kw_only=True):
    """Tracker → stage: everybody whom one camera or recording sees at one instant.

    source: name for people. camera: which of the show's sources this is, by its name there.
    lens: where the camera's lens is on the calibrated stage, metres; None if it is not calibrated,
        and the stage then is the camera's own. depth: whether it measures depth.
    stream_ns: when the tracker started; a newer stream of the same camera replaces an older.
    sent_ns: when this was published.
    """

    source: str
    camera: str = ""
    lens: tuple[float, float, float] | None = None
    depth: bool = False
    synthetic: bool
    stream_ns: int
    sent_ns: int
    sequence: int
    time: float
    skeletons: tuple[Skeleton, ...]

    @classmethod
    def of(
        cls,
        moment: Moment,
        *,
        source: str,
        synthetic: bool,
        stream_ns: int,
        sent_ns: int,
        camera: str = "",
        lens: tuple[float, float, float] | None = None,
        depth: bool = False,
    ) -> SkeletonMessage:
        return cls(
            source=source,
            camera=camera,
            lens=lens,
            depth=depth,
            synthetic=synthetic,
            stream_ns=stream_ns,
            sent_ns=sent_ns,
            sequence=moment.sequence,
            time=moment.time,
            skeletons=tuple(
                Skeleton(
                    frame.performer,
                    np.ascontiguousarray(frame.positions, np.float64).tobytes(),
                    np.ascontiguousarray(frame.states, np.uint8).tobytes(),
                )
                for frame in moment.frames
            ),
        )

    def moment(self) -> Moment:
        """Raises BadMessageError for the wrong number of joints, values that are not finite, or a
        performer who is there twice."""
        frames = tuple(
            SkeletonFrame(
                self.time,
                self.sequence,
                skeleton.performer,
                _floats(skeleton.positions, (JOINT_COUNT, 3), "positions"),
                _states(skeleton.states),
            )
            for skeleton in self.skeletons
        )
        try:
            return Moment(self.time, self.sequence, frames)
        except ValueError as error:
            raise BadMessageError(
                "a message contradicts itself", where="message: skeletons", found=str(error)
            ) from None


class PuppetPose(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One puppet now. translation: 3 float64. rotation: 4. bones: B × 4, all as bytes."""

    name: str
    translation: bytes
    rotation: bytes
    bones: bytes

    @classmethod
    def of(cls, name: str, pose: Pose) -> PuppetPose:
        return cls(name, pose.translation.tobytes(), pose.rotation.tobytes(), pose.bones.tobytes())

    def pose(self) -> Pose:
        """Raises BadMessageError for arrays of the wrong size, or values that are not finite."""
        bones = _floats(self.bones, (-1, 4), "bones")
        return Pose(
            _floats(self.translation, (3,), "translation"),
            _floats(self.rotation, (4,), "rotation"),
            bones,
        )


class SceneMessage(Message, tag="scene", frozen=True, kw_only=True):
    """Stage → viewers: everything that is to be drawn now.

    frame_sent_ns: when the tracker published the frame this was made from; 0 if it was made
        without one, because none came. cast: revision of the cast that the poses belong to.
    mapping: counts the changes of any puppet's mapping.
    performers: everybody who is there or fading; the lead, whom pictures are composed about, first.
    """

    sequence: int
    time: float
    frame_sent_ns: int
    posed_ns: int
    cast: int
    mapping: int
    source: str
    synthetic: bool
    puppets: tuple[PuppetPose, ...]
    performers: tuple[PerformerNow, ...]


class PerformerNow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The conditioned skeleton, and the stance that puppets count from.

    parts: what they play. positions: 20 × 3 float64. states: 20 × uint8. influence: 20 float64.
    neutral_hip: metres. neutral_heading: radians. measured: whether the stance was really seen.
    """

    performer: int
    parts: tuple[str, ...]
    positions: bytes
    states: bytes
    influence: bytes
    neutral_hip: tuple[float, float, float]
    neutral_heading: float
    measured: bool

    def frame(self, time: float, sequence: int) -> SkeletonFrame:
        """Raises BadMessageError for arrays of the wrong size, or values that are not finite."""
        return SkeletonFrame(
            time,
            sequence,
            self.performer,
            _floats(self.positions, (JOINT_COUNT, 3), "positions"),
            _states(self.states),
            _floats(self.influence, (JOINT_COUNT,), "influence"),
        )


class ConditionedSteps(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One performer's joints before and after each step of conditioning.

    steps: name of the step -> 20 × 3 float64, metres, in the order in which a frame meets them;
        "raw" is what came in. states: 20 × uint8. influence, trust: 20 float64.
    """

    performer: int
    steps: dict[str, bytes]
    states: bytes
    influence: bytes
    trust: bytes


class ConditioningMessage(Message, tag="conditioning", frozen=True, kw_only=True):
    """Stage → whoever tunes: everybody's joints, step by step."""

    time: float
    performers: tuple[ConditionedSteps, ...]


class EventMessage(Message, tag="event", frozen=True, kw_only=True):
    """Stage → whoever is interested: somebody came or went, or took or lost a part.

    kind: "entered", "left", "took" or "lost". part: which one, for the last two.
    """

    kind: EventKind
    time: float
    performer: int
    part: str = ""


class CastMember(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A puppet on stage: where its model lies, how many times as large it is made, whether FK or IK
    drives it, and which human bone turns or moves which of its bones."""

    name: str
    armature: str
    scale: float
    mode: Mode
    pairs: tuple[tuple[int, int], ...]


class CastMessage(Message, tag="cast", frozen=True, kw_only=True):
    """Stage → viewers, when asked: who is on stage."""

    revision: int
    members: tuple[CastMember, ...]


class HealthMessage(Message, tag="health", frozen=True, kw_only=True):
    """Every process, twice a second: how it is.

    counters only grow; gauges are as of now. state: one word, "running", "waiting", "ended".
    """

    role: str
    pid: int
    state: str
    counters: dict[str, int]
    gauges: dict[str, float]
    note: str = ""


_encoder = msgspec.msgpack.Encoder()


def encode(message: Message) -> bytes:
    """A message as bytes for the bus."""
    return _encoder.encode(message)


class Decoder(Generic[M]):
    """Decodes one kind of message."""

    def __init__(self, kind: type[M]) -> None:
        self._kind = kind
        self._decoder = msgspec.msgpack.Decoder(kind)

    def __call__(self, data: bytes) -> M:
        """Raises BadMessageError for another version, another kind, or bytes that are neither."""
        try:
            message = self._decoder.decode(data)
        except (msgspec.DecodeError, RecursionError) as error:
            raise self._explain(data, error) from None
        if message.version != VERSION:
            raise _other_version(self._kind, message.version)
        return message

    def _explain(self, data: bytes, error: Exception) -> BadMessageError:
        # A message of another version may well have another layout: say the version, if it has one.
        try:
            raw: Any = msgspec.msgpack.decode(data)
        except (msgspec.DecodeError, RecursionError):
            raw = None
        if isinstance(raw, dict) and raw.get("version", VERSION) != VERSION:
            return _other_version(self._kind, raw["version"])
        return BadMessageError(
            "a message cannot be understood",
            where=f"message {self._kind.__struct_config__.tag}",
            expected=self._kind.__name__,
            found=str(error),
        )


def _other_version(kind: type[Message], found: object) -> BadMessageError:
    return BadMessageError(
        "a message is of another version",
        where=f"message {kind.__struct_config__.tag}",
        expected=str(VERSION),
        found=str(found),
        hint="run the same version of puppet everywhere",
    )


def _states(data: bytes) -> NDArray[np.uint8]:
    states = np.frombuffer(data, np.uint8)
    if states.shape != (JOINT_COUNT,) or states.max(initial=0) > 2:
        raise BadMessageError(
            "a skeleton's states are not possible",
            where="message: states",
            expected=f"{JOINT_COUNT} bytes of 0, 1 or 2",
            found=f"{len(data)} bytes, the greatest {states.max(initial=0)}",
        )
    return states.copy()


def _floats(data: bytes, shape: tuple[int, ...], what: str) -> Floats:
    try:
        array = np.frombuffer(data, np.float64).reshape(shape).copy()
    except ValueError:
        raise BadMessageError(
            "an array has the wrong size",
            where=f"message: {what}",
            expected=f"float64 of shape {shape}",
            found=f"{len(data)} bytes",
        ) from None
    if not np.isfinite(array).all():
        raise BadMessageError("an array has values that are not finite", where=f"message: {what}")
    return array
