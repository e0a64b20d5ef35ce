"""Boxes around bones hold the skin, however it is posed."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.mesh import Model
from puppet.pose import Pose, forward_kinematics, rest_pose
from puppet.render.boxes import BoneBoxes, corners_of, matrices
from puppet.render.performer import figure
from puppet.render.rods import boxes_of, unit_capsule
from puppet.rotation import exp
from tests.stage_models import standing, tower


@given(seed=st.integers(0, 2**32 - 1), bones=st.integers(1, 5))
def test_every_point_of_the_skin_is_in_a_box(seed: int, bones: int) -> None:
    random = np.random.default_rng(seed)
    model = tower(bones)
    pose = rest_pose(model.armature)
    turned = np.array([exp(random.normal(size=3)) for _ in range(bones)])
    pose = Pose(random.normal(size=3), exp(random.normal(size=3)), turned)
    origins, rotations = forward_kinematics(model.armature, pose)
    frames = matrices(rotations)
    boxes = BoneBoxes(model).at(origins, frames)

    (mesh,) = model.meshes
    triangle = mesh.triangles[random.integers(0, len(mesh.triangles), 60)]
    shares = random.dirichlet(np.ones(3), 60)
    points = (mesh.positions[triangle] * shares[:, :, None]).sum(axis=1)
    held = mesh.bones[triangle[:, 0], 0]
    own = points - model.armature.rest[0][held]
    world = origins[held] + (frames[held] @ own[:, :, None])[:, :, 0]
    inside = (world[:, None] >= boxes[:, 0] - 1e-6) & (world[:, None] <= boxes[:, 1] + 1e-6)
    assert inside.all(axis=2).any(axis=1).all()


def test_a_bone_without_skin_has_a_box_at_its_origin() -> None:
    armature = Armature.build("bare", ["a", "b"], [-1, 0], [[0, 1, 0], [0, 2, 0]])
    boxes = BoneBoxes(Model(armature, ())).at(armature.rest[0], matrices(armature.rest[1]))
    np.testing.assert_allclose(boxes[:, 0], [[0, 1, 0], [0, 3, 0]])
    np.testing.assert_allclose(boxes[:, 1], boxes[:, 0])
    assert corners_of(boxes).shape == (16, 3)


def test_the_boxes_of_a_figure_hold_all_its_joints() -> None:
    frame = standing()
    boxes = boxes_of(figure(frame.positions, frame.states).solid)
    inside = (frame.positions[:, None] > boxes[:, 0]) & (frame.positions[:, None] < boxes[:, 1])
    assert np.all(np.any(np.all(inside, axis=2), axis=1))


def test_a_capsule_is_round_and_faces_outwards() -> None:
    vertices, triangles = unit_capsule(12, 3)
    np.testing.assert_allclose(np.linalg.norm(vertices[:, :3], axis=1), 1.0, atol=1e-6)
    places = vertices[:, :3] + vertices[:, 3:] * (0.0, 2.0, 0.0)
    a, b, c = places[triangles].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    outwards = (normals * ((a + b + c) / 3 - (0.0, 1.0, 0.0))).sum(axis=1)
    assert (outwards > -1e-7).all()
    assert len(unit_capsule(12, 0)[1]) == 24
