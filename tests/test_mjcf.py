"""MuJoCo models as armatures: compared with the file's own kinematics, written out here again."""

from __future__ import annotations

import contextlib
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.errors import BadFileError, PuppetError
from puppet.formats.mjcf import read_mjcf

#: +Z up and +X forward to +Y up and +Z forward: written as pictures, not as in the program.
STAGE = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], float)


def read(folder: Path, inside: str, **attributes: str) -> tuple[Armature, tuple[str, ...]]:
    path = folder / "rig.xml"
    head = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    path.write_text(f"<mujoco><compiler {head}/>{inside}</mujoco>")
    return read_mjcf(path)


def arm(joint: str, *, more: str = "", body: str = "") -> str:
    """A trunk that floats, and an arm on it, 1 m to the left and 0.5 m long, hanging down."""
    return (
        f'<worldbody><body name="trunk" pos="0 0 2"><freejoint/><geom size="0.1"/>'
        f'<body name="arm" pos="0 1 0" {body}>{joint}<geom size="0.01" pos="0 0 -0.5"/>{more}'
        f"</body></body></worldbody>"
    )


def posed(armature: Armature, turns: dict[str, np.ndarray]) -> np.ndarray:
    """(B, 3) origins, with some bones turned by rotation vectors in their own rest frames."""
    places, rotations = np.zeros((len(armature), 3)), list[Rotation]()
    for bone, parent in enumerate(armature.parents):
        local = Rotation.from_quat(armature.rotations[bone].copy())
        local = local * Rotation.from_rotvec(turns.get(armature.names[bone], np.zeros(3)))
        if parent < 0:
            places[bone] = armature.offsets[bone]
        else:
            places[bone] = places[parent] + rotations[parent].apply(armature.offsets[bone].copy())
            local = rotations[parent] * local
        rotations.append(local)
    return places


# -- against kinematics of our own ------------------------------------------------------------

numbers = st.floats(-1.0, 1.0).map(lambda value: round(value, 3))
triples = st.tuples(numbers, numbers, numbers)


@st.composite
def chains(draw: st.DrawFn) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]]:
    """Per body: place, quaternion wxyz, axis, anchor, and an angle to turn the hinge by."""
    chain = []
    for _ in range(draw(st.integers(2, 5))):
        quat = np.array([1.5, *draw(triples)])
        axis = np.array(draw(triples)) + (0, 0, 2)
        parts = (np.array(draw(triples)), quat, axis, np.array(draw(triples)))
        chain.append((*parts, draw(st.floats(-3.0, 3.0))))
    return chain


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(chain=chains())
def test_a_turned_hinge_moves_everything_as_the_file_says(
    tmp_path: Path, chain: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]]
) -> None:
    text = "".join(
        f'<body name="b{n}" pos="{" ".join(map(str, pos))}" quat="{" ".join(map(str, quat))}">'
        f'<joint axis="{" ".join(map(str, axis))}" pos="{" ".join(map(str, anchor))}"/><geom/>'
        for n, (pos, quat, axis, anchor, _) in enumerate(chain)
    )
    armature, _ = read(
        tmp_path,
        f'<worldbody><body name="root"><freejoint/>{text}{"</body>" * len(chain)}</body>'
        "</worldbody>",
    )
    # MuJoCo: body_from_parent, then about the axis through the anchor.
    place, turn = np.zeros(3), Rotation.identity()
    anchors = []
    for pos, quat, axis, anchor, angle in chain:
        place, turn = place + turn.apply(pos), turn * Rotation.from_quat(np.roll(quat, -1))
        about = place + turn.apply(anchor)
        turn = turn * Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle)
        place = about - turn.apply(anchor)
        anchors.append(about)
    turns = {f"b{n}": np.array([angle, 0.0, 0.0]) for n, (*_, angle) in enumerate(chain)}
    found = posed(armature, turns)
    expected = np.array(anchors) @ STAGE.T
    np.testing.assert_allclose(found[1:] - found[1], expected - expected[0], atol=1e-7)


@pytest.mark.parametrize(
    "form",
    [
        'quat="0.7071067811865476 0 0.7071067811865476 0"',
        'axisangle="0 2 0 90"',
        'euler="0 90 0"',
        'xyaxes="0 0 -1 0 1 0"',
        'zaxis="1 0 0"',
        "quat='1 0 1 0'",
    ],
)
def test_all_ways_to_write_an_orientation_agree(tmp_path: Path, form: str) -> None:
    armature, _ = read(tmp_path, arm("<joint/>", body=form))
    # The z axis, that the hinge is about, is turned to +x in the file: +z on stage.
    x = Rotation.from_quat(armature.rest[1][1].copy()).apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(x, (0, 0, 1), atol=1e-9)


@pytest.mark.parametrize(("sequence", "axis"), [("xyz", (1, 0, 0)), ("XYZ", (0, -1, 0))])
def test_small_letters_turn_with_the_body_and_capitals_do_not(
    tmp_path: Path, sequence: str, axis: tuple[int, int, int]
) -> None:
    # Where z ends up after 90° about x and 90° about y: both the body's, or both the world's.
    armature, _ = read(tmp_path, arm("<joint/>", body='euler="90 90 0"'), eulerseq=sequence)
    x = Rotation.from_quat(armature.rest[1][1].copy()).apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(x, STAGE @ axis, atol=1e-9)


# -- ranges -----------------------------------------------------------------------------------


def bounds(armature: Armature, bone: str = "arm") -> list[list[float]]:
    index = armature.index(bone)
    both = np.degrees([armature.lower[index], armature.upper[index]]).T
    return [list(map(float, pair.round(3))) for pair in both]


def test_one_hinge_is_the_x_of_the_bone_and_the_bone_lies_along_its_y(tmp_path: Path) -> None:
    armature, _ = read(tmp_path, arm('<joint axis="0 1 0" range="-30 60"/>'))
    bone = armature.index("arm")
    assert bounds(armature) == [[-30, 60], [0, 0], [0, 0]]
    assert armature.freedoms[bone] == 1
    assert armature.tips[bone][1] == pytest.approx(0.51)
    np.testing.assert_allclose(armature.tips[bone][[0, 2]], 0.0, atol=1e-9)


def test_three_hinges_are_three_axes_whatever_their_hand(tmp_path: Path) -> None:
    right = '<joint axis="1 0 0" range="-1 2"/><joint axis="0 1 0" range="-3 4"/>'
    armature, _ = read(tmp_path, arm(right + '<joint axis="0 0 1" range="-5 6"/>'))
    assert bounds(armature) == [[-1, 2], [-3, 4], [-5, 6]]
    armature, _ = read(tmp_path, arm(right + '<joint axis="0 0 -1" range="-5 6"/>'))
    assert bounds(armature) == [[-1, 2], [-3, 4], [-6, 5]]
    assert armature.freedoms[armature.index("arm")] == 3


@pytest.mark.parametrize(
    ("attributes", "joint", "expected"),
    [
        ({}, 'range="-90 45"', [-90, 45]),
        ({"angle": "degree"}, 'range="-90 45"', [-90, 45]),
        ({"angle": "radian"}, 'range="-1.5707963 0.7853982"', [-90, 45]),
        ({}, "", [-math.inf, math.inf]),
        ({}, 'range="-90 45" limited="false"', [-math.inf, math.inf]),
        ({"autolimits": "false"}, 'range="-90 45"', [-math.inf, math.inf]),
        ({"autolimits": "false"}, 'range="-90 45" limited="true"', [-90, 45]),
        ({}, 'range="10 100" ref="30"', [-20, 70]),
        ({}, 'range="10 100"', [0, 100]),
    ],
)
def test_a_range_means_what_the_compiler_says(
    tmp_path: Path, attributes: dict[str, str], joint: str, expected: list[float]
) -> None:
    armature, warnings = read(tmp_path, arm(f"<joint {joint}/>"), **attributes)
    assert bounds(armature)[0] == expected
    assert any("'arm' rests outside" in text for text in warnings) == (joint == 'range="10 100"')


def test_what_a_joint_does_not_say_its_classes_do(tmp_path: Path) -> None:
    defaults = (
        '<default><joint axis="0 1 0" range="-1 1"/><default class="limb"><joint range="-2 2"/>'
        '<default class="far"><joint axis="1 0 0"/></default></default></default>'
    )

    def first(joint: str, body: str = "") -> tuple[list[float], list[float]]:
        armature, _ = read(tmp_path, defaults + arm(joint, body=body))
        x = Rotation.from_quat(armature.rest[1][1].copy()).apply([1.0, 0.0, 0.0])
        return bounds(armature)[0], (STAGE.T @ x).round(6).tolist()

    assert first("<joint/>") == ([-1, 1], [0, 1, 0])
    assert first('<joint class="limb"/>') == ([-2, 2], [0, 1, 0])
    assert first("<joint/>", 'childclass="far"') == ([-2, 2], [1, 0, 0])
    assert first('<joint class="limb" range="-3 3"/>', 'childclass="far"') == ([-3, 3], [0, 1, 0])


def test_hinges_about_one_axis_become_one_and_skewed_ones_are_told(tmp_path: Path) -> None:
    twice = '<joint range="-10 10"/><joint axis="0 0 -1" range="-5 20"/>'
    armature, warnings = read(tmp_path, arm(twice))
    assert bounds(armature)[0] == [-30, 15]
    assert any("'arm'" in text and "one axis" in text for text in warnings)
    armature, warnings = read(tmp_path, arm('<joint axis="1 0 0"/><joint axis="1 0 2"/>'))
    assert any("'arm'" in text and "square" in text for text in warnings)


@pytest.mark.parametrize(
    ("joint", "movement", "freedoms", "limit"),
    [
        ('<joint type="ball" range="0 40"/>', "turn", 3, 40),
        ('<joint type="ball"/>', "turn", 3, math.inf),
        ('<joint type="slide"/>', "slide", 0, math.inf),
        ("", "fixed", 0, math.inf),
        ('<joint type="slide"/><joint/>', "turn", 1, math.inf),
    ],
)
def test_a_bone_moves_as_its_joint_does(
    tmp_path: Path, joint: str, movement: str, freedoms: int, limit: float
) -> None:
    armature, _ = read(tmp_path, arm(joint))
    bone = armature.index("arm")
    assert armature.movements[bone] == movement
    assert armature.freedoms[bone] == freedoms
    assert math.degrees(armature.limits[bone]) == pytest.approx(limit)


@pytest.mark.parametrize(
    ("joint", "freedoms"),
    [
        ("<freejoint/>", 3),
        ('<joint type="free"/>', 3),
        ("", 3),
        ('<joint type="slide"/><joint range="-1 1"/>', 3),
        ('<joint range="-1 1"/>', 1),
    ],
)
def test_a_root_is_free_unless_hinges_alone_hold_it(
    tmp_path: Path, joint: str, freedoms: int
) -> None:
    armature, _ = read(tmp_path, f'<worldbody><body name="a">{joint}<geom/></body></worldbody>')
    assert armature.freedoms.tolist() == [freedoms]


# -- the tree ---------------------------------------------------------------------------------


def test_it_stands_on_the_floor_facing_forward_with_left_at_plus_x(tmp_path: Path) -> None:
    nose = '<body name="nose" pos="1 0 0"/>'
    armature, _ = read(
        tmp_path, arm("<joint/>").replace('<body name="arm"', nose + '<body name="arm"')
    )
    places = dict(zip(armature.names, armature.rest[0], strict=True))
    np.testing.assert_allclose(places["nose"] - places["trunk"], (0, 0, 1), atol=1e-9)
    np.testing.assert_allclose(places["arm"] - places["trunk"], (1, 0, 0), atol=1e-9)
    np.testing.assert_allclose(places["trunk"][[0, 2]], 0.0, atol=1e-9)
    assert min(armature.rest[0][:, 1].min(), armature.rest_tips[:, 1].min()) == pytest.approx(0.0)


def test_a_bone_turns_about_the_anchor_of_its_hinge(tmp_path: Path) -> None:
    armature, _ = read(tmp_path, arm('<joint axis="0 1 0" pos="0 0 0.25"/>'))
    np.testing.assert_allclose(armature.rest[0][1] - armature.rest[0][0], (1, 0.25, 0), atol=1e-9)


def test_frames_are_folded_in_and_scenery_is_left_out(tmp_path: Path) -> None:
    inside = arm("<joint/>").replace("<worldbody>", '<worldbody><frame pos="0 0 1">', 1)
    inside = inside.replace("</worldbody>", '</frame><body name="table"><geom/></body></worldbody>')
    armature, warnings = read(tmp_path, inside)
    assert armature.names == ("trunk", "arm")
    assert any("'table'" in text for text in warnings)


def test_massless_bodies_with_a_hinge_each_at_one_place_are_one_bone(tmp_path: Path) -> None:
    inner = '<body name="upper"><joint axis="0 0 1" range="-5 6"/><geom/></body>'
    middle = f'<body name="s2"><joint axis="0 1 0" range="-3 4"/>{inner}</body>'
    chain = f'<body name="s1" pos="0 1 0"><joint axis="1 0 0" range="-1 2"/>{middle}</body>'
    armature, warnings = read(
        tmp_path, f'<worldbody><body name="t"><freejoint/><geom/>{chain}</body></worldbody>'
    )
    assert armature.names == ("t", "upper")
    assert bounds(armature, "upper") == [[-1, 2], [-3, 4], [-5, 6]]
    assert any("'s1', 's2'" in text for text in warnings)


def test_bodies_without_a_name_or_with_the_same_get_one(tmp_path: Path) -> None:
    body = "<body{}><joint/><geom/></body>"
    inside = body.format("") + body.format(' name="a"') + body.format(' name="a"')
    armature, warnings = read(tmp_path, f"<worldbody>{inside}</worldbody>")
    assert armature.names == ("body_0", "a", "a_2")
    assert any("'body_0'" in text for text in warnings)
    assert any("'a_2'" in text for text in warnings)
    assert any("3 roots" in text and "'a_2'" in text for text in warnings)


# -- files ------------------------------------------------------------------------------------


def test_included_files_stand_where_the_include_stands(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/limb.xml").write_text(
        '<mujoco><body name="limb"><joint range="-1 1"/><include file="hand.xml"/></body></mujoco>'
    )
    (tmp_path / "parts/hand.xml").write_text('<mujoco><body name="hand" pos="0 0 1"/></mujoco>')
    (tmp_path / "set.xml").write_text('<mujoco><compiler angle="radian"/></mujoco>')
    armature, warnings = read(
        tmp_path,
        '<include file="set.xml"/><worldbody><body name="a"><freejoint/>'
        '<include file="parts/limb.xml"/><include file="parts/gone.xml"/></body></worldbody>',
    )
    assert armature.names == ("a", "limb", "hand")
    assert armature.upper[1, 0] == pytest.approx(1.0)
    assert any("parts/gone.xml" in text for text in warnings)


@pytest.mark.parametrize(
    ("inside", "says"),
    [
        ('<include file="../secret.xml"/>', "outside its folder"),
        ('<include file="/etc/passwd"/>', "outside its folder"),
        ('<include file="rig.xml"/>', "second time"),
        ("<include/>", "names no file"),
        ("<worldbody/>", "no bodies"),
        ("", "no bodies"),
        (arm('<joint type="screw"/>'), "no such type"),
        (arm('<joint axis="0 0 0"/>'), "no direction"),
        (arm('<joint axis="0 0"/>'), "axis is not 3 numbers"),
        (arm('<joint range="a b"/>'), "range is not 2 numbers"),
        (arm("<joint/>", body='pos="nan 0 0"').replace('pos="0 1 0"', ""), "pos is not"),
        (arm("<joint/>").replace("0 1 0", "0 1e30 0"), "out of this world"),
        ('<compiler eulerseq="abc"/>', "order of axes"),
        ('<compiler coordinate="global"/>', "global coordinates"),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_place(
    tmp_path: Path, inside: str, says: str
) -> None:
    with pytest.raises(BadFileError, match=says) as error:
        read(tmp_path, inside)
    assert error.value.where is not None
    assert "rig.xml" in error.value.where


def test_entities_are_never_unfolded(tmp_path: Path) -> None:
    path = tmp_path / "rig.xml"
    laughs = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 12))
    path.write_text(f'<!DOCTYPE m [<!ENTITY l0 "ha">{laughs}]><mujoco model="&l11;"/>')
    with pytest.raises(BadFileError, match="document type"):
        read_mjcf(path)


@given(data=st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_file_is_refused_or_read_but_never_crashes(
    tmp_path: Path, data: st.DataObject
) -> None:
    joints = '<joint type="ball" range="0 4"/><joint axis="1 0 0" range="-1 2"/><site pos="1 2 3"/>'
    limb = arm(joints, body='euler="1 2 3"')
    whole = f"<mujoco><compiler angle='radian'/>{limb}</mujoco>"
    text = list(whole)
    for _ in range(data.draw(st.integers(1, 6))):
        text[data.draw(st.integers(0, len(text) - 1))] = data.draw(
            st.sampled_from(list("0123456789.-e <>/\"'abn"))
        )
    path = tmp_path / "damaged.xml"
    path.write_text("".join(text))
    with contextlib.suppress(PuppetError):
        armature, _ = read_mjcf(path)
        assert np.isfinite(np.hstack([*armature.rest, armature.rest_tips])).all()


def test_the_ostrich_stands_as_its_authors_measured_it(shared: Path) -> None:
    armature, _ = read_mjcf(shared / "armatures/ostrich_mjcf/ostrich.xml")
    assert len(armature) == 31
    places = dict(zip(armature.names, armature.rest[0], strict=True))
    knee = armature.index("r_tibiotarsus")
    assert (armature.lower[knee, 0], armature.upper[knee, 0]) == (0.0, 2.0)
    assert armature.freedoms[armature.index("l_femur")] == 3
    assert armature.movements[armature.index("humerusr")] == "fixed"
    assert places["head"][1] > 2.0 > places["ostrich"][1]  # a neck of more than a metre
    assert places["head"][2] > 0.5  # facing +Z
    assert places["l_femur"][0] > places["r_femur"][0]  # left is at +X
    # Bending the knee brings the foot backwards, as the sign of its range says.
    bent = posed(armature, {"r_tibiotarsus": np.array([1.0, 0.0, 0.0])})
    foot = armature.index("r_pes")
    assert bent[foot, 2] < armature.rest[0][foot, 2] - 0.3


def test_a_foot_ends_at_its_toes_though_its_shin_points_down(tmp_path: Path) -> None:
    shape = '<geom type="capsule" fromto="-.07 0 0 .14 0 0" size=".03"/>'
    foot = f'<body name="foot" pos="0 0 -0.5">{shape}</body>'
    armature, _ = read(tmp_path, arm("<joint/>", more=foot))
    tip = armature.rest_tips[armature.index("foot")] - armature.rest[0][armature.index("foot")]
    np.testing.assert_allclose(tip, (0, 0, 0.17), atol=1e-9)
