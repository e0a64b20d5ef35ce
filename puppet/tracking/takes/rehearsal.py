"""A performer who does not exist: a choreography for trying a show without camera and recording.

Everything is a pure function of time, and the end joins the beginning. Angles and places are keyed
and eased (`choreography`), the feet walk by themselves under the root, and the legs reach for them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from puppet.kernel import Bytes, Floats
from puppet.skeleton import JOINT_COUNT, Joint, Moment, SkeletonFrame, TrackingState, nobody
from puppet.tracking.source import SourceInfo
from puppet.tracking.takes.choreography import DURATION, EDGE, HIDDEN, SECTIONS, channel, feet

__all__ = ["DURATION", "SECTIONS", "Rehearsal"]

# A person of 1.75 m, by the segment lengths of Drillis and Contini (1966), metres.
_THIGH, _SHIN, _ANKLE = 0.4288, 0.4305, 0.068
_UPPER_ARM, _FOREARM, _HAND = 0.3255, 0.2555, 0.085
_HIP = np.array([0.085, 0.0, 0.0])
_FOOT = np.array([0.0, -_ANKLE, 0.13])
# From between the hips up, as the Kinect sees the trunk.
_HIP_CENTER, _SPINE = np.array([0.0, 0.06, 0.0]), np.array([0.0, 0.09, -0.005])
_CHEST = np.array([0.0, 0.405, 0.0])
_SHOULDER = np.array([0.175, -0.05, 0.0])
_HEAD = np.array([0.0, 0.165, 0.02])
#: How much shorter than stretched the legs are when standing, metres: knees are never locked.
_SLACK: Final = 0.010
_STANDING: Final = _THIGH + _SHIN + _ANKLE - _SLACK
#: Seconds by which the hands follow the elbows, and how much.
_FOLLOW_SECONDS, _FOLLOW = 0.08, 0.6
#: Sway of someone who only stands: whole cycles in the duration, so that the end meets the start.
_BREATHS, _SWAYS = 13, 8


class Rehearsal:
    """The choreography as a source: `DURATION` seconds, once, never waiting.

    rate: frames a second.
    """

    def __init__(self, rate: float = 30.0) -> None:
        self.rate = rate

    @property
    def info(self) -> SourceInfo:
        return SourceInfo(
            name="rehearsal",
            kind="rehearsal",
            rate=self.rate,
            synthetic=True,
            floor=(0.0, 1.0, 0.0, 0.0),
            note="synthetic choreography, no person was there",
            licence="Apache-2.0",
        )

    @property
    def trouble(self) -> str:
        return ""

    def __len__(self) -> int:
        return round(DURATION * self.rate)

    def __iter__(self) -> Iterator[Moment]:
        return (
            Moment.of(self.frame(sequence / self.rate, sequence)) for sequence in range(len(self))
        )

    def frame(self, time: float, sequence: int = 0) -> SkeletonFrame:
        """What the tracker sees at `time` (s), which may lie beyond the end: it goes round."""
        moment = time % DURATION
        positions = body(moment)
        states = _states(moment, positions)
        if not states.any():
            return nobody(time, sequence)
        positions[states == TrackingState.NOT_TRACKED] = 0.0
        return SkeletonFrame(time, sequence, 0, positions, states)

    def close(self) -> None:
        """Nothing to let go of."""


def _states(time: float, positions: Floats) -> Bytes:
    """What is hidden, or out of the picture, at `time`."""
    states = np.full(JOINT_COUNT, TrackingState.TRACKED, np.uint8)
    edge, width = EDGE
    states[positions[:, 0] > edge - width] = TrackingState.INFERRED
    states[positions[:, 0] > edge] = TrackingState.NOT_TRACKED
    for joints, (start, lost, found, end) in HIDDEN:
        if start <= time < end:
            known = TrackingState.INFERRED
            states[list(joints)] = TrackingState.NOT_TRACKED if lost <= time < found else known
    return states


def body(time: float) -> Floats:
    """(20, 3) metres, stage frame: where all joints are at `time`, seen or not."""
    joints = np.empty((JOINT_COUNT, 3))
    breath = np.sin(2.0 * np.pi * _BREATHS * time / DURATION)
    sway = np.sin(2.0 * np.pi * _SWAYS * time / DURATION)
    left, right = feet(time)

    def angle(name: str) -> float:
        return float(np.radians(channel(name, time)))

    root = _yaw(angle("yaw"))
    drop = channel("drop", time)
    # The weight goes over the foot that stands.
    shift = channel("shift", time) + 0.12 * (right.lift - left.lift) + 0.004 * sway
    hips = np.array([channel("x", time), _STANDING - drop - 0.001, channel("z", time)])
    hips += root @ np.array([shift, -0.001 * sway * sway, -channel("back", time)])
    pelvis = root @ _yaw(angle("pelvis_turn")) @ _lean(angle("pelvis_lean"))
    pelvis = pelvis @ _pitch(angle("pelvis_bend"))
    joints[Joint.HIP_CENTER] = hips + pelvis @ _HIP_CENTER
    joints[Joint.SPINE] = joints[Joint.HIP_CENTER] + pelvis @ _SPINE
    chest = pelvis @ _yaw(angle("turn")) @ _lean(angle("lean"))
    chest = chest @ _pitch(angle("bend") + np.radians(0.7) * breath)
    joints[Joint.SHOULDER_CENTER] = joints[Joint.SPINE] + chest @ _CHEST
    head = chest @ _yaw(angle("look")) @ _lean(angle("tilt")) @ _pitch(angle("nod"))
    joints[Joint.HEAD] = joints[Joint.SHOULDER_CENTER] + head @ _HEAD

    # Arms swing against the legs.
    forward = root[:, 2]
    stride = float(forward @ (right.ground - left.ground)) + 0.7 * (right.lift - left.lift)
    for side, word, swing in ((1.0, "LEFT", stride), (-1.0, "RIGHT", -stride)):
        _arm(joints, chest, side, word, time, 1.1 * swing)
    rise = max(0.0, -drop)
    for side, word, foot in ((1.0, "LEFT", left), (-1.0, "RIGHT", right)):
        # Who jumps stretches the legs first, then the feet come along, heels first.
        lift = foot.lift + rise * rise / (rise + 0.8 * _SLACK)
        sole = _yaw(foot.yaw) @ _pitch(0.6 * (1.0 - np.exp(-lift / 0.08)))
        ankle = foot.ground + np.array([0.0, _ANKLE + lift, 0.0])
        hip = hips + pelvis @ (_HIP * (side, 1.0, 1.0))
        knee_forward = pelvis[:, 2] + sole[:, 2]
        joints[Joint[f"HIP_{word}"]] = hip
        joints[Joint[f"KNEE_{word}"]], ankle = _leg(hip, ankle, knee_forward)
        joints[Joint[f"ANKLE_{word}"]] = ankle
        joints[Joint[f"FOOT_{word}"]] = ankle + sole @ _FOOT
    return joints


def _arm(joints: Floats, chest: Floats, side: float, word: str, time: float, swing: float) -> None:
    """Fill in one arm. Angles: lift sideways, swing forward, twist outward, elbow."""

    def angle(name: str, at: float) -> float:
        return float(np.radians(channel(f"{name}_{word.lower()}", at)))

    upper = chest @ _lean(-side * angle("lift", time)) @ _pitch(-angle("swing", time) - swing)
    upper = upper @ _yaw(side * angle("twist", time))
    elbow = angle("elbow", time)
    forearm = upper @ _pitch(-elbow - 0.3 * max(0.0, swing))
    lag = angle("elbow", time - _FOLLOW_SECONDS) - elbow
    drag = angle("lift", time - _FOLLOW_SECONDS) - angle("lift", time)
    hand = forearm @ _pitch(-_FOLLOW * lag) @ _lean(-side * _FOLLOW * drag)
    down = np.array([0.0, -1.0, 0.0])
    shoulder = joints[Joint.SHOULDER_CENTER] + chest @ (_SHOULDER * (side, 1.0, 1.0))
    joints[Joint[f"SHOULDER_{word}"]] = shoulder
    joints[Joint[f"ELBOW_{word}"]] = shoulder + _UPPER_ARM * (upper @ down)
    joints[Joint[f"WRIST_{word}"]] = joints[Joint[f"ELBOW_{word}"]] + _FOREARM * (forearm @ down)
    joints[Joint[f"HAND_{word}"]] = joints[Joint[f"WRIST_{word}"]] + _HAND * (hand @ down)


def _leg(hip: Floats, ankle: Floats, forward: Floats) -> tuple[Floats, Floats]:
    """Knee and ankle so that both bones keep their lengths and the knee points forward."""
    line = ankle - hip
    distance = float(np.linalg.norm(line))
    along = line / distance
    distance = min(distance, _THIGH + _SHIN - 1e-6)
    across = forward - along * float(forward @ along)
    across /= np.linalg.norm(across)
    cosine = (_THIGH**2 + distance**2 - _SHIN**2) / (2.0 * _THIGH * distance)
    sine = np.sqrt(max(0.0, 1.0 - cosine * cosine))
    return hip + _THIGH * (cosine * along + sine * across), hip + distance * along


def _yaw(angle: float) -> Floats:
    """Turn to the own left, radians. -> (3, 3)"""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _pitch(angle: float) -> Floats:
    """Bend forward: +Y goes to +Z, radians. -> (3, 3)"""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _lean(angle: float) -> Floats:
    """Lean to the own left: +Y goes to +X, radians. -> (3, 3)"""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
