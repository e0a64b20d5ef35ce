"""The blocks of the FK score matrix (Sanna 2015, figure 1): each from an armature to one matrix.

Every matrix is (B, 17): a row for each bone of the armature, a column for each human bone in the
order of `puppet.skeleton.HUMAN_BONES`.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from puppet.armature import Armature, side_of
from puppet.kernel import Floats, frozen
from puppet.mapping.similarity import similarity
from puppet.skeleton import HUMAN_BONE_NAMES, HUMAN_PARENTS

HUMAN_SIDES: Final = tuple(side_of(name) for name in HUMAN_BONE_NAMES)


def _depths() -> Floats:
    depths = np.zeros(len(HUMAN_PARENTS))
    for bone, parent in enumerate(HUMAN_PARENTS):
        if parent >= 0:
            depths[bone] = depths[parent] + 1
    return frozen(depths)


HUMAN_DEPTHS: Final = _depths()


def similarity_block(armature: Armature) -> Floats:
    """Node-edge similarity to the human graph, section 3.2; figure A.1 on the left."""
    return similarity(armature.parents, HUMAN_PARENTS)


def path_block(armature: Armature) -> Floats:
    """Length of paths, section 3.4: a factor that doubles with each step the two have in common.

    Similarity fades away from the hubs of the graphs; this makes up for it, and more so for bones
    at the same depth of their chains.
    """
    common = np.minimum.outer(armature.depths.astype(float), HUMAN_DEPTHS)
    return np.asarray(2.0 ** (common - 1.0))


def symmetry_block(armature: Armature) -> Floats:
    """Symmetry, section 3.5: 0 across sides, 2 on the same side, 1 between side and middle.

    In an armature that has no sides at all the middle means nothing, and everything counts 1.
    """
    sides = armature.sides
    if not any(sides):
        return np.ones((len(sides), len(HUMAN_SIDES)))
    block = np.empty((len(sides), len(HUMAN_SIDES)))
    for bone, side in enumerate(sides):
        for human, human_side in enumerate(HUMAN_SIDES):
            if side == human_side:
                block[bone, human] = 2.0
            else:
                block[bone, human] = 0.0 if side and human_side else 1.0
    return block


def combined_score(armature: Armature) -> Floats:
    """Symmetry × path × similarity; figure A.3 on the left, as far as its digits can be read."""
    return 0.5 * symmetry_block(armature) * path_block(armature) * similarity_block(armature)
