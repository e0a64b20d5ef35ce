"""How somebody stands who holds still: arms hanging (I), arms out (T), or anyhow.

From each of them follows the stance with hanging arms, which is what a puppet's rest stands for.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import Final, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from puppet.kernel import Floats
from puppet.mapping.stance import UPRIGHT, heading_of
from puppet.skeleton import Joint

Kind = Literal["I", "T", "still"]

#: Radians by which a hanging upper arm, a thigh or the trunk may lean.
LEAN: Final = math.radians(30.0)
#: Radians by which arms that are held out may point up or down, and forward or back.
SLOPE: Final = math.radians(30.0)
SWEEP: Final = math.radians(40.0)
#: Radians by which the parts of an arm may lean that hangs loosely.
LOOSE: Final = math.radians(50.0)

ARMS: Final = tuple(
    tuple(Joint[f"{name}_{side}"] for name in ("SHOULDER", "ELBOW", "WRIST", "HAND"))
    for side in ("LEFT", "RIGHT")
)
LEGS: Final = tuple(
    tuple(Joint[f"{name}_{side}"] for name in ("HIP", "KNEE", "ANKLE", "FOOT"))
    for side in ("LEFT", "RIGHT")
)


def kind_of(points: Floats, legs: bool = True) -> Kind | None:
    """How a skeleton (20, 3) stands; None if it is not upright. legs: whether they are seen."""
    if not hangs(points[Joint.HIP_CENTER] - points[Joint.SHOULDER_CENTER], LEAN):
        return None
    if legs and not all(hangs(points[leg[1]] - points[leg[0]], LEAN) for leg in LEGS):
        return None
    if all(_arm_hangs(points, arm, LEAN) for arm in ARMS):
        return "I"
    across = np.zeros(3)
    for left, right in ((ARMS[0][0], ARMS[1][0]), (LEGS[0][0], LEGS[1][0])):
        across += points[left] - points[right]
    if _arm_is_out(points, ARMS[0], across) and _arm_is_out(points, ARMS[1], -across):
        return "T"
    return "still"


def neutral_of(points: Floats, legs: bool = True) -> Floats:
    """(20, 3) the same person with hanging arms: as they are if they hang, and else let down.

    legs: whether they were seen; if not, they are those of somebody who stands.
    """
    points = points.copy()
    turn = Rotation.from_euler("y", heading_of(points))
    for arm in ARMS:
        if not _arm_hangs(points, arm, LOOSE):
            lengths = [_distance(points, a, b) for a, b in pairwise(arm)]
            _lay(points, arm, lengths, turn)
    if not legs:
        whole = _distance(points, Joint.HIP_CENTER, Joint.SHOULDER_CENTER)
        scale = whole / _length(_step(Joint.HIP_CENTER, Joint.SHOULDER_CENTER))
        for leg in LEGS:
            points[leg[0]] = points[Joint.HIP_CENTER] + scale * turn.apply(
                _step(Joint.HIP_CENTER, leg[0])
            )
            steps = pairwise(leg)
            _lay(points, leg, [scale * _length(_step(a, b)) for a, b in steps], turn)
    return points


def hangs(direction: Floats, lean: float) -> bool:
    """Whether a direction (3,) points down, within so many radians."""
    length = _length(direction)
    return bool(length > 1e-6 and -direction[1] >= math.cos(lean) * length)


def _arm_hangs(points: Floats, arm: tuple[Joint, ...], lean: float) -> bool:
    shoulder, elbow, wrist = arm[:3]
    upper, fore = points[elbow] - points[shoulder], points[wrist] - points[elbow]
    return hangs(upper, lean) and hangs(fore, lean)


def _arm_is_out(points: Floats, arm: tuple[Joint, ...], outwards: Floats) -> bool:
    shoulder, elbow, wrist = arm[:3]
    for part in (points[elbow] - points[shoulder], points[wrist] - points[elbow]):
        length, level = _length(part), part * (1.0, 0.0, 1.0)
        along = _length(level) * _length(outwards * (1.0, 0.0, 1.0))
        if length < 1e-6 or abs(part[1]) > math.sin(SLOPE) * length:
            return False
        if level @ outwards < math.cos(SWEEP) * along:
            return False
    return True


def _lay(points: Floats, limb: tuple[Joint, ...], lengths: Iterable[float], turn: Rotation) -> None:
    """Lay a limb out from its first joint as it is in somebody who stands upright."""
    for start, end, length in zip(limb[:-1], limb[1:], lengths, strict=True):
        step = _step(start, end)
        points[end] = points[start] + turn.apply(step) * (length / _length(step))


def _step(start: Joint, end: Joint) -> Floats:
    return np.subtract(UPRIGHT[end], UPRIGHT[start])


def _distance(points: Floats, a: Joint, b: Joint) -> float:
    return _length(points[b] - points[a])


def _length(vector: Floats) -> float:
    return float(np.linalg.norm(vector))
