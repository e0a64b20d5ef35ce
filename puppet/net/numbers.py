"""Performers keep their numbers when a camera's tracker is started anew and counts from 0 again."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from puppet.kernel import Floats
from puppet.skeleton import Joint, Moment, SkeletonFrame

#: Seconds after a new stream began in which those of the old one are found again, by place.
FINDING: Final = 2.0
#: Seconds after which somebody who is not seen any more is forgotten.
REMEMBERED: Final = 60.0


class Numbers:
    """The numbers of one camera's performers over successive streams.

    In the first stream they are the tracker's own. In a new one, whoever appears in the first
    moments is whoever stood nearest to there in the old one; others get numbers that nobody had.
    """

    def __init__(self) -> None:
        self._stream: object = None
        self._first = True
        self._began = 0.0
        self._ours: dict[int, int] = {}
        self._seen: dict[int, tuple[float, Floats]] = {}
        self._waiting: dict[int, Floats] = {}
        self._next = 0

    def kept(self, moment: Moment, stream: object) -> Moment:
        """The moment with the numbers that the show knows. stream: tells one from another."""
        if stream != self._stream:
            self._first = self._stream is None
            self._stream, self._began = stream, moment.time
            self._waiting = {number: place for number, (_, place) in self._seen.items()}
            self._ours, self._seen = {}, {}
        elif not 0.0 <= moment.time - self._began <= FINDING:
            self._waiting = {}
        self._meet([frame for frame in moment.frames if frame.performer not in self._ours])
        frames = []
        for frame in moment.frames:
            number = self._ours[frame.performer]
            self._seen[number] = (moment.time, _place(frame))
            same = number == frame.performer
            frames.append(frame if same else replace(frame, performer=number))
        self._forget(moment.time)
        return Moment(moment.time, moment.sequence, tuple(frames))

    def _meet(self, fresh: list[SkeletonFrame]) -> None:
        if fresh and self._waiting:
            numbers = list(self._waiting)
            apart = np.array(
                [
                    [np.linalg.norm(_place(one) - self._waiting[number]) for number in numbers]
                    for one in fresh
                ]
            )
            for row, column in zip(*linear_sum_assignment(apart), strict=True):
                self._ours[fresh[row].performer] = numbers[column]
                del self._waiting[numbers[column]]
        for frame in fresh:
            if frame.performer not in self._ours:
                number = frame.performer if self._first else self._next
                self._ours[frame.performer] = number
                self._next = max(self._next, number + 1)

    def _forget(self, time: float) -> None:
        gone = [one for one, (seen, _) in self._seen.items() if time - seen > REMEMBERED]
        for number in gone:
            del self._seen[number]
        if gone:
            self._ours = {theirs: ours for theirs, ours in self._ours.items() if ours in self._seen}


def _place(frame: SkeletonFrame) -> Floats:
    """(2,) metres on the floor."""
    return np.asarray(frame.positions[Joint.SHOULDER_CENTER, [0, 2]])
