"""A camera that orbits a target."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from puppet.kernel import Floats

#: Radians; beyond it the camera would tumble over the target, or sink into the floor.
_PITCH_RANGE = (-0.15, 1.5)
_DISTANCE_RANGE = (0.3, 40.0)


@dataclass(frozen=True, slots=True)
class Camera:
    """Where the picture is taken from. Each movement returns a new camera.

    yaw: radians about +Y; at 0 the camera stands on +Z and sees the performer's face.
    pitch: radians above the horizon. distance: metres from the target.
    target: metres, the point in the middle of the picture, in the world.
    field_of_view: radians, the picture's height.
    """

    yaw: float = 0.0
    pitch: float = 0.16
    distance: float = 5.0
    target: tuple[float, float, float] = (0.0, 0.9, 0.0)
    field_of_view: float = 0.55
    near: float = 0.1
    far: float = 80.0

    @property
    def axes(self) -> Floats:
        """(3, 3), rows: the picture's right, its up, and backwards from it; world_from_view.T"""
        sy, cy = math.sin(self.yaw), math.cos(self.yaw)
        sp, cp = math.sin(self.pitch), math.cos(self.pitch)
        return np.array([[cy, 0.0, -sy], [-sy * sp, cp, -cy * sp], [sy * cp, sp, cy * cp]])

    @property
    def eye(self) -> Floats:
        """(3,) metres, where the camera is in the world."""
        eye: Floats = np.asarray(self.target) + self.distance * self.axes[2]
        return eye

    def view_from_world(self) -> Floats:
        """(4, 4), to be multiplied with columns. The view looks along -Z."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.axes
        matrix[:3, 3] = -self.axes @ self.eye
        return matrix

    def clip_from_view(self, aspect: float) -> Floats:
        """(4, 4) perspective, to be multiplied with columns; aspect is width / height."""
        scale = 1.0 / math.tan(self.field_of_view / 2.0)
        depth = self.near - self.far
        return np.array(
            [
                [scale / aspect, 0.0, 0.0, 0.0],
                [0.0, scale, 0.0, 0.0],
                [0.0, 0.0, (self.far + self.near) / depth, 2.0 * self.far * self.near / depth],
                [0.0, 0.0, -1.0, 0.0],
            ]
        )

    def clip_from_world(self, aspect: float) -> Floats:
        """(4, 4), to be multiplied with columns."""
        return self.clip_from_view(aspect) @ self.view_from_world()

    def project(self, points: ArrayLike, size: tuple[int, int]) -> Floats:
        """Pixels from the top left of a picture of `size` (width, height). (N, 3) -> (N, 2)

        A point behind the camera has no place in the picture: NaN.
        """
        world = np.atleast_2d(np.asarray(points, float))
        clip = np.column_stack([world, np.ones(len(world))])
        clip = clip @ self.clip_from_world(size[0] / size[1]).T
        with np.errstate(divide="ignore", invalid="ignore"):
            ndc = np.where(clip[:, 3:] > 0.0, clip[:, :2] / clip[:, 3:], np.nan)
        return (ndc * (0.5, -0.5) + 0.5) * size

    def orbited(self, right: float, up: float) -> Camera:
        """Turned about the target by radians; the pitch stops before the poles."""
        low, high = _PITCH_RANGE
        return replace(
            self,
            yaw=math.remainder(self.yaw + right, math.tau),
            pitch=min(max(self.pitch + up, low), high),
        )

    def zoomed(self, factor: float) -> Camera:
        """`factor` times as far away, within limits."""
        low, high = _DISTANCE_RANGE
        return replace(self, distance=min(max(self.distance * factor, low), high))

    def panned(self, right: float, up: float) -> Camera:
        """The target moved in the picture's plane by fractions of the picture's height."""
        height = 2.0 * self.distance * math.tan(self.field_of_view / 2.0)
        moved = np.asarray(self.target) + height * (right * self.axes[0] + up * self.axes[1])
        return replace(self, target=(float(moved[0]), float(moved[1]), float(moved[2])))

    def frame_all(self, points: ArrayLike, aspect: float, margin: float = 0.14) -> Camera:
        """Looking the same way, moved so that all points are in the picture and in its middle.

        points: (N, 3) metres. margin: the part of the half picture that is left free on each side.
        Without points it is the same camera.
        """
        world = np.asarray(points, float).reshape(-1, 3)
        world = world[np.isfinite(world).all(axis=1)]
        if len(world) == 0:
            return self
        up = math.tan(self.field_of_view / 2.0) * (1.0 - margin)
        slopes = np.array([up * aspect, up])
        view = world @ self.axes.T
        # A point is inside while |across - centre| <= slope * (eye - depth): both borders of each
        # direction are lines, so the nearest eye follows from the outermost points on either side.
        near = view[:, 2:]
        high = (view[:, :2] + slopes * near).max(axis=0)
        low = (view[:, :2] - slopes * near).min(axis=0)
        eye_depth = float(((high - low) / (2.0 * slopes)).max())
        eye_depth = max(eye_depth, float(near.max()) + 2.0 * self.near)
        middle = (high + low) / 2.0
        target_depth = float((near.max() + near.min()) / 2.0)
        target = np.array([middle[0], middle[1], target_depth]) @ self.axes
        low_limit, high_limit = _DISTANCE_RANGE
        return replace(
            self,
            target=(float(target[0]), float(target[1]), float(target[2])),
            distance=min(max(eye_depth - target_depth, low_limit), high_limit),
        )
