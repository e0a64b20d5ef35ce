"""One performer's frames out of a source's moments, and back."""

from __future__ import annotations

from collections.abc import Iterable

from puppet.skeleton import Moment, SkeletonFrame


def frames_of(moments: Iterable[Moment], performer: int = 0) -> list[SkeletonFrame]:
    """A frame for each moment: empty where the performer is not there."""
    return [moment.frame_of(performer) for moment in moments]


def moments_of_one(frames: Iterable[SkeletonFrame]) -> list[Moment]:
    """A moment for each frame: one performer, or nobody."""
    return [Moment.of(frame) for frame in frames]
