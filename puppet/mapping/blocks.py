"""The blocks of the FK score matrix (Sanna 2015, figure 1): each from two armatures to one matrix.

Every matrix is (B, H): a row for each bone of the armature, a column for each bone of the other,
which is the human (`puppet.mapping.human.HUMAN`, H = 17) unless somebody compares two puppets.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.mapping.similarity import similarity
from puppet.mapping.symmetry import sides_of

#: What a pair scores that can never be: one turns, and the other slides or is fixed.
NEVER: Final = -1.0


def similarity_block(armature: Armature, human: Armature) -> Floats:
    """Node-edge similarity, section 3.2; figure A.1 on the left. (B, H), 0 or more."""
    return similarity(armature.parents, human.parents)


def constraint_block(armature: Armature, human: Armature) -> Floats:
    """Motion constraints, section 3.3; figure A.1 on the right. (B, H), 0 or less.

    A third of the pair's similarity is taken away for each degree of freedom that one of the two
    has more than the other; for the fish this gives the one penalty that is printed. A bone that
    turns freely can follow anything and is not penalised. Where one turns and the other slides or
    is fixed, the pair gets `NEVER`.
    """
    return constraints_of(similarity_block(armature, human), armature, human)


def constraints_of(alike: Floats, armature: Armature, human: Armature) -> Floats:
    """`constraint_block` where the similarity is known already."""
    apart = np.abs(np.subtract.outer(armature.freedoms.astype(float), human.freedoms))
    free = np.isinf(armature.lower).all(axis=1) & np.isinf(armature.upper).all(axis=1)
    apart[free] = 0.0
    differ = np.not_equal.outer(np.array(armature.movements), np.array(human.movements))
    return np.where(differ, NEVER, -alike * apart / 3.0)


def path_block(armature: Armature, human: Armature) -> Floats:
    """Length of paths, section 3.4: a factor that doubles with each step the two have in common.

    Similarity fades away from the hubs of the graphs; this makes up for it, and more so for bones
    at the same depth of their chains. (B, H), 0.5 or more.
    """
    common = np.minimum.outer(armature.depths.astype(float), human.depths)
    return np.asarray(2.0 ** (common - 1.0))


def symmetry_block(armature: Armature, human: Armature) -> Floats:
    """Symmetry, section 3.5; figure A.2: 0 across sides, 2 on the same, 1 between side and middle.

    In an armature that has no sides at all the middle means nothing, and everything counts 1.
    """
    ours, theirs = np.array(sides_of(armature)), np.array(sides_of(human))
    if not (ours != "").any():
        return np.ones((len(ours), len(theirs)))
    same = np.equal.outer(ours, theirs)
    both_sided = np.logical_and.outer(ours != "", theirs != "")
    return np.where(same, 2.0, np.where(both_sided, 0.0, 1.0))


def combined_block(armature: Armature, human: Armature) -> Floats:
    """½ symmetry × path × similarity + constraint; figure A.3 on the left.

    The reading that gives the printed digits, as far as the scan can be read. (B, H)
    """
    product = (
        0.5
        * symmetry_block(armature, human)
        * path_block(armature, human)
        * similarity_block(armature, human)
    )
    constraint = constraint_block(armature, human)
    return np.where(constraint == NEVER, NEVER, product + constraint)


#: The blocks by the names under which `puppet map --matrix` shows them.
BLOCKS: Final[dict[str, Callable[[Armature, Armature], Floats]]] = {
    "similarity": similarity_block,
    "constraint": constraint_block,
    "path": path_block,
    "symmetry": symmetry_block,
    "combined": combined_block,
}
