"""FK mapping: which human bone turns which bone of an armature (Sanna 2015, section 3).

The paper fills one score matrix and runs the Hungarian algorithm over bones, then preferences
pull the pairs along the limbs, then the Hungarian runs again. Here the same scores decide between
whole limbs first, so that a chain cannot be torn over several human limbs and its order cannot be
lost; the preferences then choose the bones inside each limb.

1. Limbs to human limbs: the k best assignments (`puppet.mapping.ranking`).
2. Inside a limb: the bones that a puppeteer would use, in order (section 3.7).
3. Trunk to spine.
4. If it is wished, the Hungarian algorithm once more over what is left.

What the operator decided holds in every step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Final

import numpy as np

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.mapping.alignment import aligned, overlap
from puppet.mapping.decisions import Act
from puppet.mapping.evidence import Evidence, gather
from puppet.mapping.human import (
    HUMAN,
    HUMAN_LIMBS,
    LIMB_NAMES,
    LIMB_OF_BONE,
    SPINE,
    WHOLE_LIMBS,
)
from puppet.mapping.limb_choice import LimbChoice, choices
from puppet.mapping.pair_reasons import Reasoning
from puppet.mapping.proposal import Proposal
from puppet.mapping.ranking import Assignment, hungarian, whole_first
from puppet.mapping.verdicts import Verdicts
from puppet.skeleton import HUMAN_BONE_NAMES

_HEAD: Final = LIMB_NAMES.index("head")
_LEGS: Final = tuple(i for i, limb in enumerate(HUMAN_LIMBS) if limb.is_leg)
_ARMS: Final = tuple(i for i, limb in enumerate(HUMAN_LIMBS) if limb.is_arm)
#: More than any sum of worths: a pair that the operator kept.
_KEPT: Final = 100.0


def propose_forward(
    source: Armature | Evidence, verdicts: Verdicts | None = None, k: int = 1
) -> list[Proposal]:
    """The k best FK mappings of an armature, best first; fewer if there are no more.

    What merely leaves a limb out that could be driven comes after all that does not. Bones that get
    no partner follow their parents. Give the `Evidence` instead of the armature to propose again in
    a moment.
    """
    evidence = source if isinstance(source, Evidence) else gather(source)
    verdicts = verdicts or Verdicts()
    limbs = choices(evidence, verdicts)
    found: dict[tuple[tuple[int, int], ...], Proposal] = {}
    # Two assignments of limbs may come to the same pairs of bones, where limbs were fully decided.
    ranked = whole_first(limbs.scores, limbs.allowed, hungarian)
    for merit, assignment in islice(ranked, 4 * k + 4):
        proposal = _Builder(evidence, verdicts, limbs, assignment).proposal(merit[0])
        found.setdefault(tuple((pair.bone, pair.human) for pair in proposal.pairs), proposal)
        if len(found) == k:
            break
    if not found:
        found[()] = _Builder(evidence, verdicts, limbs, ()).proposal(0.0)
    return list(found.values())


@dataclass
class _Builder:
    """One assignment of limbs, made into pairs of bones."""

    evidence: Evidence
    verdicts: Verdicts
    limbs: LimbChoice
    assignment: Assignment
    chosen: dict[int, tuple[int, Reasoning]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.armature = self.evidence.armature
        self.turns = [movement == "turn" for movement in self.armature.movements]
        index = self.armature.index
        self.kept: dict[int, tuple[int, Act]] = {
            index(bone): (HUMAN_BONE_NAMES.index(human), act)
            for bone, (human, act) in self.verdicts.kept_in("fk").items()
        }
        self.banned: dict[tuple[int, int], Act] = {
            (index(bone), HUMAN_BONE_NAMES.index(human)): act
            for (bone, human), act in self.verdicts.banned_in("fk").items()
            if human not in WHOLE_LIMBS
        }
        # What was decided of whole limbs: where they go, and where they may not.
        whole = {row: column for row, (column, _) in self.limbs.whole.items()}
        self.assignment = tuple(sorted({**dict(self.assignment), **whole}.items()))
        rows = self.evidence.row_of_bone
        self.closed = {
            (rows[index(bone)], LIMB_NAMES.index(human))
            for bone, human in self.verdicts.banned_in("fk")
            if human in WHOLE_LIMBS and index(bone) in rows
        }
        self.left_out = {
            bone
            for column, limb in enumerate(HUMAN_LIMBS)
            if limb.name in self.evidence.preferences.leave_out and column not in whole.values()
            for bone in limb.bones
        }

    def proposal(self, merit: float) -> Proposal:
        self._map_spine()
        # What was said of whole limbs comes first, where bones were given parts of the same one.
        whole_first = sorted(self.assignment, key=lambda pair: pair[0] not in self.limbs.whole)
        for row, column in whole_first:
            if column != _HEAD:
                self._map_limb(row, column)
        if self.evidence.preferences.leftovers:
            self._map_leftovers()
        self._keep_what_was_kept()
        armature = self.armature
        pairs = tuple(
            why.pair(
                armature.names[bone],
                (bone,),
                human,
                self._decided(bone, human),
                {other for other in range(len(HUMAN)) if not self._allowed(bone, other)},
            )
            for bone, (human, why) in sorted(self.chosen.items())
        )
        unmapped = tuple(
            name for bone, name in enumerate(armature.names) if bone not in self.chosen
        )
        follows = tuple(
            (bone, float(share))
            for bone, share in enumerate(self.evidence.follows)
            if share and bone not in self.chosen
        )
        return Proposal(armature, "fk", pairs, unmapped, merit, follows=follows)

    def _possible(self, bone: int, human: int) -> bool:
        """Whether the pair may be proposed: it can move, and nobody decided otherwise."""
        if bone in self.kept:
            return self.kept[bone][0] == human
        if not self.turns[bone] or not self._allowed(bone, human):
            return False
        whole = self.limbs.whole.get(self.evidence.row_of_bone.get(bone, -1))
        if whole is not None and LIMB_OF_BONE.get(human) != whole[0]:
            return False
        return all(human != kept or act == "set" for kept, act in self.kept.values())

    def _allowed(self, bone: int, human: int) -> bool:
        """Whether nobody ruled the pair out, by itself or with its limbs."""
        if human in self.left_out or (bone, human) in self.banned:
            return False
        limb = (self.evidence.row_of_bone.get(bone), LIMB_OF_BONE.get(human))
        return limb not in self.closed

    def _decided(self, bone: int, human: int) -> str:
        """The operator's word on a pair, or on the limbs that it belongs to."""
        if bone in self.kept:
            return self.kept[bone][1]
        column, act = self.limbs.whole.get(self.evidence.row_of_bone.get(bone, -1), (-1, ""))
        return act if LIMB_OF_BONE.get(human) == column else ""

    def _worth(self, bone: int, human: int, worth: float) -> float:
        if not self._possible(bone, human):
            return -np.inf
        return worth + (_KEPT if bone in self.kept else 0.0)

    def _map_limb(self, row: int, column: int) -> None:
        """The bones of one limb to those of the human limb that drives it."""
        limb, human = self.evidence.limbs[row], HUMAN_LIMBS[column]
        bones = [bone for bone in limb.bones if bone not in self.chosen]
        playable = human.bones if self.evidence.preferences.shoulders else human.playable
        if row not in self.limbs.whole or self.limbs.whole[row][1] != "set":
            taken = {its for its, _ in self.chosen.values()}
            playable = tuple(its for its in playable if its not in taken)
        if not bones or not playable:
            return
        if len(bones) == 1:
            wanted = human.playable[human.alone]
            pairs = aligned(
                bones, playable, lambda bone, h: self._worth(bone, h, 1.0 + (h == wanted))
            )
        else:
            beside = self._beside(bones, playable)
            pairs = aligned(bones, playable, lambda bone, h: self._worth(bone, h, beside[bone, h]))
        why = self.limbs.reasoning(row, column)
        for bone, bone_human in pairs:
            self.chosen[bone] = (bone_human, why)

    def _beside(self, bones: Sequence[int], humans: Sequence[int]) -> dict[tuple[int, int], float]:
        """How well each bone of a limb lies beside each of the human limb, from body to tip.

        Where there are more bones than the human has, those between follow; the tip goes with the
        tip, and the first is taken for a shoulder, which is used last (section 3.7).
        """
        lengths = _lengths(self.armature, bones)
        shares = overlap(lengths, _lengths(HUMAN, humans))
        long = lengths / max(float(lengths.sum()), 1e-12)
        # Every pair counts 1 in itself: a bone that nothing drives is worse than one that lies
        # a little off. Of too many bones, the long ones are those that are seen to turn.
        worth = {
            (bone, human): 1.0 + float(shares[row, column] + 0.8 * long[row])
            for row, bone in enumerate(bones)
            for column, human in enumerate(humans)
        }
        if len(bones) > len(humans):
            worth[bones[-1], humans[-1]] += 0.2
            for human in humans:
                worth[bones[0], human] -= 0.03
        return worth

    def _map_spine(self) -> None:
        """Trunk and head: pelvis where the legs hang, chest where the arms do, head at the end.

        A trunk of no more bones than the spine lies on it bone by bone, as the dog's does in
        figure 5, whose own head then stays unmapped; unless the head has a neck, and so is a chain
        of its own.
        """
        shape = self.evidence.shape
        head = next((row for row, column in self.assignment if column == _HEAD), None)
        legs = self._hubs(_LEGS)
        trunk = list(shape.trunk)
        if legs:
            # What carries the legs is the pelvis; what carries that only marks a place.
            depth = min(int(self.armature.depths[hub]) for hub in legs)
            trunk = [bone for bone in trunk if self.armature.depths[bone] >= depth]
        chain = list(self.evidence.limbs[head].bones) if head is not None else []
        needs_head = bool(chain) and (len(chain) > 1 or len(trunk) != len(SPINE))
        if len(trunk) <= (2 if needs_head else len(SPINE)):
            humans = SPINE[:2] if needs_head else SPINE
            scores = self.evidence.bone_scores
            # A pair is always better than none: a trunk bone without one moves nothing.
            pairs = aligned(trunk, humans, lambda b, h: self._worth(b, h, 1.0 + scores[b, h]))
        else:
            pairs = self._long_trunk(trunk, chain)
        for bone, human in pairs:
            self.chosen[bone] = (human, self.limbs.spine_reasoning(bone, human))
        if head is None or not chain:
            return
        why = self.limbs.reasoning(head, _HEAD)
        taken = {human for human, _ in self.chosen.values()}
        needs_chest = SPINE[1] not in taken and len(chain) > 2 and shape.has_sides
        if needs_chest and self._possible(chain[0], SPINE[1]):
            self.chosen[chain[0]] = (SPINE[1], why)
        if SPINE[2] not in taken:
            last = [bone for bone in reversed(chain) if self._possible(bone, SPINE[2])]
            if last:
                self.chosen[last[0]] = (SPINE[2], why)

    def _long_trunk(self, trunk: list[int], chain: list[int]) -> list[tuple[int, int]]:
        """Pelvis, chest and, where no limb is the head, head, on a trunk with more bones."""
        arms = [hub for hub in self._hubs(_ARMS) if hub in trunk[1:]]
        chest = max(arms, key=trunk.index) if arms else trunk[-1 if chain else len(trunk) // 2]
        wanted = {(trunk[0], SPINE[0]): 1.0, (chest, SPINE[1]): 1.0}
        humans = SPINE[:2] if chain else SPINE
        if not chain and trunk[-1] != chest:
            wanted[trunk[-1], SPINE[2]] = 1.0
        scores = self.evidence.bone_scores
        return aligned(
            trunk,
            humans,
            lambda b, h: self._worth(b, h, 1e-3 + scores[b, h] + 3.0 * wanted.get((b, h), 0.0)),
        )

    def _hubs(self, columns: Sequence[int]) -> list[int]:
        """The bones that the limbs driven by these human limbs hang on."""
        limbs = [self.evidence.limbs[row] for row, column in self.assignment if column in columns]
        return [limb.hub for limb in limbs if limb.hub >= 0]

    def _map_leftovers(self) -> None:
        """The Hungarian algorithm over what is left (figure 1, the last block)."""
        bones = [b for b in range(len(self.armature)) if b not in self.chosen and self.turns[b]]
        taken = {human for human, _ in self.chosen.values()}
        humans = [human for human in range(len(HUMAN)) if human not in taken]
        if not self.evidence.preferences.shoulders:
            humans = [h for h in humans if not HUMAN_BONE_NAMES[h].startswith("shoulder")]
        if not bones or not humans:
            return
        sides = self.evidence.shape.sides
        possible = np.array(
            [
                [
                    self._possible(bone, human)
                    and (not sides[bone] or HUMAN.sides[human] in ("", sides[bone]))
                    for human in humans
                ]
                for bone in bones
            ]
        )
        scores = self.evidence.bone_scores[np.ix_(bones, humans)]
        for row, column in hungarian(scores, possible):
            bone, human = bones[row], humans[column]
            self.chosen[bone] = (human, self.limbs.spine_reasoning(bone, human))

    def _keep_what_was_kept(self) -> None:
        for bone, (human, act) in self.kept.items():
            if self.chosen.get(bone, (-1,))[0] == human:
                continue
            if act != "set":
                taken = [b for b, (h, _) in self.chosen.items() if h == human]
                for other in taken:
                    if other not in self.kept:  # what was set by hand shares it
                        del self.chosen[other]
            self.chosen[bone] = (human, self.limbs.spine_reasoning(bone, human))


def _lengths(armature: Armature, bones: Sequence[int]) -> Floats:
    return np.asarray(np.linalg.norm(armature.tips[list(bones)], axis=1))
