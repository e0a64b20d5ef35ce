"""The printed board: true to size, found in images, and placed before the camera to the millimetre.

The images are the printed page itself, seen by a camera of known pose.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pictures
from scipy.spatial.transform import Rotation

from puppet.errors import BadShowError, PuppetError
from puppet.kernel import Floats
from puppet.tracking.calibration.board import Board, BoardFinder, BoardSight
from puppet.tracking.calibration.board_pose import (
    lies,
    locate,
    stage_from_lying,
    stage_from_standing,
)
from puppet.tracking.calibration.board_print import board_for, page, print_board
from puppet.tracking.calibration.stage_frame import angle_between
from tests.board_views import A3, A4, HEIGHT, LENS, LYING, WIDTH, camera_at, seen, view


def sights(board: Board, pose: tuple[Floats, Floats], count: int, **how: float) -> list[BoardSight]:
    finder = BoardFinder()
    found = [finder.find(seen(board, *pose, seed=i, **how)) for i in range(count)]  # type: ignore[arg-type]
    return [sight for sight in found if sight is not None]


CAMERAS = {
    "from the front": camera_at((0.1, 0.9, 1.1), (0.0, 0.0, 0.0)),
    "from the left, rolled": camera_at((1.2, 1.0, 0.5), (0.05, 0.0, 0.0), 0.3),
    "from behind": camera_at((-0.2, 0.8, -1.0), (0.0, 0.0, 0.05), -0.2),
    "from above": camera_at((0.05, 1.5, 0.02), (0.0, 0.0, 0.0)),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_a_board_on_the_floor_says_where_the_camera_is(name: str) -> None:
    truth = CAMERAS[name]
    pose = locate(sights(A4, view(truth, LYING, np.zeros(3)), 3), LENS)
    found = stage_from_lying(pose)
    apart = Rotation.from_matrix(found.rotation @ truth.rotation.T).magnitude()
    assert math.degrees(apart) < 0.3
    assert np.linalg.norm(found.shift - truth.shift) < 0.006
    assert pose.error < 0.5
    assert pose.shots == 3
    # What it says of its own errors is about right.
    assert apart < 5.0 * pose.turn_error + math.radians(0.1)
    assert lies(pose, truth.up)


def test_two_cameras_that_see_one_board_share_a_stage() -> None:
    point = np.array([[0.3, 1.2, 0.4]])
    seen_at = []
    for truth in CAMERAS.values():
        pose = locate(sights(A4, view(truth, LYING, np.zeros(3)), 2), LENS)
        seen_at.append(stage_from_lying(pose).to_stage(truth.to_camera(point))[0])
    assert np.ptp(np.array(seen_at), axis=0).max() < 0.02
    np.testing.assert_allclose(np.mean(seen_at, axis=0), point[0], atol=0.01)


def test_a_board_that_stands_faces_the_front() -> None:
    truth = camera_at((0.4, 1.5, 1.9), (0.0, 1.0, 0.0), 0.1)
    middle = np.array([0.0, 1.1, 0.0])
    # It hangs a little askew; up is known from gravity.
    askew = Rotation.from_euler("z", 0.03).as_matrix()
    pose = locate(sights(A4, view(truth, askew, middle), 3), LENS, truth.up)
    assert not lies(pose, truth.up)
    found = stage_from_standing(pose, 1.1, truth.up)
    assert math.degrees(angle_between(found.up, truth.up)) < 0.01
    assert math.degrees(Rotation.from_matrix(found.rotation @ truth.rotation.T).magnitude()) < 0.7
    np.testing.assert_allclose(found.shift, truth.shift, atol=0.02)


def test_a_large_board_is_seen_from_afar() -> None:
    truth = camera_at((0.3, 1.3, 2.6), (0.0, 0.0, 0.0))
    pose = locate(sights(A3, view(truth, LYING, np.zeros(3)), 6), LENS)
    assert pose.board == A3
    found = stage_from_lying(pose)
    assert math.degrees(Rotation.from_matrix(found.rotation @ truth.rotation.T).magnitude()) < 1.0
    assert np.linalg.norm(found.shift - truth.shift) < 0.04


def test_noise_and_blur_cost_little() -> None:
    truth = CAMERAS["from the front"]
    pose = locate(sights(A4, view(truth, LYING, np.zeros(3)), 6, noise=12.0, blur=1.6), LENS)
    found = stage_from_lying(pose)
    assert math.degrees(Rotation.from_matrix(found.rotation @ truth.rotation.T).magnitude()) < 0.7
    assert np.linalg.norm(found.shift - truth.shift) < 0.015


def test_a_board_that_is_partly_hidden_is_placed_all_the_same() -> None:
    truth = camera_at((0.1, 0.5, 0.6), (0.0, 0.0, 0.0))
    pose = locate(sights(A4, view(truth, LYING, np.zeros(3)), 3, hide=0.4), LENS)
    assert pose.corners < 8 + 28
    found = stage_from_lying(pose)
    assert math.degrees(Rotation.from_matrix(found.rotation @ truth.rotation.T).magnitude()) < 1.0


def test_a_page_that_was_printed_smaller_is_measured_by_its_squares() -> None:
    truth = CAMERAS["from the front"]
    finder = BoardFinder(square=0.97 * A4.square)
    sight = finder.find(seen(A4, *view(truth, LYING, np.zeros(3))))
    assert sight is not None
    pose = locate([sight], LENS)
    assert np.linalg.norm(pose.shift) == pytest.approx(0.97 * np.linalg.norm(truth.shift), abs=0.01)


def test_no_board_is_a_clear_message() -> None:
    empty = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    assert BoardFinder().find(empty) is None
    with pytest.raises(PuppetError, match="no board is seen") as caught:
        locate([], LENS)
    assert "--print-board" in str(caught.value)


def test_a_board_that_is_carried_about_is_told() -> None:
    moving = []
    for step in range(4):
        truth = camera_at((0.1 + 0.02 * step, 0.9, 1.1), (0.0, 0.0, 0.0))
        moving += sights(A4, view(truth, LYING, np.zeros(3)), 1)
    assert len(moving) == 4
    moving = [
        BoardSight(sight.board, {n: c + (8.0 * i, 0.0) for n, c in sight.corners.items()})
        for i, sight in enumerate(moving)
    ]
    with pytest.raises(PuppetError, match="moves"):
        locate(moving, LENS)


def test_corners_that_do_not_fit_together_are_told() -> None:
    [sight] = sights(A4, view(CAMERAS["from the front"], LYING, np.zeros(3)), 1)
    shuffled = dict(zip(sight.corners, list(sight.corners.values())[::-1], strict=True))
    mixed = {n: shuffled[n] if n % 2 else c for n, c in sight.corners.items()}
    with pytest.raises(PuppetError, match="do not fit"):
        locate([BoardSight(sight.board, mixed)], LENS)


@pytest.mark.parametrize("paper", ["A4", "a3", "A2"])
def test_a_printed_page_is_true_to_size(paper: str, tmp_path: Path) -> None:
    board = board_for(paper)
    print_board(tmp_path / "board.pdf", board)
    box = re.search(rb"MediaBox \[ 0 0 ([\d.]+) ([\d.]+)", (tmp_path / "board.pdf").read_bytes())
    assert box is not None
    for points, side in zip(box.groups(), board.page, strict=True):
        assert float(points) / 72 * 0.0254 == pytest.approx(side, abs=1e-4)
    # A square, measured on the page: the left column's first one is black.
    sheet = np.asarray(page(board))
    column = int((0.5 * (board.page[0] - board.size[0]) + 0.5 * board.square) / 0.0254 * 300)
    dark = np.flatnonzero(sheet[:, column] < 128)
    first = dark[: np.flatnonzero(np.diff(dark) > 1)[0] + 1]
    assert len(first) * 0.0254 / 300 == pytest.approx(board.square, abs=2e-4)


def test_a_picture_to_print_carries_its_size(tmp_path: Path) -> None:
    print_board(tmp_path / "board.png", A4)
    with Pictures.open(tmp_path / "board.png") as picture:
        dots = picture.info["dpi"][0]
        assert picture.width / dots * 0.0254 == pytest.approx(0.297, abs=1e-4)


def test_another_ending_or_paper_is_told(tmp_path: Path) -> None:
    with pytest.raises(BadShowError, match="form"):
        print_board(tmp_path / "board.docx", A4)
    with pytest.raises(BadShowError, match="size"):
        board_for("letter")
