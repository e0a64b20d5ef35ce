"""Node-edge similarity against the paper's printed matrix, and against its Kronecker form."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from puppet.mapping.similarity import similarity
from puppet.skeleton import HUMAN_BONE_NAMES, HUMAN_PARENTS

#: Cells that the facts file calls truncated, and one that was printed with two digits only.
TRUNCATED = {(0, 0): 0.009, (1, 11): 0.0015, (1, 14): 0.0015, (1, 0): 0.005}


@st.composite
def trees(draw: st.DrawFn) -> list[int]:
    count = draw(st.integers(2, 12))
    return [-1] + [draw(st.integers(0, bone - 1)) for bone in range(1, count)]


def kronecker(a: list[int], b: list[int], applications: int) -> np.ndarray:
    """The paper's equation 1, word for word."""

    def adjacency(parents: list[int]) -> np.ndarray:
        matrix = np.zeros((len(parents), len(parents)))
        for bone, parent in enumerate(parents):
            if parent >= 0:
                matrix[parent, bone] = 1.0
        return matrix

    m, n = adjacency(a), adjacency(b)
    step = (
        np.kron(m, n)
        + np.kron(m.T, n.T)
        + np.kron(np.diag(m.sum(1)), np.diag(n.sum(1)))
        + np.kron(np.diag(m.sum(0)), np.diag(n.sum(0)))
    )
    x = np.ones(len(a) * len(b))
    for _ in range(applications):
        x = step @ x
        x /= np.linalg.norm(x)
    return x.reshape(len(a), len(b))


def test_the_fish_gives_the_printed_matrix(fish_facts: dict[str, Any]) -> None:
    facts = fish_facts["similarity"]
    assert tuple(fish_facts["human_bones"]) == HUMAN_BONE_NAMES
    assert tuple(fish_facts["human_parents"]) == HUMAN_PARENTS
    x = similarity(fish_facts["fish_parents"], HUMAN_PARENTS, facts["applications"])
    printed = np.zeros_like(x)
    for cell, value in facts["printed"].items():
        row, column = map(int, cell.split(","))
        printed[row, column] = value
    allowed = np.full_like(x, facts["tolerance"])
    for place, tolerance in TRUNCATED.items():
        allowed[place] = tolerance
    assert (np.abs(x - printed) <= allowed).all()


@given(trees(), trees(), st.integers(1, 22))
def test_walking_parents_equals_the_kronecker_form(
    a: list[int], b: list[int], applications: int
) -> None:
    np.testing.assert_allclose(
        similarity(a, b, applications), kronecker(a, b, applications), atol=1e-12
    )


@given(trees())
def test_a_hierarchy_is_as_alike_to_another_as_that_is_to_it(a: list[int]) -> None:
    np.testing.assert_allclose(
        similarity(a, HUMAN_PARENTS), similarity(HUMAN_PARENTS, a).T, atol=1e-12
    )


def test_single_bones_are_not_alike_in_any_way() -> None:
    assert similarity([-1], [-1]) == 0.0
