"""The hierarchy: what is checked, what is ordered, what is read off it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from puppet.armature import Armature, side_of
from puppet.errors import PuppetError
from tests.armatures import armature_of, armatures


@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("fin.L", "L"),
        ("fin_tip.R", "R"),
        ("arm_l", "L"),
        ("leg-r.001", "R"),
        ("mixamorig:LeftArm", "L"),
        ("RightHand", "R"),
        ("hand right", "R"),
        ("l_eye", "L"),
        ("tail", ""),
        ("lower_arm", ""),
        ("collar", ""),
        ("leftover", ""),
        ("Bright", ""),
        ("b12.L", "L"),
    ],
)
def test_the_side_is_read_from_the_name(name: str, side: str) -> None:
    assert side_of(name) == side


def test_parents_come_first_whatever_the_order_given() -> None:
    built = Armature.build("x", ["tip", "root", "middle"], [2, -1, 1], np.eye(3))
    assert built.names == ("root", "middle", "tip")
    assert list(built.parents) == [-1, 0, 1]


@pytest.mark.parametrize(
    ("names", "parents", "says"),
    [
        ([], [], "no bones"),
        (["a", "a"], [-1, 0], "not unique"),
        (["a", "b"], [1, 0], "own ancestors"),
        (["a", "b"], [-1, 7], "not there"),
    ],
)
def test_an_impossible_hierarchy_is_refused(
    names: list[str], parents: list[int], says: str
) -> None:
    with pytest.raises(PuppetError, match=says):
        Armature.build("broken", names, parents, np.zeros((len(names), 3)))


def test_an_unknown_bone_is_answered_with_the_known_ones() -> None:
    with pytest.raises(PuppetError, match="one of hub, tip"):
        armature_of({"hub": "", "tip": "hub"}).index("nose")


@given(armatures())
def test_a_bone_ends_in_the_middle_of_its_children(armature: Armature) -> None:
    positions, _ = armature.rest
    for bone, children in enumerate(armature.children):
        if children:
            np.testing.assert_allclose(
                armature.rest_tips[bone], positions[list(children)].mean(axis=0), atol=1e-9
            )
