"""Performers come and go: what a camera's `People` tells of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

EventKind = Literal["entered", "hidden", "returned", "left"]


@dataclass(frozen=True, slots=True)
class Event:
    """Something happened to one performer.

    entered: a new performer, with a new number. hidden: not seen for a moment, and remembered.
    returned: seen again after that, with the same number. left: not seen for so long that they are
    forgotten; the number does not come again.
    time: capture time of the shot in which it was noticed, s.
    """

    kind: EventKind
    performer: int
    time: float
