"""Where joints are: what is seen of them, believed, filtered and predicted.

Every joint is followed where it sits on its anchor, the nearest joint above it that is well known,
so that the noise of neither turns the bone between them more than it must, and a body that jumps
stays whole.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from puppet.kernel import Bytes, Floats, Ints, kernel
from puppet.tracking.conditioning.holt import holt
from puppet.tracking.conditioning.memory import BELIEVED, DOUBTED, FOUND, LOST, Memory
from puppet.tracking.conditioning.one_euro import blend, one_euro
from puppet.tracking.conditioning.prediction import bounded, lead_on
from puppet.tracking.conditioning.rows import add, length_of, put, scale

#: On its anchor no joint goes faster than this, m/s, but for so many metres of noise; and none that
#: has no anchor. The fastest honest ones in our recordings: 7.2 m/s, an ankle on its knee in a
#: kick, and 12.2 m/s in space.
FASTEST: Final = 7.0
FASTEST_ALONE: Final = 12.0
SLACK: Final = 0.03
#: What was not believed for longer than this was somewhere else meanwhile; and what stays
#: impossible for longer than that has really gone there. Seconds.
LONGEST_GLITCH: Final = 0.1
LONGEST_DOUBT: Final = 0.25
#: A joint of less trust is no anchor; and that of one that was just found.
ANCHORED: Final = 0.5
JUST_FOUND: Final = 0.5
#: Half-life of the velocities that tell quick joints from shaking ones, seconds.
VELOCITY_HALF_LIFE: Final = 0.1
#: How many times wider Holt's radii are for an inferred joint, as in the SDK.
INFERRED_RADII: Final = 2.0


@kernel
def follow(
    positions: Floats,
    states: Bytes,
    dt: float,
    parents: Ints,
    slower: Floats,
    knobs: Floats,
    by_holt: bool,
    holt_knobs: Floats,
    m: Memory,
) -> None:
    """Take in what is seen after `dt`. positions: (20, 3). states: (20,).

    slower: (20,) how many times slower One Euro follows each joint. knobs: smoothing, quickness,
    inferred, regain, prediction, its limit. holt_knobs: (5,), if `by_holt`.
    """
    seen_before, unseen_before = m.believed.copy(), m.unseen.copy()
    filtered_before = m.filtered.copy()
    for joint in range(len(parents)):
        m.unseen[joint] += dt
        if states[joint] == 0:
            m.status[joint] = LOST
            m.lost[joint] += dt
            m.trust[joint] = 0.0
            scale(m.velocity, joint, 0.0)
            continue
        anchor = parents[joint]
        # What is only inferred itself cannot choose, and stays with the body.
        least = ANCHORED if states[joint] == 2 else 0.0
        while anchor >= 0 and (m.status[anchor] != BELIEVED or m.trust[anchor] <= least):
            anchor = parents[anchor]
        step = positions[joint] - seen_before[joint]
        carried = filtered_before[joint] * 1.0
        target = positions[joint] * 1.0
        fastest = FASTEST
        if anchor >= 0:
            carried = carried + m.filtered[anchor] - filtered_before[anchor]
            target = target + m.filtered[anchor] - positions[anchor]
            if unseen_before[anchor] == unseen_before[joint]:
                step = step - positions[anchor] + seen_before[anchor]
        elif parents[joint] >= 0:
            fastest = FASTEST_ALONE
        again = m.lost[joint] > 0.0 or m.gap[0] > 0
        possible = length_of(step) <= SLACK + fastest * m.unseen[joint]
        if not (again or possible or m.unseen[joint] > LONGEST_DOUBT):
            m.status[joint] = DOUBTED
            put(m.filtered, joint, carried)
            scale(m.lead, joint, 1.0 - blend(VELOCITY_HALF_LIFE, dt))
            _ahead(joint, anchor, carried, knobs[5], m)
            continue
        # With what is found all that hangs on it is filtered afresh, or its bone would be askew.
        bearer = parents[joint]
        while bearer >= 0 and m.status[bearer] == LOST:
            bearer = parents[bearer]
        afresh = m.status[joint] == DOUBTED or (bearer >= 0 and m.status[bearer] == FOUND)
        m.status[joint] = FOUND if again or afresh else BELIEVED
        if again or m.unseen[joint] > LONGEST_GLITCH:
            m.trust[joint] = JUST_FOUND if states[joint] == 2 else 1.0 / knobs[2]
            scale(m.velocity, joint, 0.0)  # it was somewhere else meanwhile, which is no speed
        elif not by_holt:
            share = blend(VELOCITY_HALF_LIFE, m.unseen[joint])
            scale(m.velocity, joint, 1.0 - share)
            add(m.velocity, joint, step, share / m.unseen[joint])
        freedom = 1.0 if states[joint] == 2 else 1.0 / knobs[2]
        m.trust[joint] += (freedom - m.trust[joint]) * blend(knobs[3], dt)
        m.lost[joint] = 0.0
        m.unseen[joint] = 0.0
        put(m.believed, joint, positions[joint])
        ahead = target
        trust = max(m.trust[joint], 0.1)
        if m.status[joint] == FOUND:
            # Where it is seen, at once: what eases the way there is `show`.
            put(m.filtered, joint, target)
            m.times[joint] = 1
            scale(m.pace, joint, 0.0)
            scale(m.lead, joint, 0.0)
            if by_holt:
                scale(m.velocity, joint, 0.0)
        else:
            if by_holt:
                ahead = np.empty(3)
                wide = INFERRED_RADII if states[joint] == 1 else 1.0
                count = m.times[joint]
                level, trend = m.filtered[joint], m.velocity[joint]
                holt(target, carried, trend, count, holt_knobs, trust, wide, dt, level, ahead)
                m.times[joint] = min(count + 1, 2)
            else:
                speed = length_of(m.velocity[joint])
                share = one_euro(speed, trust, knobs[0], knobs[1], slower[joint], dt)
                put(m.filtered, joint, carried + (target - carried) * share)
                ahead = m.filtered[joint]
            velocity = (m.filtered[joint] - carried) / dt
            lead_on(velocity, m.pace[joint], m.lead[joint], knobs[4], dt)
        _ahead(joint, anchor, ahead, knobs[5], m)


@kernel
def _ahead(joint: int, anchor: int, ahead: Floats, most: float, m: Memory) -> None:
    """Add up what is ahead of what is filtered, from the anchor outwards."""
    put(m.ahead, joint, ahead)
    lead = m.lead[joint] * 1.0
    if anchor >= 0:
        add(m.ahead, joint, m.ahead[anchor] - m.filtered[anchor], 1.0)
        lead = lead + m.predicted[anchor] - m.ahead[anchor]
    put(m.predicted, joint, m.ahead[joint] + bounded(lead, most))
