"""ROS robots as armatures: links become bones, and their joints what the bones may do."""

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
from puppet.formats.urdf import read_urdf

BOX = '<visual><geometry><box size="0.2 0.2 0.2"/></geometry></visual>'


def read(folder: Path, inside: str) -> tuple[Armature, tuple[str, ...]]:
    path = folder / "rig.urdf"
    path.write_text(f'<?xml version="1.0"?><robot name="r">{inside}</robot>')
    return read_urdf(path)


def link(name: str, inside: str = BOX) -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(
    parent: str, child: str, *, kind: str = "revolute", at: str = "0 0 0", inside: str = ""
) -> str:
    return (
        f'<joint name="{parent}_{child}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{at}"/>{inside}</joint>'
    )


def hinge(axis: str, lower: float, upper: float) -> str:
    return f'<axis xyz="{axis}"/><limit lower="{lower}" upper="{upper}"/>'


def ranges(armature: Armature, bone: str) -> list[list[float]]:
    index = armature.index(bone)
    both: list[list[float]] = (
        np.array([armature.lower[index], armature.upper[index]]).T.round(6).tolist()
    )
    return both


def test_links_become_bones_that_face_forward_with_left_at_plus_x(tmp_path: Path) -> None:
    armature, warnings = read(
        tmp_path,
        link("base")
        + link("arm")
        + joint("base", "arm", at="0.5 0.3 1", inside=hinge("0 1 0", -0.5, 1.5)),
    )
    assert armature.names == ("base", "arm")
    np.testing.assert_allclose(armature.rest[0][1] - armature.rest[0][0], (0.3, 1, 0.5), atol=1e-9)
    assert ranges(armature, "arm") == [[-0.5, 1.5], [0, 0], [0, 0]]
    x = Rotation.from_quat(armature.rest[1][1].copy()).apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(x, (1, 0, 0), atol=1e-9)  # the file's +y
    assert armature.freedoms.tolist() == [3, 1]
    assert warnings == ()


def test_an_origin_turns_its_child_roll_first(tmp_path: Path) -> None:
    turned = joint("a", "b").replace('xyz="0 0 0"', 'xyz="0 0 0" rpy="0.3 0.5 0.7"')
    armature, _ = read(
        tmp_path,
        link("a") + link("b") + link("c") + turned + joint("b", "c", kind="fixed", at="1 2 3"),
    )
    r, p, y = (
        Rotation.from_euler(axis, angle) for axis, angle in zip("xyz", (0.3, 0.5, 0.7), strict=True)
    )
    expected = (y * p * r).apply([1.0, 2.0, 3.0])[[1, 2, 0]]
    np.testing.assert_allclose(armature.rest[0][2] - armature.rest[0][0], expected, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "inside", "movement", "freedoms"),
    [
        ("revolute", hinge("1 0 0", -1, 1), "turn", 1),
        ("continuous", "", "turn", 1),
        ("prismatic", hinge("1 0 0", 0, 1), "slide", 0),
        ("fixed", "", "fixed", 0),
        ("floating", "", "turn", 3),
        ("planar", "", "turn", 1),
    ],
)
def test_a_bone_moves_as_its_joint_does(
    tmp_path: Path, kind: str, inside: str, movement: str, freedoms: int
) -> None:
    armature, _ = read(
        tmp_path, link("a") + link("b") + joint("a", "b", kind=kind, at="0 0 1", inside=inside)
    )
    assert armature.movements == ("turn", movement)
    assert armature.freedoms[1] == freedoms


SHOULDER = (
    link("chest")
    + link("s1", "")
    + link("s2", "")
    + link("arm")
    + joint("chest", "s1", at="0 0.2 0", inside=hinge("0 1 0", -3, 1))
    + joint("s1", "s2", inside=hinge("1 0 0", -0.3, 2))
)


def test_three_hinges_at_one_place_are_one_bone_with_three_axes(tmp_path: Path) -> None:
    armature, warnings = read(
        tmp_path, SHOULDER + joint("s2", "arm", inside=hinge("0 0 1", -0.5, 0.7))
    )
    assert armature.names == ("chest", "arm")
    # y × x is -z, so the last axis points down, and its range with it.
    assert ranges(armature, "arm") == [[-3, 1], [-0.3, 2], [-0.7, 0.5]]
    assert armature.freedoms[1] == 3
    assert any("'s1', 's2'" in text for text in warnings)


@pytest.mark.parametrize(
    ("inside", "names"),
    [
        # the last hinge lies elsewhere: a bone of its own
        (joint("s2", "arm", at="0 0 -0.1", inside=hinge("0 0 1", -1, 1)), ("chest", "s2", "arm")),
        # about an axis that is there already
        (joint("s2", "arm", inside=hinge("0 1 0", -1, 1)), ("chest", "s2", "arm")),
        # not a hinge
        (joint("s2", "arm", kind="fixed"), ("chest", "s2", "arm")),
    ],
)
def test_hinges_that_are_no_ball_stay_bones(
    tmp_path: Path, inside: str, names: tuple[str, ...]
) -> None:
    armature, _ = read(tmp_path, SHOULDER + inside)
    assert armature.names == names


def test_a_link_with_something_to_see_is_not_merged_away(tmp_path: Path) -> None:
    shown = SHOULDER.replace('<link name="s1">', '<link name="s1">' + BOX)
    armature, _ = read(tmp_path, shown + joint("s2", "arm", inside=hinge("0 0 1", -1, 1)))
    assert armature.names == ("chest", "s1", "arm")


def test_frames_are_left_out_but_tell_where_a_bone_ends(tmp_path: Path) -> None:
    rod = link("rod", '<visual><geometry><mesh filename="rod.stl"/></geometry></visual>')
    armature, warnings = read(
        tmp_path,
        link("base")
        + rod
        + link("tool0", "")
        + link("tip", "")
        + joint("base", "rod", at="0 0 1", inside=hinge("0 1 0", -1, 1))
        + joint("rod", "tool0", kind="fixed", at="0 0 2")
        + joint("tool0", "tip", kind="fixed", at="0 0 0.5"),
    )
    assert armature.names == ("base", "rod")
    assert np.linalg.norm(armature.tips[1]) == pytest.approx(2.5)
    assert any("'tool0', 'tip'" in text for text in warnings)


def test_a_world_that_the_robot_is_fixed_to_is_no_bone(tmp_path: Path) -> None:
    inside = link("world", "") + link("base") + link("arm") + joint("world", "base", kind="fixed")
    armature, warnings = read(tmp_path, inside + joint("base", "arm", at="0 0 1"))
    assert armature.names == ("base", "arm")
    assert armature.freedoms[0] == 3
    assert any("'world'" in text for text in warnings)


def test_odd_ranges_are_repaired_and_told_by_the_bone(tmp_path: Path) -> None:
    armature, warnings = read(
        tmp_path,
        "".join(map(link, "abcd"))
        + joint("a", "b", at="0 0 1", inside=hinge("1 0 0", 2, -1))
        + joint("b", "c", at="0 0 1", inside=hinge("1 0 0", 0.5, 1))
        + joint("c", "d", at="0 0 1"),
    )
    assert ranges(armature, "b")[0] == [-1, 2]
    assert ranges(armature, "c")[0] == [0, 1]
    assert ranges(armature, "d")[0] == [-math.inf, math.inf]
    for bone, words in (("b", "backwards"), ("c", "outside its range"), ("d", "no range")):
        assert any(f"'{bone}'" in text and words in text for text in warnings)


@pytest.mark.parametrize(
    ("inside", "says"),
    [
        ("", "no links"),
        (link(""), "no name"),
        (link("a") + link("b"), "several roots"),
        (link("a") + joint("a", "gone"), "child is not there"),
        (link("a") + joint("gone", "a"), "parent is not there"),
        (link("a") + link("b") + joint("a", "b") + joint("a", "b"), "hangs on two joints"),
        (link("a") + link("b") + joint("a", "b") + joint("b", "a"), "a → b → a|b → a → b"),
        (
            "".join(map(link, "abcd")) + joint("b", "c") + joint("c", "d") + joint("d", "b"),
            "(?s)cycle.* → ",
        ),
        (link("a") + link("b") + joint("a", "b", kind="rubber"), "no such type"),
        (link("a") + link("b") + joint("a", "b", inside='<axis xyz="0 0 0"/>'), "no direction"),
        (link("a") + link("b") + joint("a", "b", at="1 2"), "xyz is not 3 numbers"),
        (link("a") + link("b") + joint("a", "b", at="0 0 inf"), "xyz is not 3 numbers"),
        (link("a") + '<joint type="fixed"><child link="a"/></joint>', "no parent link"),
        (link("${prefix}base"), "xacro"),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_place(
    tmp_path: Path, inside: str, says: str
) -> None:
    with pytest.raises(BadFileError, match=says) as error:
        read(tmp_path, inside)
    assert error.value.where is not None
    assert "rig.urdf" in error.value.where


@given(data=st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_file_is_refused_or_read_but_never_crashes(
    tmp_path: Path, data: st.DataObject
) -> None:
    whole = f"<robot>{SHOULDER}{joint('s2', 'arm', inside=hinge('0 0 1', -0.5, 0.7))}</robot>"
    text = list(whole)
    for _ in range(data.draw(st.integers(1, 6))):
        text[data.draw(st.integers(0, len(text) - 1))] = data.draw(
            st.sampled_from(list("0123456789.-e <>/\"'abn"))
        )
    path = tmp_path / "damaged.urdf"
    path.write_text("".join(text))
    with contextlib.suppress(PuppetError):
        armature, _ = read_urdf(path)
        assert np.isfinite(np.hstack([*armature.rest, armature.rest_tips])).all()
