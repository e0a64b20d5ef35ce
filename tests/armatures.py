"""Armatures for tests: from a table of parents, or random ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.kernel import Floats


def armature_of(parents: Mapping[str, str], name: str = "test", seed: int = 0) -> Armature:
    """An armature with these bones (bone -> parent, "" for the root), of random shape."""
    names = list(parents)
    rng = np.random.default_rng(seed)
    return Armature.build(
        name,
        names,
        [names.index(parents[bone]) if parents[bone] else -1 for bone in names],
        rng.normal(size=(len(names), 3)) * 0.2,
        _unit(rng.normal(size=(len(names), 4))),
    )


def _unit(quaternions: Floats) -> Floats:
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True))


@st.composite
def armatures(draw: st.DrawFn, most: int = 25) -> Armature:
    """Random trees with random rest poses."""
    count = draw(st.integers(1, most))
    parents = [-1] + [draw(st.integers(0, bone - 1)) for bone in range(1, count)]
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return Armature.build(
        "random",
        [f"b{bone}" for bone in range(count)],
        parents,
        rng.normal(size=(count, 3)),
        _unit(rng.normal(size=(count, 4))),
    )


@st.composite
def quaternions(draw: st.DrawFn) -> Floats:
    """Random rotations, uniform on the sphere."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return _unit(rng.normal(size=4))
