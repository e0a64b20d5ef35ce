"""Kinect recordings: axes, states, clocks, holes, and files that are broken."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

from puppet.errors import BadFileError
from puppet.formats.kinect import (
    KINECT1_FROM_KINECT2,
    KINECT2_JOINTS,
    read_kinect1_csv,
    read_kinect1_skl,
    read_kinect2_csv,
)
from puppet.formats.performance import ImportReport, Performance, skeleton_frames
from puppet.skeleton import JOINT_NAMES, Joint, SkeletonFrame

RECORDINGS = Path(__file__).parents[1].parent / "shared" / "recordings"
needs_recordings = pytest.mark.skipif(
    not RECORDINGS.is_dir(), reason="the Kinect recordings are not beside the checkout"
)
#: Hips of `sensor_body` above its floor.
UP = np.array([0.0, 0.9, 0.0])
CAMEL = ["".join(word.title() for word in name.split("_")) for name in JOINT_NAMES]


def sensor_body(frame: int = 0) -> np.ndarray:
    """(20, 3) someone before a Kinect, in its own space: x to its left, z away, hips at 0."""
    body = np.zeros((20, 3))
    body[:, 2] = 2.5
    heights = {"hip": 0.0, "spine": 0.1, "shoulder": 0.45, "head": 0.65, "elbow": 0.2}
    heights |= {"wrist": -0.05, "hand": -0.1, "knee": -0.45, "ankle": -0.85, "foot": -0.9}
    for joint in Joint:
        body[joint, 1] = heights[joint.name.split("_")[0].lower()]
        body[joint, 0] = {"LEFT": -0.2, "RIGHT": 0.2}.get(joint.name.split("_")[-1], 0.0)
    # A sensor never says the same twice.
    return body + 1e-4 * np.random.default_rng(frame).standard_normal((20, 3))


def csv1(bodies: list[np.ndarray], action: str = ";0") -> str:
    rows = [";".join(" ".join(map(repr, p)) for p in body.tolist()) + action for body in bodies]
    return "\n".join(["; ".join(CAMEL), *rows]) + "\n"


def skl(
    bodies: list[np.ndarray],
    times: list[float],
    states: np.ndarray | None = None,
    plane: tuple[float, float, float, float] | None = (0.0, 1.0, 0.0, 0.9),
) -> str:
    header = ["timestamp"]
    header += [f"{name}_{part}" for name in CAMEL for part in ("X", "Y", "Z", "tracked")]
    header += [f"FloorPlane_{letter}" for letter in "ABCD"] if plane else []
    states = np.full((len(bodies), 20), 2) if states is None else states
    lines = ["\t".join(header)]
    for body, time, row in zip(bodies, times, states, strict=True):
        cells = [f"{time:.0f}"]
        for place, state in zip(body.tolist(), row.tolist(), strict=True):
            cells += [*map(repr, place), str(state)]
        lines.append("\t".join([*cells, *map(str, plane or ())]))
    return "\n".join(lines) + "\n"


def csv2(bodies: list[np.ndarray], times: list[int], states: int = 2) -> str:
    lines = []
    for body, time in zip(bodies, times, strict=True):
        joints = np.full((25, 3), 9.0)
        joints[list(KINECT1_FROM_KINECT2)] = body
        cells = [c for place in joints.tolist() for c in (*map(repr, place), str(states))]
        lines.append(f"{time}," + ",".join(cells) + ",")
    return "\n".join(lines) + "\n"


def read(reader: Callable[[Path], Performance], folder: Path, text: str | bytes) -> Performance:
    path = folder / "recording"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return reader(path)


def bodies(count: int) -> list[np.ndarray]:
    return [sensor_body(frame) for frame in range(count)]


TICKS = [1000 + 333_333 * i for i in range(40)]
MILLISECONDS = [1000.0 + 33 * i for i in range(40)]
ALL = [
    pytest.param(read_kinect1_csv, csv1, id="v1 csv"),
    pytest.param(
        read_kinect1_skl,
        lambda b: skl([x + UP for x in b], MILLISECONDS[: len(b)]),
        id="v1 skl",
    ),
    pytest.param(read_kinect2_csv, lambda b: csv2(b, TICKS[: len(b)]), id="v2 csv"),
]


@pytest.mark.parametrize(("reader", "text"), ALL)
def test_the_left_hand_of_who_faces_the_sensor_is_at_plus_x(
    tmp_path: Path,
    reader: Callable[[Path], Performance],
    text: Callable[[list[np.ndarray]], str],
) -> None:
    frames, report = skeleton_frames(read(reader, tmp_path, text(bodies(10))))
    place = frames[0].positions
    np.testing.assert_allclose(place[Joint.HAND_LEFT], (0.2, 0.8, -2.5), atol=2e-3)
    np.testing.assert_allclose(place[Joint.FOOT_RIGHT], (-0.2, 0.0, -2.5), atol=2e-3)
    np.testing.assert_allclose(place[Joint.HEAD], (0.0, 1.55, -2.5), atol=2e-3)
    assert (frames[0].states == 2).all()
    assert (report.frames, report.nobody, report.not_tracked) == (10, 0, 0)
    assert frames[9].time == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize("mark", [b"\xef\xbb\xbf", b""])
@pytest.mark.parametrize(("reader", "text"), ALL)
def test_windows_line_ends_and_byte_order_marks_are_no_matter(
    tmp_path: Path,
    reader: Callable[[Path], Performance],
    text: Callable[[list[np.ndarray]], str],
    mark: bytes,
) -> None:
    data = mark + text(bodies(3)).replace("\n", "\r\n").encode() + b"\r\n"
    assert len(read(reader, tmp_path, data).times) == 3


def test_the_twenty_joints_are_taken_from_the_25() -> None:
    taken = [KINECT2_JOINTS[index] for index in KINECT1_FROM_KINECT2]
    assert taken[:4] == ["spine_base", "spine_mid", "spine_shoulder", "head"]
    assert taken[4:] == list(JOINT_NAMES[4:])


def test_a_tilted_sensor_is_levelled_by_its_plane(tmp_path: Path) -> None:
    """The recorder gives y above the floor, but x and z as the tilted sensor saw them."""
    angle = np.radians(12.0)
    normal = np.array([0.0, np.cos(angle), -np.sin(angle)])
    stage = sensor_body() + UP
    level_from_sensor = np.array(
        [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    )
    height = 0.6
    sensor = (stage - (0.0, height, 0.0)) @ level_from_sensor
    recorded = sensor.copy()
    recorded[:, 1] = sensor @ normal + height
    np.testing.assert_allclose(recorded[:, 1], stage[:, 1])
    text = skl([recorded] * 2, MILLISECONDS[:2], plane=(*normal.tolist(), height))
    performance = read(read_kinect1_skl, tmp_path, text)
    np.testing.assert_allclose(performance.positions[0], stage * (-1, 1, -1), atol=1e-9)


# Holes


def test_an_empty_stage_is_nobody_in_every_frame(tmp_path: Path) -> None:
    frames, report = skeleton_frames(
        read(read_kinect1_csv, tmp_path, csv1([np.zeros((20, 3))] * 9))
    )
    assert not any(frame.present for frame in frames)
    assert report.nobody == report.frames == 9
    assert any("the whole recording" in line for line in report.lines())


def test_joints_at_zero_or_that_only_repeat_are_not_tracked(tmp_path: Path) -> None:
    some = bodies(8)
    some[2][Joint.HEAD] = 0.0
    for frame in (4, 5):
        some[frame][Joint.HAND_LEFT] = some[3][Joint.HAND_LEFT]
    frames, report = skeleton_frames(read(read_kinect1_csv, tmp_path, csv1(some)))
    assert frames[2].states[Joint.HEAD] == 0
    assert [frame.states[Joint.HAND_LEFT] for frame in frames[2:7]] == [2, 2, 0, 0, 2]
    assert report.not_tracked == 3


def test_a_lost_joint_of_the_skl_lies_at_the_sensor_and_is_not_tracked(tmp_path: Path) -> None:
    some = [body + UP for body in bodies(3)]
    some[1][Joint.WRIST_RIGHT] = (0.0, 0.9, 0.0)
    frames, _ = skeleton_frames(read(read_kinect1_skl, tmp_path, skl(some, MILLISECONDS[:3])))
    assert frames[1].states[Joint.WRIST_RIGHT] == 0
    assert (frames[1].positions[Joint.WRIST_RIGHT] == 0.0).all()


def test_a_row_that_repeats_is_kept_until_it_goes_on_too_long(tmp_path: Path) -> None:
    some = bodies(40)
    some[3] = some[2]
    for frame in range(10, 40):
        some[frame] = some[9]
    frames, report = skeleton_frames(read(read_kinect2_csv, tmp_path, csv2(some, TICKS)))
    assert frames[3].present
    assert not frames[30].present
    assert report.repeated == 31


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 1e30])
@pytest.mark.parametrize(("reader", "text"), ALL)
def test_impossible_numbers_are_joints_that_are_not_tracked(
    tmp_path: Path,
    reader: Callable[[Path], Performance],
    text: Callable[[list[np.ndarray]], str],
    bad: float,
) -> None:
    some = bodies(5)
    some[2][Joint.KNEE_LEFT, 0] = bad
    frames, report = skeleton_frames(read(reader, tmp_path, text(some)))
    assert frames[2].states[Joint.KNEE_LEFT] == 0
    assert report.invalid == 1
    assert all(np.isfinite(frame.positions).all() for frame in frames)


# Clocks


def recorded(folder: Path, times: list[float]) -> tuple[list[SkeletonFrame], ImportReport]:
    some = [body + UP for body in bodies(len(times))]
    return skeleton_frames(read(read_kinect1_skl, folder, skl(some, times)))


def test_who_leaves_for_a_while_is_away_for_that_while(tmp_path: Path) -> None:
    times = [0.0, 33, 66, 99, 99 + 8000, 99 + 8033, 99 + 8066]
    frames, report = recorded(tmp_path, times)
    assert report.gaps == 1
    assert frames[-1].time == pytest.approx(8.165)
    away = [frame for frame in frames if not frame.present]
    assert len(away) == pytest.approx(8.0 * 30.3, abs=2)
    steps = np.diff([frame.time for frame in frames])
    assert steps.min() > 0.0
    assert steps.max() < 0.07
    assert [frame.sequence for frame in frames] == list(range(len(frames)))


@pytest.mark.parametrize(
    ("times", "jumps", "backwards"),
    [
        ([0, 33, 66, 1e7, 1e7 + 33, 1e7 + 66], 1, 0),
        ([5000, 5033, 5066, 0, 33, 66], 0, 1),
        ([0, 33, 33, 66, 99], 0, 1),
        ([0, 33, 9e9, 66, 99, 132], 1, 1),
    ],
)
def test_a_clock_that_jumps_is_closed_up_and_counted(
    tmp_path: Path, times: list[float], jumps: int, backwards: int
) -> None:
    frames, report = recorded(tmp_path, times)
    assert (report.clock_jumps, report.clock_backwards) == (jumps, backwards)
    steps = np.diff([frame.time for frame in frames])
    assert steps.min() > 0.0
    assert steps.max() < 0.07


def test_gaps_without_end_do_not_fill_the_memory(tmp_path: Path) -> None:
    steps = np.tile([5.0, 5.0, 55_000.0], 100)
    frames, report = recorded(tmp_path, np.cumsum(steps).tolist())
    assert report.gap_seconds <= 600.0
    assert report.clock_jumps > 0
    assert len(frames) < 600 * 240


# Broken files


@pytest.mark.parametrize(
    ("reader", "text", "says"),
    [
        (read_kinect1_csv, "", "empty"),
        (read_kinect1_csv, "; ".join(CAMEL), "no frames"),
        (read_kinect1_csv, csv1(bodies(2)).replace("Head", "Hat"), "lacks columns"),
        (read_kinect1_csv, csv1(bodies(2)) + "1 2 3;4 5 6\n", "line 4, column 3"),
        (read_kinect1_csv, csv1([np.ones((20, 3))]).replace("1.0 1.0", "1.0", 1), "not three"),
        (read_kinect1_csv, csv1([np.ones((20, 3))]).replace("1.0", "x", 1), "line 2, column 1"),
        (read_kinect1_skl, skl([], []), "no frames"),
        (read_kinect1_skl, skl(bodies(3), MILLISECONDS[:3])[:-60], "line 4, column"),
        (read_kinect1_skl, skl(bodies(1), [0]).replace("\t2\t", "\tyes\t", 1), "(hipcentertr"),
        (read_kinect1_skl, skl(bodies(1), [0]).replace("\t2\t", "\t7\t", 1), "tracking state"),
        (read_kinect1_skl, skl(bodies(1), [0]).replace("Knee", "Nee"), "lacks columns"),
        (read_kinect1_skl, skl(bodies(2), [0, 3]).replace("\n3\t", "\nnan\t"), "not finite"),
        (read_kinect1_skl, skl(bodies(3), [0, 3e6, 6e6]), "clock"),
        (read_kinect2_csv, csv2(bodies(2), TICKS[:2])[:-100], "line 2, column"),
        (read_kinect2_csv, csv2(bodies(1), TICKS[:1]).rstrip() + "1,2\n", "too long"),
        (read_kinect2_csv, csv2(bodies(1), TICKS[:1]).replace(",2,", ",?,", 1), "not a number"),
        (read_kinect2_csv, b"\x00\x01\x02", "not a text file"),
    ],
)
def test_a_broken_file_says_where_and_what(
    tmp_path: Path, reader: Callable[[Path], Performance], text: str | bytes, says: str
) -> None:
    with pytest.raises(BadFileError) as caught:
        read(reader, tmp_path, text)
    assert says in str(caught.value)


# The real ones


@needs_recordings
def test_a_real_fighter_strikes_and_kicks_with_the_side_that_the_labels_say() -> None:
    """Left and right, against what a person wrote beside each frame of the recordings."""
    agreed = []
    for path in sorted((RECORDINGS / "kinect1_precog").glob("*.csv")):
        frames, report = skeleton_frames(read_kinect1_csv(path))
        if report.nobody:
            continue
        labels = [line.rsplit(";", 1)[1].strip() for line in path.read_text().splitlines()[1:]]
        positions = np.array([frame.positions for frame in frames])
        first = 0
        for label, run in groupby(labels):
            part = positions[first : first + len(list(run))]
            first += len(part)
            if label in ("1", "2"):  # right, left punch
                arm = part[:, [Joint.HAND_LEFT, Joint.HAND_RIGHT], 2]
                arm = arm - part[:, [Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT], 2]
                left, right = np.ptp(arm, axis=0)
                agreed.append((right > left) == (label == "1"))
            elif label in ("3", "4"):  # right, left front kick
                left, right = part[:, [Joint.FOOT_LEFT, Joint.FOOT_RIGHT], 1].max(axis=0)
                agreed.append((right > left) == (label == "3"))
    assert len(agreed) == 18
    assert sum(agreed) >= 17  # in one left punch both arms go just as far


@needs_recordings
def test_everybody_in_the_real_recordings_is_upright_with_the_left_hand_at_the_left() -> None:
    for path in (RECORDINGS / "kinect2_labanotation").glob("Ges*.csv"):
        frames, report = skeleton_frames(read_kinect2_csv(path))
        place = np.median([frame.positions for frame in frames], axis=0)
        assert place[Joint.SHOULDER_LEFT, 0] > place[Joint.SHOULDER_RIGHT, 0]
        assert 1.3 < place[Joint.HEAD, 1] < 1.7
        assert abs(place[[Joint.FOOT_LEFT, Joint.FOOT_RIGHT], 1]).max() < 0.1
        assert report.rate == pytest.approx(30.3, abs=0.1)


@needs_recordings
def test_the_real_recording_with_absences_has_five() -> None:
    path = RECORDINGS / "kinect1_gaitkinect" / "miky_assaf_45.skl"
    frames, report = skeleton_frames(read_kinect1_skl(path))
    assert (report.gaps, report.not_tracked) == (5, 1)
    assert report.gap_seconds == pytest.approx(40.4, abs=0.1)
    assert np.diff([frame.time for frame in frames]).min() > 0.0


@needs_recordings
def test_the_seated_recording_is_a_third_inferred() -> None:
    path = RECORDINGS / "kinect2_labanotation" / "KinectReader_joints.csv"
    _, report = skeleton_frames(read_kinect2_csv(path))
    assert report.inferred / (report.frames * 20) == pytest.approx(0.35, abs=0.02)
