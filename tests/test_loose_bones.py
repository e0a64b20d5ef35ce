"""Feet that a rig keeps apart from their legs are given back to them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from puppet.armature import Armature
from puppet.formats.gltf import load_model
from puppet.formats.loose_bones import with_loose_bones_attached
from puppet.mesh import Model
from puppet.pose import Pose, forward_kinematics, rest_pose
from puppet.rotation import exp
from tests.stage_models import tower


def biped(foot_on: str, at: tuple[float, float, float] = (0.2, 0.05, 0.0)) -> Armature:
    """Hips with two legs; the left foot hangs on `foot_on` ("" for nothing)."""
    names = ["root", "hips", "thigh.L", "shin.L", "thigh.R", "shin.R", "foot.L"]
    parents = [-1, 0, 1, 2, 1, 4, names.index(foot_on) if foot_on else -1]
    places = np.array(
        [[0, 0, 0], [0, 1, 0], [0.2, 0.95, 0], [0.2, 0.5, 0], [-0.2, 0.95, 0], [-0.2, 0.5, 0], at]
    )
    offsets = [
        places[i] - (places[parent] if parent >= 0 else 0) for i, parent in enumerate(parents)
    ]
    tips = np.array([[0, 1, 0], [0, 0.3, 0], *[[0, -0.45, 0]] * 4, [0, 0, 0.15]])
    return Armature.build("biped", names, parents, offsets, tips=tips)


def attached(armature: Armature) -> Model:
    return with_loose_bones_attached(Model(armature, ()))


def parent_of(armature: Armature, bone: str) -> str:
    parent = int(armature.parents[armature.index(bone)])
    return armature.names[parent] if parent >= 0 else ""


@pytest.mark.parametrize("apart", ["root", ""])
def test_a_foot_on_the_root_or_on_nothing_goes_to_its_leg(apart: str) -> None:
    model = attached(biped(apart))
    assert parent_of(model.armature, "foot.L") == "shin.L"
    assert "'foot.L'" in model.warnings[0]
    assert "'shin.L'" in model.warnings[0]


def test_the_rest_pose_is_the_same_afterwards() -> None:
    before, after = biped("root"), attached(biped("root")).armature
    for bone, name in enumerate(before.names):
        np.testing.assert_allclose(before.rest[0][bone], after.rest[0][after.index(name)])
        np.testing.assert_allclose(before.rest_tips[bone], after.rest_tips[after.index(name)])


def test_the_foot_follows_its_leg_from_then_on() -> None:
    armature = attached(biped("root")).armature
    pose = rest_pose(armature)
    bones = pose.bones.copy()
    bones[armature.index("thigh.L")] = exp(np.array([-0.8, 0.0, 0.0]))
    positions, _ = forward_kinematics(armature, Pose(pose.translation, pose.rotation, bones))
    gap = positions[armature.index("foot.L")] - positions[armature.index("shin.L")]
    assert np.linalg.norm(gap) == pytest.approx(0.45, abs=1e-9)


def test_a_foot_is_not_given_to_the_other_side() -> None:
    model = attached(biped("root", at=(-0.2, 0.05, 0.0)))
    assert parent_of(model.armature, "foot.L") == "root"


def test_what_lies_far_from_everything_stays_where_it_is() -> None:
    model = attached(biped("root", at=(0.8, 0.05, 0.0)))
    assert parent_of(model.armature, "foot.L") == "root"
    assert model.warnings == ()


def test_an_ordinary_rig_is_returned_as_it_is() -> None:
    model = Model(biped("shin.L"), ())
    assert with_loose_bones_attached(model) is model


def test_the_skin_stays_on_its_bones_when_their_order_changes() -> None:
    model = tower(2)
    names = ("foot.L", *biped("").names[:-1])
    source = biped("")
    order = [source.index(name) for name in names]
    armature = Armature.build(
        "shuffled",
        names,
        [names.index(parent_of(source, name)) if parent_of(source, name) else -1 for name in names],
        source.offsets[order],
        tips=source.tips[order],
    )
    mesh = replace(model.meshes[0], bones=np.zeros_like(model.meshes[0].bones))  # all on the foot
    mesh.bones[:, 0] = armature.index("foot.L")
    moved = with_loose_bones_attached(Model(armature, (mesh,)))
    assert parent_of(moved.armature, "foot.L") == "shin.L"
    assert set(moved.meshes[0].bones[:, 0]) == {moved.armature.index("foot.L")}


@pytest.mark.parametrize(
    ("rig", "foot", "leg"),
    [
        ("animals_pack__Husky.glb", "IKFrontLeg.L", "FrontLowerLeg.L"),
        ("animals_pack__Horse.glb", "IKBackLeg.R", "BackLowerLeg.R"),
        ("RobotExpressive.glb", "Foot.L", "LowerLeg.L"),
        ("dinosaurs_pack__Trex.glb", "BackFoot.R", "BackLowLeg.R"),
    ],
)
def test_real_rigs_get_their_feet_back(shared: Path, rig: str, foot: str, leg: str) -> None:
    armature = load_model(shared / "armatures" / rig).armature
    assert parent_of(armature, foot) == leg
