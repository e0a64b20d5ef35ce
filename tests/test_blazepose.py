from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.errors import UnavailableError
from puppet.tracking.cameras.camera import Image
from puppet.tracking.people import blazepose
from puppet.tracking.people.blazepose import BlazePose, Landmarks, Region
from puppet.tracking.people.duplicates import BODY
from puppet.tracking.people.models import PoseModels
from puppet.tracking.people.paint_out import covered
from puppet.tracking.people.people import MOST_COVERED
from tests.pose_models import clip_or_skip, models_or_skip

LEFT_SHOULDER, RIGHT_SHOULDER, LEFT_HIP, RIGHT_HIP = 11, 12, 23, 24


@pytest.fixture(scope="module")
def pose() -> BlazePose:
    return BlazePose(models_or_skip())


@pytest.fixture(scope="module")
def image() -> Image:
    """The first frame of the clip: he stands at about (410, 740), facing the camera."""
    capture = cv2.VideoCapture(str(clip_or_skip()))
    decoded, image = capture.read()
    capture.release()
    assert decoded
    return np.asarray(image)


@given(
    st.floats(-500, 2000), st.floats(-500, 2000), st.floats(2, 1000), st.floats(-math.pi, math.pi)
)
def test_a_body_stands_upright_in_its_region(x: float, y: float, reach: float, lean: float) -> None:
    centre = np.array([x, y])
    up = reach * np.array([math.sin(lean), -math.cos(lean)])
    region = Region.around(centre, centre + up)
    image_from_region = region.image_from_region()
    np.testing.assert_allclose(image_from_region @ [0.0, 0.0, 1.0], centre, atol=1e-9)
    # Up by half of what is left of the side without its margin.
    edge = image_from_region @ [0.0, -0.5 / blazepose.REGION_MARGIN, 1.0]
    np.testing.assert_allclose(edge, centre + up, atol=1e-9)


def test_the_detector_has_a_cell_for_each_of_its_boxes() -> None:
    cells = blazepose._cell_centres()
    assert cells.shape == (2254, 2)
    np.testing.assert_allclose(cells[0], [4.0, 4.0])
    np.testing.assert_allclose(cells[2], [12.0, 4.0])
    np.testing.assert_allclose(cells[-1], [208.0, 208.0])


def test_boxes_that_overlap_become_their_weighted_mean() -> None:
    boxes = np.array([[10.0, 10, 8, 8], [11.0, 10, 8, 8], [100.0, 100, 8, 8]])
    first, second = blazepose._merge_overlapping(boxes, np.array([0.9, 0.6, 0.7]))
    np.testing.assert_allclose(first, [10.4, 10, 8, 8])
    np.testing.assert_allclose(second, boxes[2])


def test_boxes_without_area_do_not_stop_the_merging() -> None:
    boxes = np.zeros((3, 4))
    assert len(blazepose._merge_overlapping(boxes, np.array([0.9, 0.8, 0.7]))) == 3


def test_a_point_moves_to_the_heat_around_it() -> None:
    points = np.full((39, 2), 0.5)
    points[1], points[2] = np.nan, 1.5
    heatmap = np.full((64, 64, 39), -20.0, np.float32)
    heatmap[30, 34, 0] = 20.0
    before = points.copy()
    blazepose._refine(points, heatmap)
    np.testing.assert_allclose(points[0], [34 / 64, 30 / 64], atol=1e-6)
    np.testing.assert_array_equal(points[1:], before[1:])


@pytest.mark.parametrize("data", [b"", b"not a model"])
def test_a_file_that_is_no_model_is_named(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "model.onnx"
    path.write_bytes(data)
    with pytest.raises(UnavailableError, match=r"model\.onnx"):
        BlazePose(PoseModels(path, path, path))


def found(pose: BlazePose, image: Image) -> Landmarks:
    """The largest person whom the detector finds."""
    seen = pose.look(image, pose.detect(image)[0])
    assert seen is not None
    return seen


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 640, 3), (480, 640, 3), (1080, 608, 3)])
def test_nobody_is_seen_where_nobody_is(pose: BlazePose, shape: tuple[int, int, int]) -> None:
    everywhere = Region(np.array([shape[1], shape[0]]) / 2.0, float(max(shape)), 0.0)
    for image in (
        np.zeros(shape, np.uint8),
        np.random.default_rng(0).integers(0, 255, shape, np.uint8),
    ):
        assert pose.detect(image) == []
        assert pose.look(image, everywhere) is None


def test_the_nearest_person_is_found_where_he_is(pose: BlazePose, image: Image) -> None:
    seen = found(pose, image)
    assert seen.score > 0.9
    np.testing.assert_allclose(seen.pixels[[LEFT_HIP, RIGHT_HIP]].mean(0), [412, 742], atol=25)
    # He faces the camera: his left is on the right of the image.
    assert seen.pixels[LEFT_SHOULDER, 0] > seen.pixels[RIGHT_SHOULDER, 0] + 50
    # Metres, y down: shoulders half a metre above the hips, and hips at the origin.
    shoulders = seen.world[[LEFT_SHOULDER, RIGHT_SHOULDER]].mean(0)
    assert -0.65 < shoulders[1] < -0.35
    np.testing.assert_allclose(seen.world[[LEFT_HIP, RIGHT_HIP]].mean(0), 0.0, atol=0.02)


def test_his_landmarks_tell_where_to_look_next(pose: BlazePose, image: Image) -> None:
    first = found(pose, image)
    assert first.following is not None
    second = pose.look(image, first.following)
    assert second is not None
    np.testing.assert_allclose(second.pixels[11:], first.pixels[11:], atol=25)


def test_a_mirrored_image_exchanges_left_and_right(pose: BlazePose, image: Image) -> None:
    seen = found(pose, image)
    mirrored = found(pose, np.ascontiguousarray(image[:, ::-1]))
    expected = image.shape[1] - 1 - seen.pixels[RIGHT_SHOULDER, 0]
    assert mirrored.pixels[LEFT_SHOULDER, 0] == pytest.approx(expected, abs=15)


def test_a_smaller_image_gives_the_same_place(pose: BlazePose, image: Image) -> None:
    seen = found(pose, image)
    half = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    small = found(pose, half.astype(np.uint8))
    np.testing.assert_allclose(small.pixels * 2.0 + 0.5, seen.pixels, atol=25)


def test_who_is_painted_out_is_not_found_again(pose: BlazePose, image: Image) -> None:
    seen = found(pose, image)
    before = image.copy()
    assert pose.detect(image, [seen]) == []
    # The landmark network may take the paint itself for a body: that is known by where it lies.
    again = pose.look(image, seen.region, [seen])
    assert again is None or covered(again.pixels[BODY], [(seen.pixels, seen.extent)]) > MOST_COVERED
    np.testing.assert_array_equal(image, before)


def test_part_of_an_image_is_searched_in_the_image_s_own_pixels(
    pose: BlazePose, image: Image
) -> None:
    # The man at the right end of a wide wall: in all of it he is too small for the detector.
    wall = np.full((960, 3000, 3), 90, np.uint8)
    wall[:, 2460:] = cv2.resize(image, (540, 960), interpolation=cv2.INTER_AREA)
    assert pose.detect(wall) == []
    assert pose.detect(wall, columns=(0, 960)) == []
    [region] = pose.detect(wall, columns=(2040, 3000))
    np.testing.assert_allclose(region.centre, [2460 + 206, 371], atol=40)
