"""What cameras see of synthetic and real performers, played at once, for the tests of fusion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from benchmarks.fusion import takes
from puppet.kernel import Floats
from puppet.skeleton import JOINT_COUNT, Joint, Moment, SkeletonFrame, TrackingState
from puppet.tracking.fusion.fusion import Fusion
from puppet.tracking.takes.rehearsal import body

#: When it arrived, which camera, what it saw.
Arrival = tuple[float, str, Moment]
BALANCE = takes()


def person(number: int, positions: Floats, *lost: Joint, inferred: bool = False) -> SkeletonFrame:
    states = np.full(JOINT_COUNT, TrackingState.INFERRED if inferred else 2, np.uint8)
    states[list(lost)] = TrackingState.NOT_TRACKED
    return SkeletonFrame(0.0, 0, number, positions, states)


def seen(time: float, sequence: int, *people: SkeletonFrame) -> Moment:
    return Moment(0.0, 0, people).at(time, sequence)


def played(fusion: Fusion, arrivals: Iterable[Arrival]) -> list[Moment]:
    """What comes out, in order of arrival."""
    given = [fusion.add(camera, m, at) for at, camera, m in sorted(arrivals, key=lambda a: a[0])]
    return [moment for moment in given if moment is not None]


def film(
    camera: str,
    people: Callable[[float], Sequence[SkeletonFrame]],
    *,
    rate: float = 30.0,
    start: float = 0.0,
    end: float = 4.0,
    clock: float = 0.0,
    late: float = 0.02,
    jitter: float = 0.0,
    drift: float = 0.0,
) -> list[Arrival]:
    """What a camera sees from `start` to `end`, stamped by its own clock."""
    noise = np.random.default_rng(len(camera))
    arrivals = []
    for sequence, time in enumerate(np.arange(start, end, 1.0 / rate)):
        own = seen(float(time) * (1.0 + drift) + clock, sequence, *people(float(time)))
        arrivals.append((float(time) + late + jitter * float(noise.exponential()), camera, own))
    return arrivals


def dancing(
    number: int, away: Sequence[float] = (0.0, 0.0, 0.0)
) -> Callable[[float], Sequence[SkeletonFrame]]:
    """The rehearsal's performer, somewhere else."""
    return lambda time: (person(number, body(time) + np.asarray(away)),)


def numbers(moment: Moment) -> list[int]:
    return [frame.performer for frame in moment.frames]


def of(moments: Sequence[Moment], number: int) -> Floats:
    """(T, 20, 3)"""
    return np.array([moment.frame_of(number).positions for moment in moments])
