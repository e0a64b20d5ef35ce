"""Shots with depth out of a real OAK-D's stereo pair, by OpenCV and the pair's own calibration."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from puppet.tracking.cameras.camera import Shot
from puppet.tracking.cameras.intrinsics import Intrinsics

LEFT, RIGHT = 1, 2
RATE = 30.0


def stereo_shots(folder: Path, frames: Iterable[int]) -> Iterator[Shot]:
    """Rectified left images with their depth. folder: calib.json, left.mp4, right.mp4."""
    cameras = dict(json.loads((folder / "calib.json").read_text())["cameraData"])
    left, right = cameras[LEFT], cameras[RIGHT]
    size = (left["width"], left["height"])
    # depthai: a point in the left camera's axes goes to the right's by rotation and translation,
    # the latter in centimetres; distortion is OpenCV's rational model, 14 numbers.
    turn = np.array(left["extrinsics"]["rotationMatrix"])
    shift = np.array([left["extrinsics"]["translation"][axis] for axis in "xyz"]) / 100.0
    shift = shift[:, None]
    lenses = [np.array(camera["intrinsicMatrix"]) for camera in (left, right)]
    bends = [np.array(camera["distortionCoeff"]) for camera in (left, right)]
    turned = cv2.stereoRectify(
        lenses[0], bends[0], lenses[1], bends[1], size, turn, shift, alpha=0.0
    )
    maps: list[Any] = [
        cv2.initUndistortRectifyMap(
            lenses[i], bends[i], np.array(turned[i]), np.array(turned[2 + i]), size, cv2.CV_32FC1
        )
        for i in (0, 1)
    ]
    flat, other = np.array(turned[2]), np.array(turned[3])
    lens = Intrinsics(flat[0, 0], flat[1, 1], flat[0, 2], flat[1, 2])
    baseline = -float(other[0, 3] / other[0, 0])
    captures = [cv2.VideoCapture(str(folder / f"{side}.mp4")) for side in ("left", "right")]
    for sequence, frame in enumerate(frames):
        images = []
        for capture, (across, down) in zip(captures, maps, strict=True):
            capture.set(cv2.CAP_PROP_POS_FRAMES, frame)
            images.append(cv2.remap(capture.read()[1], across, down, cv2.INTER_LINEAR))
        depth = depth_of(images[0], images[1], lens, baseline)
        yield Shot(frame / RATE, sequence, np.asarray(images[0], np.uint8), depth, lens)
    for capture in captures:
        capture.release()


def depth_of(
    left: NDArray[Any], right: NDArray[Any], lens: Intrinsics, baseline: float
) -> NDArray[np.uint16]:
    """(h/2, w/2) millimetres before the left camera; 0 where the two do not match.

    baseline: metres. Half the size hides that the calibration leaves rows a pixel or two apart.
    """
    matcher = cv2.StereoSGBM.create(
        numDisparities=48,
        blockSize=7,
        P1=8 * 49,
        P2=32 * 49,
        disp12MaxDiff=1,
        uniquenessRatio=10,
        speckleWindowSize=200,
        speckleRange=2,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    grey = [
        cv2.resize(
            cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), None, fx=0.5, fy=0.5,
            interpolation=cv2.INTER_AREA,
        )
        for image in (left, right)
    ]  # fmt: skip
    disparity = matcher.compute(grey[0], grey[1]).astype(float) / 16.0
    away = np.zeros(disparity.shape)
    seen = disparity > 1.5
    away[seen] = 500.0 * lens.focal_x * baseline / disparity[seen]
    return np.where(away < 65535.0, away, 0.0).astype(np.uint16)
