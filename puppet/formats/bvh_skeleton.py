"""The 20 joints out of a BVH hierarchy, whatever its joints are called, in metres, upright.

Names, unit and up axis are guessed from a table of words and from how people are built. Each guess
is said in the notes, and each can be given instead.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from puppet.errors import BadFileError
from puppet.formats.bvh import BvhMotion
from puppet.formats.performance import Performance
from puppet.kernel import Bytes, Floats
from puppet.skeleton import JOINT_COUNT, Joint, TrackingState

#: Words for each joint of the body's middle, the likeliest first.
_MIDDLE: Final = {
    "hip_center": ("hips", "pelvis", "hip", "root"),
    "head": ("head",),
}
#: Words for the joints of a limb from its middle outwards: the first three must hang on each
#: other, so that "LeftShoulder" is the collar bone where there is a "LeftArm", else the shoulder.
_LIMBS: Final = {
    "arm": (
        ("shoulder", ("upperarm", "uparm", "arm", "shoulder", "shldr")),
        ("elbow", ("elbow", "forearm", "lowerarm", "lowarm")),
        ("wrist", ("wrist", "hand")),
    ),
    "leg": (
        ("hip", ("upleg", "upperleg", "thigh", "hip", "leg")),
        ("knee", ("knee", "lowerleg", "lowleg", "shin", "calf", "leg")),
        ("ankle", ("ankle", "foot")),
    ),
}
_TIPS: Final = {
    "hand": ("handmiddle1", "middle1", "handindex1", "handend", "hand", "fingers", "handthumb1"),
    "foot": ("toebase", "toe", "toes", "forefoot", "ball", "toe0"),
}

#: Metres in the units that motion capture comes in. No two of them make the same file human.
_UNITS: Final = (
    ("metres", 1.0),
    ("centimetres", 0.01),
    ("millimetres", 0.001),
    ("inches", 0.0254),
    ("units of the CMU collection (1/0.45 inch)", 0.0254 / 0.45),
    ("decimetres", 0.1),
    ("feet", 0.3048),
)
_HUMAN_HEIGHT: Final = (1.4, 2.1)
_USUAL_HEIGHT: Final = 1.7
#: In units of the file; less is no body at all.
_LEAST_HEIGHT: Final = 1e-6
#: Thigh, shin and trunk (hips to shoulders) as a part of the height (Drillis and Contini 1966).
_LEGS_AND_TRUNK: Final = 0.245 + 0.246 + 0.288
#: How far up the spine, from the hips to between the shoulders, the Kinect puts its spine joint.
_SPINE: Final = 0.18
#: How far above the shoulders' line the Kinect puts the shoulder centre, seen from the hips.
_SHOULDER_CENTER: Final = 1.10
#: The tip's distance from wrist or ankle as a part of forearm or shin: least, usual, most. Nearer
#: than the least says nothing; the palm that the Kinect sees is nearer than the finger tips.
_TIP_LENGTHS: Final = {"hand": (0.25, 0.33, 0.40), "foot": (0.15, 0.32, 0.60)}
#: A point nearer to another than this part of the body's height is the same point.
_TINY: Final = 0.01


def bvh_to_skeleton(motion: BvhMotion, *, rate: float = 60.0) -> Performance:
    """The motion as a performance: at most `rate` frames a second, the 20 joints, metres, +Y up.

    The first frame stands at the origin and faces +Z. Raises BadFileError that names the joints
    that are not found.
    """
    stride = max(1, int(np.ceil(1.0 / (motion.frame_time * rate) - 0.01)))
    body = _Body(motion.every(stride))
    positions, states = body.skeleton()
    unit, unit_note = guess_unit(body.height)
    stage_from_file, up_note = upright(positions)
    positions = stage_from_file.apply(positions.reshape(-1, 3)).reshape(positions.shape) * unit
    positions, heading = _facing_front(positions)
    frames_a_second = round(1.0 / (motion.frame_time * stride), 2)
    thinned = () if stride == 1 else (f"one of {stride} frames is kept",)
    inferred = sorted({Joint(int(j)).name.lower() for j in np.argwhere(states == 1)[:, 1]})
    guessed = (f"not in the file, so inferred: {', '.join(inferred)}",) if inferred else ()
    return Performance(
        kind="bvh",
        rate=frames_a_second,
        times=np.arange(len(positions), dtype=float) * (motion.frame_time * stride),
        positions=positions,
        states=states,
        measured=False,
        notes=(
            *motion.warnings,
            unit_note,
            up_note,
            f"turned by {heading:.0f}° so that the first frame faces the audience, at the origin",
            *thinned,
            *guessed,
        ),
    )


def human_joints(motion: BvhMotion) -> tuple[Floats, float]:
    """(F, 20, 3) the Kinect's joints in the file's units and axes, and how tall the human is.

    Raises BadFileError that names the joints that are not found.
    """
    body = _Body(motion)
    return body.skeleton()[0], body.height


def guess_unit(height: float) -> tuple[float, str]:
    """Metres in one unit of a file whose performer is `height` units tall, and a note."""
    low, high = _HUMAN_HEIGHT
    for name, metres in _UNITS:
        if low <= height * metres <= high:
            return metres, f"unit: {name}, as the performer is then {height * metres:.2f} m tall"
    return (
        _USUAL_HEIGHT / height,
        f"unit: unknown ({height:.3g} of them make a performer); scaled to {_USUAL_HEIGHT} m",
    )


def _key(name: str) -> str:
    """``mixamorig:LeftUpLeg``, ``Bip01 L Thigh`` -> ``leftupleg``, ``lthigh``."""
    own = name.rpartition(":")[2].lower()
    return re.sub(r"^bip\d+|[^a-z0-9]", "", own)


@dataclass(eq=False)
class _Body:
    """The human in a hierarchy: which joint is which, and where they are."""

    motion: BvhMotion

    def __post_init__(self) -> None:
        self.keys = [_key(name) for name in self.motion.names]
        self.positions, self.rotations = self.motion.forward()
        if not np.isfinite(self.positions).all(axis=(1, 2)).any():
            raise BadFileError("no frame of this BVH is whole", where=self.motion.name)
        self.found: dict[str, int] = {}
        missing: list[str] = []
        for name, words in _MIDDLE.items():
            self._keep(name, self._first(words), missing)
        for limb in _LIMBS.values():
            for side in ("left", "right"):
                below = -1
                for part, words in reversed(limb):
                    # From the tip inwards, as the outer names are the clearer ones.
                    joint = self._first(self._sided(words, side), below=below)
                    self._keep(f"{part}_{side}", joint, missing)
                    below = joint if joint >= 0 else below
        if missing:
            raise BadFileError(
                "this BVH has no whole human body",
                where=self.motion.name,
                expected="hips, head, and on both sides shoulder, elbow, wrist, hip, knee, ankle",
                found=f"no joint for {', '.join(missing)} among {', '.join(self.motion.names)}",
            )

    def _keep(self, name: str, joint: int, missing: list[str]) -> None:
        if joint < 0:
            missing.append(name)
        else:
            self.found[name] = joint

    def _first(self, keys: tuple[str, ...], *, below: int = -1, above: int = -1) -> int:
        """The joint with the first of the keys: over joint `below`, under `above`; -1 if none."""
        over = self._ancestors(below) if below >= 0 else None
        for key in keys:
            for joint, its in enumerate(self.keys):
                if its != key or (over is not None and joint not in over):
                    continue
                if above < 0 or above in self._ancestors(joint):
                    return joint
        return -1

    @staticmethod
    def _sided(words: tuple[str, ...], side: str) -> tuple[str, ...]:
        return tuple(key for word in words for key in (side + word, side[0] + word, word + side))

    def _ancestors(self, joint: int) -> list[int]:
        """From the parent of `joint` to the root."""
        line = []
        while (joint := self.motion.parents[joint]) >= 0:
            line.append(joint)
        return line

    def at(self, name: str) -> Floats:
        """(F, 3) the joint of that name."""
        return self.positions[:, self.found[name]]

    @cached_property
    def height(self) -> float:
        """How tall the performer is, in units of the file, from legs and trunk."""
        legs = [
            np.linalg.norm(self.at(f"{a}_{side}") - self.at(f"{b}_{side}"), axis=1)
            for side in ("left", "right")
            for a, b in (("hip", "knee"), ("knee", "ankle"))
        ]
        hips = 0.5 * (self.at("hip_left") + self.at("hip_right"))
        shoulders = 0.5 * (self.at("shoulder_left") + self.at("shoulder_right"))
        trunk = np.linalg.norm(shoulders - hips, axis=1)
        height = float(np.nanmedian(0.5 * np.sum(legs, axis=0) + trunk)) / _LEGS_AND_TRUNK
        if height < _LEAST_HEIGHT:
            raise BadFileError(
                "this BVH has a body without size",
                where=self.motion.name,
                found="hips, knees and shoulders at the same place",
            )
        return height

    def skeleton(self) -> tuple[Floats, Bytes]:
        """(F, 20, 3) positions in the file's units and axes, (F, 20) states."""
        count = len(self.positions)
        positions = np.empty((count, JOINT_COUNT, 3))
        states = np.full((count, JOINT_COUNT), TrackingState.TRACKED, np.uint8)
        for name in self.found:
            positions[:, Joint[name.upper()]] = self.at(name)
        hips = 0.5 * (self.at("hip_left") + self.at("hip_right"))
        shoulders = 0.5 * (self.at("shoulder_left") + self.at("shoulder_right"))
        shoulder_center = hips + _SHOULDER_CENTER * (shoulders - hips)
        positions[:, Joint.SHOULDER_CENTER] = shoulder_center
        positions[:, Joint.SPINE] = self._spine(shoulder_center)
        top = self._end(self.found["head"])
        if top is not None:
            positions[:, Joint.HEAD] = 0.5 * (self.at("head") + top)
        for side in ("left", "right"):
            for tip, root, before in (("hand", "wrist", "elbow"), ("foot", "ankle", "knee")):
                joint = Joint[f"{tip}_{side}".upper()]
                place = self._tip(tip, side, root, before)
                if place is None:
                    states[:, joint] = TrackingState.INFERRED
                    place = self._extended(tip, f"{before}_{side}", f"{root}_{side}")
                positions[:, joint] = place
        return positions, states

    def _spine(self, shoulder_center: Floats) -> Floats:
        """A point a little up the spine, on it however it bends."""
        trunk = set(self._ancestors(self.found["head"])) - {self.found["hip_center"]}
        line = [joint for joint in self._ancestors(self.found["shoulder_left"]) if joint in trunk]
        trunk_joints = [joint for joint in reversed(line) if self._above_hips(joint)]
        points = [self.at("hip_center"), *(self.positions[:, j] for j in trunk_joints)]
        points.append(shoulder_center)
        lengths = [_distance(a, b) for a, b in pairwise(points)]
        rest = _SPINE * sum(lengths)
        for (start, end), length in zip(pairwise(points), lengths, strict=True):
            if rest <= length and length > 0.0:
                return start + (end - start) * (rest / length)
            rest -= length
        return points[0]

    def _above_hips(self, joint: int) -> bool:
        return self.found["hip_center"] in self._ancestors(joint)

    def _tip(self, tip: str, side: str, root: str, before: str) -> Floats | None:
        """(F, 3) of hand or foot: a joint under the wrist or ankle, or an End Site there."""
        start, base = self.found[f"{root}_{side}"], self.at(f"{root}_{side}")
        bone = _distance(base, self.at(f"{before}_{side}"))
        least, _, most = (bone * part for part in _TIP_LENGTHS[tip])
        joints = [self._first((key,), above=start) for key in self._sided(_TIPS[tip], side)]
        joints = [joint for joint in joints if joint >= 0]
        places = [
            *(self.positions[:, joint] for joint in joints),
            self._end(start),
            *map(self._end, joints),
        ]
        for place in places:
            if place is not None and (length := _distance(place, base)) >= least:
                return base + (place - base) * min(1.0, most / length)
        return None

    def _end(self, joint: int) -> Floats | None:
        """(F, 3) the End Site of a joint, or its first child; None if that is where it is."""
        children = [j for j, parent in enumerate(self.motion.parents) if parent == joint]
        if joint in self.motion.ends:
            end = self.rotations[joint].apply(self.motion.ends[joint])
            place = self.positions[:, joint] + end
        elif children:
            place = self.positions[:, children[0]]
        else:
            return None
        return place if _distance(place, self.positions[:, joint]) > _TINY * self.height else None

    def _extended(self, tip: str, before: str, root: str) -> Floats:
        """Where hand or foot would be: on from the forearm, or square to the shin and forward."""
        bone = self.at(root) - self.at(before)
        _, usual, _ = _TIP_LENGTHS[tip]
        if tip == "hand":
            return self.at(root) + usual * bone
        forward = np.cross(bone, self.at("hip_left") - self.at("hip_right"))
        size = np.linalg.norm(forward, axis=1, keepdims=True)
        length = np.linalg.norm(bone, axis=1, keepdims=True)
        place: Floats = self.at(root) + usual * length * forward / np.maximum(size, 1e-9)
        return place


def _distance(a: Floats, b: Floats) -> float:
    """How far (F, 3) and (F, 3) usually are from each other."""
    return float(np.nanmedian(np.linalg.norm(a - b, axis=1)))


def upright(positions: Floats) -> tuple[Rotation, str]:
    """The turn that makes +Y up, and a note. Up is the axis nearest to where heads are from feet.

    positions: (F, 20, 3) in the file's axes.
    """
    feet = 0.5 * (positions[:, Joint.ANKLE_LEFT] + positions[:, Joint.ANKLE_RIGHT])
    body = positions[:, Joint.HEAD] - feet
    body /= np.maximum(np.linalg.norm(body, axis=1, keepdims=True), 1e-12)
    mean = np.nanmean(body, axis=0)
    axis = int(np.argmax(np.abs(mean)))
    negative = mean[axis] < 0.0
    note = f"up axis: {'-' if negative else '+'}{'XYZ'[axis]}, from how the performer stands"
    turns = {
        "+X": ("z", 90.0),
        "-X": ("z", -90.0),
        "+Y": ("x", 0.0),
        "-Y": ("x", 180.0),
        "+Z": ("x", -90.0),
        "-Z": ("x", 90.0),
    }
    about, degrees = turns[f"{'-' if negative else '+'}{'XYZ'[axis]}"]
    return Rotation.from_euler(about, degrees, degrees=True), note


def _facing_front(positions: Floats) -> tuple[Floats, float]:
    """The performance turned and moved so that it starts at the origin, facing +Z; and degrees."""
    whole = np.flatnonzero(np.isfinite(positions).all(axis=(1, 2)))
    if len(whole) == 0:
        return positions, 0.0
    first = positions[whole[0]]
    heading = heading_of(first)
    turn = Rotation.from_euler("y", -heading)
    moved = positions - first[Joint.HIP_CENTER] * (1.0, 0.0, 1.0)
    return turn.apply(moved.reshape(-1, 3)).reshape(moved.shape), -float(np.degrees(heading))


def heading_of(positions: Floats) -> float:
    """The turn about +Y, rad, from +Z to where the human faces. (20, 3), +Y up"""
    left = positions[Joint.HIP_LEFT] - positions[Joint.HIP_RIGHT]
    left = left + positions[Joint.SHOULDER_LEFT] - positions[Joint.SHOULDER_RIGHT]
    return float(np.arctan2(-left[2], left[0]))
