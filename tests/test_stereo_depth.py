"""The depth path on a real OAK-D's images, from above: a tiled floor, a table, and who walks in."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from puppet.kernel import Floats
from puppet.tracking.calibration.floor_plane import find_floor
from puppet.tracking.cameras.camera import CameraInfo, Shot
from puppet.tracking.cameras.raw_recording import RawRecording
from puppet.tracking.cameras.raw_writer import RawWriter
from tests.stereo import RATE, stereo_shots

#: Nobody there; and somebody who has come in from the right, as seen in the image.
EMPTY, PEOPLED = 120, 400
#: Rows and columns of the depth where the performer's head and shoulders are in the second.
PERFORMER = slice(135, 225), slice(565, 635)
#: The near edge of the table.
TABLE = slice(50, 80), slice(430, 540)


@pytest.fixture(scope="module")
def shots(shared: Path) -> list[Shot]:
    return list(stereo_shots(shared / "oak", (EMPTY, PEOPLED)))


@pytest.fixture(scope="module")
def replayed(shots: list[Shot], tmp_path_factory: pytest.TempPathFactory) -> list[Shot]:
    path = tmp_path_factory.mktemp("stereo") / "oak.raw.mcap"
    with RawWriter(path, CameraInfo("oak", "oak", RATE, device="stereo pair")) as writer:
        for shot in shots:
            writer.write(shot)
    recording = RawRecording(path)
    read = list(recording)
    assert not recording.warnings
    return read


def points_of(shot: Shot) -> Floats:
    """(rows, columns, 3) metres before the lens, x right, y down, z away; NaN where not known."""
    assert shot.depth is not None
    assert shot.intrinsics is not None
    rows, columns = np.mgrid[0 : shot.depth.shape[0], 0 : shot.depth.shape[1]]
    pixels = np.stack([columns, rows], axis=-1).reshape(-1, 2).astype(float)
    lens = shot.intrinsics.resized(shot.depth.shape[1] / shot.colour.shape[1])
    rays = lens.rays(pixels).reshape(*shot.depth.shape, 2)
    away = np.where(shot.depth > 0, shot.depth / 1000.0, np.nan)
    return np.dstack([rays[..., 0] * away, rays[..., 1] * away, away])


def plane_of(points: Floats) -> tuple[Floats, float]:
    """The plane that most of (N, 3) points lie on, by RANSAC: unit normal towards the lens, and the
    lens's distance from it."""
    random = np.random.default_rng(0)
    best: Floats = points[:3]
    for _ in range(200):
        three = points[random.choice(len(points), 3, replace=False)]
        normal = np.cross(three[1] - three[0], three[2] - three[0])
        normal /= np.linalg.norm(normal) + 1e-12
        near = points[np.abs((points - three[0]) @ normal) < 0.06]
        if len(near) > len(best):
            best = near
    middle = best.mean(axis=0)
    normal = np.linalg.svd(best - middle, full_matrices=False)[2][2]
    normal = normal if normal[2] < 0.0 else -normal
    return normal, float(-middle @ normal)


def test_depth_and_lens_come_back_bit_for_bit(shots: list[Shot], replayed: list[Shot]) -> None:
    for wrote, read in zip(shots, replayed, strict=True):
        assert wrote.depth is not None
        assert read.depth is not None
        np.testing.assert_array_equal(read.depth, wrote.depth)
        assert (read.depth > 0).mean() > 0.55
        assert read.intrinsics == wrote.intrinsics
        assert read.time == wrote.time
        assert np.abs(read.colour.astype(int) - wrote.colour).mean() < 2.0


def test_most_of_what_is_seen_from_above_is_one_floor(replayed: list[Shot]) -> None:
    planes = []
    for shot in replayed:
        points = points_of(shot).reshape(-1, 3)
        seen = points[np.isfinite(points[:, 2])]
        normal, height = plane_of(seen[::97])
        above = seen @ normal + height
        # No other surface is as large: the rest is furniture, a sky that mirrors in the table, and
        # walls of sunlight in which nothing can be matched.
        shares, _ = np.histogram(above, np.arange(-3.05, 3.0, 0.1))
        assert np.argmax(shares) == 30
        assert (np.abs(above) < 0.1).mean() > 0.4
        # The lens looks straight down, but for a little.
        assert math.degrees(math.acos(-normal[2])) < 8.0
        planes.append((normal, height))
        # What the tracker finds in it is that plane.
        assert shot.depth is not None
        assert shot.intrinsics is not None
        floor = find_floor(
            shot.depth, shot.intrinsics.resized(0.5), np.array([0.0, 0.0, 1.0]), math.radians(35.0)
        )
        assert floor is not None
        assert float(floor.normal @ (normal * (1.0, -1.0, -1.0))) > math.cos(math.radians(5.0))
        assert floor.height == pytest.approx(height, abs=0.05)
    # The camera hangs still.
    assert float(planes[0][0] @ planes[1][0]) > math.cos(math.radians(6.0))
    assert planes[0][1] == pytest.approx(planes[1][1], abs=0.05)
    assert 2.3 < planes[0][1] < 3.0


def test_a_table_is_as_high_as_tables_are_and_who_walks_in_is_higher(replayed: list[Shot]) -> None:
    empty, peopled = (points_of(shot) for shot in replayed)
    flat = empty.reshape(-1, 3)
    normal, height = plane_of(flat[np.isfinite(flat[:, 2])][::97])
    assert 0.65 < float(np.nanmedian(empty[TABLE] @ normal + height)) < 0.85
    before, after = (points[PERFORMER] @ normal + height for points in (empty, peopled))
    assert -0.25 < float(np.nanmedian(before)) < 0.1
    assert 0.7 < float(np.nanmedian(after)) < 1.8
