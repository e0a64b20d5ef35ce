"""IK mapping: which control point moves which end effector (Sanna 2015, section 5).

End effectors are the tips of an armature's chains; control points are the performer's head, hands
and feet. The best pair of all is taken first, then the best of what is left, and so on (figure 6).
A master bone stands for several effectors and scores what they score on average. What is left over
when the control points are used up stays where the rest carries it, and masters are offered that
would leave nothing over.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, count

import numpy as np

from puppet.armature import Armature
from puppet.mapping.decisions import BANS, KEEPS, Verdicts
from puppet.mapping.evidence import Evidence, gather
from puppet.mapping.human import CONTROL_POINTS, HUMAN_LIMBS, LIMB_NAMES
from puppet.mapping.limb_choice import LimbChoice
from puppet.mapping.proposal import OfferedMaster, Pair, Proposal
from puppet.mapping.ranking import Assignment, best_first, sum_of_powers


@dataclass(frozen=True, slots=True)
class Effector:
    """One row of the choice: a single end effector, or a master.

    bones: what it moves. limbs: the rows of the evidence that these belong to.
    """

    name: str
    bones: tuple[int, ...]
    limbs: tuple[int, ...]

    @property
    def is_master(self) -> bool:
        """Whether it stands for several."""
        return len(self.bones) > 1


def propose_effectors(
    source: Armature | Evidence, verdicts: Verdicts | None = None, k: int = 1
) -> list[Proposal]:
    """The k best IK mappings of an armature, best first; fewer if there are no more.

    An armature without a chain (a single bone) has nothing that IK could move: its proposal has
    no pairs.
    """
    evidence = source if isinstance(source, Evidence) else gather(source, pieces=False)
    verdicts = verdicts or Verdicts()
    rows = effectors_of(evidence, verdicts)
    choice = _choice(evidence, verdicts, rows)
    found: dict[tuple[tuple[str, int], ...], Proposal] = {}
    # What was decided is in every proposal, so two assignments may come to the same pairs.
    for _, assignment in choice.ranked(best_first):
        proposal = _proposal(evidence, verdicts, rows, choice, assignment)
        found.setdefault(tuple((pair.name, pair.human) for pair in proposal.pairs), proposal)
        if len(found) == k:
            break
    return list(found.values()) or [_proposal(evidence, verdicts, rows, choice, ())]


def effectors_of(evidence: Evidence, verdicts: Verdicts) -> list[Effector]:
    """What can be moved: masters first, then the single effectors that no master holds."""
    armature = evidence.armature
    limb_of_bone = _limbs_by_bone(evidence)
    rows = []
    held: set[int] = set()
    for name, effectors in sorted(verdicts.masters.items()):
        bones = tuple(armature.index(effector) for effector in effectors)
        held.update(bones)
        limbs = tuple(limb_of_bone[bone] for bone in bones if bone in limb_of_bone)
        rows.append(Effector(name, bones, limbs))
    for row, limb in enumerate(evidence.limbs):
        tip = limb.bones[-1]
        if tip not in held and armature.parents[tip] >= 0:
            rows.append(Effector(armature.names[tip], (tip,), (row,)))
    known = {effector.name for effector in rows}
    for bone, (_, act) in sorted(verdicts.kept_in("ik").items()):
        # By hand, any bone may be moved, not only a tip.
        if act in KEEPS and bone not in known and bone in armature.names:
            index = armature.index(bone)
            if armature.parents[index] >= 0 and index not in held:
                limbs = (limb_of_bone[index],) if index in limb_of_bone else ()
                rows.append(Effector(bone, (index,), limbs))
    return rows


def _limbs_by_bone(evidence: Evidence) -> dict[int, int]:
    """For each bone the limb that it belongs to or branches off."""
    owner = {bone: row for row, limb in enumerate(evidence.limbs) for bone in limb.bones}
    for bone, parent in enumerate(evidence.armature.parents):
        if bone not in owner and int(parent) in owner:
            owner[bone] = owner[int(parent)]
    return owner


def _choice(evidence: Evidence, verdicts: Verdicts, rows: Sequence[Effector]) -> LimbChoice:
    parts = np.zeros((len(evidence.parts), len(rows), len(HUMAN_LIMBS)))
    allowed = np.zeros((len(rows), len(HUMAN_LIMBS)), bool)
    for row, effector in enumerate(rows):
        if effector.limbs:
            limbs = list(effector.limbs)
            parts[:, row] = evidence.parts[:, limbs].mean(axis=1)
            turning = [limb for limb in limbs if _turns(evidence, limb)]
            allowed[row] = evidence.allowed[turning].any(axis=0)
    by_name = {effector.name: row for row, effector in enumerate(rows)}
    tips = {evidence.armature.names[b]: row for row, e in enumerate(rows) for b in e.bones}
    for (bone, human), act in verdicts.banned_in("ik").items():
        row = by_name.get(bone, tips.get(bone, -1))
        if act in BANS and row >= 0:
            allowed[row, _column(human)] = False
    possible = allowed.copy()
    kept = {by_name[b]: verdict for b, verdict in verdicts.kept_in("ik").items() if b in by_name}
    for row, (human, act) in kept.items():
        allowed[row, :] = False
        if act != "set":
            allowed[:, _column(human)] = False
    for row, (human, act) in kept.items():
        # What is locked is no choice; what was set by hand still takes its control point from
        # whatever is less like it.
        if act == "set":
            allowed[row, _column(human)] = True
    scores = np.clip(parts.sum(axis=0), 0.0, 1.0)
    return LimbChoice(scores, parts, allowed, possible, evidence)


def _turns(evidence: Evidence, limb: int) -> bool:
    """Whether anything in it turns under a goal, as a root never does."""
    armature = evidence.armature
    return any(
        armature.movements[bone] == "turn" and armature.parents[bone] >= 0
        for bone in evidence.limbs[limb].bones
    )


def _column(human: str) -> int:
    return (LIMB_NAMES if human in LIMB_NAMES else CONTROL_POINTS).index(human)


def _proposal(
    evidence: Evidence,
    verdicts: Verdicts,
    rows: Sequence[Effector],
    choice: LimbChoice,
    assignment: Assignment,
) -> Proposal:
    kept = verdicts.kept_in("ik")
    chosen = dict(assignment)
    for row, effector in enumerate(rows):
        # Two effectors that were set to one control point by hand: the choice gives it only once.
        if effector.name in kept:
            chosen[row] = _column(kept[effector.name][0])
    pairs: list[Pair] = []
    for row, column in sorted(chosen.items(), key=lambda item: rows[item[0]].bones):
        effector = rows[row]
        decided = kept.get(effector.name, ("", ""))[1]
        pairs.append(
            choice.reasoning(row, column).pair(
                effector.name, effector.bones, HUMAN_LIMBS[column].tip, decided
            )
        )
    left = [effector for row, effector in enumerate(rows) if row not in chosen]
    return Proposal(
        evidence.armature,
        "ik",
        tuple(pairs),
        tuple(effector.name for effector in sorted(left, key=lambda e: e.bones)),
        sum_of_powers(choice.scores, tuple(chosen.items()))[0],
        tuple(
            offer
            for offer in _offers(evidence, verdicts, rows, left, chosen, choice.possible)
            if _left_over(evidence, verdicts, offer) < len(left)
        ),
    )


def _left_over(evidence: Evidence, verdicts: Verdicts, offer: OfferedMaster) -> int:
    """How many effectors would have no partner if the offer were accepted."""
    accepted = replace(verdicts, masters={**verdicts.masters, offer.name: offer.effectors})
    rows = effectors_of(evidence, accepted)
    choice = _choice(evidence, accepted, rows)
    mapped = {row for row, _ in best_first(choice.scores, choice.allowed)}
    kept = verdicts.kept_in("ik")
    return sum(row not in mapped and rows[row].name not in kept for row in range(len(rows)))


def _offers(
    evidence: Evidence,
    verdicts: Verdicts,
    rows: Sequence[Effector],
    left: Sequence[Effector],
    chosen: Mapping[int, int],
    possible: np.ndarray,
) -> tuple[OfferedMaster, ...]:
    """Masters that would leave less over.

    What is left over joins the mapped effector that is most like it, on its own side if there is
    one; what is like none of them gets the control point that the two most alike mapped effectors
    free by sharing one, if it could be moved by either.
    """
    taken = {*evidence.armature.names, *verdicts.masters}
    mapped = [row for row in chosen if not rows[row].is_master]
    groups: dict[int, list[str]] = {}
    alone: list[str] = []
    for effector in left:
        if effector.is_master or not effector.limbs:
            continue
        alike = [row for row in mapped if _alike(evidence, rows[row], effector)]
        if alike:
            side = evidence.limbs[effector.limbs[0]].side
            nearest = min(alike, key=lambda row: evidence.limbs[rows[row].limbs[0]].side != side)
            groups.setdefault(nearest, []).append(effector.name)
        else:
            alone.append(effector.name)
    offers = []
    for row, joined in sorted(groups.items()):
        effectors = (rows[row].name, *sorted(joined))
        sides = {evidence.shape.sides[evidence.armature.index(name)] for name in effectors}
        name = _fresh_name(effectors, sides.pop() if len(sides) == 1 else "", taken)
        taken.add(name)
        offers.append(
            OfferedMaster(
                name,
                effectors,
                f"{', '.join(sorted(joined))}: built like {rows[row].name}, could move with it",
            )
        )
    by_name = {effector.name: row for row, effector in enumerate(rows)}
    for a, b in combinations(sorted(mapped, key=lambda row: rows[row].name), 2):
        helped = [name for name in alone if possible[by_name[name], [chosen[a], chosen[b]]].all()]
        if (
            helped
            and _alike(evidence, rows[a], rows[b])
            and _mirrored(evidence, rows[a], rows[b])
            and not _stands(evidence, rows[a])
        ):
            twins = (rows[a].name, rows[b].name)
            offers.append(
                OfferedMaster(
                    _fresh_name(twins, "", taken),
                    twins,
                    f"if {twins[0]} and {twins[1]} share a control point, "
                    f"one is free for {', '.join(helped)}",
                )
            )
            break
    return tuple(offers)


def _alike(evidence: Evidence, one: Effector, other: Effector) -> bool:
    """Whether two effectors end chains of the same build."""
    if not one.limbs or not other.limbs:
        return False
    a, b = evidence.limbs[one.limbs[0]], evidence.limbs[other.limbs[0]]
    return len(a.bones) == len(b.bones) and abs(a.reach - b.reach) <= 0.2 * max(a.reach, b.reach)


def _mirrored(evidence: Evidence, one: Effector, other: Effector) -> bool:
    """Whether one is at the left and the other at the right, or both are in the middle."""
    a, b = evidence.limbs[one.limbs[0]].side, evidence.limbs[other.limbs[0]].side
    return a != b if a and b else not a and not b


def _stands(evidence: Evidence, effector: Effector) -> bool:
    """Whether the puppet stands on it, as far as its scores say: then it is not to be shared."""
    scores = evidence.scores[effector.limbs[0]]
    legs = max(scores[i] for i, limb in enumerate(HUMAN_LIMBS) if limb.is_leg)
    return bool(legs >= max(scores[i] for i, limb in enumerate(HUMAN_LIMBS) if limb.is_arm))


def _fresh_name(effectors: Sequence[str], side: str, taken: Collection[str]) -> str:
    """What the names have in common, or the first of them, with their side; and what makes it one
    that nothing else has."""
    first, last = min(effectors), max(effectors)
    length = next(
        (i for i, (a, b) in enumerate(zip(first, last, strict=False)) if a != b),
        min(len(first), len(last)),
    )
    stem = first[:length].strip("._- 0123456789") or first
    name = f"{stem}.{side}" if side and not stem.endswith(f".{side}") else stem
    tries = chain((name, f"master_{name}"), (f"master_{name}_{i}" for i in count(2)))
    return next(name for name in tries if name not in taken)
