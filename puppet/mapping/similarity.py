"""Node-edge similarity of two hierarchies (Sanna 2015, section 3.2, after Zager 2005).

Two bones are alike when their parents, their children and the numbers of both are alike. The
paper writes one step of the iteration as a product of Kronecker matrices; here the same step is
``X <- A X Bᵀ + Aᵀ X B + D_out X D_out + D_in X D_in``, and since every bone has at most one
parent, the two products are walks from parents to children: no matrix is built.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from puppet.kernel import Floats, Ints, kernel

#: The paper's 11 iterations each update edges from nodes and nodes from edges; that is two
#: applications of the one-sided step. 22 reproduce the printed digits of Figure A.1, 11 do not.
APPLICATIONS: Final = 22


@kernel
def _iterate(a_parents: Ints, b_parents: Ints, applications: int) -> Floats:
    n, m = len(a_parents), len(b_parents)
    a_children, b_children = np.zeros(n), np.zeros(m)
    for i in range(n):
        if a_parents[i] >= 0:
            a_children[a_parents[i]] += 1.0
    for j in range(m):
        if b_parents[j] >= 0:
            b_children[b_parents[j]] += 1.0
    x = np.ones((n, m))
    for _ in range(applications):
        y = np.empty((n, m))
        for i in range(n):
            for j in range(m):
                both_have_parents = 1.0 if a_parents[i] >= 0 and b_parents[j] >= 0 else 0.0
                y[i, j] = x[i, j] * (a_children[i] * b_children[j] + both_have_parents)
        for i in range(n):
            p = a_parents[i]
            if p < 0:
                continue
            for j in range(m):
                q = b_parents[j]
                if q >= 0:
                    y[i, j] += x[p, q]  # Aᵀ X B: a pair is as alike as its parents are
                    y[p, q] += x[i, j]  # A X Bᵀ: and as its children are
        total = 0.0
        for i in range(n):
            for j in range(m):
                total += y[i, j] * y[i, j]
        scale = 1.0 / math.sqrt(total) if total > 0.0 else 0.0
        for i in range(n):
            for j in range(m):
                x[i, j] = y[i, j] * scale
    return x


def similarity(
    a_parents: Sequence[int] | Ints,
    b_parents: Sequence[int] | Ints,
    applications: int = APPLICATIONS,
) -> Floats:
    """How alike each bone of A is to each bone of B, by the shape of the hierarchies alone.

    a_parents: (n,), b_parents: (m,) index of each bone's parent, -1 for a root.
    Returns (n, m), not negative, of Frobenius norm 1 (0 where neither hierarchy has an edge).
    """
    return _iterate(np.array(a_parents, np.int32), np.array(b_parents, np.int32), applications)
