"""Where bones end, for files that only say where they begin."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats

#: Parts of the whole size: two places nearer than this are one; a bone shorter than this is none.
_SAME: Final = 1e-3


def bone_ends(
    parents: Sequence[int], origins: Floats, points: Floats, owners: NDArray[np.intp]
) -> Floats:
    """The end of each bone. -> (B, 3), in the frame of `origins`

    parents: B, each before its children. origins: (B, 3). points: (V, 3) places on the surface of
    the bones, and owners: (V,) the bone of each.

    A bone ends at the middle of its children's origins; a leaf ends where its own points do, seen
    along the direction in which most of them lie, or goes on as its parent did.
    """
    order = np.argsort(owners, kind="stable")
    points, bounds = points[order], np.searchsorted(owners[order], np.arange(len(origins) + 1))
    size = float(np.ptp(np.concatenate([origins, points]), axis=0).max()) or 1.0
    above = np.asarray(parents, int)
    child = np.flatnonzero(above >= 0)
    middles, counts = np.zeros_like(origins), np.bincount(above[child], minlength=len(origins))
    np.add.at(middles, above[child], origins[child])
    middles /= np.maximum(counts, 1)[:, None]
    ends = np.empty_like(origins)
    for bone, parent in enumerate(parents):
        onwards = np.zeros(3) if parent < 0 else ends[parent] - origins[parent]
        if parent >= 0 and not counts[bone]:
            onwards = origins[bone] - origins[parent]
        if counts[bone] and np.linalg.norm(middles[bone] - origins[bone]) > _SAME * size:
            ends[bone] = middles[bone]
            continue
        around = points[bounds[bone] : bounds[bone + 1]] - origins[bone]
        ends[bone] = origins[bone] + _reach(around, onwards, size)
    return ends


def _reach(around: Floats, onwards: Floats, size: float) -> Floats:
    """From a bone's origin to its end, judged by the points around it. (V, 3), (3,) -> (3,)"""
    if len(around):
        centre = around.mean(axis=0)
        spread = float(np.sqrt(((around - centre) ** 2).sum(axis=1).mean()))
        direction = centre if np.linalg.norm(centre) > 0.3 * spread else onwards
        length = float(np.linalg.norm(direction))
        if length > 1e-4 * size:
            reach = float((around @ direction).max()) / length
            if reach > _SAME * size:
                return direction / length * reach
        # Nothing lies that way: a foot goes on square to its shin, and on both sides of it.
        distances = np.linalg.norm(around, axis=1)
        if distances.max() > 10.0 * _SAME * size:
            farthest: Floats = around[int(distances.argmax())]
            return farthest
    length = float(np.linalg.norm(onwards))
    if length > 1e-4 * size:
        return onwards
    return np.array([0.0, 0.05 * size, 0.0])
