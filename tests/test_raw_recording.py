"""Raw recordings: written, replayed, cut off, damaged, and other files in their place."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import jsonschema
import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory
from numpy.typing import NDArray

from puppet.errors import BadFileError, UnavailableError
from puppet.tracking.cameras import raw_writer
from puppet.tracking.cameras.camera import Camera, CameraInfo, Shot
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.cameras.raw_format import METADATA_NAME, SHOT_SCHEMA, is_raw
from puppet.tracking.cameras.raw_recording import RawRecording
from puppet.tracking.cameras.raw_writer import ColourCoding, RawWriter
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.source import SourceInfo
from puppet.tracking.takes.take import read_take, write_take
from puppet.tracking.watcher import Watcher
from tests.cameras import First, Shots
from tests.pose_models import clip_or_skip, models_or_skip

INFO = CameraInfo("oak:1844", "oak", 30.0, live=True, device="1844", note="a test", licence="CC0")
LENS = Intrinsics(70.1, 70.3, 48.25, 30.5)


def some_shots(count: int, rate: float = 30.0) -> Iterator[Shot]:
    """96 × 64 pixels, depth of half that with holes; a number, a depth and a lens are missing."""
    noise = np.random.default_rng(0)
    for i in range(count):
        colour = np.full((64, 96, 3), 90, np.uint8)
        cv2.circle(colour, (30 + i % 40, 30), 12, (40, 160, 220), -1)
        depth = noise.integers(0, 65536, (32, 48)).astype(np.uint16)
        depth[:5] = 0
        yield Shot(
            time=4000.0 + i / rate,
            sequence=i + (i > 7),
            colour=colour,
            depth=None if i == 3 else depth,
            intrinsics=None if i == 4 else LENS,
            up=None if i == 5 else np.array([0.1, -0.9, 1 / 3 + i]),
        )


def write(
    path: Path, shots: Iterable[Shot], info: CameraInfo = INFO, colour: ColourCoding = "jpeg"
) -> Path:
    with RawWriter(path, info, colour) as writer:
        for shot in shots:
            writer.write(shot)
    return path


def assert_same(read: Shot, wrote: Shot, *, colour: float) -> None:
    assert (read.time, read.sequence) == (wrote.time, wrote.sequence)
    assert read.intrinsics == wrote.intrinsics
    assert read.colour.shape == wrote.colour.shape
    assert read.colour.dtype == np.uint8
    assert np.abs(read.colour.astype(int) - wrote.colour).mean() <= colour
    for there, was in ((read.depth, wrote.depth), (read.up, wrote.up)):
        assert (there is None) == (was is None)
        if there is not None and was is not None:
            assert there.dtype == was.dtype
            np.testing.assert_array_equal(there, was)


@pytest.mark.parametrize(("coding", "loss"), [("jpeg", 2.5), ("png", 0.0)])
def test_a_recording_gives_the_same_shots_again_and_again(
    tmp_path: Path, coding: ColourCoding, loss: float
) -> None:
    path = write(tmp_path / "a.raw.mcap", some_shots(40), colour=coding)
    recording: Camera = RawRecording(path)
    for _ in range(2):
        for read, wrote in zip(recording, some_shots(40), strict=True):
            assert_same(read, wrote, colour=loss)
    assert len(recording) == 40
    assert not recording.warnings
    assert not recording.trouble
    recording.close()
    recording.close()


@given(
    times=st.lists(st.floats(0.0, 1e6), min_size=1, max_size=6, unique=True).map(sorted),
    sequence=st.integers(0, 2**40),
    up=st.none() | st.tuples(*[st.floats(-1e3, 1e3)] * 3),
    lens=st.tuples(*[st.floats(1.0, 40.0)] * 2, *[st.floats(0.0, 7.0)] * 2),
)
@settings(max_examples=25)
def test_numbers_come_back_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory,
    times: list[float],
    sequence: int,
    up: tuple[float, float, float] | None,
    lens: tuple[float, float, float, float],
) -> None:
    black = np.zeros((8, 8, 3), np.uint8)
    there = None if up is None else np.array(up)
    shots = [
        Shot(time, sequence + i, black, None, Intrinsics(*lens), there)
        for i, time in enumerate(times)
    ]
    path = write(tmp_path_factory.mktemp("raw") / "a.mcap", shots)
    for read, wrote in zip(RawRecording(path), shots, strict=True):
        assert_same(read, wrote, colour=0.0)


def test_it_is_not_live_and_its_camera_s_calibration_holds(tmp_path: Path) -> None:
    recording = RawRecording(write(tmp_path / "a.raw.mcap", some_shots(2)))
    assert recording.info == CameraInfo(
        "a.raw.mcap", "raw", 30.0, device="1844", note="a test", licence="CC0"
    )
    assert recording.recorded == replace(INFO, live=False)
    # Recorded once more, it is still that camera's; a camera without a device has its name.
    again = write(tmp_path / "b.raw.mcap", recording, recording.info)
    assert RawRecording(again).info.device == "1844"
    webcam = write(tmp_path / "c.raw.mcap", some_shots(1), CameraInfo("webcam:0", "webcam", 30.0))
    assert RawRecording(webcam).info.device == "webcam:0"


def test_other_mcap_tools_open_it_and_the_schemas_are_true(tmp_path: Path) -> None:
    path = write(tmp_path / "a.raw.mcap", some_shots(30))
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        counts = {
            channel.topic: summary.statistics.channel_message_counts[number]
            for number, channel in summary.channels.items()
        }
        assert counts == {"/shot": 30, "/calibration": 29, "/depth": 29, "/colour": 30}
        assert len(summary.chunk_indexes) == 2  # a second
        images = list(reader.iter_decoded_messages(topics=["/colour", "/depth"]))
        for schema, channel, message, image in images:
            assert schema is not None
            assert schema.name == "foxglove.CompressedImage"
            assert image.format == ("png" if channel.topic == "/depth" else "jpeg")
            assert image.timestamp.ToNanoseconds() == message.log_time
            assert image.frame_id == "camera"
        lenses = list(reader.iter_decoded_messages(topics=["/calibration"]))
        assert lenses[0][0] is not None
        assert lenses[0][0].name == "foxglove.CameraCalibration"
        lens = lenses[0][3]
        assert (lens.width, lens.height) == (96, 64)
        assert list(lens.K) == [70.1, 0, 48.25, 0, 70.3, 30.5, 0, 0, 1]
        assert list(lens.P) == [70.1, 0, 48.25, 0, 0, 70.3, 30.5, 0, 0, 0, 1, 0]
        for schema, _, message in reader.iter_messages(topics=["/shot"]):
            assert schema is not None
            assert json.loads(schema.data) == SHOT_SCHEMA
            jsonschema.validate(json.loads(message.data), SHOT_SCHEMA)


def test_reading_needs_memory_for_a_chunk_only(tmp_path: Path) -> None:
    import tracemalloc

    noise = np.random.default_rng(1)
    image = noise.integers(0, 256, (240, 320, 3)).astype(np.uint8)
    shots = (Shot(i / 30, i, np.roll(image, i, axis=1)) for i in range(180))
    tracemalloc.start()
    path = write(tmp_path / "a.raw.mcap", shots)
    written = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    assert sum(1 for _ in RawRecording(path)) == 180
    read = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    chunk = path.stat().st_size / 12
    assert written < 4.0 * chunk
    assert read < 5.0 * chunk


def test_it_survives_a_tool_that_sorts_and_indexes_it_anew(tmp_path: Path) -> None:
    path = write(tmp_path / "a.raw.mcap", some_shots(10))
    copy = tmp_path / "b.raw.mcap"
    with path.open("rb") as file, copy.open("wb") as other:
        reader = make_reader(file)
        writer = Writer(other)
        writer.start()
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        messages = list(reader.iter_messages())
        # Of one instant, the other way round.
        for schema, channel, message in sorted(
            messages, key=lambda one: (one[2].log_time, -one[1].id)
        ):
            assert schema is not None
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(
                    schema.name, schema.encoding, schema.data
                )
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id]
                )
            writer.add_message(
                channels[channel.id],
                message.log_time,
                message.data,
                message.publish_time,
                message.sequence,
            )
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)  # and at the end
        writer.finish()  # type: ignore[no-untyped-call]
    assert is_raw(copy)
    for read, wrote in zip(RawRecording(copy), RawRecording(path), strict=True):
        assert_same(read, wrote, colour=0.0)


@pytest.mark.parametrize("part", [0.35, 0.5, 0.8, 0.97, 0.999])
def test_a_cut_off_recording_gives_what_it_has_with_a_warning(tmp_path: Path, part: float) -> None:
    whole = write(tmp_path / "whole.raw.mcap", some_shots(60))
    path = tmp_path / "cut.raw.mcap"
    path.write_bytes(whole.read_bytes()[: int(part * whole.stat().st_size)])
    assert is_raw(path)
    recording = RawRecording(path)
    assert len(recording) == 0
    shots = list(recording)
    # Chunks are of half a second.
    assert part * 60 - 16 <= len(shots) <= 60
    for read, wrote in zip(shots, some_shots(60), strict=False):
        assert_same(read, wrote, colour=2.5)
    (warning,) = recording.warnings
    assert "cut.raw.mcap is cut off or damaged" in warning
    assert f"its first {len(shots)} shots" in warning


def test_what_is_not_finished_loses_half_a_second_at_most(tmp_path: Path) -> None:
    path = tmp_path / "a.raw.mcap"
    writer = RawWriter(path, INFO)
    for shot in some_shots(60):
        writer.write(shot)
    copy = tmp_path / "killed.raw.mcap"
    copy.write_bytes(path.read_bytes())
    writer.close()
    writer.close()
    assert 60 - 16 <= len(list(RawRecording(copy))) < 60


def test_a_flipped_byte_ends_it_with_a_warning(tmp_path: Path) -> None:
    path = write(tmp_path / "a.raw.mcap", some_shots(60))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0x10
    path.write_bytes(data)
    recording = RawRecording(path)
    shots = list(recording)
    assert 10 < len(shots) < 50
    assert "crc" in recording.warnings[0]


def test_a_recording_without_a_shot_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.raw.mcap", [])
    assert is_raw(path)
    with pytest.raises(BadFileError, match="has no shot"):
        RawRecording(path)
    path = write(path, some_shots(20))
    path.write_bytes(path.read_bytes()[:4000])
    with pytest.raises(BadFileError, match=r"has no shot(.|\n)*cut off"):
        RawRecording(path)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "is empty"),
        (b"\x89MCAP0\r\n", "not a raw recording"),
        (b"\x89MCAP0\r\n" + b"\xff" * 200, "not a raw recording"),
        (b"\x00\x00\x00\x18ftypisom" * 20, "not a raw recording"),
        (b"hello", "not a raw recording"),
    ],
)
def test_other_files_are_refused_by_name(tmp_path: Path, data: bytes, says: str) -> None:
    path = tmp_path / "a.raw.mcap"
    path.write_bytes(data)
    assert not is_raw(path)
    with pytest.raises(BadFileError, match=rf"a\.raw\.mcap: .*{says}"):
        RawRecording(path)


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    for path in (tmp_path / "gone.raw.mcap", tmp_path):
        assert not is_raw(path)
        with pytest.raises(BadFileError, match="cannot be opened"):
            RawRecording(path)


def test_takes_and_raw_recordings_are_told_apart(tmp_path: Path) -> None:
    raw = write(tmp_path / "a.raw.mcap", some_shots(40))
    take = tmp_path / "a.mcap"
    write_take(take, SourceInfo("a test", "test", 30.0), [])
    assert (is_raw(raw), is_raw(take)) == (True, False)
    with pytest.raises(BadFileError, match="a take, not a raw recording"):
        RawRecording(take)
    with pytest.raises(BadFileError, match="a raw recording, not a take"):
        read_take(raw)
    raw.write_bytes(raw.read_bytes()[: raw.stat().st_size // 2])
    with pytest.raises(BadFileError, match="a raw recording, not a take"):
        read_take(raw)


def test_another_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(raw_writer, "FORMAT_VERSION", 9)
    path = write(tmp_path / "a.raw.mcap", some_shots(1))
    with pytest.raises(BadFileError, match=r"another format version(.|\n)*expected: 1(.|\n)*9"):
        RawRecording(path)


Change = Callable[[str, bytes], bytes | None]


def changed(path: Path, change: Change) -> Path:
    """The recording with its messages changed, or left out: topic, data -> data."""
    copy = path.with_name("changed.raw.mcap")
    with path.open("rb") as file, copy.open("wb") as other:
        writer = Writer(other)
        writer.start()
        for record in make_reader(file).iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        file.seek(0)
        channels: dict[int, int] = {}
        for _, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, 0
                )
            data = change(channel.topic, message.data)
            if data is not None:
                writer.add_message(
                    channels[channel.id],
                    message.log_time,
                    data,
                    message.log_time,
                    message.sequence,
                )
        writer.finish()  # type: ignore[no-untyped-call]
    return copy


def replaced(topic: str, data: bytes | None) -> Change:
    return lambda where, was: data if where == topic else was


def png(image: NDArray[Any]) -> bytes:
    return CompressedImage(data=cv2.imencode(".png", image)[1].tobytes()).SerializeToString()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (replaced("/colour", b"\xff\xff\xff"), "not an image"),
        (replaced("/colour", CompressedImage(data=b"hello").SerializeToString()), "be decoded"),
        (replaced("/colour", CompressedImage(format="png").SerializeToString()), "be decoded"),
        (replaced("/colour", None), "nothing on /colour"),
        (replaced("/shot", None), "nothing on /shot"),
        (replaced("/shot", b'{"time": "now", "sequence": 1}'), "not a shot"),
        (replaced("/shot", b"\xff"), "not a shot"),
        (replaced("/depth", png(np.zeros((32, 48), np.uint8))), "uint8, and not one channel"),
        (replaced("/depth", png(np.zeros((32, 48, 3), np.uint16))), "3) uint16"),
        (replaced("/depth", png(np.zeros((32, 32), np.uint16))), "32×32 pixels, another shape"),
        (replaced("/calibration", b"\xff\xff\xff"), "not a calibration"),
    ],
)
def test_messages_that_are_wrong_are_named_by_their_shot(
    tmp_path: Path, change: Change, says: str
) -> None:
    path = changed(write(tmp_path / "a.raw.mcap", some_shots(3)), change)
    with pytest.raises(
        BadFileError, match=rf"changed\.raw\.mcap: shot 0: (.|\n)*{re.escape(says)}"
    ):
        RawRecording(path)


def test_time_that_runs_backwards_is_named_by_its_shot(tmp_path: Path) -> None:
    shots = list(some_shots(3))
    path = write(tmp_path / "a.raw.mcap", [shots[0], shots[2], shots[1]])
    with pytest.raises(BadFileError, match="shot 2: the time of a raw recording runs backwards"):
        list(RawRecording(path))


def test_another_camera_s_calibration_is_refused_where_it_cannot_be_right(tmp_path: Path) -> None:
    other = write(
        tmp_path / "other.raw.mcap",
        (
            replace(shot, colour=np.zeros((48, 64, 3), np.uint8), depth=None)
            for shot in some_shots(1)
        ),
    )
    lens: list[bytes] = []

    def keep(topic: str, data: bytes) -> bytes:
        if topic == "/calibration":
            lens.append(data)
        return data

    changed(other, keep)
    path = write(tmp_path / "a.raw.mcap", some_shots(3))
    with pytest.raises(BadFileError, match=r"another camera(.|\n)*96×64(.|\n)*64×48"):
        RawRecording(changed(path, replaced("/calibration", lens[0])))
    impossible = CameraCalibration(width=96, height=64, K=[70.0, 0, 300.0, 0, 70.0, 32.0, 0, 0, 1])
    for other_lens, says in (
        (impossible, "outside of 96×64"),
        (CameraCalibration(width=96, height=64, K=[70.0, 0.0]), "no camera matrix"),
    ):
        change = replaced("/calibration", other_lens.SerializeToString())
        with pytest.raises(BadFileError, match=rf"shot 0: .*calibration(.|\n)*{says}"):
            RawRecording(changed(path, change))


def bad_depth(shot: Shot) -> Shot:
    return replace(shot, depth=np.zeros((32, 32), np.uint16))


def bad_lens(shot: Shot) -> Shot:
    return replace(shot, intrinsics=Intrinsics(1681.0, 1681.0, 47.5, 31.5))


@pytest.mark.parametrize(
    ("bad", "says"), [(bad_depth, "depth cannot be"), (bad_lens, "calibration cannot be")]
)
def test_what_could_not_be_replayed_is_not_recorded(
    tmp_path: Path, bad: Callable[[Shot], Shot], says: str
) -> None:
    path = tmp_path / "a.raw.mcap"
    with pytest.raises(UnavailableError, match=rf"oak:1844: shot 0: .*{says}"):
        write(path, map(bad, some_shots(3)))
    # Nothing of it was written.
    with pytest.raises(BadFileError, match="has no shot"):
        RawRecording(path)


def test_a_doubtful_calibration_is_a_warning_once(tmp_path: Path) -> None:
    doubtful = Intrinsics(360.0, 360.0, 47.5, 31.5)
    shots = [replace(shot, intrinsics=doubtful) for shot in some_shots(5)]
    recording = RawRecording(write(tmp_path / "a.raw.mcap", shots))
    assert [shot.intrinsics for shot in recording] == [doubtful] * 5
    (warning,) = recording.warnings
    assert "the lens sees 15°" in warning
    assert "another camera" in warning


def test_the_metadata_is_there_for_people(tmp_path: Path) -> None:
    path = write(tmp_path / "a.raw.mcap", some_shots(1))
    with path.open("rb") as file:
        (record,) = make_reader(file).iter_metadata()
    assert record.name == METADATA_NAME
    assert record.metadata["format_version"] == "1"
    assert record.metadata["camera"] == "oak:1844"
    assert record.metadata["kind"] == "oak"
    assert record.metadata["rate"] == "30"


def with_depth(shots: Iterable[Shot]) -> Iterator[Shot]:
    """Half the size, with a sense of up, and depth as if everything were about 3.2 m away."""
    noise = np.random.default_rng(2)
    for shot in shots:
        colour = cv2.resize(shot.colour, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        yield replace(
            shot,
            colour=np.asarray(colour, np.uint8),
            depth=noise.integers(3100, 3300, (480, 270)).astype(np.uint16),
            intrinsics=Intrinsics(840.5, 840.5, 269.5, 479.5),
            up=np.array([0.2144479, -0.8986921, -0.3825762]),
        )


def test_a_replayed_recording_goes_the_live_path_bit_for_bit(tmp_path: Path) -> None:
    models, clip = models_or_skip(), clip_or_skip()
    direct = Shots(with_depth(First(VideoFile(clip), 15)))
    path = write(tmp_path / "a.raw.mcap", direct, direct.info, "png")
    live = list(Watcher(direct, models))
    replayed = list(Watcher(RawRecording(path), models))
    assert sum(moment.present for moment in live) > 10
    for one, other in zip(live, replayed, strict=True):
        assert (one.time, one.sequence) == (other.time, other.sequence)
        assert len(one.frames) == len(other.frames)
        for frame, again in zip(one.frames, other.frames, strict=True):
            assert frame.performer == again.performer
            np.testing.assert_array_equal(frame.positions, again.positions)
            np.testing.assert_array_equal(frame.states, again.states)
