"""The cast: what script/make_cast.py builds, and what lies in configs/armatures."""

from __future__ import annotations

import importlib
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from puppet.armature import Armature
from puppet.formats.armature_toml import Puppet, load_puppet
from puppet.mesh import Mesh
from puppet.pose import Pose, forward_kinematics
from puppet.rotation import exp, rotate

ROOT = Path(__file__).parents[1]
FACTS = ROOT.parent / "shared" / "facts" / "published_mappings.toml"
ARMATURES = ROOT / "configs" / "armatures"

sys.path.insert(0, str(ROOT / "script"))
make_cast = importlib.import_module("make_cast")
CAST: tuple[str, ...] = make_cast.NAMES
GROUNDED = {"lamp", "dog", "seagull", "snake", "ostrich"} & set(CAST)


@pytest.fixture(scope="module")
def puppets() -> dict[str, Puppet]:
    return {name: load_puppet(ARMATURES / f"{name}.glb") for name in CAST}


def skin_of(puppet: Puppet) -> np.ndarray[Any, Any]:
    return np.concatenate([mesh.positions for mesh in puppet.model.meshes])


@pytest.mark.parametrize("name", CAST)
def test_the_script_builds_the_very_file_that_is_shipped(name: str) -> None:
    assert make_cast.build(name) == (ARMATURES / f"{name}.glb").read_bytes()


@pytest.mark.skipif(not FACTS.exists(), reason="the facts file is not here")
@pytest.mark.parametrize("name", CAST)
def test_bones_are_those_of_the_published_puppets(name: str, puppets: dict[str, Puppet]) -> None:
    expected = tomllib.loads(FACTS.read_text())[name]["parents"]
    armature = puppets[name].model.armature
    parents = {
        bone: armature.names[armature.parents[index]] if armature.parents[index] >= 0 else ""
        for index, bone in enumerate(armature.names)
    }
    assert parents == expected


@pytest.mark.parametrize("name", CAST)
def test_nothing_in_the_cast_needs_repair(name: str, puppets: dict[str, Puppet]) -> None:
    puppet = puppets[name]
    assert puppet.model.warnings == ()
    for mesh in puppet.model.meshes:
        np.testing.assert_allclose(mesh.weights.sum(axis=1), 1.0, atol=1e-4)
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-3)
    assert 3_000 <= sum(len(mesh.triangles) for mesh in puppet.model.meshes) <= 10_000
    assert len(puppet.model.meshes) >= 4  # that many colours


@pytest.mark.parametrize("name", CAST)
def test_faces_look_outwards(name: str, puppets: dict[str, Puppet]) -> None:
    for mesh in puppets[name].model.meshes:
        a, b, c = (mesh.positions[mesh.triangles[:, k]].astype(float) for k in range(3))
        normals = mesh.normals[mesh.triangles].mean(axis=1)
        faces = np.cross(b - a, c - a)
        agree = (faces * normals).sum(axis=1) / np.linalg.norm(faces, axis=1)
        area = np.linalg.norm(faces, axis=1)
        assert area[agree < 0.0].sum() < 0.01 * area.sum(), mesh.material.name


@pytest.mark.parametrize("name", CAST)
def test_at_rest_it_stands_on_the_floor_where_it_has_feet(
    name: str, puppets: dict[str, Puppet]
) -> None:
    puppet = puppets[name]
    assert puppet.traits.grounded == (name in GROUNDED)
    if name in GROUNDED:
        assert skin_of(puppet)[:, 1].min() == pytest.approx(0.0, abs=2e-3)


@pytest.mark.parametrize("name", CAST)
def test_left_is_at_plus_x_and_mirrors_right(name: str, puppets: dict[str, Puppet]) -> None:
    armature = puppets[name].model.armature
    origins = armature.rest[0]
    for bone, side in zip(armature.names, armature.sides, strict=True):
        if side == "L":
            left = origins[armature.index(bone)]
            right = origins[armature.index(bone.removesuffix("L") + "R")]
            assert left[0] > 0.0
            np.testing.assert_allclose(right, left * [-1, 1, 1], atol=1e-4)


def test_the_whole_published_cast_is_here() -> None:
    assert set(CAST) == {"fish", "lamp", "dog", "seagull", "snake", "ostrich"}


@pytest.mark.parametrize("name", ["dog", "seagull", "ostrich"])
def test_the_left_half_of_an_animal_mirrors_its_right(
    name: str, puppets: dict[str, Puppet]
) -> None:
    """In shape; the dog's patch over one eye is only paint, which cuts triangles elsewhere."""
    skin = np.unique(np.round(skin_of(puppets[name]).astype(float), 4), axis=0)
    gaps, _ = cKDTree(skin).query(skin * [-1.0, 1.0, 1.0])
    assert np.quantile(gaps, 0.9) < 1e-3
    assert gaps.max() < 0.02


@pytest.mark.parametrize(
    ("name", "tall"), [("dog", 0.75), ("seagull", 0.60), ("ostrich", 1.90), ("snake", 0.57)]
)
def test_animals_are_as_tall_as_they_should_be(
    name: str, tall: float, puppets: dict[str, Puppet]
) -> None:
    assert skin_of(puppets[name])[:, 1].max() == pytest.approx(tall, rel=0.05)


@pytest.mark.parametrize("name", ["dog", "seagull", "ostrich"])
def test_every_foot_stands_on_the_floor(name: str, puppets: dict[str, Puppet]) -> None:
    puppet = puppets[name]
    paws = [bone for bone in puppet.model.armature.names if "paw" in bone]
    assert paws
    for paw in paws:
        lowest = min(
            float(mesh.positions[share > 0.9, 1].min())
            for mesh in puppet.model.meshes
            if ((share := follows(mesh, puppet.model.armature.index(paw))) > 0.9).any()
        )
        assert lowest == pytest.approx(0.0, abs=3e-3), paw


@pytest.mark.parametrize("name", ["dog", "seagull", "ostrich"])
def test_no_limb_pulls_the_skin_of_the_other_side(name: str, puppets: dict[str, Puppet]) -> None:
    armature = puppets[name].model.armature
    for mesh in puppets[name].model.meshes:
        for bone, side in enumerate(armature.sides):
            if side:
                across = mesh.positions[:, 0] * (-1.0 if side == "L" else 1.0)
                assert follows(mesh, bone)[across > 0.03].max(initial=0.0) < 0.05


def follows(mesh: Mesh, bone: int) -> np.ndarray[Any, Any]:
    """How much each vertex follows a bone."""
    return np.asarray((mesh.weights * (mesh.bones == bone)).sum(axis=1))


def skinned(puppet: Puppet, pose: Pose) -> list[np.ndarray[Any, Any]]:
    """Each mesh's vertices in a pose, by linear blend skinning."""
    armature: Armature = puppet.model.armature
    origins, turns = forward_kinematics(armature, pose)
    rest_origins, rest_turns = armature.rest
    out = []
    for mesh in puppet.model.meshes:
        moved = np.zeros((len(mesh.positions), 3))
        for vertex, place in enumerate(mesh.positions.astype(float)):
            for bone, weight in zip(mesh.bones[vertex], mesh.weights[vertex], strict=True):
                if weight > 0.0:
                    back = rest_turns[bone] * [-1, -1, -1, 1]
                    own = rotate(back, place - rest_origins[bone])
                    moved[vertex] += weight * (origins[bone] + rotate(turns[bone], own))
        out.append(moved)
    return out


@pytest.mark.parametrize("name", CAST)
def test_bending_keeps_the_skin_whole(name: str, puppets: dict[str, Puppet]) -> None:
    puppet = puppets[name]
    armature = puppet.model.armature
    assert np.isfinite(armature.limits).all()
    bones = armature.rotations.copy()
    for bone in range(len(armature)):
        axis = np.zeros(3)
        axis[bone % 3] = min(float(armature.limits[bone]), 0.5)
        bones[bone] = exp(axis)
    pose = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), bones)
    for mesh, moved in zip(puppet.model.meshes, skinned(puppet, pose), strict=True):
        assert np.isfinite(moved).all()
        edges = mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        before = np.linalg.norm(np.diff(mesh.positions[edges], axis=1), axis=2)
        after = np.linalg.norm(np.diff(moved[edges], axis=1), axis=2)
        # Skin stretches at joints, but no vertex is left behind by its neighbours.
        assert (after - before).max() < 0.15 * armature.size


def test_only_the_middle_of_the_fish_differs_from_its_human_bone_in_freedom(
    puppets: dict[str, Puppet],
) -> None:
    """The human pelvis has 3 degrees, other human bones 2; a free bone can follow either."""
    fish = puppets["fish"].model.armature
    free = np.isinf(np.hstack([fish.lower, fish.upper])).min(axis=1).tolist()
    assert fish.freedoms[fish.index("middle")] == 2
    assert [name for name, is_free in zip(fish.names, free, strict=True) if not is_free] == [
        "middle"
    ]


def test_the_lamp_bends_at_bolts_along_z(puppets: dict[str, Puppet]) -> None:
    lamp = puppets["lamp"].model.armature
    for bone in lamp.names[1:]:
        turns = lamp.upper[lamp.index(bone)] > lamp.lower[lamp.index(bone)]
        assert turns.tolist() == [False, False, True], bone


@pytest.mark.parametrize("name", CAST)
def test_left_and_right_bones_turn_as_in_a_mirror(name: str, puppets: dict[str, Puppet]) -> None:
    """About x alike, about y and z the other way round."""
    armature = puppets[name].model.armature
    for bone, side in enumerate(armature.sides):
        if side == "L":
            other = armature.index(armature.names[bone].removesuffix("L") + "R")
            flip = np.array([1.0, -1.0, -1.0])
            bounds = np.sort([armature.lower[other] * flip, armature.upper[other] * flip], axis=0)
            np.testing.assert_array_equal(bounds, [armature.lower[bone], armature.upper[bone]])
            assert armature.limits[bone] == armature.limits[other]


def test_the_seagull_with_a_master_is_the_seagull_and_a_handle_for_both_wings(
    puppets: dict[str, Puppet],
) -> None:
    mastered = load_puppet(ARMATURES / "seagull_with_master.toml")
    assert mastered.traits.masters == {"wings": ("wing_tip.L", "wing_tip.R")}
    assert mastered.traits.bones == puppets["seagull"].traits.bones
    assert mastered.traits.grounded
    assert puppets["seagull"].traits.masters == {}


@pytest.mark.parametrize(
    "truth", sorted(ARMATURES.glob("*.truth.toml")), ids=lambda path: path.name.split(".")[0]
)
def test_what_is_said_to_be_right_is_about_bones_that_there_are(truth: Path) -> None:
    said = tomllib.loads(truth.read_text())
    armature = load_puppet(ARMATURES / said["rig"]).model.armature
    names = set(armature.names)
    leaves = {
        bone for bone, below in zip(armature.names, armature.children, strict=True) if not below
    }
    forward, inverse = said["fk"], said["ik"]
    assert set(forward["expect"]) | set(forward["unmapped"]) <= names
    assert {bone for limb in forward["ordered"] for bone in limb} <= names
    assert set(inverse["expect"]) | set(inverse["unmapped"]) <= leaves | set(
        inverse.get("masters", {})
    )


@pytest.mark.skipif(not FACTS.exists(), reason="the facts file is not here")
@pytest.mark.parametrize("name", [*CAST, "seagull_with_master"])
def test_what_is_said_to_be_right_is_what_was_published(name: str) -> None:
    published = tomllib.loads(FACTS.read_text())[name]
    said = tomllib.loads((ARMATURES / f"{name}.truth.toml").read_text())[published["mode"]]
    assert said["expect"] == published["expect"]
    assert said["unmapped"] == published.get("unmapped", [])
    assert sorted(said.get("ordered", [])) == sorted(published.get("ordered", []))
    assert said.get("masters", {}) == published.get("masters", {})


def test_arms_up_open_the_fish() -> None:
    """Its fins hang at rest, and at their limit they point above the horizontal."""
    armature = load_puppet(ARMATURES / "fish.glb").model.armature
    for side, sign in (("L", 1.0), ("R", -1.0)):
        fin = armature.index(f"fin.{side}")
        way = armature.rest_tips[fin] - armature.rest[0][fin]
        below = np.degrees(np.arctan2(-way[1], sign * way[0]))
        assert 40.0 < below < 65.0
        opened = rotate(exp(np.array([0.0, 0.0, sign * armature.limits[fin]])), way)
        assert opened[1] > 0.0


def test_a_raised_arm_lifts_the_shade_of_the_lamp() -> None:
    armature = load_puppet(ARMATURES / "lamp.glb").model.armature
    bones = armature.rotations.copy()
    bones[armature.index("upper_arm")] = exp(np.array([0.0, 0.0, np.radians(-60.0)]))
    origins, _ = forward_kinematics(
        armature, Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), bones)
    )
    shade = armature.index("shade")
    assert origins[shade, 1] > armature.rest[0][shade, 1] + 0.3


@pytest.mark.parametrize("name", ["fish", "ostrich"])
def test_a_puppet_can_be_made_as_tall_as_a_show_wants(name: str) -> None:
    model = load_puppet(ARMATURES / f"{name}.glb").model
    small = model.scaled(0.5 / model.height)
    assert small.height == pytest.approx(0.5, abs=1e-3)
    np.testing.assert_allclose(
        small.armature.rest_tips * (model.height / 0.5), model.armature.rest_tips, atol=1e-5
    )
