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
    origins = model.armature.rest[0]
    count = len(origins)
    bones, points = [np.arange(count)], [np.zeros((count, 3))]
    for mesh in model.meshes:
        vertex, column = np.nonzero(mesh.weights >= _TAKES_PART)
        holding = mesh.bones[vertex, column].astype(np.intp)
        away = (mesh.positions[vertex] - origins[holding])[:, None, :]
        bones.append(holding)
        points.append((away @ rest_frames[holding])[:, 0, :])
    bone, point = np.concatenate(bones), np.concatenate(points)
    bare = np.bincount(bone, minlength=count) == 1
    # The origins were only there for bare bones: skin may well be elsewhere.
    keep = (np.arange(len(bone)) >= count) | bare[bone]
    bone, point = bone[keep], point[keep]

    low, high = _extremes(bone, point, count)
    longest = (high - low).argmax(axis=1)
    rows = np.arange(len(bone))
    along = point[rows, longest[bone]] - low[bone, longest[bone]]
    length = np.maximum((high - low)[bone, longest[bone]], 1e-9)
    part = bone * _SLICES + np.minimum(along / length * _SLICES, _SLICES - 1).astype(np.intp)
    low, high = _extremes(part, point, count * _SLICES)
    used = np.unique(part)
    low, high = low[used], high[used]
    return used // _SLICES, (low + high) / 2.0, (high - low) / 2.0


def _extremes(group: NDArray[np.intp], points: Floats, count: int) -> tuple[Floats, Floats]:
    """Lowest and highest coordinates of each group of points. -> (count, 3) twice"""
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, group, points)
    np.maximum.at(high, group, points)
    return low, high
