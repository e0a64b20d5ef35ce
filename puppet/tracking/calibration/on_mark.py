"""Calibrating by a performer: the floor first, then they stand on their mark and face the front.

Goes along with a camera's shots, one by one, and says at each what is still missing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from puppet.kernel import Floats
from puppet.mapping.stance import Stance, stance_of
from puppet.skeleton import Joint, Moment, SkeletonFrame
from puppet.tracking.calibration.level import Level
from puppet.tracking.calibration.stage_frame import StageFromCamera, at_mark, joints_of, mark_of
from puppet.tracking.conditioning.condition import Conditioner
from puppet.tracking.neutral import NeutralStance
from puppet.tracking.standing import Kind

#: Seconds for which somebody has to be seen before feet have told the floor, and depth.
FEET_SECONDS: Final = 1.0
DEPTH_SECONDS: Final = 0.5
#: Metres that feet may be off the floor that was found; ankles and toes are a little above it.
FEET_OFF: Final = 0.1
#: Seconds without the performer after which counting begins anew.
AWAY: Final = 1.0

_FEET: Final = [Joint.ANKLE_LEFT, Joint.FOOT_LEFT, Joint.ANKLE_RIGHT, Joint.FOOT_RIGHT]


@dataclass(frozen=True, slots=True, eq=False)
class FoundStage:
    """What was found out.

    stage_from_camera: with the origin at the mark, facing front. stance: on that stage; None if
    nobody stood still. kind: how they stood. floor, origin: what told them. quality: a sentence.
    """

    stage_from_camera: StageFromCamera
    stance: Stance | None
    kind: Kind | None
    floor: str
    origin: str
    quality: str


class OnMark:
    """Watches one camera until a performer has stood still on their mark.

    stage: what was found out; None until then. floor_known: whether the floor is. progress: 0..1,
    of what is waited for now. saying: what to do, a sentence for the performer.
    """

    def __init__(self, walk: float = 0.0) -> None:
        """walk: seconds from when the floor is known until standing still counts."""
        self._walk = walk
        self._counts_from = math.inf
        self.stage: FoundStage | None = None
        self.floor_known = False
        self.progress = 0.0
        self.saying = "Step into the picture, so that all of you is seen, feet too."
        self._condition = Conditioner()
        self._neutral = NeutralStance()
        self._performer: int | None = None
        self._since: float | None = None
        self._last = -math.inf
        self._places: list[Floats] = []

    def step(self, moment: Moment, level: Level) -> None:
        """Take in who is seen, in the camera's axes; `level` learns from them."""
        if self.stage is not None:
            return
        for frame in moment.frames:
            level.observe(frame.positions, frame.states)
        chosen = self._choose(moment)
        if chosen is None:
            self.progress = 0.0
            self.saying = "Step into the picture, so that all of you is seen, feet too."
            return
        self._places.append(chosen.positions)
        if not self.floor_known:
            self._learn_floor(chosen, level)
            return
        left = self._counts_from - chosen.time
        if left > 0.0:
            self.progress = 1.0 - left / self._walk
            self.saying = f"Walk to your mark and face the audience: {math.ceil(left)} ..."
            return
        conditioned = self._condition(replace(chosen, positions=level.to_stage(chosen.positions)))
        self._neutral(conditioned)
        self.progress = self._neutral.progress
        others = len(moment.frames) - 1
        self.saying = (
            "Stand on your mark, face the audience, arms hanging or held out, and keep still."
            if not others
            else f"The nearest person counts; {others} more can be seen, and should step out."
        )
        if self._neutral.measured and self._neutral.stance is not None:
            points = level.stage_from_camera().to_camera(joints_of(self._neutral.stance))
            level.settle()
            self.stage = _stage(level, points, self._neutral.kind)
            self.progress = 1.0
            self.saying = "Done."

    def finish(self, level: Level) -> FoundStage | None:
        """What can be said at the end of a recording in which nobody stood still: the middle of
        where they were is the mark. None if nobody was seen."""
        if self.stage is None and self._places:
            level.settle()
            self.stage = _stage(level, np.median(self._places, axis=0), None)
        return self.stage

    def _choose(self, moment: Moment) -> SkeletonFrame | None:
        """Whoever was looked at before, or else the nearest."""
        frame = next((f for f in moment.frames if f.performer == self._performer), None)
        if frame is None and moment.time - self._last > AWAY and moment.frames:
            frame = max(moment.frames, key=lambda f: float(f.positions[Joint.HIP_CENTER, 2]))
            self._performer, self._since = frame.performer, moment.time
            self._forget()
        if frame is not None:
            self._last = moment.time
        return frame

    def _learn_floor(self, frame: SkeletonFrame, level: Level) -> None:
        assert self._since is not None
        told = level.origin in ("depth", "a given height", "a saved calibration")
        needed = DEPTH_SECONDS if told else FEET_SECONDS
        self.progress = min(1.0, (frame.time - self._since) / needed)
        self.saying = "Stand upright where all of you is seen; the floor is being found."
        if self.progress >= 1.0 and level.origin != "a guess":
            level.settle()
            self.floor_known = True
            self.progress = 0.0
            self._counts_from = frame.time + self._walk

    def _forget(self) -> None:
        self._condition = Conditioner()
        self._neutral.reset()
        self._places.clear()


def _stage(level: Level, points: Floats, kind: Kind | None) -> FoundStage:
    """points: (20, 3) metres in the camera's axes, of somebody on their mark."""
    before = level.stage_from_camera()
    body = before.to_stage(points)
    mark = mark_of(body)
    lowest = float(body[_FEET, 1].min())
    how = {"I": "arms hanging", "T": "arms held out", "still": "standing still"}
    quality = (
        f"the lens is {before.shift[1]:.2f} m above the floor and "
        f"{math.hypot(mark[0] - before.shift[0], mark[1] - before.shift[2]):.2f} m from the mark; "
        f"feet are seen {abs(lowest) * 100:.0f} cm {'above' if lowest > 0.0 else 'below'} the floor"
    )
    if abs(lowest) > FEET_OFF:
        quality += ", which is too much: see whether all of you can be seen, and do it again"
    return FoundStage(
        before.with_mark(*mark),
        None if kind is None else at_mark(stance_of(body), *mark),
        kind,
        level.origin,
        "where nobody stood still: the middle of where they were"
        if kind is None
        else f"a performer, {how[kind]}",
        quality,
    )
