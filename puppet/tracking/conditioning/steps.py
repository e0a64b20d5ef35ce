"""What conditioning made of a frame, step by step, for whoever wants to watch."""

from __future__ import annotations

from dataclasses import dataclass

from puppet.kernel import Bytes, Floats


@dataclass(frozen=True, slots=True, eq=False)
class ConditioningSteps:
    """The last frame before and after each step. Positions (20, 3), metres, stage frame.

    raw: as it came. believed: where each joint was when it was last believed. filtered: on their
    anchors, without noise. predicted: ahead of that. shown: what goes on to the puppets, with lost
    joints held, and with those that were found closing in.
    states: (20,) as they came. influence, trust: (20,) 0..1.
    """

    raw: Floats
    believed: Floats
    filtered: Floats
    predicted: Floats
    shown: Floats
    states: Bytes
    influence: Floats
    trust: Floats
