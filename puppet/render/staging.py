"""Composing the picture: the performer beside the puppets, and a camera that has all in view."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from puppet.kernel import Floats
from puppet.pose import Pose
from puppet.render.camera import Camera
from puppet.render.scene import Picture, Status
from puppet.show import ViewConfig
from puppet.skeleton import SkeletonFrame

#: Metres around a place that a performer needs: to each side, and up.
_ELBOW_ROOM = 0.75
_HEADROOM = 2.0


class Staging:
    """Makes pictures of poses, for one show.

    camera: may be replaced at any time (the mouse does); `home` is where it started.
    """

    def __init__(self, view: ViewConfig, rest_extent: Iterable[Floats], aspect: float) -> None:
        """`rest_extent`: (N, 3) metres, points around each puppet at rest, in the world."""
        self._view = view
        points = [_with_room(box) for box in rest_extent]
        if view.performer is not None:
            x, y, z = view.performer
            points.append(
                np.array(
                    [
                        (x + dx, y + dy, z)
                        for dx in (-_ELBOW_ROOM, _ELBOW_ROOM)
                        for dy in (0.0, _HEADROOM)
                    ]
                )
            )
        everything = np.vstack(points) if points else np.zeros((0, 3))
        self.home = Camera().frame_all(everything, aspect)
        self.camera = self.home
        self.show_pairs = view.show_pairs

    def picture(
        self,
        poses: Mapping[str, Pose],
        performers: Sequence[SkeletonFrame],
        neutral_hip: Floats | tuple[float, float, float],
        neutral_heading: float,
        status: Status | None,
        idle: Collection[int] = (),
    ) -> Picture:
        """Performers are shown as they stand to each other: the first from the neutral stance's
        place and heading, facing the camera."""
        offset = (0.0, 0.0, 0.0)
        place = self._view.performer
        if place is None:
            performers = ()
        else:
            # Put the neutral stance's place, on the floor, where the show wants the performer.
            sine, cosine = math.sin(-neutral_heading), math.cos(-neutral_heading)
            x, z = float(neutral_hip[0]), float(neutral_hip[2])
            offset = (
                place[0] - (cosine * x + sine * z),
                place[1],
                place[2] - (cosine * z - sine * x),
            )
        return Picture(
            poses=poses,
            performers=performers,
            idle=idle,
            performer_offset=offset,
            performer_yaw=-neutral_heading,
            camera=self.camera,
            status=status,
            show_pairs=self.show_pairs,
        )


def _with_room(box: Floats) -> Floats:
    """Points a little further out: a puppet at rest takes less room than one that dances."""
    middle = box.mean(axis=0)
    return np.asarray(middle + (box - middle) * 1.25)
