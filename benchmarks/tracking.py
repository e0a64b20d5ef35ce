"""How right the tracked joints are, from one camera, against four calibrated ones.

    python -m benchmarks.tracking [--wheel pose2sim-0.10.49-py3-none-any.whl] [--step 2]

The ground truth is triangulated from all four views (`ground_truth.py`); each view alone then goes
through the tracker as in a show. Given are mean distances in millimetres, all joints and frames:

  root     the hip centres laid upon each other, nothing else
  scaled   the same, and the skeleton made as large as the true one
  aligned  shifted, turned and scaled as a whole to fit best (Procrustes)

Depth is half synthetic (`body_depth.py`): the true skeleton, made a body of balls.
"""

from __future__ import annotations

import argparse
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.body_depth import body_depth
from benchmarks.ground_truth import View, read_views, triangulate
from puppet.kernel import Floats
from puppet.show import ConditioningConfig
from puppet.skeleton import JOINT_NAMES, SkeletonFrame, TrackingState
from puppet.tracking.blazepose import Landmarks
from puppet.tracking.body import Body
from puppet.tracking.camera import Shot
from puppet.tracking.condition import Conditioner
from puppet.tracking.models import PoseModels, model_paths
from puppet.tracking.people import People
from puppet.tracking.video_file import VideoFile
from script.make_recorded_streams import POSE2SIM, download

DEMO: Final = "Pose2Sim/Demo_SinglePerson"
RATE: Final = 60.0
TARGET: Final = 90.0


@dataclass(frozen=True, slots=True, eq=False)
class Scored:
    """One frame of one view: errors of the joints in metres, by the three ways, and their states.
    positions: (20, 3) as tracked, truth: (20, 3), both metres from the lens."""

    view: int
    frame: int
    root: Floats
    scaled: Floats
    aligned: Floats
    states: NDArray[np.uint8]
    positions: Floats
    truth: Floats


def procrustes(points: Floats, truth: Floats) -> Floats:
    """The points, shifted, turned and scaled as a whole to fit best."""
    a, b = points - points.mean(axis=0), truth - truth.mean(axis=0)
    left, sizes, right = np.linalg.svd(a.T @ b)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    scale = float((sizes * signs).sum() / (a * a).sum())
    return np.asarray(scale * a @ (left * signs) @ right + truth.mean(axis=0))


def score(
    view: int, frame: int, positions: Floats, truth: Floats, states: NDArray[np.uint8]
) -> Scored:
    a, b = positions - positions[0], truth - truth[0]
    size = float((a * b).sum() / (a * a).sum())
    return Scored(
        view,
        frame,
        np.linalg.norm(a - b, axis=1),
        np.linalg.norm(size * a - b, axis=1),
        np.linalg.norm(procrustes(positions, truth) - truth, axis=1),
        states,
        positions,
        truth,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What the network found in one picture, kept so that every variant starts from the same."""

    shot: Shot
    landmarks: Landmarks | None
    turned: dict[float, Landmarks | None]


def look_at(clip: Path, models: PoseModels, count: int | None = None) -> list[Look]:
    """The first performer in each picture. What is asked for again is looked at again, once."""
    people, body = People(models, most=1), Body()
    looks: list[Look] = []
    for shot in VideoFile(clip):
        if count is not None and len(looks) >= count:
            break
        seen = people.look(shot)
        turned: dict[float, Landmarks | None] = {}
        if seen:

            def again(turn: float, shot: Shot = shot, memo: dict[float, Landmarks | None] = turned,
                      one: object = seen[0]) -> Landmarks | None:  # fmt: skip
                memo[turn] = people.look_again(shot, one, turn)  # type: ignore[arg-type]
                return memo[turn]

            body.joints(seen[0].landmarks, shot, again)
        empty = replace(shot, colour=np.broadcast_to(np.uint8(0), shot.colour.shape))
        looks.append(Look(empty, seen[0].landmarks if seen else None, turned))
    return looks


def run(
    views: Sequence[View],
    looks: Sequence[Sequence[Look]],
    truth: Floats,
    *,
    lens: bool,
    depth: bool,
    step: int,
) -> list[Scored]:
    """Each view through `Body`, as the tracker does. truth: (F, 20, 3) metres in the room."""
    scores = []
    for index, (view, seen) in enumerate(zip(views, looks, strict=True)):
        body = Body()
        for frame, look in enumerate(seen[:: step if depth else 1]):
            number = frame * (step if depth else 1)
            if look.landmarks is None or not np.isfinite(truth[number]).all():
                continue
            there = view.see(truth[number])
            shot = replace(look.shot, intrinsics=view.lens if lens else None)
            if depth:
                height, width = shot.colour.shape[:2]
                image = body_depth(there, view.lens, (width, height), seed=number)
                shot = replace(shot, depth=image)
            positions, states = body.joints(look.landmarks, shot, partial(_again, look.turned))
            scores.append(score(index, number, positions, there * (1, -1, -1), states))
    return scores


def _again(turned: dict[float, Landmarks | None], turn: float) -> Landmarks | None:
    return turned.get(turn)


def report(what: str, scores: Sequence[Scored]) -> float:
    """Print the means; returns the root-relative one, millimetres."""
    root = 1000.0 * np.stack([one.root for one in scores])
    scaled = 1000.0 * np.stack([one.scaled for one in scores])
    aligned = 1000.0 * np.stack([one.aligned for one in scores])
    states = np.stack([one.states for one in scores])
    print(f"{what:34} root {root.mean():5.1f}  scaled {scaled.mean():5.1f}", end="")
    print(f"  aligned {aligned.mean():5.1f}")
    views = np.array([one.view for one in scores])
    each = ", ".join(f"{root[views == view].mean():.0f}" for view in np.unique(views))
    print(f"  by view, root: {each}")
    for state in TrackingState:
        those = states == state
        if those.any():
            word = state.name.lower().replace("_", " ")
            print(f"  {word}: {100 * those.mean():.1f} % of joints, root {root[those].mean():.0f}")
    return float(root.mean())


def report_joints(scores: Sequence[Scored]) -> None:
    root = 1000.0 * np.mean([one.root for one in scores], axis=0)
    aligned = 1000.0 * np.mean([one.aligned for one in scores], axis=0)
    print("by joint, mm: root / aligned")
    for name, a, b in zip(JOINT_NAMES, root, aligned, strict=True):
        print(f"  {name:16} {a:5.0f} / {b:.0f}")


def report_jitter(scores: Sequence[Scored], conditioning: ConditioningConfig) -> None:
    """What trembles: the part of the movement on the body that the ground truth does not have."""
    before: list[float] = []
    after: list[float] = []
    for view in sorted({one.view for one in scores}):
        condition, raw, smooth, true = Conditioner(conditioning), [], [], []
        for one in (one for one in scores if one.view == view):
            frame = SkeletonFrame(one.frame / RATE, one.frame, 0, one.positions, one.states)
            raw.append(one.positions - one.positions[0])
            conditioned = condition(frame).positions
            smooth.append(conditioned - conditioned[0])
            true.append(one.truth - one.truth[0])
        for out, points in ((before, raw), (after, smooth)):
            # The second difference of a tremble of s millimetres in each frame is √6 · s.
            off = np.diff(np.array(points) - np.array(true), 2, axis=0)[20:]
            out.append(1000.0 * np.sqrt((off**2).sum(axis=2).mean() / 6.0))
    print(f"jitter: {np.mean(before):.1f} mm before conditioning, {np.mean(after):.1f} after")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--wheel", type=Path, help=f"{POSE2SIM}, already downloaded")
    parser.add_argument("--step", type=int, default=2, help="depth: every so many frames")
    arguments = parser.parse_args()
    models = model_paths()
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        with zipfile.ZipFile(arguments.wheel or download(POSE2SIM, scratch)) as archive:
            views = list(read_views(archive.read(f"{DEMO}/calibration/Calib.qca.txt")).values())
            looks = []
            for view in views:
                clip = scratch / f"{view.name}.mp4"
                clip.write_bytes(archive.read(f"{DEMO}/videos/{view.name}.mp4"))
                looks.append(look_at(clip, models))
    truth = triangulate(views, [[look.landmarks for look in seen] for seen in looks])
    frames = sum(map(len, looks))
    found = sum(look.landmarks is not None for seen in looks for look in seen)
    print(f"{found} of {frames} frames tracked; the views miss the ground truth by ", end="")
    print(f"{truth.residual:.0f} pixels (median)\n")
    measure = partial(run, views, looks, truth.joints, step=arguments.step)
    colour = measure(lens=True, depth=False)
    mean = report("colour alone", colour)
    report("colour alone, lens not known", measure(lens=False, depth=False))
    report("colour and depth (half synthetic)", measure(lens=True, depth=True))
    print()
    report_joints(colour)
    print()
    report_jitter(colour, ConditioningConfig())
    print(f"\ntarget, colour alone, root: {TARGET:.0f} mm; measured {mean:.1f}")


if __name__ == "__main__":
    main()
