"""Left and right: by names where these say it, else by shape, whichever way a character faces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.armature import Armature, Side
from puppet.formats.model import load_model
from puppet.mapping.symmetry import facing, sides_of
from tests.armatures import armature_of, armatures
from tests.rig_changes import (
    bare,
    creatures,
    limb,
    mirrored,
    numbered,
    placed,
    renamed,
    reordered,
    shipped,
)

WITH_LIMBS = ("fish", "dog", "seagull", "ostrich")


def sides(armature: Armature) -> dict[str, Side]:
    return dict(zip(armature.names, sides_of(armature), strict=True))


def nameless(armature: Armature) -> Armature:
    return renamed(armature, numbered(armature, keep_sides=False))


@given(creatures())
def test_names_decide_where_they_say_anything(armature: Armature) -> None:
    if any(armature.sides):
        assert sides_of(armature) == armature.sides


# -- by shape ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", WITH_LIMBS)
@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_without_names_the_cast_has_the_same_left_and_right(name: str, scale: float) -> None:
    armature = shipped(name).armature
    assert sides_of(nameless(placed(armature, scale))) == armature.sides


@pytest.mark.parametrize("name", ["dog", "seagull", "ostrich"])
@given(yaw=st.floats(-1.8, 1.8))
def test_paws_say_left_and_right_of_those_that_look_to_a_side(name: str, yaw: float) -> None:
    armature = shipped(name).armature
    turned = placed(armature, 1.0, Rotation.from_euler("y", yaw))
    assert sides_of(nameless(turned)) == armature.sides


@pytest.mark.parametrize("name", WITH_LIMBS)
def test_who_turns_their_back_is_taken_to_face_us(name: str) -> None:
    """By glTF's convention, which a shape without names cannot gainsay."""
    armature = shipped(name).armature
    turned = placed(armature, 1.0, Rotation.from_euler("y", np.pi))
    across: dict[Side, Side] = {"L": "R", "R": "L", "": ""}
    assert sides_of(nameless(turned)) == tuple(across[side] for side in armature.sides)


@pytest.mark.parametrize("name", WITH_LIMBS)
@given(data=st.data())
def test_the_order_of_bones_does_not_change_sides(name: str, data: st.DataObject) -> None:
    armature = shipped(name).armature
    order = data.draw(st.permutations(range(len(armature))))
    told = reordered(nameless(armature), order)
    assert sides(told) == sides(nameless(armature))


@given(armatures(), st.data())
def test_the_order_of_bones_does_not_change_the_sides_of_anything(
    armature: Armature, data: st.DataObject
) -> None:
    order = data.draw(st.permutations(range(len(armature))))
    assert sides(reordered(armature, order)) == sides(armature)


@pytest.mark.parametrize("name", WITH_LIMBS)
def test_in_a_mirror_left_is_right(name: str) -> None:
    armature = shipped(name).armature
    told = nameless(mirrored(armature))
    across: dict[Side, Side] = {"L": "R", "R": "L", "": ""}
    assert sides_of(told) == tuple(across[side] for side in armature.sides)


def test_a_person_who_faces_along_x_has_the_left_at_minus_z(shared: Path) -> None:
    armature = load_model(shared / "armatures" / "cesium_man_embedded.gltf").armature
    assert not any(armature.sides)
    assert facing(armature) == "+x"
    found = sides_of(armature)
    left = [bone for bone, side in enumerate(found) if side == "L"]
    right = [bone for bone, side in enumerate(found) if side == "R"]
    assert len(left) == len(right) == 7  # a leg of four bones, an arm of three
    assert (armature.rest_tips[left, 2] < 0.0).all()
    assert (armature.rest_tips[right, 2] > 0.0).all()


REAL = sorted((Path(__file__).parents[2] / "shared" / "armatures").glob("*.glb"))


@pytest.mark.skipif(not REAL, reason="the shared rigs are not here")
@pytest.mark.parametrize("path", REAL, ids=lambda path: path.stem)
def test_the_shape_of_a_real_rig_says_what_its_names_say(path: Path) -> None:
    armature = load_model(path).armature
    assert sides_of(nameless(armature)) == armature.sides


@pytest.mark.parametrize(("name", "yaw"), [("dog", 0.0), ("seagull", 0.3), ("ostrich", -0.3)])
def test_where_a_character_looks_is_read_off_its_sides(name: str, yaw: float) -> None:
    armature = shipped(name).armature
    for turns, looks in enumerate(("+z", "+x", "-z", "-x")):
        turned = placed(armature, 1.0, Rotation.from_euler("y", yaw + turns * np.pi / 2))
        assert facing(turned) == looks


@st.composite
def handed_bodies(draw: st.DrawFn) -> Armature:
    """A standing body with arms and legs that have feet in front, named without a side."""
    stretch = draw(st.floats(0.5, 2.0))
    arms, legs = draw(st.integers(1, 3)), draw(st.integers(1, 3))
    bones = {"hips": ("", (0.0, 1.0, 0.0)), "chest": ("hips", (0.0, 0.5, 0.0))}
    found = {
        **bones,
        **limb("arm", "chest", (0.3 * stretch, 0.0, 0.05), arms, (0.05, 0.2, 0.0)),
        **limb("leg", "hips", (0.02, -0.4 * stretch, 0.0), legs, (0.1, 0.0, 0.0)),
        **{f"foot.{side}": (f"leg{legs - 1}.{side}", (0.0, -0.1, 0.0)) for side in ("L", "R")},
        **{f"toe.{side}": (f"foot.{side}", (0.0, 0.0, 0.15)) for side in ("L", "R")},
    }
    return bare(found)


@given(handed_bodies(), st.floats(-2.0, 2.0), st.tuples(*[st.floats(-10, 10)] * 3))
def test_a_body_with_feet_has_its_left_at_its_left(
    armature: Armature, yaw: float, place: tuple[float, float, float]
) -> None:
    told = nameless(placed(armature, 1.0, Rotation.from_euler("y", yaw), place))
    assert sides_of(told) == armature.sides


# -- where there is none ----------------------------------------------------------------------


@given(st.integers(1, 30), st.integers(0, 1000))
def test_a_single_chain_has_no_sides(count: int, seed: int) -> None:
    chain = {f"b{bone}": f"b{bone - 1}" if bone else "" for bone in range(count)}
    assert not any(sides_of(armature_of(chain, seed=seed)))


@pytest.mark.parametrize("name", ["lamp", "snake"])
def test_what_has_no_mirrored_limbs_has_no_sides(name: str) -> None:
    assert not any(sides_of(nameless(shipped(name).armature)))


def star(count: int) -> Armature:
    """So many equal limbs around one bone, like the legs of a stool."""
    angles = 2 * np.pi * (np.arange(count) + 0.25) / count
    bones = {"hub": ("", (0.0, 1.0, 0.0))}
    for number, angle in enumerate(angles):
        way = (float(np.cos(angle)), -0.5, float(np.sin(angle)))
        bones[f"ray{number}"] = ("hub", (0.1 * way[0], 0.0, 0.1 * way[2]))
        bones[f"end{number}"] = (f"ray{number}", way)
    return bare(bones)


@pytest.mark.parametrize("count", [3, 5, 7])
def test_three_alike_around_a_hub_are_no_left_and_right(count: int) -> None:
    assert not any(sides_of(star(count)))


def test_two_of_different_build_are_no_left_and_right() -> None:
    bones = {
        "hub": ("", (0.0, 1.0, 0.0)),
        "one": ("hub", (0.5, 0.0, 0.0)),
        "other": ("hub", (-0.5, 0.0, 0.0)),
        "one_end": ("one", (0.5, 0.0, 0.0)),
        "other_end": ("other", (-0.1, 0.0, 0.0)),
    }
    assert not any(sides_of(bare(bones)))


def test_one_above_the_other_is_no_left_and_right() -> None:
    bones = {
        "hub": ("", (0.0, 1.0, 0.0)),
        "up": ("hub", (0.0, 0.3, 0.0)),
        "down": ("hub", (0.0, -0.3, 0.0)),
        "up_end": ("up", (0.0, 0.3, 0.0)),
        "down_end": ("down", (0.0, -0.3, 0.0)),
    }
    assert not any(sides_of(bare(bones)))
