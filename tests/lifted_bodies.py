"""Bodies before a camera, as the pose network would give them."""

from __future__ import annotations

import numpy as np

from puppet.kernel import Floats
from puppet.tracking.body.depth_probe import INSETS
from puppet.tracking.cameras.camera import Depth, Shot
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.people.blazepose import LANDMARK_COUNT, Landmarks, Region

WIDTH, HEIGHT = 1280, 720
LENS = Intrinsics.assumed(WIDTH, HEIGHT)
BLACK = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
LEFT_WRIST = 15


def shot(time: float = 0.0, depth: Depth | None = None, up: Floats | None = None) -> Shot:
    return Shot(time, round(30 * time), BLACK, depth, LENS, up)


def random_body(seed: int) -> Floats:
    """(33, 3) metres about the middle of the hips: x right, y down, z away."""
    world = np.random.default_rng(seed).normal(0.0, [0.15, 0.3, 0.12], (LANDMARK_COUNT, 3))
    return np.asarray(world - world[[23, 24]].mean(axis=0))


def standing_body() -> Floats:
    """(33, 3) metres of somebody who faces the camera with hanging arms."""
    world = np.zeros((LANDMARK_COUNT, 3))
    world[:11] = (0.0, -0.68, -0.05)
    world[[7, 8]] = [(0.08, -0.68, 0.0), (-0.08, -0.68, 0.0)]
    sides = {11: (0.18, -0.48), 13: (0.22, -0.20), 15: (0.24, 0.05), 17: (0.24, 0.12),
             19: (0.24, 0.12), 21: (0.22, 0.10), 23: (0.10, 0.0), 25: (0.11, 0.40),
             27: (0.12, 0.80), 29: (0.12, 0.84), 31: (0.13, 0.86)}  # fmt: skip
    for left, (x, y) in sides.items():
        world[left], world[left + 1] = (x, y, 0.0), (-x, y, 0.0)
    world[[31, 32], 2] = -0.12
    return world


def landmarks(
    world: Floats,
    place: tuple[float, float, float],
    *,
    visibility: float | Floats = 1.0,
    presence: float = 1.0,
    size: float = 1.0,
) -> Landmarks:
    """What the network would say of that body with its hips at `place` (x right, y down, z away),
    metres. It takes everybody for an average person, and looks at them straight ahead."""
    at = world * size + place
    pixels = LENS.pixels(at)
    centre = LENS.pixels(np.array([place]))[0]
    # The region is seen from straight ahead, so the network's axes are turned to the ray there.
    ray = np.array([*LENS.rays(centre[None])[0], 1.0])
    seen = world @ _turned_ahead(ray / np.linalg.norm(ray)).T
    return Landmarks(
        pixels,
        seen,
        np.full(LANDMARK_COUNT, visibility),
        np.full(LANDMARK_COUNT, presence),
        1.0,
        Region(centre, 2.2 * size * LENS.focal_x / place[2], 0.0),
    )


def _turned_ahead(ray: Floats) -> Floats:
    """The smallest rotation that takes the ray to straight ahead."""
    cross = np.cross(ray, [0.0, 0.0, 1.0])
    k = np.array(
        [[0.0, -cross[2], cross[1]], [cross[2], 0.0, -cross[0]], [-cross[1], cross[0], 0.0]]
    )
    return np.asarray(np.eye(3) + k + k @ k / (1.0 + ray[2]))


def camera_axes(world: Floats, place: tuple[float, float, float]) -> Floats:
    """x right, y up, z from the scene to the camera."""
    return np.asarray((world + place) * (1.0, -1.0, -1.0))


def depth_of(at: Floats, wall: float = 6.0, reach: int = 5) -> Depth:
    """A depth image, a quarter of the size, with a patch of skin before each of the 33 points, as
    far before it as an adult's; a wall behind."""
    image = np.full((HEIGHT // 4, WIDTH // 4), round(1000 * wall), np.uint16)
    points = (LENS.pixels(at) + 0.5) / 4.0 - 0.5
    skin = at[:, 2] - INSETS
    for (x, y), z in sorted(zip(points.tolist(), skin, strict=True), key=lambda p: -p[1]):
        row, column = round(y), round(x)
        top, left = max(row - reach, 0), max(column - reach, 0)
        image[top : row + reach + 1, left : column + reach + 1] = round(1000 * z)
    return image
