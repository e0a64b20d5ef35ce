"""A little bend for straight chains, before they are asked to fold.

A straight chain that is pulled back along itself does not know which way to bend: to the first
order none of its joints brings the tip nearer. Left to the solver, rounding would decide, or a
goal's wobble, and the chain would flip from one side to the other. So its straight joints are bent
to a side that was chosen once for the armature (`EffectorPaths.bends`), and the chain's first bone
half as much the other way, so that it still points where it did. How much depends on the goals
alone, and smoothly: nothing for goals where the tips are, so that the base pose is kept there.
"""

from __future__ import annotations

import math

import numpy as np

from puppet.kernel import Floats, Ints, kernel

#: Radians, by how much a chain is bent in all: for any goal away from its tip, for a whole fold.
_ALWAYS, _FOLDED = 0.4, 4.0
#: Shares of the reach: how far away a goal must be to count, for a chain that is partly straight
#: and for one that is wholly so, which cannot wait; and how deep a fold must be.
_AWAY, _AWAY_STRAIGHT, _FOLD = 0.25, 0.08, 0.01
#: The cosine of the angle between two bones from which on they count as straight, more and more.
_STRAIGHT = 0.8


@kernel
def distance(a: Floats, b: Floats) -> float:
    """(3,), (3,) -> metres."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@kernel
def _straightness(before: Floats, here: Floats, after: Floats) -> float:
    """From 0, the bones before and after a joint lie at an angle, to 1, they are in line."""
    dot = 0.0
    for i in range(3):
        dot += (here[i] - before[i]) * (after[i] - here[i])
    cosine = dot / max(distance(before, here) * distance(here, after), 1e-30)
    t = min(max((cosine - _STRAIGHT) / (1.0 - _STRAIGHT), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@kernel
def bend_straight_chains(
    starts: Ints,
    path: Ints,
    firsts: Ints,
    axes: Floats,
    reaches: Floats,
    weights: Floats,
    anchors: Floats,
    anchor_goals: Floats,
    tips: Floats,
    goals: Floats,
    origins: Floats,
    bends: Floats,
) -> None:
    """Fill `bends`, (P, 3) rad, rotation vectors in the frames of the paths' bones.

    An effector's chain begins at `firsts`, (E,) into `path`, and hangs on its anchor: `anchors`,
    (E, 3), where that is, and `anchor_goals` where it shall be. axes: (P, 3).
    """
    straight = np.zeros(len(path))
    for e in range(len(tips)):
        if weights[e] == 0.0 or firsts[e] >= starts[e + 1]:
            continue
        first, last = firsts[e], starts[e + 1] - 1
        now, wanted = distance(tips[e], anchors[e]), distance(goals[e], anchor_goals[e])
        fold = max(1.0 - wanted / max(now, 1e-12), 0.0)
        fold *= fold / (fold + _FOLD)
        away = 0.0
        for i in range(3):
            away += ((goals[e, i] - anchor_goals[e, i]) - (tips[e, i] - anchors[e, i])) ** 2
        total, length = 0.0, distance(anchors[e], origins[path[first]])
        for k in range(first, last + 1):
            after = origins[path[k + 1]] if k < last else tips[e]
            length += distance(origins[path[k]], after)
            if k > starts[e]:
                straight[k] = _straightness(origins[path[k - 1]], origins[path[k]], after)
                total += straight[k]
        whole = min(max(10.0 * now / max(length, 1e-12) - 9.0, 0.0), 1.0)
        near = (_AWAY + (_AWAY_STRAIGHT - _AWAY) * whole) * reaches[e]
        share = 1.0 - math.exp(-away / (near * near))
        angle = share * (_ALWAYS + _FOLDED * fold) / max(total, 1.0)
        for k in range(first, last + 1):
            bent = angle * straight[k]
            if k == first:
                bent -= 0.5 * angle * total
            for i in range(3):
                bends[k, i] = bent * axes[k, i]
