"""What speaks for each limb of an armature being driven by each limb of the performer.

The blocks of Sanna 2015 score bones; here they are laid along whole limbs, and joined by what the
paper leaves to the eye: how long the limbs are, where on the trunk they hang and where they point.
Everything is a contribution to one score in 0..1, so that a pair can be explained by adding up.
Nothing depends on the order or the names of bones, on size, place or direction of the armature.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from puppet.armature import Armature
from puppet.kernel import Floats, frozen
from puppet.mapping.anatomy import Anatomy, Limb, anatomy, limb_rows
from puppet.mapping.blocks import constraints_of, path_block, similarity_block, symmetry_block
from puppet.mapping.body_axis import body_axis, cosine, forwardness, way_of
from puppet.mapping.human import HUMAN, HUMAN_LIMBS, HumanLimb
from puppet.mapping.preferences import Preferences

#: The blocks in the order of figure 1; geometry stands where the paper has the eye.
PARTS: Final = ("similarity", "path", "symmetry", "constraint", "geometry", "preference")
#: How much the paper's blocks, geometry, and preferences can contribute together.
TOPOLOGY, GEOMETRY, PREFERENCE = 0.25, 0.65, 0.1
#: What a limb in the middle loses on an arm, in a body with sides.
MIDDLE: Final = 0.12
#: What decides between limbs that are equal otherwise: the longer ones.
_EQUAL: Final = 1e-4
#: What a tongue or an ear loses, so that it is looked at last.
_TWIG: Final = 0.3
#: Head and hands.
_UPPER: Final = 3


@dataclass(frozen=True, eq=False)
class Evidence:
    """Worked out once for an armature; decisions do not change it.

    limbs: the rows; for an armature that is one long chain, its pieces from the tip inwards.
    bones: (6, B, 17) contribution of each part to each pair of bones, parts as in `PARTS`.
    parts: (6, L, 5) the same for each pair of limbs, columns as `HUMAN_LIMBS`.
    allowed: (L, 5) whether the pair is possible at all.
    follows: (B,) the share of its parent's turn that each bone repeats when nothing drives it.
    """

    armature: Armature
    shape: Anatomy
    preferences: Preferences
    limbs: tuple[Limb, ...]
    bones: Floats
    parts: Floats
    allowed: np.ndarray
    follows: Floats

    @cached_property
    def row_of_bone(self) -> dict[int, int]:
        """For each bone of a limb, and each that branches off one, the row of that limb."""
        return limb_rows(self.armature, self.limbs)

    @property
    def scores(self) -> Floats:
        """(L, 5) the sum of the parts, 0..1."""
        return np.asarray(np.clip(self.parts.sum(axis=0), 0.0, 1.0))

    @property
    def bone_scores(self) -> Floats:
        """(B, 17) the sum of the parts over bones, 0..1."""
        return np.asarray(np.clip(self.bones.sum(axis=0), 0.0, 1.0))


def gather(
    armature: Armature,
    preferences: Preferences | None = None,
    follows: ArrayLike | None = None,
    *,
    pieces: bool = True,
) -> Evidence:
    """Everything that speaks for or against each pair.

    follows: (B,) as in `Evidence`, none by default.
    pieces: whether a chain without a trunk is cut into pieces that two arms can share (FK).
    """
    preferences = preferences or Preferences()
    shape = anatomy(armature)
    limbs = shape.pieces if pieces else shape.limbs
    bones = _over_bones(armature)
    parts = np.zeros((len(PARTS), len(limbs), len(HUMAN_LIMBS)))
    for row, limb in enumerate(limbs):
        for column, human in enumerate(HUMAN_LIMBS):
            steps = min(len(limb.bones), len(human.bones))
            aligned = bones[:, limb.bones[:steps], human.bones[:steps]]
            parts[:, row, column] = aligned.mean(axis=1)
    allowed = _allowed(armature, shape, limbs, preferences)
    parts *= _evened(parts.sum(axis=0), allowed)
    parts[PARTS.index("geometry")] = GEOMETRY * _geometry(armature, shape, limbs)
    if shape.has_sides:
        # A hand has a side; what hangs in the middle takes it only if nothing at the sides does.
        middle = [not limb.side for limb in limbs]
        arms = [human.is_arm for human in HUMAN_LIMBS]
        parts[PARTS.index("symmetry")] -= MIDDLE * np.outer(middle, arms)
    parts[PARTS.index("preference")] = PREFERENCE * _preference(limbs, preferences)
    return Evidence(
        armature,
        shape,
        preferences,
        tuple(limbs),
        # Sums in another order differ in their last digits; that must not decide between equals.
        frozen(np.round(bones, 9)),
        frozen(np.round(parts, 9)),
        allowed,
        frozen(np.zeros(len(armature)) if follows is None else follows),
    )


def _over_bones(armature: Armature) -> Floats:
    """(6, B, 17): the paper's blocks one after the other, each as what it adds to the score.

    Rows are taken relative to their best: similarity fades away from the hubs, choices do not.
    """
    alike = similarity_block(armature, HUMAN)
    steps = [alike]
    steps.append(steps[-1] * path_block(armature, HUMAN))
    steps.append(steps[-1] * 0.5 * symmetry_block(armature, HUMAN))
    steps.append(np.maximum(steps[-1] + constraints_of(alike, armature, HUMAN), 0.0))
    parts = np.zeros((len(PARTS), len(armature), len(HUMAN)))
    before = np.zeros_like(alike)
    for index, step in enumerate(steps):
        now = TOPOLOGY * _relative(step)
        parts[index] = now - before
        before = now
    return parts


def _relative(scores: Floats) -> Floats:
    best = scores.max(axis=1, keepdims=True)
    return np.asarray(scores / np.where(best > 0, best, 1.0))


def _evened(scores: Floats, allowed: np.ndarray) -> Floats:
    """(L, 5) factors that make each human limb's best partner count as much as any other's.

    A hierarchy with one bone more at its root is less like the human's everywhere, but most of all
    at the legs; without this every limb would seem to be an arm.
    """
    best = np.where(allowed, scores, 0.0).max(axis=0, initial=0.0)
    by_column = TOPOLOGY * scores / np.where(best > 1e-9, best, 1.0)
    evened = np.sqrt(np.maximum(scores * by_column, 0.0))
    return np.clip(np.where(scores > 1e-9, evened / np.maximum(scores, 1e-9), 1.0), 0.5, 2.0)


def _geometry(armature: Armature, shape: Anatomy, limbs: Sequence[Limb]) -> Floats:
    """(L, 5) in 0..1: lengths, the place on the trunk, and for the head the direction."""
    longest = max((limb.reach for limb in limbs), default=0.0)
    axis = body_axis(armature, shape)
    ahead = forwardness(armature, shape, limbs, axis)
    scores = np.zeros((len(limbs), len(HUMAN_LIMBS)))
    for row, limb in enumerate(limbs):
        reach = limb.reach / longest if longest > 0 else 0.5
        for column, human in enumerate(HUMAN_LIMBS):
            cover = min(len(limb.bones) / len(human.playable), 1.0)
            if human.is_arm:
                parts = (0.3 * cover, 0.3 * min(reach / 0.8, 1.0), 0.4 * ahead[row])
            elif human.is_leg:
                parts = (0.3 * cover, 0.3 * reach, 0.4 * (1.0 - ahead[row]))
            else:
                onwards = 0.5 if axis is None else 0.5 + 0.5 * cosine(way_of(armature, limb), axis)
                parts = (0.2 * cover, 0.4 * ahead[row], 0.4 * onwards)
            # Of limbs that are as good in all that, left and right must be a pair.
            scores[row, column] = sum(parts) - _EQUAL * (1.0 - reach) - _TWIG * limb.is_twig
    return scores


def _preference(limbs: Sequence[Limb], preferences: Preferences) -> Floats:
    """(L, 5) in 0..1: arms before legs, and the leading hand for what reaches furthest.

    "Arms are selected here, since their preferences score is the highest one" (section 4).
    """
    longest = max((limb.reach for limb in limbs), default=0.0)
    scores = np.zeros((len(limbs), len(HUMAN_LIMBS)))
    for row, limb in enumerate(limbs):
        for column, human in enumerate(HUMAN_LIMBS):
            if not human.is_arm:
                continue
            scores[row, column] = 0.8
            if not limb.side and human.side == preferences.hand:
                share = limb.reach / longest if longest > 0 else len(limb.bones) / 100.0
                scores[row, column] += 0.1 + 0.1 * min(share, 1.0) - 0.01 * row
    return scores


def _allowed(
    armature: Armature, shape: Anatomy, limbs: Sequence[Limb], preferences: Preferences
) -> np.ndarray:
    """(L, 5): never across sides, never what was left out, never what cannot turn.

    In a body with sides the legs are for limbs at the sides: what hangs in the middle, as a tail
    or a crest, is not stood upon. In one without, nothing says leg: it is played with the hands
    and the head, as long as these suffice.
    """
    allowed = np.zeros((len(limbs), len(HUMAN_LIMBS)), bool)
    turns = [movement == "turn" for movement in armature.movements]
    real = [limb for limb in limbs if not limb.is_twig]
    legs_too = not shape.has_sides and len(real) > _UPPER
    for row, limb in enumerate(limbs):
        for column, human in enumerate(HUMAN_LIMBS):
            allowed[row, column] = (
                human.name not in preferences.leave_out
                and any(turns[bone] for bone in limb.bones)
                and _sides_agree(limb, human, legs_for_the_middle=legs_too)
            )
    return allowed


def _sides_agree(limb: Limb, human: HumanLimb, *, legs_for_the_middle: bool) -> bool:
    if limb.side:
        return limb.side == human.side
    return legs_for_the_middle or not human.is_leg
