"""FK mapping: which human bone turns which bone of an armature (Sanna 2015, section 3).

The paper fills one score matrix and runs the Hungarian algorithm over bones, then preferences
pull the pairs along the limbs, then the Hungarian runs again. Here the same scores decide between
whole limbs first, so that a chain cannot be torn over several human limbs and its order cannot be
lost; the preferences then choose the bones inside each limb.

1. Trunk to spine: the best order-preserving pairs by score.
2. Limbs to human limbs: the Hungarian algorithm over how well they run side by side.
3. Inside a limb: the preferred bones, in order. A long limb in the middle, which one human limb
   cannot fill, gives its tip to that limb and the rest to the next free one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.mapping.anatomy import Anatomy, Limb, anatomy
from puppet.mapping.proposal import Pair, Proposal
from puppet.mapping.scores import combined_score
from puppet.skeleton import HUMAN_BONE_NAMES


@dataclass(frozen=True, slots=True)
class HumanLimb:
    """A limb of the performer, and which of its bones a puppeteer would rather use.

    bones: from the body outwards. preferred: for a puppet's chain of 1, 2, 3… bones, the positions
    in `bones` that drive it. preference: added to the affinity of every limb.
    """

    side: str
    is_arm: bool
    bones: tuple[int, ...]
    preferred: tuple[tuple[int, ...], ...]
    preference: float


def _human_limbs() -> tuple[HumanLimb, ...]:
    index = HUMAN_BONE_NAMES.index
    limbs = []
    # Arms before legs, and the right one first: where the graphs say nothing, a puppeteer
    # uses the hand (section 4: "Arms are selected here, since their preferences score is the
    # highest one"). The shoulder hardly moves by itself, so it comes last.
    for kind, preference in (("arm", 0.1), ("leg", 0.0)):
        for side, handed in (("R", 0.01), ("L", 0.0)):
            if kind == "arm":
                names: tuple[str, ...] = ("shoulder", "upper_arm", "forearm", "hand")
                preferred: tuple[tuple[int, ...], ...] = ((2,), (1, 2), (1, 2, 3))
            else:
                names = ("thigh", "shin", "foot")
                preferred = ((0,), (0, 1), (0, 1, 2))
            bones = tuple(index(f"{name}.{side}") for name in names)
            limbs.append(HumanLimb(side, kind == "arm", bones, preferred, preference + handed))
    return tuple(limbs)


HUMAN_LIMBS: Final = _human_limbs()
SPINE: Final = tuple(HUMAN_BONE_NAMES.index(name) for name in ("pelvis", "chest", "head"))


def propose_forward(armature: Armature) -> Proposal:
    """The best FK mapping of an armature.

    Bones that get no partner follow their parents; in an armature with sides, what is in the
    middle (a tail, a dorsal fin) is only ever given to the spine and head.
    """
    scores = _relative(combined_score(armature))
    shape = anatomy(armature)
    chosen = {
        bone: (human, float(scores[bone, human]))
        for bone, human in _map_trunk(shape.trunk, scores).items()
    }
    free_spine = [human for human in SPINE if human not in {pair[0] for pair in chosen.values()}]
    limbs = list(shape.limbs)
    # In a creature without sides a single bone is a joint between two chains and has no head.
    if free_spine and (len(shape.trunk) > 1 or (shape.trunk and shape.has_sides)):
        head = _limb_that_continues(armature, shape, limbs, scores[:, free_spine[-1]])
        if head is not None:
            bone, human = head.bones[0], free_spine[-1]
            chosen[bone] = (human, float(scores[bone, human]))
            limbs.remove(head)
    if shape.has_sides:
        limbs = [limb for limb in limbs if limb.side]
    chosen.update(_map_limbs(limbs, scores, arms_first=not shape.has_sides))
    return Proposal(
        armature,
        "fk",
        tuple(Pair(bone, human, score) for bone, (human, score) in sorted(chosen.items())),
    )


def _relative(scores: Floats) -> Floats:
    """Each row as a share of its best: similarity fades away from the hubs, choices do not."""
    best = scores.max(axis=1, keepdims=True)
    return np.asarray(scores / np.where(best > 0, best, 1.0))


def _map_trunk(trunk: Sequence[int], scores: Floats) -> dict[int, int]:
    """Order-preserving pairs of trunk and spine bones with the greatest sum of scores."""
    best: dict[tuple[int, int], tuple[float, tuple[tuple[int, int], ...]]] = {}
    rows, columns = len(trunk), len(SPINE)
    for row in range(rows + 1):
        for column in range(columns + 1):
            if row == 0 or column == 0:
                best[row, column] = (0.0, ())
                continue
            bone, human = trunk[row - 1], SPINE[column - 1]
            before, pairs = best[row - 1, column - 1]
            # A pair is always better than none: a trunk bone without one moves nothing.
            paired = (before + scores[bone, human] + 1.0, (*pairs, (bone, human)))
            best[row, column] = max(
                paired, best[row - 1, column], best[row, column - 1], key=lambda item: item[0]
            )
    return dict(best[rows, columns][1])


def _limb_that_continues(
    armature: Armature, shape: Anatomy, limbs: Iterable[Limb], scores: Floats
) -> Limb | None:
    """Of the limbs in the middle, the one that goes on where the trunk was going: the head."""
    positions, _ = armature.rest
    trunk_start, trunk_end = positions[shape.trunk[0]], positions[shape.trunk[-1]]
    candidates = [limb for limb in limbs if not limb.side]
    if not candidates:
        return None

    def merit(limb: Limb) -> float:
        start, end = positions[limb.bones[0]], armature.rest_tips[limb.bones[-1]]
        return float(scores[limb.bones[0]]) + _cosine(trunk_end - trunk_start, end - start)

    return max(candidates, key=merit)


def _cosine(a: Floats, b: Floats) -> float:
    length = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / length if length > 1e-9 else 0.0


def _affinity(limb: Limb, human: HumanLimb, scores: Floats) -> float:
    """Mean score of the two limbs laid side by side from the body; -inf across sides."""
    if limb.side and limb.side != human.side:
        return -np.inf
    steps = min(len(limb.bones), len(human.bones))
    aligned = scores[limb.bones[:steps], human.bones[:steps]]
    return float(aligned.mean()) + human.preference


def _map_limbs(
    limbs: Sequence[Limb], scores: Floats, *, arms_first: bool
) -> dict[int, tuple[int, float]]:
    """For each mapped bone its human bone, and how well the two limbs run side by side (0..1)."""
    chosen: dict[int, tuple[int, float]] = {}
    free = list(HUMAN_LIMBS)
    waiting = list(limbs)
    while waiting and free:
        affinity = np.array(
            [[_affinity(limb, human, scores) for human in free] for limb in waiting]
        )
        # A finite, prohibitive cost keeps the problem solvable when sides leave no partner.
        cost = np.where(np.isfinite(affinity), -affinity, 1e6)
        if arms_first:  # without sides nothing says leg, and hands are easier to play with
            cost -= [float(human.is_arm) for human in free]
        pairs = [
            (waiting[row], free[column], min(float(affinity[row, column]), 1.0))
            for row, column in zip(*linear_sum_assignment(cost), strict=True)
            if np.isfinite(affinity[row, column])
        ]
        if not pairs:
            break
        rest = []
        for _, human, _ in pairs:
            free.remove(human)
        for limb, human, score in pairs:
            room = len(human.preferred)
            # What is too long for one arm goes on in the other, if that is free and it may be on
            # either side. Else its bones share the arm evenly, and those between follow.
            goes_on = not limb.side and any(other.is_arm for other in free)
            if goes_on and len(limb.bones) > room:
                bones = limb.bones[-room:]
                rest.append(Limb(limb.bones[:-room], limb.side))
            else:
                count = min(room, len(limb.bones))
                picks = np.linspace(0, len(limb.bones) - 1, count).round().astype(int)
                bones = tuple(limb.bones[pick] for pick in picks)
            for bone, place in zip(bones, human.preferred[len(bones) - 1], strict=True):
                chosen[bone] = (human.bones[place], score)
        waiting = rest
    return chosen
