"""BVH files in every dialect: the reader, its forward kinematics, and the 20 joints out of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.errors import BadFileError
from puppet.formats.bvh import read_bvh
from puppet.formats.bvh_armature import bvh_armature
from puppet.formats.bvh_skeleton import bvh_to_skeleton, guess_unit
from puppet.formats.performance import skeleton_frames
from puppet.skeleton import HUMAN_BONES, Joint

BVH = Path(__file__).parents[1].parent / "shared" / "bvh"
FILES = sorted(BVH.glob("*/*.bvh"))
TOYS = {"full_precision_frame_time.bvh", "rotation_first_root.bvh"}
needs_files = pytest.mark.skipif(not FILES, reason="the BVH collection is not beside the checkout")

#: A person of 175 cm: joint, parent, offset in cm, x to the left, y up, facing z.
PERSON = (
    ("Hips", "", (0, 95, 0)),
    ("Spine", "Hips", (0, 10, 0)),
    ("Neck", "Spine", (0, 45, 0)),
    ("Head", "Neck", (0, 10, 0)),
    *(
        bone
        for side, s in (("Left", 1), ("Right", -1))
        for bone in (
            (f"{side}Shoulder", "Spine", (4 * s, 40, 0)),
            (f"{side}Arm", f"{side}Shoulder", (14 * s, 0, 0)),
            (f"{side}ForeArm", f"{side}Arm", (30 * s, 0, 0)),
            (f"{side}Hand", f"{side}ForeArm", (25 * s, 0, 0)),
            (f"{side}UpLeg", "Hips", (9 * s, -3, 0)),
            (f"{side}Leg", f"{side}UpLeg", (0, -43, 0)),
            (f"{side}Foot", f"{side}Leg", (0, -42, 0)),
        )
    ),
)
ENDS = {"Head": (0, 20, 0), "LeftFoot": (0, -7, 13), "RightFoot": (0, -7, 13)}
SIX = "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"


def person(
    *,
    turn: Rotation | None = None,
    scale: float = 1.0,
    frames: int = 3,
    frame_time: str = "0.033333",
    rows: list[str] | None = None,
    declared: int | None = None,
) -> str:
    """The text of a BVH file of someone who stands in a T-pose."""
    turn = Rotation.identity() if turn is None else turn
    text = ["HIERARCHY"]

    def joint(name: str, parent: str, offset: tuple[float, float, float]) -> None:
        text.append(f"{'JOINT' if parent else 'ROOT'} {name} {{")
        text.append("OFFSET {} {} {}".format(*turn.apply(offset) * scale))
        text.append("CHANNELS " + ("3 Zrotation Xrotation Yrotation" if parent else SIX))
        for child, its, offset_of_child in PERSON:
            if its == name:
                joint(child, its, offset_of_child)
        if name in ENDS:
            text.append(
                "End Site { OFFSET {} {} {} }".replace("{}", "%r")
                % tuple(float(v) for v in turn.apply(ENDS[name]) * scale)
            )
        text.append("}")

    joint(*PERSON[0])
    root = " ".join(map(str, turn.apply((0, 95, 0)) * scale))
    row = root + " 0" * (3 * len(PERSON))
    rows = [row] * frames if rows is None else rows
    text += ["MOTION", f"Frames: {len(rows) if declared is None else declared}"]
    text += [f"Frame Time: {frame_time}", *rows]
    return "\n".join(text) + "\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "a.bvh"
    path.write_bytes(text.encode())
    return path


# The reader against forward kinematics done by the book


@st.composite
def hierarchies(draw: st.DrawFn) -> tuple[str, list[np.ndarray]]:
    """A random file in a random dialect, and world matrices of its joints by its first frame."""
    random = np.random.default_rng(draw(st.integers(0, 2**31)))
    count = draw(st.integers(1, 8))
    parents = [-1, *(int(random.integers(0, i)) for i in range(1, count))]
    separator = draw(st.sampled_from([" ", "\t", "  \t"]))
    newline = draw(st.sampled_from(["\n", "\r\n"]))
    lower = draw(st.booleans())
    six = draw(st.booleans())
    lines: list[str] = ["HIERARCHY"]
    values: list[float] = []
    locals_: list[np.ndarray] = [np.eye(4)] * count
    offsets = random.uniform(-20, 20, (count, 3)).round(4)

    def joint(index: int, depth: int) -> None:
        pad = separator * depth
        lines.append(pad + ("ROOT" if index == 0 else "JOINT") + f" bone{index}")
        lines.append(pad + "{")
        lines.append(pad + "OFFSET" + separator + separator.join(map(str, offsets[index])))
        order = "".join(random.permutation(list("XYZ")))
        angles = random.uniform(-180, 180, 3).round(4)
        rotate = [f"{axis}rotation" for axis in order]
        place = offsets[index].copy()
        channels, numbers = rotate, list(angles)
        if six or index == 0:
            place = (offsets[index] + random.uniform(-1, 1, 3)).round(4)
            moved = ["Xposition", "Yposition", "Zposition"]
            first = bool(random.integers(0, 2))
            channels = moved + rotate if first else rotate + moved
            numbers = [*place, *angles] if first else [*angles, *place]
        lines.append(pad + f"CHANNELS {len(channels)} " + " ".join(channels))
        values.extend(numbers)
        locals_[index] = np.eye(4)
        locals_[index][:3, :3] = Rotation.from_euler(order, angles, degrees=True).as_matrix()
        locals_[index][:3, 3] = place
        for child in range(count):
            if parents[child] == index:
                joint(child, depth + 1)
        if index not in parents and random.integers(0, 2):
            lines.extend([pad + "End Site {", "OFFSET 1 2 3", "}"])
        lines.append(pad + "}")

    joint(0, 0)
    lines += ["MOTION", f"Frames:{separator}1", f"Frame Time:{separator}0.01"]
    lines.append(separator.join(map(str, values)))
    text = newline.join(lines) + newline
    worlds: dict[int, np.ndarray] = {}
    for index in range(count):
        parent = parents[index]
        worlds[index] = locals_[index] if parent < 0 else worlds[parent] @ locals_[index]
    return (text.lower() if lower else text), [worlds[index] for index in range(count)]


@settings(max_examples=60, deadline=None)
@given(hierarchies())
def test_a_file_in_any_dialect_stands_where_the_book_says(
    tmp_path_factory: pytest.TempPathFactory, case: tuple[str, list[np.ndarray]]
) -> None:
    text, worlds = case
    motion = read_bvh(write(tmp_path_factory.mktemp("bvh"), text))
    positions, rotations = motion.forward()
    for name, place, turn in zip(motion.names, positions[0], rotations, strict=True):
        world = worlds[int(name.removeprefix("bone"))]
        np.testing.assert_allclose(place, world[:3, 3], atol=1e-9)
        np.testing.assert_allclose(turn.as_matrix()[0], world[:3, :3], atol=1e-9)


# The 20 joints


@pytest.mark.parametrize("scale", [1.0, 10.0, 0.01, 1 / 2.54, 0.45 / 2.54])
@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("heading", [0.0, 75.0, 180.0])
def test_unit_up_axis_and_heading_are_found(
    tmp_path: Path, scale: float, up: str, heading: float
) -> None:
    turn = Rotation.from_euler("y", heading, degrees=True)
    if up == "z":
        turn = Rotation.from_euler("x", 90, degrees=True) * turn
    path = write(tmp_path, person(turn=turn, scale=scale))
    frames, report = skeleton_frames(bvh_to_skeleton(read_bvh(path)))
    first = frames[0].positions
    expected = {
        Joint.SHOULDER_LEFT: (0.18, 1.45, 0.0),
        Joint.HAND_RIGHT: (-0.8125, 1.45, 0.0),
        Joint.ANKLE_LEFT: (0.09, 0.07, 0.0),
        Joint.FOOT_RIGHT: (-0.09, 0.0, 0.13),
        Joint.HEAD: (0.0, 1.70, 0.0),
    }
    for joint, place in expected.items():
        np.testing.assert_allclose(first[joint], place, atol=2e-3, err_msg=joint.name)
    assert any(f"up axis: +{up.upper()}" in note for note in report.notes)


def test_an_unknown_unit_is_scaled_to_a_person_and_said() -> None:
    unit, note = guess_unit(43.0)
    assert unit * 43.0 == pytest.approx(1.7)
    assert "unknown" in note


def test_frames_are_thinned_to_the_wanted_rate(tmp_path: Path) -> None:
    path = write(tmp_path, person(frames=241, frame_time="0.008333"))
    performance = bvh_to_skeleton(read_bvh(path), rate=60.0)
    assert len(performance.times) == 121
    assert performance.rate == pytest.approx(60.0, abs=0.01)
    assert bvh_to_skeleton(read_bvh(path), rate=30.0).rate == pytest.approx(30.0, abs=0.01)


def test_a_number_that_is_none_costs_only_its_joints(tmp_path: Path) -> None:
    rows = person().splitlines()[-3:]
    words = rows[1].split()
    words[-1] = "nan"  # the right foot
    rows[1] = " ".join(words)
    frames, report = skeleton_frames(bvh_to_skeleton(read_bvh(write(tmp_path, person(rows=rows)))))
    assert frames[1].states[Joint.FOOT_RIGHT] == 0
    assert frames[1].states[Joint.KNEE_RIGHT] == 2
    assert report.invalid == 2  # ankle and foot
    assert all(np.isfinite(frame.positions).all() for frame in frames)


def test_a_performer_at_the_very_origin_is_there(tmp_path: Path) -> None:
    rows = [" ".join(["0"] * (3 + 3 * len(PERSON)))]
    frames, report = skeleton_frames(bvh_to_skeleton(read_bvh(write(tmp_path, person(rows=rows)))))
    assert (frames[0].states > 0).all()
    assert report.frames == 1


def test_the_hierarchy_becomes_an_armature_that_stands_on_the_floor(tmp_path: Path) -> None:
    armature = bvh_armature(read_bvh(write(tmp_path, person())))
    positions, _ = armature.rest
    assert armature.names[0] == "Hips"
    np.testing.assert_allclose(positions[0], (0.0, 0.95, 0.0), atol=1e-9)
    assert armature.rest_tips[:, 1].min() == pytest.approx(0.0)
    foot = armature.index("LeftFoot")
    np.testing.assert_allclose(armature.tips[foot], (0.0, -0.07, 0.13))


def test_an_armature_need_not_be_human(tmp_path: Path) -> None:
    worm = "HIERARCHY\nROOT a { OFFSET 0 0 0 CHANNELS 3 Zrotation Xrotation Yrotation\n"
    worm += "JOINT b { OFFSET 0 0 80 CHANNELS 3 Zrotation Xrotation Yrotation } }\nMOTION\n"
    worm += "Frames: 1\nFrame Time: 0.1\n0 0 0 0 0 0\n"
    armature = bvh_armature(read_bvh(write(tmp_path, worm)))
    assert armature.rest[0][1, 2] == pytest.approx(0.8)


# Odd and broken files


@pytest.mark.parametrize(
    ("change", "warning"),
    [
        (lambda text: text.replace("Frames: 3", "Frames: 2"), "2 frames declared, 3 there"),
        (lambda text: text.replace("Frames: 3", "Frames: 9"), "9 frames declared, 3 there"),
        (lambda text: text.replace("0.033333", "0"), "frame time"),
        (lambda text: text.replace("CHANNELS 6", "CHANNELS 7"), "declared"),
        (lambda text: text.rstrip()[:-2] + "\n", "cut off"),
        (lambda text: text.replace("RightForeArm", "LeftForeArm"), "two joints are called"),
        (lambda text: text.replace("}\nMOTION", "MOTION"), "not closed"),
        (lambda text: text.replace("}\nMOTION", "}}\nMOTION"), "a brace too many"),
    ],
)
def test_what_is_odd_is_read_and_said(tmp_path: Path, change: object, warning: str) -> None:
    assert callable(change)
    motion = read_bvh(write(tmp_path, change(person())))
    assert any(warning in text for text in motion.warnings), motion.warnings


def test_frames_that_do_not_keep_to_lines_are_read(tmp_path: Path) -> None:
    text = person()
    head, tail = text.split("0.033333\n")
    motion = read_bvh(write(tmp_path, head + "0.033333\n" + tail.replace(" ", "\n")))
    assert len(motion.values) == 3


@pytest.mark.parametrize("prefix", ["\ufeff", "\n\n  "])
def test_a_byte_order_mark_or_blank_lines_before_are_no_matter(tmp_path: Path, prefix: str) -> None:
    assert len(read_bvh(write(tmp_path, prefix + person())).names) == len(PERSON)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty"),
        ("hello", "not a BVH"),
        ("HIERARCHY\nMOTION\nFrames: 0\nFrame Time: 1\n", "no joints"),
        (person().split("MOTION")[0], "ends before its motion"),
        (person(rows=[]), "no frames"),
        (person().replace("OFFSET 0.0 10.0 0.0", "OFFSET 0.0 x 0.0"), "not three numbers"),
        (person().replace("OFFSET 0.0 10.0 0.0", "OFFSET 0.0 inf 0.0"), "not three numbers"),
        (person().replace("OFFSET 0.0 10.0 0.0", "OFSET 0.0 10.0 0.0"), "does not belong"),
        (person().replace("CHANNELS 3", "CHANNELS three", 1), "number of channels"),
        (person().replace("3 Zrotation", "3 Wrotation", 1), "not a channel"),
        (person().replace("Frames: 3", "Frames: 3\nColour: red"), "does not belong"),
        (person(rows=["1 2 3", "1 2 3"]), "wrong number of values"),
        (person(rows=[person().splitlines()[-1].replace(" 0", " zero", 1)]), "not a number"),
    ],
)
def test_a_broken_file_says_what_is_wrong(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(BadFileError) as caught:
        read_bvh(write(tmp_path, text))
    assert says in str(caught.value)


def test_a_wrong_value_is_found_by_line_and_column(tmp_path: Path) -> None:
    rows = person().splitlines()[-3:]
    rows[1] = rows[1].replace(" 0 0", " 0 O", 1)
    text = person(rows=rows)
    line = text.splitlines().index(rows[1]) + 1
    with pytest.raises(BadFileError) as caught:
        read_bvh(write(tmp_path, text))
    column = rows[1].split().index("O") + 1
    assert f"line {line}, column {column}" in str(caught.value)


def test_a_body_without_knees_is_refused_by_the_names_of_what_lacks(tmp_path: Path) -> None:
    text = person().replace("LeftLeg", "LeftWheel")
    with pytest.raises(BadFileError, match="knee_left"):
        bvh_to_skeleton(read_bvh(write(tmp_path, text)))


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_a_damaged_file_is_read_or_refused_but_never_crashes(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    words = person().split(" ")
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(words) - 1))
        words[at] = data.draw(
            st.sampled_from(["", "{", "}", "nan", "1e999", "-1", "JOINT", "End", "\n", "MOTION\n"])
        )
    path = write(tmp_path_factory.mktemp("bvh"), " ".join(words))
    try:
        frames, _ = skeleton_frames(bvh_to_skeleton(read_bvh(path)))
    except BadFileError:
        return
    assert all(np.isfinite(frame.positions).all() for frame in frames)


# The real ones


@needs_files
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_file_of_the_collection_imports_or_says_why_not(path: Path) -> None:
    motion = read_bvh(path)
    if path.name in TOYS:
        with pytest.raises(BadFileError, match="no joint for"):
            bvh_to_skeleton(motion)
        return
    frames, report = skeleton_frames(bvh_to_skeleton(motion))
    positions = np.array([frame.positions for frame in frames])
    assert report.rate <= 60.1
    assert report.not_tracked == 0
    height = np.median(positions[:, Joint.HEAD, 1])
    assert 1.2 < height < 1.9
    # Toes point the way that hips and left and right say the body faces: nothing is mirrored.
    left = positions[:, Joint.HIP_LEFT] - positions[:, Joint.HIP_RIGHT]
    front = np.cross(left, (0.0, 1.0, 0.0))
    toes = positions[:, Joint.FOOT_LEFT] - positions[:, Joint.ANKLE_LEFT]
    assert np.median((front * toes).sum(axis=1)) > 0.0
    first = np.cross(
        left[0] + positions[0, Joint.SHOULDER_LEFT] - positions[0, Joint.SHOULDER_RIGHT],
        (0.0, 1.0, 0.0),
    )
    np.testing.assert_allclose(first[0] / np.linalg.norm(first), 0.0, atol=1e-6)
    assert first[2] > 0.0
    for bone in HUMAN_BONES:
        if bone.name.split(".")[0] in ("upper_arm", "forearm", "thigh", "shin", "hand", "foot"):
            lengths = np.linalg.norm(positions[:, bone.end] - positions[:, bone.start], axis=1)
            assert np.ptp(lengths) < 0.02, bone.name
            assert 0.02 < np.median(lengths) < 0.6, bone.name


@needs_files
def test_a_file_and_its_copy_in_metres_give_the_same_body() -> None:
    paths = [path for path in FILES if path.name.endswith("131_01.bvh")]
    one, other = (
        np.array([f.positions for f in skeleton_frames(bvh_to_skeleton(read_bvh(path)))[0]])
        for path in paths
    )
    count = min(len(one), len(other))
    for bone in HUMAN_BONES:
        a, b = (
            np.median(np.linalg.norm(p[:count, bone.end] - p[:count, bone.start], axis=1))
            for p in (one, other)
        )
        assert a == pytest.approx(b, rel=0.01)
