"""What the pose network finds in pose2sim's four views, once; and what `Body` makes of it."""

from __future__ import annotations

import itertools
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.ground_truth import GroundTruth, View, read_views, triangulate
from puppet.kernel import Floats
from puppet.tracking.body.body import Body
from puppet.tracking.body.sides import Sides
from puppet.tracking.cameras.camera import Depth, Shot
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.people.blazepose import Landmarks
from puppet.tracking.people.models import PoseModels
from puppet.tracking.people.people import People, Seen

ONE: Final = "Pose2Sim/Demo_SinglePerson"
TWO: Final = "Pose2Sim/Demo_MultiPerson"


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """One performer in one picture, kept so that every variant starts from the same.

    size: width and height of the picture. turned: what was found when it was looked at again.
    """

    time: float
    size: tuple[int, int]
    landmarks: Landmarks
    turned: dict[float, Landmarks | None]


#: One performer in one view, picture by picture; None where they were not seen.
Track = list[Look | None]


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """One performer in one view, the frames in which they were seen and are known.

    frames: (F,). positions, truth: (F, 20, 3) metres from the lens, x right, y up, z from the scene
    to the camera. states: (F, 20).
    """

    frames: NDArray[np.int64]
    positions: Floats
    states: NDArray[np.uint8]
    truth: Floats


def clips(wheel: Path, demo: str, scratch: Path) -> tuple[list[View], list[Path]]:
    """The views of a demonstration, and their clips."""
    with zipfile.ZipFile(wheel) as archive:
        views = list(read_views(archive.read(f"{demo}/calibration/Calib.qca.txt")).values())
        paths = []
        for view in views:
            paths.append(scratch / f"{Path(demo).name}_{view.name}.mp4")
            paths[-1].write_bytes(archive.read(f"{demo}/videos/{view.name}.mp4"))
    return views, paths


def look_at(clip: Path, models: PoseModels, most: int) -> list[Track]:
    """The `most` performers who are seen longest, the longest first."""
    people = People(models, most=most)
    bodies: dict[int, Body] = {}
    tracks: dict[int, Track] = {}
    count = 0
    for shot in VideoFile(clip):
        for seen in people.look(shot):
            track = tracks.setdefault(seen.performer, [])
            track += [None] * (count - len(track))
            turned: dict[float, Landmarks | None] = {}
            again = partial(_kept, people, shot, seen, turned)
            bodies.setdefault(seen.performer, Body()).joints(seen.landmarks, shot, again)
            height, width = shot.colour.shape[:2]
            track.append(Look(shot.time, (width, height), seen.landmarks, turned))
        count += 1
    for track in tracks.values():
        track.extend([None] * (count - len(track)))
    longest = sorted(tracks.values(), key=lambda track: -sum(look is not None for look in track))
    return longest[:most]


def _kept(
    people: People, shot: Shot, seen: Seen, turned: dict[float, Landmarks | None], turn: float
) -> Landmarks | None:
    turned[turn] = people.look_again(shot, seen, turn)
    return turned[turn]


def same_people(views: Sequence[View], tracks: Sequence[Sequence[Track]]) -> list[list[Track]]:
    """For each of two performers their tracks in all views: in that order in which the views agree
    best on where they are."""
    first, *others = tracks
    best: tuple[float, list[list[Track]]] = (np.inf, [])
    for swapped in itertools.product((0, 1), repeat=len(others)):
        pairs = [
            first,
            *(pair[::-1] if s else pair for pair, s in zip(others, swapped, strict=True)),
        ]
        people = [[pair[index] for pair in pairs] for index in range(2)]
        miss = sum(ground_truth(views, person).left_out for person in people)
        best = min(best, (miss, people), key=lambda found: found[0])
    return best[1]


def ground_truth(views: Sequence[View], tracks: Sequence[Track]) -> GroundTruth:
    """One performer, from all views; where a view takes front for back for some pictures, as it
    goes on from those before."""
    found: list[list[Landmarks | None]] = []
    for track in tracks:
        sides = Sides()
        found.append(
            [
                None if look is None else sides.keep(look.landmarks, look.time, look.turned.get)
                for look in track
            ]
        )
    return triangulate(views, found)


def truth_without(index: int, views: Sequence[View], tracks: Sequence[Track]) -> GroundTruth:
    """What the other views say, of which that one knows nothing."""
    rest = [other for other in range(len(views)) if other != index]
    return ground_truth([views[other] for other in rest], [tracks[other] for other in rest])


def tracked(
    view: View,
    track: Track,
    truth: Floats,
    *,
    lens: bool = True,
    depth: Callable[[int], Depth | None] = lambda _frame: None,
    step: int = 1,
    seated: bool = False,
) -> Scores:
    """One performer in one view through `Body`, every `step`th picture, as the tracker does.

    truth: (F, 20, 3) metres in the room. lens: whether it is known. depth: of a frame.
    """
    body = Body(seated)
    frames, positions, states, there = [], [], [], []
    for frame in range(0, len(track), step):
        look = track[frame]
        if look is None or not np.isfinite(truth[frame]).all():
            continue
        width, height = look.size
        black = np.broadcast_to(np.uint8(0), (height, width, 3))
        known = view.lens if lens else None
        shot = Shot(look.time, frame, black, depth(frame), known)
        found, state = body.joints(look.landmarks, shot, look.turned.get)
        frames.append(frame)
        positions.append(found)
        states.append(state)
        there.append(view.see(truth[frame]) * (1.0, -1.0, -1.0))
    return Scores(np.array(frames), np.array(positions), np.array(states), np.array(there))
