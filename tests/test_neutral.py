"""When somebody's stance is taken for the neutral one."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from puppet.skeleton import SkeletonFrame
from puppet.tracking.neutral import NeutralStance
from puppet.tracking.rehearsal import SECTIONS, Rehearsal


def moved(
    frames: list[SkeletonFrame], turn: float, place: tuple[float, float, float]
) -> list[SkeletonFrame]:
    spin = Rotation.from_euler("y", turn)
    return [
        SkeletonFrame(f.time, f.sequence, 0, np.array(spin.apply(f.positions) + place), f.states)
        for f in frames
    ]


def test_standing_still_for_a_moment_is_measured_once() -> None:
    find = NeutralStance()
    changes = [frame.time for frame in Rehearsal() if find(frame)]
    assert find.measured
    assert len(changes) == 2  # assumed at first sight, measured at the first stillness
    assert 0.5 < changes[1] < 1.5


def test_the_measured_stance_knows_where_and_which_way() -> None:
    find = NeutralStance()
    for frame in moved(list(Rehearsal())[:60], 0.8, (1.0, 0.0, -3.0)):
        find(frame)
    assert find.stance is not None
    assert abs(find.stance.heading - 0.8) < math.radians(3)
    np.testing.assert_allclose(find.stance.hip[[0, 2]], [1.0, -3.0], atol=0.08)


def test_someone_who_never_stands_still_gets_an_assumed_stance() -> None:
    find = NeutralStance()
    times = {section.name: section for section in SECTIONS}
    walk = next(section for name, section in times.items() if "walk" in name)
    for frame in Rehearsal():
        if walk.start + 0.5 < frame.time < walk.end - 0.5:
            find(frame)
    assert find.stance is not None
    assert not find.measured


def test_raised_arms_are_not_a_neutral_stance() -> None:
    frame = next(iter(Rehearsal()))
    points = np.array(frame.positions)
    points[[5, 6, 7]] = points[4] + [(0.3, 0, 0), (0.55, 0, 0), (0.63, 0, 0)]
    find = NeutralStance()
    for i in range(60):
        find(SkeletonFrame(i / 30, i, 0, points, frame.states))
    assert not find.measured
