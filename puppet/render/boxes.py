"""Boxes around the parts of a puppet: what is in sight, and where shadows may fall."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.mesh import Model

#: A bone takes part in a vertex from this weight on.
_TAKES_PART: Final = 0.1
#: A bone has so many boxes, one behind the other, that a long one is not lost in a large box.
_SLICES: Final = 4


class BoneBoxes:
    """Boxes that hold the skin of each bone, in the bone's own frame; built once for a model."""

    def __init__(self, model: Model) -> None:
        rest_frames = matrices(model.armature.rest[1])
        self._bones, self._middles, self._halves = _boxes(model, rest_frames)

    def at(self, origins: Floats, frames: Floats) -> Floats:
        """Lowest and highest corner of each box in the world. -> (N, 2, 3) metres

        origins: (B, 3) metres, frames: (B, 3, 3), world_from_bone.
        """
        frame = frames[self._bones]
        middles = origins[self._bones] + turned(frame, self._middles)
        halves = turned(np.abs(frame), self._halves)
        return np.stack([middles - halves, middles + halves], axis=1)


def corners_of(boxes: Floats) -> Floats:
    """The corners of boxes. (N, 2, 3) -> (8 N, 3)"""
    pick = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)])
    corners: Floats = boxes[:, pick, np.arange(3)].reshape(-1, 3)
    return corners


def matrices(q: Floats) -> Floats:
    """Rotation matrices of unit quaternions xyzw. (N, 4) -> (N, 3, 3)"""
    x, y, z, w = q.T
    out = np.empty((len(q), 3, 3))
    out[:, 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[:, 0, 1] = 2.0 * (x * y - z * w)
    out[:, 0, 2] = 2.0 * (x * z + y * w)
    out[:, 1, 0] = 2.0 * (x * y + z * w)
    out[:, 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[:, 1, 2] = 2.0 * (y * z - x * w)
    out[:, 2, 0] = 2.0 * (x * z - y * w)
    out[:, 2, 1] = 2.0 * (y * z + x * w)
    out[:, 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return out


def turned(frames: NDArray[Any], vectors: NDArray[Any]) -> Floats:
    """Each vector by its own matrix. (N, 3, 3), (N, 3) -> (N, 3)"""
    out: Floats = (frames @ vectors[:, :, None])[:, :, 0]
    return out


def _boxes(model: Model, rest_frames: Floats) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Boxes around what bones move: their bone (N,), middle and half sides (N, 3) in its frame.

    A bone that moves no skin has a box without size at its origin.
    """
    count = len(model.armature)
    bone, low, high = _triangle_boxes(model, rest_frames)
    bare = np.setdiff1d(np.arange(count), bone)
    bone = np.concatenate([bone, bare])
    nothing = np.zeros((len(bare), 3))
    low, high = np.concatenate([low, nothing]), np.concatenate([high, nothing])

    all_low, all_high = _extremes(bone, low, high, count)
    axis = (all_high - all_low).argmax(axis=1)[bone]
    rows = np.arange(len(bone))
    start = all_low[bone, axis]
    step = np.maximum(all_high[bone, axis] - start, 1e-9) / _SLICES
    part, lows, highs = [], [], []
    for slice_ in range(_SLICES):
        # A triangle is in every slice that it reaches into, with what it has there.
        near, far = start + slice_ * step, start + (slice_ + 1) * step
        there = (low[rows, axis] <= far) & (high[rows, axis] >= near)
        clipped_low, clipped_high = low.copy(), high.copy()
        clipped_low[rows, axis] = np.maximum(low[rows, axis], near)
        clipped_high[rows, axis] = np.minimum(high[rows, axis], far)
        part.append(bone[there] * _SLICES + slice_)
        lows.append(clipped_low[there])
        highs.append(clipped_high[there])
    parts = np.concatenate(part)
    low, high = _extremes(parts, np.concatenate(lows), np.concatenate(highs), count * _SLICES)
    used = np.unique(parts)
    low, high = low[used], high[used]
    return used // _SLICES, (low + high) / 2.0, (high - low) / 2.0


def _triangle_boxes(model: Model, rest_frames: Floats) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Each triangle for each bone that moves it: the bone (N,), its box, low and high (N, 3)."""
    origins = model.armature.rest[0]
    bones, lows, highs = [np.empty(0, np.intp)], [np.empty((0, 3))], [np.empty((0, 3))]
    for mesh in model.meshes:
        corners = mesh.triangles
        triangle, corner, column = np.nonzero(mesh.weights[corners] >= _TAKES_PART)
        held = mesh.bones[corners[triangle, corner], column]
        pairs = np.unique(triangle * len(origins) + held)
        triangle, bone = pairs // len(origins), pairs % len(origins)
        away = mesh.positions[corners[triangle]] - origins[bone][:, None, :]
        own = away @ rest_frames[bone]
        bones.append(bone)
        lows.append(own.min(axis=1))
        highs.append(own.max(axis=1))
    return np.concatenate(bones), np.concatenate(lows), np.concatenate(highs)


def _extremes(
    group: NDArray[np.intp], lows: Floats, highs: Floats, count: int
) -> tuple[Floats, Floats]:
    """The box around each group of boxes. -> (count, 3) twice"""
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    order = np.argsort(group, kind="stable")
    present, first = np.unique(group[order], return_index=True)
    low[present] = np.minimum.reduceat(lows[order], first)
    high[present] = np.maximum.reduceat(highs[order], first)
    return low, high
