"""How right the tracked joints are, from one camera, against four calibrated ones.

    python -m benchmarks.tracking [--wheel pose2sim-0.10.49-py3-none-any.whl] [--step 2] [--one]

The ground truth is triangulated from all four views (`ground_truth.py`); each view alone then goes
through the tracker as in a show: people, sides, lift, states, leaps, bone lengths. Figures are mean
distances in millimetres over all joints and frames, with the hip centres laid upon each other
("root"), and with the skeleton shifted, turned and scaled to fit best ("aligned", Procrustes).

Depth is half synthetic (`body_depth.py`): the true skeleton, made a body of balls.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.body_depth import body_depth
from benchmarks.clips import POSE2SIM, download
from benchmarks.ground_truth import GroundTruth, View
from benchmarks.tracked_views import (
    ONE,
    TWO,
    Scores,
    Track,
    clips,
    ground_truth,
    look_at,
    same_people,
    tracked,
    truth_without,
)
from benchmarks.tracking_scores import (
    conditioned,
    jitter_at_rest,
    report,
    report_joints,
    report_states,
    trembling,
)
from puppet.kernel import Floats
from puppet.tracking.cameras.camera import Depth
from puppet.tracking.people.models import PoseModels, model_paths

TARGET: Final = 90.0
HEADING: Final = f"{'':38}  root  aligned    root by view             bones vary"
#: What depth can be, if it is not what it should be: of a good image and the number of its frame.
WRONG: Final[dict[str, Callable[[Depth, int], Depth]]] = {
    "all zero": lambda good, _: np.zeros_like(good),
    "noise": lambda good, n: (
        np.random.default_rng(n).integers(0, 8000, good.shape).astype(np.uint16)
    ),
    "a wall at 3 m": lambda good, _: np.full_like(good, 3000),
    "another view (mirrored)": lambda good, _: np.ascontiguousarray(good[:, ::-1]),
    "gone for every second third of a second": lambda good, n: good * np.uint16(n // 20 % 2),
}


def depth_images(view: View, track: Track, truth: Floats, step: int) -> dict[int, Depth]:
    """What a depth camera in that view would give, by frame."""
    images = {}
    for frame in range(0, len(track), step):
        look = track[frame]
        if look is not None and np.isfinite(truth[frame]).all():
            images[frame] = body_depth(view.see(truth[frame]), view.lens, look.size, seed=frame)
    return images


def every_view(
    views: Sequence[View], tracks: Sequence[Track], truth: Floats, **how: bool | int
) -> list[Scores]:
    """Each view without depth. how: as for `tracked`."""
    found = zip(views, tracks, strict=True)
    return [tracked(view, track, truth, **how) for view, track in found]  # type: ignore[arg-type]


def with_depth(
    views: Sequence[View],
    tracks: Sequence[Track],
    truth: Floats,
    images: Sequence[dict[int, Depth]],
    step: int,
    spoil: Callable[[Depth, int], Depth] = lambda good, _: good,
) -> list[Scores]:
    """Each view with its depth images, spoilt or not."""

    def image(of: dict[int, Depth], frame: int) -> Depth | None:
        return spoil(of[frame], frame) if frame in of else None

    found = zip(views, tracks, images, strict=True)
    return [
        tracked(view, track, truth, depth=partial(image, of), step=step)
        for view, track, of in found
    ]


def say_truth(views: Sequence[View], tracks: Sequence[Track], truth: GroundTruth) -> None:
    """How many frames are tracked, and how sure the ground truth is."""
    count = sum(map(len, tracks))
    seen = sum(look is not None for track in tracks for look in track)
    fewer = [truth_without(index, views, tracks).joints for index in range(len(views))]
    without = [np.linalg.norm(joints - truth.joints, axis=2) for joints in fewer]
    print(
        f"tracked: {seen} of {count} frames. Ground truth: the views that agree miss it by ", end=""
    )
    print(
        f"{truth.residual:.0f} pixels\n(median), {100 * truth.left_out:.0f} % of what views ",
        end="",
    )
    print("found is left out; without any one view a joint is elsewhere by ", end="")
    print(f"{1000 * np.nanmedian(without):.0f} mm (median)\n")


def measure_one(wheel: Path, scratch: Path, models: PoseModels, step: int) -> None:
    """One person: with and without depth, with the lens and without, by state and by joint."""
    views, paths = clips(wheel, ONE, scratch)
    tracks = [look_at(path, models, most=1)[0] for path in paths]
    true = ground_truth(views, tracks)
    print("ONE PERSON")
    say_truth(views, tracks, true)
    truth = true.joints
    images = [depth_images(v, t, truth, step) for v, t in zip(views, tracks, strict=True)]
    print(HEADING)
    scores = every_view(views, tracks, truth)
    colour = report("colour alone", scores)
    report("colour alone, lens not known", every_view(views, tracks, truth, lens=False))
    of_others = [
        tracked(view, track, truth_without(index, views, tracks).joints)
        for index, (view, track) in enumerate(zip(views, tracks, strict=True))
    ]
    report("colour alone, truth of other views", of_others)
    depth = report("colour and depth", with_depth(views, tracks, truth, images, step))
    print()
    report_states(colour)
    print()
    report_joints(colour, depth)
    smooth = [conditioned(one) for one in scores]
    (before, stretches), (after, _) = jitter_at_rest(scores), jitter_at_rest(smooth)
    print(f"\njitter at rest ({stretches} stretches of a joint): {before:.1f} mm before ", end="")
    print("conditioning, ", end="")
    print(
        f"{after:.1f} mm after;\ntrembling, at rest or not: {trembling(scores):.1f} mm before, ",
        end="",
    )
    print(f"{trembling(smooth):.1f} mm after\n")
    print("DEPTH THAT IS WRONG must not be worse than none")
    report("none", every_view(views, tracks, truth, step=step))
    for name, spoil in WRONG.items():
        report(name, with_depth(views, tracks, truth, images, step, spoil))
    print(f"\ntarget, colour alone, root: {TARGET:.0f} mm; measured {colour.root.mean():.1f}")


def measure_two(wheel: Path, scratch: Path, models: PoseModels) -> None:
    """Two people at once: he balances, she looks on; they hide each other in part."""
    views, paths = clips(wheel, TWO, scratch)
    found = [look_at(path, models, most=2) for path in paths]
    for number, tracks in enumerate(same_people(views, found)):
        print(f"\nTWO PEOPLE, number {number + 1}")
        true = ground_truth(views, tracks)
        say_truth(views, tracks, true)
        print(HEADING)
        report_states(report("colour alone", every_view(views, tracks, true.joints)))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--wheel", type=Path, help=f"{POSE2SIM}, already downloaded")
    parser.add_argument("--step", type=int, default=2, help="depth: every so many frames")
    parser.add_argument("--one", action="store_true", help="leave the two people out")
    arguments = parser.parse_args()
    models = model_paths()
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        wheel = arguments.wheel or download(POSE2SIM, scratch)
        measure_one(wheel, scratch, models, arguments.step)
        if not arguments.one:
            measure_two(wheel, scratch, models)


if __name__ == "__main__":
    main()
