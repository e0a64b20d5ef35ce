"""Depth images of a body that is known: what a stereo camera would measure of it.

There is no recording of people with depth and with ground truth. So the triangulated skeleton gets
a body of balls, is looked at from a camera's place, and what is seen is spoilt as stereo spoils it:
errors that grow with the square of the distance, holes along edges and here and there. Half
synthetic, and called so wherever its figures are given.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from puppet.kernel import Floats
from puppet.skeleton import JOINT_PARENTS, Joint
from puppet.tracking.cameras.camera import Depth
from puppet.tracking.cameras.intrinsics import Intrinsics

#: Metres: how thick a body is about the bone that ends in each joint.
RADII: Final = {
    "HIP_CENTER": 0.14,
    "SPINE": 0.14,
    "SHOULDER_CENTER": 0.13,
    "HEAD": 0.09,
    "SHOULDER": 0.07,
    "ELBOW": 0.05,
    "WRIST": 0.04,
    "HAND": 0.04,
    "HIP": 0.11,
    "KNEE": 0.08,
    "ANKLE": 0.05,
    "FOOT": 0.04,
}
BALLS: Final = 10
#: The depth image has so many times fewer pixels along each side.
COARSER: Final = 4
#: Of the stereo pair: focal length times baseline, pixel metres, and how well a disparity is found,
#: pixels (an OAK-D at 1280 pixels: 800 × 0.075).
FOCAL_BASELINE: Final = 60.0
DISPARITY_NOISE: Final = 0.25
WALL: Final = 6.0
HOLES: Final = 0.05


def body_depth(joints: Floats, lens: Intrinsics, size: tuple[int, int], seed: int) -> Depth:
    """(h, w) millimetres of a body before a wall.

    joints: (20, 3) metres before the lens, x right, y down, z away. size: width and height of the
    colour image that the lens is of.
    """
    width, height = size[0] // COARSER, size[1] // COARSER
    small = lens.resized(1.0 / COARSER)
    metres = np.full((height, width), WALL)
    for joint, parent in enumerate(JOINT_PARENTS):
        start = joints[parent] if parent >= 0 else joints[joint]
        radius = _radius(Joint(joint))
        for share in np.linspace(0.0, 1.0, BALLS):
            _draw_ball(metres, start + share * (joints[joint] - start), radius, small)
    return _as_measured(metres, np.random.default_rng(seed))


def _radius(joint: Joint) -> float:
    return RADII.get(joint.name) or RADII[joint.name.rsplit("_", 1)[0]]


def _draw_ball(metres: Floats, centre: Floats, radius: float, lens: Intrinsics) -> None:
    if centre[2] < 0.3:
        return
    height, width = metres.shape
    (x, y), reach = lens.pixels(centre[None])[0], radius * lens.focal_x / centre[2] + 1.0
    left, right = max(int(x - reach), 0), min(int(x + reach) + 2, width)
    top, bottom = max(int(y - reach), 0), min(int(y + reach) + 2, height)
    if left >= right or top >= bottom:
        return
    columns, rows = np.meshgrid(np.arange(left, right), np.arange(top, bottom))
    rays = np.stack(
        [(columns - lens.centre_x) / lens.focal_x, (rows - lens.centre_y) / lens.focal_y], axis=-1
    )
    # The nearer of the two points at which a line of sight (x, y, 1) · z meets the ball.
    square = 1.0 + np.sum(rays * rays, axis=-1)
    along = rays @ centre[:2] + centre[2]
    inside = along * along - square * (float(centre @ centre) - radius * radius)
    hit = inside > 0.0
    z = np.where(hit, (along - np.sqrt(np.maximum(inside, 0.0))) / square, np.inf)
    part = metres[top:bottom, left:right]
    np.minimum(part, z, out=part)


def _as_measured(metres: Floats, noise: np.random.Generator) -> Depth:
    """Noise that neighbours share, as windows of stereo matching do, and holes."""
    rough = cv2.GaussianBlur(noise.normal(size=metres.shape), (0, 0), 1.5)
    rough *= DISPARITY_NOISE / rough.std()
    measured = metres + metres * metres / FOCAL_BASELINE * rough
    kernel = np.ones((3, 3), np.uint8)
    edge = cv2.dilate(metres, kernel) - cv2.erode(metres, kernel) > 0.3
    holes = cv2.GaussianBlur(noise.random(metres.shape), (0, 0), 2.0)
    holes = holes < np.quantile(holes, HOLES)
    measured[edge | holes] = 0.0
    return np.asarray(np.clip(1000.0 * measured, 0.0, 65535.0), np.uint16)
