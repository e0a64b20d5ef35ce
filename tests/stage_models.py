"""Small models and performers for tests of what is drawn."""

from __future__ import annotations

import numpy as np

from puppet.armature import Armature
from puppet.mesh import Material, Mesh, Model
from puppet.skeleton import Joint, SkeletonFrame

WHITE = Material("white", (0.9, 0.9, 0.9, 1.0))


def tower(bones: int, height: float = 1.0, width: float = 0.2, material: Material = WHITE) -> Model:
    """A square post along +Y, one stiff box for each of its bones, which hang on one another."""
    step = height / bones
    armature = Armature.build(
        "tower",
        [f"bone{i}" for i in range(bones)],
        list(range(-1, bones - 1)),
        [[0.0, 0.0 if i == 0 else step, 0.0] for i in range(bones)],
        tips=np.tile([0.0, step, 0.0], (bones, 1)),
    )
    parts = [box(width, i * step, (i + 1) * step) for i in range(bones)]
    positions = np.concatenate([part[0] for part in parts])
    normals = np.concatenate([part[1] for part in parts])
    triangles = np.concatenate([part[2] + 24 * i for i, part in enumerate(parts)])
    holding = np.zeros((len(positions), 4), np.uint16)
    holding[:, 0] = np.repeat(np.arange(bones), 24)
    weights = np.zeros((len(positions), 4), np.float32)
    weights[:, 0] = 1.0
    mesh = Mesh(
        positions.astype(np.float32),
        normals.astype(np.float32),
        np.zeros((len(positions), 2), np.float32),
        holding,
        weights,
        triangles.astype(np.uint32),
        material,
    )
    return Model(armature, (mesh,))


def box(width: float, low: float, high: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions (24, 3), normals (24, 3) and triangles (12, 3), counter-clockwise from outside."""
    corners: list[np.ndarray] = []
    normals: list[np.ndarray] = []
    triangles: list[tuple[int, int, int]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            n = np.zeros(3)
            n[axis] = sign
            u = np.roll(np.eye(3)[axis], 1)
            v = np.cross(n, u)
            first = len(corners)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = n + a * u + b * v
                corners.append(corner * (width / 2, 0.5, width / 2) + (0, 0.5, 0))
                normals.append(n)
            triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    positions = np.array(corners)
    positions[:, 1] = low + positions[:, 1] * (high - low)
    return positions, np.array(normals), np.array(triangles)


def standing(states: int = 2) -> SkeletonFrame:
    """A performer with the arms a little out, facing +Z."""
    places = {
        Joint.HIP_CENTER: (0.0, 0.95, 0.0),
        Joint.SPINE: (0.0, 1.08, 0.0),
        Joint.SHOULDER_CENTER: (0.0, 1.44, 0.0),
        Joint.HEAD: (0.0, 1.64, 0.02),
    }
    for word, side in (("LEFT", 1.0), ("RIGHT", -1.0)):
        for name, x, y, z in (
            ("SHOULDER", 0.17, 1.40, 0.0),
            ("ELBOW", 0.40, 1.20, 0.0),
            ("WRIST", 0.55, 1.00, 0.05),
            ("HAND", 0.60, 0.94, 0.06),
            ("HIP", 0.10, 0.88, 0.0),
            ("KNEE", 0.13, 0.48, 0.03),
            ("ANKLE", 0.14, 0.09, 0.0),
            ("FOOT", 0.16, 0.03, 0.13),
        ):
            places[Joint[f"{name}_{word}"]] = (side * x, y, z)
    positions = np.array([places[joint] for joint in Joint])
    return SkeletonFrame(0.0, 0, 0, positions, np.full(len(Joint), states, np.uint8))
