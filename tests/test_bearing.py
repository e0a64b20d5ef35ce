"""What a model's file does not say: whether it stands on the floor, and where it looks."""

from __future__ import annotations

from pathlib import Path

import pytest
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.formats.armature_toml import load_puppet
from puppet.mapping.body_axis import stands_upright
from puppet.mapping.symmetry import facing

CAST = Path(__file__).resolve().parents[1] / "configs" / "armatures"


def turned(armature: Armature, degrees: float) -> Armature:
    """The armature turned about +Y; its bones' own frames are parallel to it at rest."""
    turn = Rotation.from_euler("y", degrees, degrees=True)
    return Armature.build(
        armature.name,
        armature.names,
        armature.parents.tolist(),
        turn.apply(armature.offsets.copy()),
        tips=turn.apply(armature.tips.copy()),
    )


@pytest.mark.parametrize("name", ["dog", "fish", "seagull", "ostrich"])
@pytest.mark.parametrize(("degrees", "way"), [(0, "+z"), (90, "+x"), (180, "-z"), (270, "-x")])
def test_left_and_right_say_where_a_character_looks(name: str, degrees: float, way: str) -> None:
    armature = load_puppet(CAST / f"{name}.glb").model.armature
    assert facing(turned(armature, degrees)) == way


@pytest.mark.parametrize("name", ["lamp", "snake"])
def test_what_has_no_sides_looks_ahead(name: str) -> None:
    assert facing(turned(load_puppet(CAST / f"{name}.glb").model.armature, 90)) == "+z"


def test_a_figure_that_looks_sideways_is_turned_to_the_audience_and_says_so(shared: Path) -> None:
    puppet = load_puppet(shared / "armatures" / "cesium_man_embedded.gltf")
    assert facing(puppet.model.armature) == "+z"
    assert any("+x" in warning for warning in puppet.model.warnings)


@pytest.mark.parametrize(
    ("rig", "stands"),
    [
        ("Fox_bevy.glb", True),
        ("RobotExpressive.glb", True),
        ("ostrich_mjcf/ostrich.xml", True),
        ("cute_fish_pack__Clownfish.glb", False),
        ("fish_pack__Fish2.glb", False),
    ],
)
def test_a_model_whose_lowest_point_is_on_the_floor_stands_on_it(
    shared: Path, rig: str, stands: bool
) -> None:
    assert load_puppet(shared / "armatures" / rig).traits.grounded is stands


@pytest.mark.parametrize(
    ("rig", "upright"),
    [
        ("RobotExpressive.glb", True),
        ("cesium_man_embedded.gltf", True),
        ("Fox_bevy.glb", False),
        ("animals_pack__Horse.glb", False),
    ],
)
def test_a_body_that_lies_along_the_ground_is_told_from_one_that_stands(
    shared: Path, rig: str, upright: bool
) -> None:
    assert stands_upright(load_puppet(shared / "armatures" / rig).model.armature) is upright
