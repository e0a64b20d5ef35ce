"""From a device's messages to shots, with depthai's own nodes, queues and messages."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.cameras.oak_stream import (
    OakLostError,
    OakOutputs,
    OakShot,
    OakStream,
    intrinsics_of,
    shot_of,
)
from puppet.tracking.cameras.quiet_depthai import dai
from tests.oak_host import (
    IMU_TO_CAMERA,
    LENS,
    SIZE,
    HostOak,
    Script,
    half,
    host_stream,
    image_frame,
    lens_of,
)

HALF = (SIZE[0] // 2, SIZE[1] // 2)


@contextmanager
def closing(stream: OakStream) -> Iterator[OakStream]:
    try:
        yield stream
    finally:
        stream.close()


def all_shots(stream: OakStream) -> list[OakShot]:
    """Every shot until none comes any more, or the device is gone."""
    shots = []
    try:
        while (shot := stream.shot(0.3)) is not None:
            shots.append(shot)
    except OakLostError:
        pass
    return shots


def exhaust(stream: OakStream) -> None:
    while True:
        stream.shot(0.5)


def group(
    colour: np.ndarray[tuple[int, ...], np.dtype[np.uint8]] | None = None,
    depth: np.ndarray[tuple[int, ...], np.dtype[np.uint16]] | None = None,
    lens: dai.ImgTransformation | None = None,
    depth_lens: dai.ImgTransformation | None = None,
    kind: dai.ImgFrame.Type = dai.ImgFrame.Type.BGR888i,
) -> dai.MessageGroup:
    messages = dai.MessageGroup()
    if colour is not None:
        messages["colour"] = image_frame(colour, kind, 12.5, 7, lens)
    if depth is not None:
        messages["depth"] = image_frame(depth, dai.ImgFrame.Type.RAW16, 12.5, 7, depth_lens)
    return messages


def grey(value: int = 90) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    return np.full((SIZE[1], SIZE[0], 3), value, np.uint8)


def far(value: int = 2000) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    return np.full((HALF[1], HALF[0]), value, np.uint16)


def test_colour_and_depth_of_one_instant_come_together() -> None:
    with closing(host_stream(Script(shots=8, first=3))) as stream:
        shots = all_shots(stream)
    assert len(shots) >= 2
    for shot in shots:
        assert shot.colour[0, 0].tolist() == [shot.sequence, 100, 200]
        assert shot.depth is not None
        assert shot.depth[0, 0] == 1000 + shot.sequence
        assert shot.depth.shape == (HALF[1], HALF[0])


def test_colour_whose_depth_was_lost_is_left_out_and_shows_as_a_gap() -> None:
    with closing(host_stream(Script(shots=9, lost_depths=frozenset({2, 3})))) as stream:
        sequences = [shot.sequence for shot in all_shots(stream)]
    assert sequences
    assert not {2, 3} & set(sequences)
    assert max(sequences) > 3


def test_depth_of_another_instant_is_never_paired() -> None:
    # Half a shot late at 100 a second is 5 ms; this is eight times that.
    with closing(host_stream(Script(shots=6, behind=0.04, pace=0.1))) as stream:
        assert all_shots(stream) == []


def test_a_device_without_depth_gives_colour() -> None:
    with closing(host_stream(Script(depth=False))) as stream:
        shots = all_shots(stream)
    assert shots
    assert all(shot.depth is None for shot in shots)


def test_the_newest_shot_wins() -> None:
    with closing(host_stream(Script(shots=10, pace=0.01))) as stream:
        time.sleep(0.6)
        sequences = [shot.sequence for shot in all_shots(stream)]
    assert sequences[-1] == 9
    assert len(sequences) <= 3


def test_times_are_of_capture_on_the_hosts_clock() -> None:
    before = time.monotonic()
    with closing(host_stream(Script())) as stream:
        times = [shot.time for shot in all_shots(stream)]
    assert times
    assert before < times[0]
    assert times[-1] < time.monotonic()


def test_readings_are_turned_into_the_images_axes() -> None:
    with closing(host_stream(Script(imu=(-9.81, 0.0, 0.5)))) as stream:
        assert stream.knows_up
        all_shots(stream)
        readings = stream.readings()
        assert len(readings) > 90
        for _, reading in readings:
            np.testing.assert_allclose(reading, (0.0, -9.81, 0.5), atol=1e-5)
        assert stream.readings() == []
    assert [moment for moment, _ in readings] == sorted(moment for moment, _ in readings)


def test_an_unplugged_device_is_lost() -> None:
    with closing(host_stream(Script(shots=2, then="unplug"))) as stream:
        with pytest.raises(OakLostError):
            exhaust(stream)
        stream.readings()  # does no harm


def test_closing_twice_does_no_harm_and_ends_the_shots() -> None:
    stream = host_stream(Script())
    stream.close()
    stream.close()
    with pytest.raises(OakLostError):
        exhaust(stream)


def test_the_lens_is_the_devices_own() -> None:
    shot = shot_of(group(grey(), far(), lens_of(), lens_of(HALF, half())))
    assert shot is not None
    assert shot.intrinsics == Intrinsics(100.0, 101.0, 64.0, 36.0)
    assert (shot.time, shot.sequence, shot.warnings) == (12.5, 7, ())


def test_the_lens_follows_what_the_device_cuts_and_scales() -> None:
    scaled = lens_of((256, 144), [[200, 0, 128], [0, 202, 72], [0, 0, 1]]).addScale(0.5, 0.5)
    lens = intrinsics_of(scaled)
    assert lens is not None
    assert (lens.focal_x, lens.focal_y) == pytest.approx((100.0, 101.0))


def test_without_a_lens_there_is_a_warning() -> None:
    shot = shot_of(group(grey()))
    assert shot is not None
    assert shot.intrinsics is None
    assert "angle of view is assumed" in shot.warnings[0]


def test_a_distorted_image_is_warned_of() -> None:
    shot = shot_of(group(grey(), lens=lens_of(distortion=[0.1] * 14)))
    assert shot is not None
    assert "distorted" in shot.warnings[0]


def test_depth_of_another_lens_is_warned_of() -> None:
    other = lens_of(HALF, [[80, 0, 32], [0, 80, 18], [0, 0, 1]])
    shot = shot_of(group(grey(), far(), lens_of(), other))
    assert shot is not None
    assert "lenses differ" in shot.warnings[0]


def test_depth_of_another_shape_is_left_out() -> None:
    shot = shot_of(group(grey(), np.full((40, 64), 2000, np.uint16), lens_of()))
    assert shot is not None
    assert shot.depth is None
    assert "left out" in shot.warnings[0]


@pytest.mark.parametrize("kind", [dai.ImgFrame.Type.NV12, dai.ImgFrame.Type.BGR888p])
def test_every_kind_of_colour_comes_as_bgr(kind: dai.ImgFrame.Type) -> None:
    colour = np.empty((SIZE[1], SIZE[0], 3), np.uint8)
    colour[:] = (200, 60, 30)
    shot = shot_of(group(colour, kind=kind))
    assert shot is not None
    assert np.abs(shot.colour.astype(int) - colour).max() <= 3


def test_a_grey_camera_gives_an_image_of_three_equal_colours() -> None:
    shot = shot_of(group(grey()[..., 0].copy(), kind=dai.ImgFrame.Type.GRAY8))
    assert shot is not None
    assert shot.colour.shape == (SIZE[1], SIZE[0], 3)


def test_a_group_without_an_image_is_no_shot() -> None:
    assert shot_of(group(None, far())) is None


def test_depth_of_zeros_is_depth() -> None:
    shot = shot_of(group(grey(), far(0), lens_of(), lens_of(HALF, half())))
    assert shot is not None
    assert shot.depth is not None
    assert not shot.depth.any()


def test_what_depthai_recorded_comes_back_through_its_replay_nodes(tmp_path: Path) -> None:
    names = ("colour", "depth", "imu")
    recorder = dai.Pipeline(False)
    oak = recorder.create(HostOak, Script(shots=8, pace=0.03))
    for name in names:
        node = recorder.create(dai.node.RecordMessage)
        node.setRecordFile(tmp_path / f"{name}.mcap")
        getattr(oak, name).link(node.input)
    recorder.start()
    time.sleep(0.5)
    recorder.stop()
    recorder.wait()

    player = dai.Pipeline(False)
    ends = {}
    for name in names:
        replay = player.create(dai.node.ReplayMessage)
        replay.setReplayFile(tmp_path / f"{name}.mcap")
        replay.setLoop(False)
        replay.setFps(30.0)
        ends[name] = replay.out
    outputs = OakOutputs(ends["colour"], ends["depth"], ends["imu"], IMU_TO_CAMERA)
    with closing(OakStream(player, outputs, 30.0)) as stream:
        shots = all_shots(stream)
    assert len(shots) >= 3
    for shot in shots:
        assert shot.colour[0, 0].tolist() == [shot.sequence, 100, 200]
        assert shot.depth is not None
        assert shot.depth[0, 0] == 1000 + shot.sequence
        assert shot.intrinsics == Intrinsics(LENS[0][0], LENS[1][1], LENS[0][2], LENS[1][2])
