"""Two performers at once, as our own tracker saw them: the takes `script/make_recorded_streams.py`
makes of pose2sim's clips of two people, replayed."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from puppet.kernel import Floats
from puppet.skeleton import Joint
from puppet.tracking.takes.replay import Replay
from puppet.tracking.takes.take import read_take

DUO = sorted((Path(__file__).parent / "recorded_streams").glob("duo_*.mcap"))
#: Metres, from triangulating all four views: how far their hips are apart as the clip begins and
#: ends. He comes nearer all the time.
TRUE_DISTANCES = (1.61, 1.03)
#: A single view takes everybody for one size, and she is small: it sees her too far away.
ASTRAY = 1.4


def hips_of(path: Path) -> dict[int, list[tuple[float, Floats]]]:
    """Time and hips of each performer, wherever they are there."""
    found: dict[int, list[tuple[float, Floats]]] = {}
    for moment in Replay(read_take(path)):
        for frame in moment.frames:
            place = frame.positions[Joint.HIP_CENTER]
            found.setdefault(frame.performer, []).append((moment.time, place))
    return found


def test_there_are_takes_of_all_four_views() -> None:
    assert [path.stem for path in DUO] == [f"duo_cam0{camera}" for camera in (1, 2, 3, 4)]


@pytest.mark.parametrize("path", DUO, ids=lambda path: path.stem)
def test_there_are_two_performers_and_no_third(path: Path) -> None:
    found = hips_of(path)
    assert found.keys() == {0, 1}
    # A few shots pass until somebody is believed; from then on they are lost hardly ever.
    assert all(len(places) >= 88 for places in found.values())


@pytest.mark.parametrize("path", DUO, ids=lambda path: path.stem)
def test_identities_never_swap(path: Path) -> None:
    take = read_take(path)
    both = [moment for moment in take if len(moment.frames) == 2]
    hips = [
        {frame.performer: frame.positions[Joint.HIP_CENTER] for frame in moment.frames}
        for moment in both
    ]
    for before, after in pairwise(hips):
        stay = sum(np.linalg.norm(after[number] - before[number]) for number in (0, 1))
        swap = sum(np.linalg.norm(after[1 - number] - before[number]) for number in (0, 1))
        assert stay < 0.5 * swap
    for places in hips_of(path).values():
        for (earlier, a), (later, b) in pairwise(places):
            assert np.linalg.norm(b - a) < 0.3 + 2.0 * (later - earlier)


@pytest.mark.parametrize("path", DUO, ids=lambda path: path.stem)
def test_he_lifts_a_leg_and_comes_nearer_as_in_the_clip(path: Path) -> None:
    both = [moment for moment in read_take(path) if len(moment.frames) == 2]
    lifted = {0: 0.0, 1: 0.0}
    distances = []
    for moment in both:
        positions = {frame.performer: frame.positions for frame in moment.frames}
        for number, joints in positions.items():
            feet = joints[Joint.FOOT_LEFT] - joints[Joint.FOOT_RIGHT]
            lifted[number] = max(lifted[number], abs(float(feet[1])))
        apart = positions[0][Joint.HIP_CENTER] - positions[1][Joint.HIP_CENTER]
        distances.append(float(np.linalg.norm(apart)))
    # One balances on one leg, the other stands on both.
    assert max(lifted.values()) > 0.25
    assert min(lifted.values()) < 0.25
    first, last = np.median(distances[:10]), np.median(distances[-10:])
    assert last < first - 0.3
    assert abs(first - TRUE_DISTANCES[0]) < ASTRAY
    assert abs(last - TRUE_DISTANCES[1]) < ASTRAY


def test_he_who_leaps_off_a_roof_is_still_himself_when_he_lands() -> None:
    found = hips_of(DUO[0].with_name("leap.mcap"))
    assert found.keys() == {0, 1}
    (start, roof), (end, lawn) = found[0][0], found[0][-1]
    assert end - start > 7.0
    assert roof[1] - lawn[1] > 1.0
    # She walks past below him, from behind a tree on the right to the border on the left.
    (_, tree), (_, border) = found[1][0], found[1][-1]
    assert tree[0] - border[0] > 3.0
    assert abs(tree[1] - border[1]) < 0.4
