"""Where a performer's joints really are: triangulated from four calibrated views.

The views are those of Pose2Sim's demonstration (BSD-3-Clause): one person, 100 pictures each at 60
a second, taken at the same instants. In each our own network finds the 33 landmarks, and what the
four say of one landmark is triangulated; a view that disagrees is left out. No single view's guess
of depth is in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import cv2
import numpy as np

from puppet.kernel import Floats
from puppet.tracking.body.lift import joints_of
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.people.blazepose import LANDMARK_COUNT, Landmarks
from puppet.tracking.people.models import PoseModels
from puppet.tracking.people.people import People

#: The calibration counts in 64ths of a pixel, and in millimetres.
SUBPIXELS: Final = 64.0
#: Pixels by which a view may miss the point that the others agree on; beyond it is left out.
OUTLIER: Final = 25.0
#: Frames over which a landmark's place is averaged: what is left of the network's trembling.
SMOOTH: Final = 5


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One calibrated camera. camera_from_room: (3, 3), x right, y down, z away; the room's z is up.
    centre: (3,) metres in the room. distortion: (4,) as OpenCV has it."""

    name: str
    lens: Intrinsics
    distortion: Floats
    camera_from_room: Floats
    centre: Floats

    @property
    def up(self) -> Floats:
        """(3,) the room's up in the image's axes."""
        return np.asarray(self.camera_from_room[:, 2])

    def rays(self, pixels: Floats) -> Floats:
        """(N, 2) pixels as filmed -> (N, 3) unit vectors in the room."""
        lens = self.lens
        matrix = np.array(
            [[lens.focal_x, 0, lens.centre_x], [0, lens.focal_y, lens.centre_y], [0, 0, 1]]
        )
        flat = cv2.undistortPoints(pixels.reshape(-1, 1, 2), matrix, self.distortion)[:, 0]
        rays = np.column_stack([flat, np.ones(len(flat))]) @ self.camera_from_room
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))

    def see(self, points: Floats) -> Floats:
        """(N, 3) metres in the room -> (N, 3) metres before the lens: x right, y down, z away."""
        return np.asarray((points - self.centre) @ self.camera_from_room.T)


def read_views(calibration: bytes) -> dict[str, View]:
    """The cameras of a Qualisys calibration, by name."""
    views = {}
    for node in ElementTree.fromstring(calibration).iterfind("cameras/camera"):
        transform, inner = node.find("transform"), node.find("intrinsic")
        name = node.get("serial")
        if transform is None or inner is None or name is None:
            raise SystemExit("the calibration is damaged")
        # The rows are the camera's axes in the room: x right, y up, z backwards.
        rows = [[float(transform.attrib[f"r{i}{j}"]) for j in (1, 2, 3)] for i in (1, 2, 3)]
        centre = [float(transform.attrib[axis]) / 1000.0 for axis in "xyz"]

        def number(key: str, inner: ElementTree.Element = inner) -> float:
            return float(inner.attrib[key])

        views[name] = View(
            name,
            Intrinsics(
                number("focalLengthU") / SUBPIXELS,
                number("focalLengthV") / SUBPIXELS,
                number("centerPointU") / SUBPIXELS,
                number("centerPointV") / SUBPIXELS,
            ),
            np.array(
                [
                    number("radialDistortion1"),
                    number("radialDistortion2"),
                    number("tangentalDistortion1"),
                    number("tangentalDistortion2"),
                ]
            ),
            np.array(rows) * np.array([[1.0], [-1.0], [-1.0]]),
            np.array(centre),
        )
    return views


def landmarks_in(clip: Path, models: PoseModels) -> list[Landmarks | None]:
    """What the network finds of the first performer in each picture."""
    people = People(models, most=1)
    found: list[Landmarks | None] = []
    for shot in VideoFile(clip):
        seen = people.look(shot)
        found.append(seen[0].landmarks if seen else None)
    return found


@dataclass(frozen=True, slots=True, eq=False)
class GroundTruth:
    """landmarks: (F, 33, 3) metres in the room; NaN where fewer than two views agree.
    residual: median distance, pixels, between the points and what the views that agree found.
    left_out: share of what the views found that did not agree."""

    landmarks: Floats
    residual: float
    left_out: float

    @property
    def joints(self) -> Floats:
        """(F, 20, 3) metres in the room."""
        return np.stack([joints_of(frame) for frame in self.landmarks])


def triangulate(views: Sequence[View], found: Sequence[Sequence[Landmarks | None]]) -> GroundTruth:
    """The landmarks of all frames, from what each view found in each frame."""
    count = min(map(len, found))
    points = np.full((count, LANDMARK_COUNT, 3), np.nan)
    misses: list[float] = []
    found_by_views = 0
    for frame in range(count):
        seen = [(view, of[frame]) for view, of in zip(views, found, strict=True)]
        there = [(view, landmarks) for view, landmarks in seen if landmarks is not None]
        if len(there) < 2:
            continue
        centres = np.stack([view.centre for view, _ in there])
        rays = np.stack([view.rays(landmarks.pixels) for view, landmarks in there], axis=1)
        weights = np.stack([landmarks.visibility for _, landmarks in there], axis=1) + 0.05
        focal = np.array([view.lens.focal_x for view, _ in there])
        for index in range(LANDMARK_COUNT):
            point, miss = _meeting(centres, rays[index], weights[index], focal)
            points[frame, index] = point
            misses += miss
            found_by_views += len(there)
    if not misses:
        raise SystemExit("no two views see the performer at once")
    left_out = 1.0 - len(misses) / found_by_views
    return GroundTruth(_smoothed(points), float(np.median(misses)), left_out)


def _meeting(
    centres: Floats, rays: Floats, weights: Floats, focal: Floats
) -> tuple[Floats, list[float]]:
    """The point nearest to the rays, and how many pixels each of those that agree misses it by."""
    used = np.ones(len(rays), bool)
    while True:
        across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
        scaled = (weights * used)[:, None, None] * across
        point = np.linalg.solve(scaled.sum(axis=0), (scaled @ centres[:, :, None]).sum(axis=0))[
            :, 0
        ]
        away = point - centres
        miss = focal * np.linalg.norm((across @ away[:, :, None])[:, :, 0], axis=1)
        miss /= np.maximum(np.sum(away * rays, axis=1), 0.1)
        worst = int(np.argmax(np.where(used, miss, -1.0)))
        if miss[worst] <= OUTLIER or used.sum() <= 2:
            return np.asarray(point), miss[used].tolist()
        used[worst] = False


def _smoothed(points: Floats) -> Floats:
    """Each place averaged over its neighbours in time."""
    half = SMOOTH // 2
    padded = np.pad(points, ((half, half), (0, 0), (0, 0)), mode="edge")
    windows = [padded[i : i + len(points)] for i in range(SMOOTH)]
    return np.asarray(np.mean(windows, axis=0))
