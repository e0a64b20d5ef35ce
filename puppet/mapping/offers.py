"""Masters that are offered where IK has more end effectors than control points."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain, combinations, count
from typing import Final

import numpy as np

from puppet.armature import Armature
from puppet.mapping.effector_rows import EffectorTable, effector_table
from puppet.mapping.evidence import Evidence
from puppet.mapping.human import HUMAN_LIMBS
from puppet.mapping.proposal import OfferedMaster
from puppet.mapping.ranking import best_first
from puppet.mapping.verdicts import Verdicts

#: A name with fewer letters says nothing.
_LETTERS: Final = 3
#: Chains whose reaches differ by no more than this share of the longer are of the same build.
_ALIKE: Final = 0.2


def offered(
    evidence: Evidence,
    verdicts: Verdicts,
    table: EffectorTable,
    chosen: Mapping[int, int],
    possible: np.ndarray,
) -> tuple[OfferedMaster, ...]:
    """Masters that would leave less over; each can be accepted alone.

    chosen: by row, the column. possible: (R, 5) as in `LimbChoice`.
    """
    left = [row for row in range(len(table.rows)) if row not in chosen]
    if not left:
        return ()
    taken = {*evidence.armature.names, *verdicts.masters}
    mapped = [row for row in chosen if not table.rows[row].is_master]
    groups, alone = _grouped(evidence, table, left, mapped)
    offers = [_joined(evidence, table, row, groups[row], taken) for row in sorted(groups)]
    offers += _shared(evidence, table, mapped, chosen, possible, alone, taken)
    return tuple(o for o in offers if _left_over(evidence, verdicts, o) < len(left))


def _left_over(evidence: Evidence, verdicts: Verdicts, offer: OfferedMaster) -> int:
    """How many effectors would have no partner if the offer were accepted."""
    accepted = replace(verdicts, masters={**verdicts.masters, offer.name: offer.effectors})
    table = effector_table(evidence, accepted)
    choice = table.choice(evidence, accepted)
    mapped = {row for row, _ in best_first(choice.scores, choice.allowed)}
    return len(table.rows) - len(mapped | set(table.kept(verdicts)))


def _grouped(
    evidence: Evidence, table: EffectorTable, left: Sequence[int], mapped: Sequence[int]
) -> tuple[dict[int, list[int]], list[int]]:
    """What is left over, by the mapped row that is most like it, on its own side if there is one;
    and what is like none of them. Nobody joins what it hangs on, or what hangs on it."""
    above = _above(evidence.armature)
    # All bones of a group and all above them, as bits.
    held: dict[int, tuple[int, int]] = {}
    groups: dict[int, list[int]] = {}
    alone: list[int] = []
    left = sorted(
        (row for row in left if not table.rows[row].is_master and table.rows[row].limbs),
        key=lambda row: table.rows[row].name,
    )
    for row in mapped:
        bone = table.rows[row].bones[0]
        held[row] = 1 << bone, above[bone]
    alike = _alike(table, left, mapped)
    for row, likeness in zip(left, alike.tolist(), strict=True):
        bone = table.rows[row].bones[0]
        like = [
            other
            for other, is_like in zip(mapped, likeness, strict=True)
            if is_like and not (above[bone] & held[other][0] or held[other][1] >> bone & 1)
        ]
        if like:
            side = _side(evidence, table, row)
            nearest = min(like, key=lambda other: _side(evidence, table, other) != side)
            groups.setdefault(nearest, []).append(row)
            bones, parents = held[nearest]
            held[nearest] = bones | 1 << bone, parents | above[bone]
        else:
            alone.append(row)
    return groups, alone


def _joined(
    evidence: Evidence, table: EffectorTable, row: int, others: Sequence[int], taken: set[str]
) -> OfferedMaster:
    """What is left over moves with what it is like."""
    rows = table.rows
    name, joined = rows[row].name, sorted(rows[other].name for other in others)
    sides = {evidence.shape.sides[rows[one].bones[0]] for one in (row, *others)}
    fresh = fresh_name((name, *joined), sides.pop() if len(sides) == 1 else "", taken)
    taken.add(fresh)
    why = f"{', '.join(joined)}: built like {name}, could move with it"
    return OfferedMaster(fresh, (name, *joined), why)


def _shared(
    evidence: Evidence,
    table: EffectorTable,
    mapped: Sequence[int],
    chosen: Mapping[int, int],
    possible: np.ndarray,
    alone: Sequence[int],
    taken: Collection[str],
) -> list[OfferedMaster]:
    """The first two mirrored effectors that could share a control point and so free one for what is
    like nothing else, if that could be moved by either."""
    if not alone:
        return []
    rows = table.rows
    mapped = sorted(mapped, key=lambda row: rows[row].name)
    above = _above(evidence.armature)
    alike = _alike(table, mapped, mapped)
    for i, j in combinations(range(len(mapped)), 2):
        a, b = mapped[i], mapped[j]
        if not (alike[i, j] and _mirrored(evidence, table, a, b)) or _stands(evidence, table, a):
            continue
        one, other = rows[a].bones[0], rows[b].bones[0]
        if above[one] >> other & 1 or above[other] >> one & 1:
            continue
        either = possible[:, chosen[a]] & possible[:, chosen[b]]
        helped = [rows[row].name for row in alone if either[row]]
        if helped:
            twins = (rows[a].name, rows[b].name)
            why = f"if {twins[0]} and {twins[1]} share a control point, "
            why += f"one is free for {', '.join(helped)}"
            return [OfferedMaster(fresh_name(twins, "", taken), twins, why)]
    return []


@lru_cache(maxsize=16)
def _above(armature: Armature) -> tuple[int, ...]:
    """For each bone those that it hangs on, as bits of a number."""
    above: list[int] = []
    for parent in armature.parents.tolist():  # parents come first
        above.append(above[parent] | 1 << parent if parent >= 0 else 0)
    return tuple(above)


def _alike(table: EffectorTable, some: Sequence[int], others: Sequence[int]) -> np.ndarray:
    """(S, O): whether two effectors end chains of the same build."""
    a, b = np.array(some, np.intp), np.array(others, np.intp)
    ours, theirs = table.reaches[a], table.reaches[b]
    near = np.abs(np.subtract.outer(ours, theirs)) <= _ALIKE * np.maximum.outer(ours, theirs)
    same = np.equal.outer(table.lengths[a], table.lengths[b])
    return np.asarray(near & same & (table.lengths[a] >= 0)[:, None])


def _side(evidence: Evidence, table: EffectorTable, row: int) -> str:
    """That of its chain."""
    return evidence.limbs[table.rows[row].limbs[0]].side


def _mirrored(evidence: Evidence, table: EffectorTable, one: int, other: int) -> bool:
    """Whether one is at the left and the other at the right, or both are in the middle."""
    a, b = _side(evidence, table, one), _side(evidence, table, other)
    return a != b if a and b else not a and not b


def _stands(evidence: Evidence, table: EffectorTable, row: int) -> bool:
    """Whether the puppet stands on it, as far as its scores say: then it is not to be shared."""
    scores = np.clip(evidence.parts[:, table.rows[row].limbs[0]].sum(axis=0), 0.0, 1.0)
    legs = max(scores[i] for i, limb in enumerate(HUMAN_LIMBS) if limb.is_leg)
    return bool(legs >= max(scores[i] for i, limb in enumerate(HUMAN_LIMBS) if limb.is_arm))


def fresh_name(effectors: Sequence[str], side: str, taken: Collection[str]) -> str:
    """What the names have in common, with their side; and what makes it one that nothing else has.

    Where they have too little in common, it is the master of the first.
    """
    first, last = min(effectors), max(effectors)
    length = next(
        (i for i, (a, b) in enumerate(zip(first, last, strict=False)) if a != b),
        min(len(first), len(last)),
    )
    stem = first[:length].strip("._- 0123456789")
    if sum(letter.isalpha() for letter in stem) < _LETTERS:
        name = f"master_{effectors[0]}"
        tries = chain((name,), (f"{name}_{i}" for i in count(2)))
    else:
        name = f"{stem}.{side}" if side and not stem.endswith(f".{side}") else stem
        tries = chain((name, f"master_{name}"), (f"master_{name}_{i}" for i in count(2)))
    return next(name for name in tries if name not in taken)
