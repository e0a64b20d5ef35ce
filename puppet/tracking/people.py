"""Everybody in one camera's images: who is where, and that it stays the same person."""

from __future__ import annotations

from dataclasses import dataclass

from puppet.tracking.blazepose import BlazePose, Landmarks
from puppet.tracking.camera import Shot
from puppet.tracking.models import PoseModels


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """One performer in one shot. performer: the number that stays theirs while they are there."""

    performer: int
    landmarks: Landmarks


class People:
    """Follows the performers of one camera from shot to shot."""

    def __init__(self, models: PoseModels) -> None:
        """Raises UnavailableError for models that cannot be loaded."""
        self._pose = BlazePose(models)

    def reset(self) -> None:
        """Forget everybody."""
        self._pose.reset()

    def look(self, shot: Shot) -> list[Seen]:
        """Who is in the shot, by their numbers."""
        landmarks = self._pose.track(shot.colour)
        return [] if landmarks is None else [Seen(0, landmarks)]

    def look_again(self, shot: Shot, seen: Seen, turn: float) -> Landmarks | None:
        """The same performer in the same shot, with the region turned by `turn` (rad)."""
        return self._pose.look(shot.colour, seen.landmarks.region.turned(turn))
