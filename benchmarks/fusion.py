"""What two, three and four cameras make of a performer together, against each of them alone.

    python -m benchmarks.fusion

One person balances on one leg (pose2sim's single-person demo, four calibrated views, 60 a second):
what our own tracker made of each view lies in tests/recorded_streams. The calibration puts the four
takes into one room, and they are played at once, each with its own clock and a message's delay.
"""

from __future__ import annotations

import argparse
import itertools
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.ground_truth import View, landmarks_in, read_views, triangulate
from puppet.kernel import Floats
from puppet.show import TrackingConfig
from puppet.skeleton import HUMAN_BONES, JOINT_COUNT, Moment, TrackingState
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.fusion.fusion import Fusion, FusionConfig
from puppet.tracking.people.models import model_paths
from puppet.tracking.takes.take import read_take
from puppet.tracking.watcher import Watcher

POSE2SIM: Final = "pose2sim==0.10.49"
DEMO: Final = "Pose2Sim/Demo_SinglePerson"
STREAMS: Final = Path(__file__).resolve().parents[1] / "tests" / "recorded_streams"
#: The cameras as their calibration has them: place in the room, metres (z up), and the camera's
#: axes in the room, as rows (x right, y up).
ROOM: Final = {
    "cam01": ((1.4602, -1.9092, 1.8965), ((0.5536, 0.8047, 0.2144), (-0.4345, 0.0595, 0.8987))),
    "cam02": ((2.5820, 0.7066, 1.6910), ((-0.1967, 0.9795, -0.0430), (-0.3148, -0.0215, 0.9489))),
    "cam03": ((-3.2169, 2.2312, 2.0882), ((-0.7406, -0.6704, -0.0447), (0.2525, -0.3393, 0.9061))),
    "cam04": ((-3.7587, -1.4157, 1.8818), ((0.2586, -0.8751, -0.4090), (0.4959, -0.2431, 0.8337))),
}
#: The room has z up, the stage y.
_STAGE_FROM_ROOM: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
#: Seconds from capture to arrival, at least, and by how much more in the mean.
DELAY, JITTER = 0.02, 0.005
#: Figures are of what comes after so many seconds, when the tracker has settled.
SETTLED: Final = 0.3


def camera_positions() -> dict[str, Floats]:
    """Where the cameras stand, in the common stage frame."""
    return {name: _STAGE_FROM_ROOM @ np.array(place) for name, (place, _) in ROOM.items()}


def on_stage(camera: str, positions: Floats) -> Floats:
    """(..., 3) metres in the levelled frame of one take -> the common stage frame."""
    place, (right, image_up) = ROOM[camera]
    back = np.cross(right, image_up)
    z = np.array([back[0], back[1], 0.0]) / np.hypot(back[0], back[1])
    room_from_take = np.array([[-z[1], z[0], 0.0], [0.0, 0.0, 1.0], z]).T
    in_room = positions @ room_from_take.T + (place[0], place[1], 0.0)
    return np.asarray(in_room @ _STAGE_FROM_ROOM.T)


def takes() -> dict[str, list[Moment]]:
    """The four takes, in the common stage frame. Where a view does not see the performer (in its
    first pictures), it has what it sees next."""
    views = {
        camera: [
            replace(
                moment,
                frames=tuple(
                    replace(frame, positions=on_stage(camera, frame.positions))
                    for frame in moment.frames
                ),
            )
            for moment in read_take(STREAMS / f"balance_{camera}.mcap")
        ]
        for camera in ROOM
    }
    for seen in views.values():
        for index in reversed(range(len(seen) - 1)):
            if not seen[index].present:
                moment = seen[index]
                seen[index] = seen[index + 1].at(moment.time, moment.sequence)
    return views


def fused(views: dict[str, list[Moment]], *, aware: bool = True) -> list[Moment]:
    """Play the views at once. aware: whether fusion knows where the cameras stand."""
    noise = np.random.default_rng(0)
    arrivals = []
    for index, (camera, moments) in enumerate(views.items()):
        clock = 1000.0 * index  # each on a machine of its own
        times = np.array([moment.time for moment in moments])
        late = DELAY + noise.exponential(JITTER, len(moments)) + index / (60.0 * len(views))
        for moment, arrived in zip(moments, np.maximum.accumulate(times + late), strict=True):
            own = moment.at(moment.time + clock, moment.sequence)
            arrivals.append((float(arrived), camera, own))
    arrivals.sort(key=lambda arrival: arrival[0])
    fusion = Fusion(FusionConfig(camera_positions() if aware else {}))
    given = [fusion.add(camera, moment, arrived) for arrived, camera, moment in arrivals]
    return [moment for moment in given if moment is not None]


@dataclass(frozen=True, slots=True)
class Figures:
    """Means over all moments and joints, millimetres. place: from the truth. pose: the same with
    both hip centres at one place. beyond: what one joint in twenty exceeds of that. truth is NaN
    where it is not known. jitter: median second difference of a joint. lengths: deviation of a
    bone's length over time. apart: from the mean of all views. tracked: share of joints."""

    place: float
    pose: float
    beyond: float
    jitter: float
    lengths: float
    apart: float
    tracked: float

    @classmethod
    def of(cls, moments: Sequence[Moment], middle: Floats, truth: Floats | None) -> Figures:
        """middle, truth: (F, 20, 3) metres, at 60 a second."""
        seen = [moment for moment in moments if moment.present and moment.time >= SETTLED]
        numbers = [round(60.0 * moment.time) for moment in seen]
        joints = np.array([moment.frames[0].positions for moment in seen])
        states = np.array([moment.frames[0].states for moment in seen])
        right = np.full_like(joints, np.nan) if truth is None else truth[numbers]
        pose = np.linalg.norm((joints - joints[:, :1]) - (right - right[:, :1]), axis=-1)
        steps = np.diff(numbers)
        even = (steps[1:] == 1) & (steps[:-1] == 1)
        second = np.linalg.norm(np.diff(joints, 2, axis=0), axis=-1)[even]
        lengths = [
            np.linalg.norm(joints[:, bone.end] - joints[:, bone.start], axis=-1).std()
            for bone in HUMAN_BONES
        ]
        return cls(
            1000.0 * float(np.linalg.norm(joints - right, axis=-1).mean()),
            1000.0 * float(pose.mean()),
            1000.0 * float(np.percentile(pose, 95)),
            1000.0 * float(np.median(second)),
            1000.0 * float(np.mean(lengths)),
            1000.0 * float(np.linalg.norm(joints - middle[numbers], axis=-1).mean()),
            float((states == TrackingState.TRACKED).mean()),
        )


def mean_of(figures: Sequence[Figures]) -> Figures:
    """Of several runs."""
    return Figures(*np.mean([astuple(one) for one in figures], axis=0).tolist())


def middle_of(views: dict[str, list[Moment]]) -> Floats:
    """(F, 20, 3) metres: the mean of all views that see somebody in each frame."""
    count = 1 + max(round(60.0 * moments[-1].time) for moments in views.values())
    joints = np.full((len(views), count, JOINT_COUNT, 3), np.nan)
    for view, moments in zip(joints, views.values(), strict=True):
        for moment in moments:
            if moment.present:
                view[round(60.0 * moment.time)] = moment.frames[0].positions
    there = ~np.isnan(joints[:, :, :1, :1])
    return np.asarray(np.nansum(joints, axis=0) / np.maximum(there.sum(axis=0), 1))


def tracked_anew(wheel: Path | None) -> tuple[dict[str, list[Moment]], Floats]:
    """What the tracker as it is now makes of the clips, each view placed by its calibration alone,
    and where the joints really are. Both in the common stage frame."""
    views: dict[str, list[Moment]] = {}
    found = []
    models = model_paths()
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        with zipfile.ZipFile(wheel or _downloaded(scratch)) as archive:
            calibration = read_views(archive.read(f"{DEMO}/calibration/Calib.qca.txt"))
            for camera in calibration:
                archive.extract(f"{DEMO}/videos/{camera}.mp4", scratch)
        for camera, view in calibration.items():
            clip = scratch / DEMO / "videos" / f"{camera}.mp4"
            video = VideoFile(clip, up=view.up, focal=view.lens.focal_x)
            watcher = Watcher(video, models, TrackingConfig(performers=1))
            views[camera] = [_placed(moment, view) for _, moment in watcher.unlevelled()]
            found.append(landmarks_in(clip, models))
    truth = triangulate(list(calibration.values()), found).joints
    return views, np.asarray(truth @ _STAGE_FROM_ROOM.T)


def _placed(moment: Moment, view: View) -> Moment:
    """From the camera's axes (x right, y up, z backwards) into the stage frame."""
    frames = []
    for frame in moment.frames:
        in_room = (frame.positions * (1.0, -1.0, -1.0)) @ view.camera_from_room + view.centre
        frames.append(replace(frame, positions=in_room @ _STAGE_FROM_ROOM.T))
    return Moment(moment.time, moment.sequence, tuple(frames))


def _downloaded(directory: Path) -> Path:
    command = [
        *(sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"),
        *("--only-binary=:all:", "--dest", str(directory), POSE2SIM),
    ]
    subprocess.run(command, check=True)
    return next(directory.glob("*.whl"))


def report(views: dict[str, list[Moment]], truth: Floats | None) -> None:
    """Print a table: each view, and all choices of two, three and four."""
    middle = middle_of(views)
    rows = [(camera, Figures.of(moments, middle, truth)) for camera, moments in views.items()]
    rows.append(("one alone, mean", mean_of([figures for _, figures in rows])))
    for aware in (False, True):
        for count in range(2, len(views) + 1):
            runs = [
                Figures.of(fused({name: views[name] for name in names}, aware=aware), middle, truth)
                for names in itertools.combinations(views, count)
            ]
            name = f"{count} fused, places {'known' if aware else 'unknown'}"
            rows.append((name, mean_of(runs)))
    titles = [name for name in Figures.__dataclass_fields__ if name != "tracked"]
    print(f"{'mm':26}" + "".join(f"{title:>9}" for title in titles) + "  tracked")
    for name, figures in rows:
        *numbers, tracked = astuple(figures)
        print(f"{name:26}" + "".join(f"{n:9.1f}" for n in numbers) + f"  {tracked:7.1%}")


def cost() -> None:
    """Print what a moment of two performers and two cameras takes."""
    Fusion.warm_up()
    events = []
    for index, (camera, moments) in enumerate(list(takes().items())[:2]):
        for moment in moments:
            one = moment.frames[0]
            other = replace(one, performer=1, positions=one.positions + (2.0, 0.0, 0.0))
            both = Moment(moment.time, moment.sequence, (one, other))
            events.append((moment.time + 0.004 * index, camera, both))
    fusion = Fusion(FusionConfig(camera_positions()))
    spent = []
    for arrived, camera, moment in sorted(events, key=lambda event: event[0]):
        started = time.perf_counter()
        fusion.add(camera, moment, arrived)
        spent.append(1000.0 * (time.perf_counter() - started))
    median, worst = np.percentile(spent, [50, 95])
    print(f"two performers, two cameras: {median:.3f} ms a moment, 95 % within {worst:.3f} ms")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--wheel", type=Path, help=f"{POSE2SIM}, already downloaded")
    parser.add_argument("--takes", action="store_true", help="only what is in the repository")
    arguments = parser.parse_args()
    print("recorded takes, each levelled by itself")
    report(takes(), None)
    if not arguments.takes:
        print("\ntracked anew and placed by the calibration, against triangulated joints")
        report(*tracked_anew(arguments.wheel))
    print()
    cost()


if __name__ == "__main__":
    main()
