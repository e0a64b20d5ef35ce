"""The same rig told in another way: bones in another order, other names, other places; mirrored.

And creatures: random armatures with limbs at their sides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.armature import Armature, side_of
from puppet.cast import rig_of
from puppet.formats.armature_toml import load_puppet
from puppet.kernel import Floats, frozen
from puppet.mapping.proposal import Mode, Proposal
from puppet.mapping.service import Rig
from puppet.mapping.verdicts import Verdicts

ARMATURES: Final = Path(__file__).parents[1] / "configs" / "armatures"
CAST: Final = ("fish", "lamp", "dog", "seagull", "snake", "ostrich")
MODES: Final[tuple[Mode, ...]] = ("fk", "ik")


@cache
def shipped(name: str) -> Rig:
    """A rig of the shipped cast, with what its .toml says."""
    model = ARMATURES / f"{name}.glb"
    return rig_of(load_puppet(model if model.exists() else model.with_suffix(".toml")))


def propose(rig: Rig, mode: Mode, k: int = 1) -> list[Proposal]:
    """As a show proposes when nothing was decided."""
    return rig.propose(Verdicts(mode, masters=dict(rig.masters)), k=k)


def by_name(proposal: Proposal) -> dict[str, str]:
    """Bone, effector or master -> what drives it."""
    return {pair.name: pair.partner for pair in proposal.pairs}


def reordered(armature: Armature, order: Sequence[int]) -> Armature:
    """The same bones, listed in another order."""
    place = {old: new for new, old in enumerate(order)}
    rows = list(order)
    parents = [int(armature.parents[old]) for old in rows]
    return Armature.build(
        armature.name,
        [armature.names[old] for old in rows],
        [place[parent] if parent >= 0 else -1 for parent in parents],
        armature.offsets[rows],
        armature.rotations[rows],
        armature.tips[rows],
        armature.limits[rows],
        armature.lower[rows],
        armature.upper[rows],
        [armature.movements[old] for old in rows],
    )


def renamed(armature: Armature, names: Mapping[str, str]) -> Armature:
    """The same bones under other names."""
    return replace(armature, names=tuple(names[name] for name in armature.names))


def numbered(armature: Armature, *, keep_sides: bool = True) -> dict[str, str]:
    """b0 to bn for its bones, with .L and .R where their names say so."""
    suffix = {"L": ".L", "R": ".R", "": ""}
    return {
        name: f"b{bone}" + (suffix[side_of(name)] if keep_sides else "")
        for bone, name in enumerate(armature.names)
    }


def placed(
    armature: Armature, scale: float = 1.0, turn: Rotation | None = None, move: Sequence[float] = ()
) -> Armature:
    """The same bones at another size, in another direction and place."""
    turn = turn or Rotation.identity()
    offsets, rotations = armature.offsets * scale, np.array(armature.rotations)
    for root in np.flatnonzero(armature.parents < 0):
        offsets[root] = turn.apply(offsets[root]) + (move or (0.0, 0.0, 0.0))
        rotations[root] = (turn * Rotation.from_quat(rotations[root])).as_quat()
    return replace(
        armature,
        offsets=frozen(offsets),
        rotations=frozen(rotations),
        tips=frozen(armature.tips * scale),
    )


def retold(rig: Rig, armature: Armature, names: Mapping[str, str] | None = None) -> Rig:
    """A rig with a changed armature; what lies beside it follows the new names."""
    names = names or {name: name for name in rig.armature.names}
    return Rig(
        armature,
        rig.preferences,
        {master: tuple(names[bone] for bone in bones) for master, bones in rig.masters.items()},
        {names[bone]: share for bone, share in rig.follows.items()},
    )


def other_side(name: str) -> str:
    """`fin.L` -> `fin.R` and the other way round."""
    across = {".L": ".R", ".R": ".L"}.get(name[-2:])
    return name[:-2] + across if across else name


def mirrored(armature: Armature) -> Armature:
    """What a mirror at x = 0 shows, where left is called right."""
    flip, turns = np.array([-1.0, 1.0, 1.0]), np.array([1.0, -1.0, -1.0, 1.0])
    low, high = armature.lower.copy(), armature.upper.copy()
    low[:, 1:], high[:, 1:] = -armature.upper[:, 1:], -armature.lower[:, 1:]
    return replace(
        armature,
        names=tuple(other_side(name) for name in armature.names),
        offsets=frozen(armature.offsets * flip),
        rotations=frozen(armature.rotations * turns),
        tips=frozen(armature.tips * flip),
        lower=frozen(low),
        upper=frozen(high),
    )


def bare(bones: Mapping[str, tuple[str, Sequence[float]]], name: str = "drawn") -> Armature:
    """An armature from bone -> (parent, offset), all frames parallel."""
    names = list(bones)
    return Armature.build(
        name,
        names,
        [names.index(parent) if parent else -1 for parent, _ in bones.values()],
        np.array([offset for _, offset in bones.values()], float),
    )


def limb(
    word: str, hub: str, way: Sequence[float], bones: int, aside: Sequence[float] = (0.0, 0.0, 0.0)
) -> dict[str, tuple[str, Sequence[float]]]:
    """Bones word0.L, word1.L, ... and their mirror images, for `bare`; `way` is the left one's."""
    out: dict[str, tuple[str, Sequence[float]]] = {}
    for side, sign in (("L", 1.0), ("R", -1.0)):
        flip = np.array([sign, 1.0, 1.0])
        for bone in range(bones):
            parent = f"{word}{bone - 1}.{side}" if bone else hub
            step = np.asarray(way, float) if bone else np.asarray(aside, float) + way
            out[f"{word}{bone}.{side}"] = (parent, tuple(flip * step))
    return out


@st.composite
def creatures(draw: st.DrawFn) -> Armature:
    """A body in the middle with limbs in pairs, a left and a right that mirror each other, and
    others in the middle; all of random lengths and directions."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    spine = draw(st.integers(1, 4))
    names, parents = ["s0"], [-1]
    offsets: list[Floats] = [np.zeros(3)]
    for bone in range(1, spine):
        names.append(f"s{bone}")
        parents.append(bone - 1)
        offsets.append(np.array([0.0, *rng.normal(size=2)]))
    for pair in range(draw(st.integers(0, 3))):
        hub, bones = draw(st.integers(0, spine - 1)), draw(st.integers(1, 4))
        ways = rng.normal(size=(bones, 3))
        ways[:, 0] = np.abs(ways[:, 0])
        for side, sign in (("L", 1.0), ("R", -1.0)):
            for bone in range(bones):
                parents.append(hub if bone == 0 else len(names) - 1)
                names.append(f"p{pair}_{bone}.{side}")
                offsets.append(ways[bone] * [sign, 1.0, 1.0])
    for middle in range(draw(st.integers(0, 2))):
        hub = draw(st.integers(0, spine - 1))
        for bone in range(draw(st.integers(1, 4))):
            parents.append(hub if bone == 0 else len(names) - 1)
            names.append(f"m{middle}_{bone}")
            offsets.append(np.array([0.0, *rng.normal(size=2)]))
    return Armature.build("creature", names, parents, np.array(offsets))
