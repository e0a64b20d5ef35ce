"""Recognising an armature: the same rig next time, and what is different in a changed one."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from puppet.armature import Armature
from puppet.kernel import Floats

#: Digits of positions (in bones' lengths) and quaternions that count.
_DIGITS: Final = 5


@dataclass(frozen=True, slots=True)
class BoneRecord:
    """What a fingerprint knows of a bone. rest: offset x, y, z in bones' lengths and rotation xyzw.

    The length is the middle one of the rig, so that another scale changes no record and one bone
    that was moved or turned changes only its own.
    """

    parent: str
    rest: tuple[float, ...]


def bone_records(armature: Armature) -> dict[str, BoneRecord]:
    """By name, in the order of the names: neither the order of bones nor the scale matters."""
    lengths = np.linalg.norm(armature.offsets[armature.parents >= 0], axis=1)
    lengths = lengths[lengths > 1e-9 * armature.size]
    size = max(float(np.median(lengths)) if len(lengths) else armature.size, 1e-12)
    records = {}
    for bone, name in enumerate(armature.names):
        parent = int(armature.parents[bone])
        turn = _rounded(armature.rotations[bone])
        # A rotation and its negative are one: w is positive, or else the first that is not zero.
        sign = next((value for value in turn[::-1] if value), 1.0)
        turn = turn if sign > 0.0 else _rounded(-armature.rotations[bone])
        rest = (*_rounded(armature.offsets[bone] / size), *turn)
        records[name] = BoneRecord(armature.names[parent] if parent >= 0 else "", rest)
    return dict(sorted(records.items()))


def _rounded(values: Floats) -> tuple[float, ...]:
    # + 0.0: a negative zero is a zero.
    return tuple(round(float(value), _DIGITS) + 0.0 for value in values)


def fingerprint(armature: Armature) -> str:
    """16 hexadecimal digits: the same for the same names, parents and rest pose."""
    return digest(bone_records(armature))


def digest(records: Mapping[str, BoneRecord]) -> str:
    """The fingerprint of an armature with these bones."""
    rows = [[name, bone.parent, *bone.rest] for name, bone in records.items()]
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()[:16]


def differences(was: Mapping[str, BoneRecord], now: Mapping[str, BoneRecord]) -> Iterator[str]:
    """What changed, a sentence for each bone."""
    scale = _scale(was, now)
    for name in was:
        if name not in now:
            yield f"{name} is gone"
    for name, bone in now.items():
        if name not in was:
            yield f"{name} is new" + (f", on {bone.parent}" if bone.parent else "")
        elif was[name].parent != bone.parent:
            before, after = was[name].parent or "nothing", bone.parent or "nothing"
            yield f"{name} hung on {before}, and now on {after}"
        elif not np.allclose(was[name].rest, np.divide(bone.rest, scale), atol=5 * 10.0**-_DIGITS):
            yield f"{name} rests differently"


def _scale(was: Mapping[str, BoneRecord], now: Mapping[str, BoneRecord]) -> Floats:
    """What most bones' offsets were multiplied by: where bones come or go, the middle length may be
    another one. (7,), as `BoneRecord.rest`."""
    ratios = [
        np.linalg.norm(bone.rest[:3]) / np.linalg.norm(was[name].rest[:3])
        for name, bone in now.items()
        if name in was and bone.parent and any(bone.rest[:3]) and any(was[name].rest[:3])
    ]
    scale = float(np.median(ratios)) if ratios else 1.0
    return np.array([scale] * 3 + [1.0] * 4)
