"""A recorded performance on its way from a foreign file to skeleton frames.

A reader gives what the file says, in stage axes (`Performance`). `skeleton_frames` mends what all
such files have in common: clocks that jump, joints and people that are not there, an unknown
floor. What was mended is counted (`ImportReport`), so that nobody takes a hole for a performance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Bytes, Floats
from puppet.skeleton import JOINT_COUNT, SkeletonFrame, TrackingState, nobody

#: Seconds without a frame after which the performer has left, rather than a frame been lost.
GAP_SECONDS: Final = 0.5
#: Nobody stays away longer than this in a file: it is the clock that jumped.
JUMP_SECONDS: Final = 60.0
#: All gaps together fill no more than this; what is beyond it is closed up like a clock jump.
FILL_SECONDS: Final = 600.0
#: A tracker whose numbers all stand still for this long looks at an empty stage.
FROZEN_SECONDS: Final = 0.5
#: Metres; nothing that a sensor sees is farther away.
FARTHEST: Final = 100.0
#: Of the lowest points of all frames, the share that lies on or under the floor: jitter.
FLOOR_PERCENTILE: Final = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """What a file of recorded motion says, in stage axes, its clock and its holes as found.

    kind: "kinect1-csv", "kinect1-skl", "kinect2-csv", "bvh". rate: nominal frames a second.
    times: (F,) seconds on the file's own clock, in the order of its rows.
    positions: (F, 20, 3) metres. states: (F, 20) `TrackingState`.
    states_known: the file has states; else they are guessed from zeros and repeats.
    measured: a sensor saw it, so that a joint at the origin or a number that repeats is a hole.
    floor_known: y = 0 is the floor already.
    notes: what was guessed or dropped, for people.
    """

    kind: str
    rate: float
    times: Floats
    positions: Floats
    states: Bytes
    states_known: bool = True
    measured: bool = True
    floor_known: bool = False
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ImportReport:
    """What an import found and mended, in counts.

    frames, duration (s): of the result. nobody: frames with no one in them, those that fill gaps
    included. inferred, not_tracked: joints, in frames with someone. invalid: joints that were not
    numbers, or farther away than any sensor sees. repeated: rows equal to the row before.
    clock_jumps: steps of the clock that were too long to be true. clock_backwards: steps back or
    of nothing. gaps, gap_seconds: times when the performer was away.
    """

    rate: float
    frames: int = 0
    duration: float = 0.0
    nobody: int = 0
    inferred: int = 0
    not_tracked: int = 0
    invalid: int = 0
    repeated: int = 0
    clock_jumps: int = 0
    clock_backwards: int = 0
    gaps: int = 0
    gap_seconds: float = 0.0
    notes: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        """The report for people: the size first, then only what there is to say."""
        someone = max(1, (self.frames - self.nobody) * JOINT_COUNT)
        lines = [
            f"{_count(self.frames, 'frame')}, {self.duration:.1f} s "
            f"at {self.rate:g} frames a second"
        ]
        if self.nobody:
            whole = " (the whole recording)" if self.nobody == self.frames else ""
            lines.append(f"nobody there in {_count(self.nobody, 'frame')}{whole}")
        if self.gaps:
            gaps = _count(self.gaps, "gap")
            lines.append(f"{gaps}, {self.gap_seconds:.1f} s in all, filled with nobody")
        for count, words in (
            (self.inferred, "inferred"),
            (self.not_tracked, "not tracked"),
            (self.invalid, "with impossible numbers, taken as not tracked"),
        ):
            if count:
                lines.append(f"{_count(count, 'joint')} {words} ({100 * count / someone:.1f} %)")
        for count, words in (
            (self.repeated, "equal to the row before"),
            (self.clock_jumps, "where the clock jumps, closed up"),
            (self.clock_backwards, "where the clock does not go forwards, closed up"),
        ):
            if count:
                lines.append(f"{_count(count, 'row')} {words}")
        return [*lines, *self.notes]


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def skeleton_frames(performance: Performance) -> tuple[list[SkeletonFrame], ImportReport]:
    """Frames with a clock that only grows, a floor at y = 0, and honest states; and the counts."""
    positions, states = performance.positions.copy(), performance.states.copy()
    possible = np.isfinite(positions).all(axis=2) & (np.abs(positions) < FARTHEST).all(axis=2)
    states[~possible] = TrackingState.NOT_TRACKED
    if performance.measured:
        states[(positions == 0.0).all(axis=2)] = TrackingState.NOT_TRACKED
    repeated = _repeats(performance, states) if performance.measured else 0
    positions[states == TrackingState.NOT_TRACKED] = 0.0
    notes = performance.notes
    if not performance.floor_known and states.any():
        height = floor_height(positions, states)
        positions[..., 1] -= height
        positions[states == TrackingState.NOT_TRACKED] = 0.0
        notes = (*notes, f"floor: {height:+.2f} m in the file, from the lowest joints; now y = 0")
    times, gaps, report = _mended_clock(performance)
    frames = _frames(times, positions, states, gaps, performance.rate)
    present = states.any(axis=1)
    return frames, replace(
        report,
        frames=len(frames),
        duration=frames[-1].time if frames else 0.0,
        nobody=sum(not frame.present for frame in frames),
        inferred=int((states == TrackingState.INFERRED).sum()),
        not_tracked=int((states[present] == TrackingState.NOT_TRACKED).sum()),
        invalid=int((~possible).sum()),
        repeated=repeated,
        notes=notes,
    )


def floor_height(positions: Floats, states: Bytes) -> float:
    """How high the floor is, m: where the lowest joint of most frames is. 0 if nobody is seen.

    positions: (F, 20, 3) metres, +Y up. states: (F, 20). The lowest joint of a standing performer
    is a foot; of one who sits at a table the hip may be all there is. Tilt is not estimated.
    """
    heights = np.where(states > TrackingState.NOT_TRACKED, positions[..., 1], np.inf).min(axis=1)
    heights = heights[np.isfinite(heights)]
    return float(np.percentile(heights, FLOOR_PERCENTILE)) if len(heights) else 0.0


def _repeats(performance: Performance, states: Bytes) -> int:
    """Take down states of joints that only repeat the frame before; count rows that do so whole.

    Sensor noise never gives the same number twice. A row that repeats is a tracker polled too
    often, unless it goes on; a joint that repeats while others move is one that was lost.
    """
    seen = states > TrackingState.NOT_TRACKED
    same = np.zeros(seen.shape, bool)
    same[1:] = (performance.positions[1:] == performance.positions[:-1]).all(axis=2) & seen[1:]
    still = seen.any(axis=1) & (same == seen).all(axis=1)
    if not performance.states_known:
        states[same & ~still[:, None]] = TrackingState.NOT_TRACKED
    for first, last in _runs(still):
        if last - first > FROZEN_SECONDS * performance.rate:
            states[first:last] = TrackingState.NOT_TRACKED
    return int(still.sum())


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Where `flags` is true: (first, past the last) of each run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def _mended_clock(
    performance: Performance,
) -> tuple[Floats, NDArray[np.bool_], ImportReport]:
    """Times from 0 that only grow; for each frame whether a gap is before it; and the counts."""
    nominal = 1.0 / performance.rate
    steps = np.diff(performance.times)
    backwards = steps <= 0.0
    away = np.where((steps > GAP_SECONDS) & (steps <= JUMP_SECONDS), steps, 0.0)
    away[np.cumsum(away) > FILL_SECONDS] = 0.0
    jumps = (steps > GAP_SECONDS) & (away == 0.0)
    steps[backwards | jumps] = nominal
    times = np.concatenate([[0.0], np.cumsum(steps)])[: len(performance.times)]
    report = ImportReport(
        rate=performance.rate,
        clock_jumps=int(jumps.sum()),
        clock_backwards=int(backwards.sum()),
        gaps=int((away > 0.0).sum()),
        gap_seconds=float(away.sum()),
    )
    return times, np.concatenate([[False], away > 0.0])[: len(times)], report


def _frames(
    times: Floats, positions: Floats, states: Bytes, gaps: NDArray[np.bool_], rate: float
) -> list[SkeletonFrame]:
    frames: list[SkeletonFrame] = []
    for index, time in enumerate(times.tolist()):
        if gaps[index]:
            before = frames[-1].time
            for missing in range(1, round((time - before) * rate)):
                frames.append(nobody(before + missing / rate, len(frames)))
        frames.append(SkeletonFrame(time, len(frames), 0, positions[index], states[index]))
    return frames
