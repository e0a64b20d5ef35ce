"""Messages: back and forth, versions, and a guard against layouts that drift."""

from __future__ import annotations

import hashlib
import json

import msgspec
import numpy as np
import pytest

from puppet.errors import BadMessageError
from puppet.net import mapping_messages, messages, part_messages
from puppet.net.messages import (
    CastMessage,
    ConditioningMessage,
    Decoder,
    EventMessage,
    HealthMessage,
    Message,
    PuppetPose,
    SceneMessage,
    SkeletonMessage,
    encode,
)
from puppet.pose import Pose
from puppet.skeleton import Moment, SkeletonFrame

ASKED = [
    kind
    for module in (mapping_messages, part_messages)
    for kind in vars(module).values()
    if isinstance(kind, type) and issubclass(kind, Message) and kind is not Message
]
#: Version -> fingerprint of all layouts. After a change of layout: a new version, a new line here.
LAYOUTS = {1: "151d5f833e8c0d46", 2: "6361085faec77935", 3: "8f4d38fd615e222e"}


def frame() -> SkeletonFrame:
    rng = np.random.default_rng(0)
    return SkeletonFrame(1.5, 7, 2, rng.normal(size=(20, 3)), np.full(20, 2, np.uint8))


def skeleton_message() -> SkeletonMessage:
    return SkeletonMessage.of(
        Moment.of(frame()), source="s", synthetic=True, stream_ns=1, sent_ns=2
    )


def test_a_skeleton_comes_through_bit_for_bit() -> None:
    got = Decoder(SkeletonMessage)(encode(skeleton_message())).moment().frame_of(2)
    assert got.positions.tobytes() == frame().positions.tobytes()
    assert (got.time, got.sequence, got.performer) == (1.5, 7, 2)
    np.testing.assert_array_equal(got.states, frame().states)


def test_a_pose_comes_through_bit_for_bit() -> None:
    rng = np.random.default_rng(0)
    pose = Pose(rng.normal(size=3), rng.normal(size=4), rng.normal(size=(8, 4)))
    got = PuppetPose.of("fish", pose).pose()
    assert got.bones.tobytes() == pose.bones.tobytes()
    assert got.translation.tobytes() == pose.translation.tobytes()


def test_the_layout_of_messages_changes_only_with_the_version() -> None:
    kinds = [
        SkeletonMessage,
        SceneMessage,
        ConditioningMessage,
        EventMessage,
        CastMessage,
        HealthMessage,
        *ASKED,
    ]
    schema = json.dumps(msgspec.json.schema_components(kinds), sort_keys=True, default=str)
    fingerprint = hashlib.sha256(schema.encode()).hexdigest()[:16]
    assert LAYOUTS.get(messages.VERSION) == fingerprint


def test_another_version_is_refused_by_its_number_even_with_another_layout() -> None:
    class Future(Message, tag="skeleton", frozen=True, kw_only=True):
        limbs: int

    with pytest.raises(BadMessageError, match="another version") as caught:
        Decoder(SkeletonMessage)(encode(Future(version=9, limbs=3)))
    assert "9" in str(caught.value)
    same_layout = msgspec.structs.replace(skeleton_message(), version=messages.VERSION + 1)
    with pytest.raises(BadMessageError, match="another version"):
        Decoder(SkeletonMessage)(encode(same_layout))


@pytest.mark.parametrize(
    "data",
    [b"", b"\xff\x00", b"hello", msgspec.msgpack.encode([1, 2]), b"\x91" * 5000],
    ids=["empty", "garbage", "text", "list", "nested without end"],
)
def test_bytes_that_are_no_message_are_refused(data: bytes) -> None:
    with pytest.raises(BadMessageError, match="cannot be understood"):
        Decoder(SkeletonMessage)(data)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"positions": bytes(10)}, "wrong size"),
        ({"positions": np.full(60, np.nan).tobytes()}, "not finite"),
        ({"states": bytes(3)}, "states"),
        ({"states": bytes([9] * 20)}, "states"),
    ],
)
def test_impossible_skeletons_are_refused(change: dict[str, bytes], says: str) -> None:
    message = skeleton_message()
    broken = msgspec.structs.replace(message.skeletons[0], **change)
    message = msgspec.structs.replace(message, skeletons=(broken,))
    with pytest.raises(BadMessageError, match=says):
        message.moment()


def test_a_performer_who_is_there_twice_is_refused() -> None:
    message = skeleton_message()
    twice = msgspec.structs.replace(message, skeletons=message.skeletons * 2)
    with pytest.raises(BadMessageError, match="contradicts itself"):
        twice.moment()
