"""How joints that were lost close in on where they are seen again, and where lost ones are held.

A joint that is found is at its new place at once, but shown away from it: by a turn of its bone, a
stretch of the bone, a yaw of the whole body and a shift of what hangs on nothing. These go to zero
by critical damping, slowly enough for bounds on their speed, while what the performer does goes
through undelayed (inertialization: Bollo, GDC 2016). Turning bones rather than moving their ends
keeps them long where the way leads past the joint that they hang on.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from puppet.kernel import Floats, Ints, frozen, kernel
from puppet.rotation import exp, log, rotate, swing
from puppet.skeleton import Joint
from puppet.tracking.conditioning.heading import between, heading_by, yawed
from puppet.tracking.conditioning.memory import BELIEVED, DOUBTED, FOUND, LOST, Memory
from puppet.tracking.conditioning.rows import length_of, put, scale
from puppet.tracking.conditioning.spring import damped, ease_off, gentle

#: Bounds for what closes in, on top of what the performer does: what hangs on nothing, and so the
#: whole performer, m/s; a bone, and the whole body about the vertical, rad/s.
CLOSING_SPEED: Final = 1.5
CLOSING_TURN: Final = math.radians(300.0)
#: Bounds for all that is shown, whatever happens, m/s: the hip centre in space; any joint on the
#: joint that it hangs on; any joint on the hip centre. Honest movement stays below: 2.6, 7.2 and
#: 11.8 m/s in our recordings.
ROOT_SPEED: Final = 5.0
BONE_SPEED: Final = 8.0
BODY_SPEED: Final = 12.0
#: With less influence than this nothing is felt: it may go anywhere at once.
UNFELT: Final = 0.01
#: What is lost turns with the body, but at most so fast, rad/s.
_CARRIED_TURN: Final = math.radians(720.0)
_TRUNK: Final[Ints] = frozen(
    [Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT, Joint.HIP_LEFT, Joint.HIP_RIGHT], np.int32
)
#: What carries a hip centre that is lost: the first of these that is there.
_CARRIERS: Final[Ints] = frozen(
    [Joint.SPINE, Joint.SHOULDER_CENTER, Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT, Joint.HEAD],
    np.int32,
)


@kernel
def close_in(predicted_before: Floats, dt: float, parents: Ints, regain: float, m: Memory) -> None:
    """Bring what is shown up to date. predicted_before: (20, 3), `predicted` of the frame before.

    regain: rate of closing in where no bound makes it slower.
    """
    before = m.shown.copy()
    felt = _felt(parents, m)
    hips = m.status[12] >= BELIEVED and m.status[16] >= BELIEVED
    shoulders = m.status[4] >= BELIEVED and m.status[8] >= BELIEVED
    turned = _face(before, hips, shoulders, dt, regain, m)
    anew = np.zeros(len(parents), np.bool_)
    wanted = before.copy()
    for joint in range(len(parents)):
        if m.status[joint] == LOST:
            m.hung[joint] = -2
            continue
        parent = parents[joint]
        while parent >= 0 and m.status[parent] == LOST:
            parent = parents[parent]
        anew[joint] = m.status[joint] == FOUND or parent != m.hung[joint]
        m.hung[joint] = parent
        visible = felt[joint] > UNFELT
        if parent < 0:
            _shift(joint, before, anew[joint], visible, regain, dt, m)
            put(wanted, joint, m.predicted[joint] + m.shift[joint])
        elif m.status[joint] == DOUBTED:
            put(wanted, joint, wanted[parent] + before[joint] - before[parent])
        elif m.status[parent] == DOUBTED:
            # A bone to where its parent cannot be has no direction: its end just goes on.
            step = yawed(m.predicted[joint] - predicted_before[joint], m.yaw[0])
            put(wanted, joint, before[joint] + step)
            anew[joint] = True
        else:
            bone = yawed(m.predicted[joint] - m.predicted[parent], m.yaw[0])
            if anew[joint] or anew[parent] or turned:
                old = before[joint] - before[parent]
                _bend(joint, bone, old, visible, regain, m)
            ease_off(m.turn[joint], m.turning[joint], m.rate[joint], dt)
            m.stretch[joint, 0], m.stretch[joint, 1] = damped(
                m.stretch[joint, 0], m.stretch[joint, 1], 0.0, m.rate[joint], dt
            )
            longer = math.exp(m.stretch[joint, 0])
            put(wanted, joint, wanted[parent] + rotate(exp(m.turn[joint]), bone) * longer)
    _hold(before, wanted, hips, shoulders, dt, parents, m)
    _bound(before, wanted, dt, parents, m)


@kernel
def _felt(parents: Ints, m: Memory) -> Floats:
    """(20,) the most influence that depends on where each joint is."""
    felt = m.influence[:, 0].copy()
    for joint in range(len(parents) - 1, 0, -1):
        felt[parents[joint]] = max(felt[parents[joint]], felt[joint])
    for joint in _TRUNK:
        felt[joint] = felt[0]  # the heading depends on them, and all on the heading
    return felt


@kernel
def _face(before: Floats, hips: bool, shoulders: bool, dt: float, regain: float, m: Memory) -> bool:
    """Bring the yaw up to date. -> whether it counts anew, for somebody who has turned unseen."""
    framed = hips or shoulders
    anew = framed and m.framed[0] == 0
    m.framed[0] = framed
    if anew:
        now = heading_by(m.predicted, hips, shoulders)
        m.yaw[0] = between(now, heading_by(before, hips, shoulders))
        m.yaw[1] = 0.0
        m.yaw[2] = gentle(regain, abs(m.yaw[0]), CLOSING_TURN)
    m.yaw[0], m.yaw[1] = damped(m.yaw[0], m.yaw[1], 0.0, m.yaw[2], dt)
    return anew


@kernel
def _shift(
    joint: int, before: Floats, anew: bool, visible: bool, regain: float, dt: float, m: Memory
) -> None:
    if anew:
        scale(m.shifting, joint, 0.0)
        put(m.shift, joint, before[joint] - m.predicted[joint])
        if not visible:
            scale(m.shift, joint, 0.0)
        m.rate[joint] = gentle(regain, length_of(m.shift[joint]), CLOSING_SPEED)
    ease_off(m.shift[joint], m.shifting[joint], m.rate[joint], dt)


@kernel
def _bend(joint: int, bone: Floats, old: Floats, visible: bool, regain: float, m: Memory) -> None:
    """Turn and stretch a bone so that it is shown as it was."""
    scale(m.turn, joint, 0.0)
    scale(m.turning, joint, 0.0)
    m.stretch[joint, 0] = 0.0
    m.stretch[joint, 1] = 0.0
    if visible:
        put(m.turn, joint, log(swing(bone, old)))
        short, long = max(length_of(bone), 1e-3), max(length_of(old), 1e-3)
        m.stretch[joint, 0] = math.log(long / short)
    m.rate[joint] = gentle(regain, length_of(m.turn[joint]), CLOSING_TURN)


@kernel
def _hold(
    before: Floats,
    wanted: Floats,
    hips: bool,
    shoulders: bool,
    dt: float,
    parents: Ints,
    m: Memory,
) -> None:
    """Lost joints keep their place on the body: they go along with it, and turn with it."""
    turn = between(heading_by(before, hips, shoulders), heading_by(wanted, hips, shoulders))
    turn = min(max(turn, -_CARRIED_TURN * dt), _CARRIED_TURN * dt)
    for joint in range(len(parents)):
        if m.status[joint] != LOST:
            continue
        carrier = parents[joint]
        if carrier < 0:
            for other in _CARRIERS:
                if m.status[other] != LOST:
                    carrier = other
                    break
        if carrier >= 0:
            put(wanted, joint, wanted[carrier] + yawed(before[joint] - before[carrier], turn))


@kernel
def _bound(before: Floats, wanted: Floats, dt: float, parents: Ints, m: Memory) -> None:
    """Show what is wanted, as far as nothing gets faster than a body."""
    for joint in range(len(parents)):
        step = wanted[joint] - before[joint]
        if joint == 0:
            step = _shortened(step, ROOT_SPEED * dt)
        else:
            carried = m.shown[parents[joint]] - before[parents[joint]]
            step = carried + _shortened(step - carried, BONE_SPEED * dt)
            carried = m.shown[0] - before[0]
            # Both at once: where two balls meet, going to the nearest point of the one that holds
            # the centre of the other leaves neither.
            step = carried + _shortened(step - carried, BODY_SPEED * dt)
        put(m.shown, joint, before[joint] + step)


@kernel
def _shortened(step: Floats, most: float) -> Floats:
    length = length_of(step)
    return step * (most / length) if length > most else step
