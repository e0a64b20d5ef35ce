"""Figures of how right tracked joints are, how steady, and whether their states mean something."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.tracked_views import Scores
from puppet.kernel import Floats
from puppet.skeleton import JOINT_NAMES, JOINT_PARENTS, Joint, SkeletonFrame, TrackingState
from puppet.tracking.conditioning.condition import Conditioner

#: Pictures a second, and a joint is at rest that moves slower, m/s, for so many pictures.
RATE: Final = 60.0
RESTING: Final = 0.15
RESTING_FRAMES: Final = 12
#: Pictures at the beginning in which conditioning wakes up.
WAKING: Final = 20
#: The neck hangs on the hips here: the spine lies on a line between them.
_PARENTS: Final = [
    0 if joint == Joint.SHOULDER_CENTER else p for joint, p in enumerate(JOINT_PARENTS)
]
_BONES: Final = [joint for joint in Joint if joint not in (Joint.HIP_CENTER, Joint.SPINE)]


def procrustes(points: Floats, truth: Floats) -> Floats:
    """The points, shifted, turned and scaled as a whole to fit best."""
    a, b = points - points.mean(axis=0), truth - truth.mean(axis=0)
    left, sizes, right = np.linalg.svd(a.T @ b)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    scale = float((sizes * signs).sum() / (a * a).sum())
    return np.asarray(scale * a @ (left * signs) @ right + truth.mean(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Distances from the truth in millimetres, (F, 20), all frames of all views below each other.

    root: the hip centres laid upon each other. across: the same, as the camera sees it, without
    what lies along the line of sight. aligned: shifted, turned and scaled to fit best. states:
    (F, 20). views: (F,).
    """

    root: Floats
    across: Floats
    aligned: Floats
    states: NDArray[np.uint8]
    views: NDArray[np.int64]


def errors(scores: Sequence[Scores]) -> Errors:
    root, across, aligned = [], [], []
    for one in scores:
        off = one.positions - one.positions[:, :1] - (one.truth - one.truth[:, :1])
        root.append(np.linalg.norm(off, axis=2))
        across.append(np.linalg.norm(off[:, :, :2], axis=2))
        pairs = zip(one.positions, one.truth, strict=True)
        aligned.append([np.linalg.norm(procrustes(p, t) - t, axis=1) for p, t in pairs])
    return Errors(
        1000.0 * np.concatenate(root),
        1000.0 * np.concatenate(across),
        1000.0 * np.concatenate(aligned),
        np.concatenate([one.states for one in scores]),
        np.repeat(np.arange(len(scores)), [len(one.frames) for one in scores]),
    )


def bone_variation(scores: Sequence[Scores]) -> float:
    """Per cent of its length by which a bone varies (standard deviation), on average."""
    varies = []
    for one in scores:
        bones = np.linalg.norm(one.positions - one.positions[:, _PARENTS], axis=2)[:, _BONES]
        varies.append((bones.std(axis=0) / bones.mean(axis=0)).mean())
    return 100.0 * float(np.mean(varies))


def conditioned(one: Scores) -> Scores:
    """The same after conditioning with its defaults."""
    condition = Conditioner()
    out = []
    for frame, positions, states in zip(one.frames, one.positions, one.states, strict=True):
        seen = SkeletonFrame(float(frame) / RATE, int(frame), 0, positions, states)
        out.append(condition(seen).positions)
    return Scores(one.frames, np.array(out), one.states, one.truth)


def trembling(scores: Sequence[Scores]) -> float:
    """Millimetres: what joints do from picture to picture that the truth does not do, seen from the
    hips; at rest or not."""
    squares = []
    for one in scores:
        off = one.positions - one.positions[:, :1] - (one.truth - one.truth[:, :1])
        # The second difference of a tremble of s millimetres in each frame is √6 · s.
        squares.append((np.diff(off, 2, axis=0)[WAKING:] ** 2).sum(axis=2).mean() / 6.0)
    return 1000.0 * float(np.sqrt(np.mean(squares)))


def jitter_at_rest(scores: Sequence[Scores]) -> tuple[float, int]:
    """Millimetres: how far joints tremble (RMS about a straight line, within a fifth of a second)
    that are really at rest in the room; and in how many such stretches."""
    squares = []
    for one in scores:
        for joint in range(len(Joint)):
            for first in range(WAKING, len(one.truth) - RESTING_FRAMES + 1, RESTING_FRAMES // 2):
                part = slice(first, first + RESTING_FRAMES)
                if _speed(one.truth[part, joint]) < RESTING:
                    squares.append(_off_line(one.positions[part, joint]))
    return 1000.0 * float(np.sqrt(np.mean(squares))) if squares else float("nan"), len(squares)


def _speed(points: Floats) -> float:
    """Metres a second from the first third of (N, 3) points to the last."""
    third = len(points) // 3
    way = points[-third:].mean(axis=0) - points[:third].mean(axis=0)
    return float(np.linalg.norm(way)) * RATE / (len(points) - third)


def _off_line(points: Floats) -> float:
    """Mean square distance of (N, 3) points in time from a straight and even movement."""
    time = np.arange(len(points))
    line = np.polynomial.polynomial.polyfit(time, points, 1)
    return float(((points - line[0] - time[:, None] * line[1]) ** 2).sum(axis=1).mean())


def report(what: str, scores: Sequence[Scores]) -> Errors:
    """A line of means, in millimetres."""
    found = errors(scores)
    each = "  ".join(
        f"{found.root[found.views == view].mean():4.0f}" for view in range(len(scores))
    )
    print(f"{what:38} {found.root.mean():5.1f}  {found.aligned.mean():7.1f}    {each}", end="")
    print(f"   {bone_variation(scores):4.1f} %")
    return found


def report_states(found: Errors) -> None:
    print(
        "by state: joints, mm root, mm across the line of sight, share off by more than 80 mm there"
    )
    for state in TrackingState:
        those = found.states == state
        if those.any():
            word, across = state.name.lower().replace("_", " "), found.across[those]
            print(
                f"  {word:12} {100 * those.mean():5.1f} %  {found.root[those].mean():4.0f}", end=""
            )
            print(f"  {across.mean():4.0f}  {100 * (across > 80.0).mean():4.0f} %")


def report_joints(colour: Errors, depth: Errors) -> None:
    print("by joint: mm root / aligned; colour alone, colour and depth")
    for joint, name in enumerate(JOINT_NAMES):
        line = [
            f"{e.root[:, joint].mean():4.0f} / {e.aligned[:, joint].mean():3.0f}"
            for e in (colour, depth)
        ]
        print(f"  {name:16} {line[0]}   {line[1]}")
