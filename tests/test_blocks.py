"""The blocks of figure 1: their shapes, the printed matrices, and what can never be paired."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature, Movement
from puppet.mapping.blocks import (
    BLOCKS,
    NEVER,
    combined_block,
    constraint_block,
    path_block,
    similarity_block,
    symmetry_block,
)
from puppet.mapping.effectors import propose_effectors
from puppet.mapping.evidence import gather
from puppet.mapping.forward import propose_forward
from puppet.mapping.human import HUMAN
from puppet.mapping.preferences import Preferences
from puppet.mapping.verdicts import Verdicts
from puppet.skeleton import HUMAN_BONE_NAMES, HUMAN_PARENTS
from tests.armatures import armature_of, armatures
from tests.rig_changes import creatures, mirrored, reordered, shipped
from tests.test_similarity import kronecker

fish = pytest.fixture(lambda: shipped("fish").armature)


def rows_of(armature: Armature, facts: dict[str, Any]) -> list[int]:
    """The appendix counts the fish's bones in its own order."""
    return [armature.index(bone) for bone in facts["fish_bones"]]


# -- the appendix -----------------------------------------------------------------------------


def test_the_fish_is_the_one_of_the_appendix(fish: Armature, fish_facts: dict[str, Any]) -> None:
    told = reordered(fish, rows_of(fish, fish_facts))
    assert told.parents.tolist() == fish_facts["fish_parents"]
    assert tuple(fish_facts["human_bones"]) == HUMAN_BONE_NAMES
    assert tuple(fish_facts["human_parents"]) == HUMAN_PARENTS


def test_the_one_motion_constraint_that_is_printed_is_the_only_one(
    fish: Armature, fish_facts: dict[str, Any]
) -> None:
    found = constraint_block(fish, HUMAN)[rows_of(fish, fish_facts)]
    # Elsewhere a penalty is a third of a similarity that is printed as 0.
    alike = similarity_block(fish, HUMAN)[rows_of(fish, fish_facts)] > 0.0005
    expected = np.zeros_like(found)
    for cell, value in fish_facts["motion_constraint"].items():
        expected[tuple(map(int, cell.split(",")))] = value
    np.testing.assert_array_equal((found != 0.0) & alike, expected != 0.0)
    np.testing.assert_allclose(found, expected, atol=0.0015)


def test_the_combined_score_is_near_the_printed_one(
    fish: Armature, fish_facts: dict[str, Any]
) -> None:
    scores = combined_block(fish, HUMAN)[rows_of(fish, fish_facts)]
    for cell, value in fish_facts["combined"]["printed"].items():
        row, column = map(int, cell.split(","))
        assert scores[row, column] == pytest.approx(value, rel=0.15, abs=0.0045), cell


def test_what_is_printed_as_zero_is_next_to_nothing(
    fish: Armature, fish_facts: dict[str, Any]
) -> None:
    scores = combined_block(fish, HUMAN)[rows_of(fish, fish_facts)]
    for cell in fish_facts["combined"]["printed"]:
        scores[tuple(map(int, cell.split(",")))] = 0.0
    assert np.abs(scores).max() < 0.02


# -- shapes and laws --------------------------------------------------------------------------


@given(armatures(), armatures())
def test_every_block_has_a_row_for_each_bone_and_a_column_for_each_of_the_other(
    one: Armature, other: Armature
) -> None:
    for name, block in BLOCKS.items():
        assert block(one, HUMAN).shape == (len(one), 17), name
        assert block(one, other).shape == (len(one), len(other)), name
        assert np.isfinite(block(one, other)).all(), name


@given(armatures(most=10), armatures(most=10))
def test_the_similarity_is_the_dense_iteration_of_the_paper(one: Armature, other: Armature) -> None:
    if len(one) == 1 or len(other) == 1:
        return  # Without an edge the paper divides by 0.
    dense = kronecker(one.parents.tolist(), other.parents.tolist(), 22)
    np.testing.assert_allclose(similarity_block(one, other), dense, atol=1e-12)


@given(creatures(), st.data())
def test_blocks_follow_the_order_of_bones(armature: Armature, data: st.DataObject) -> None:
    order = data.draw(st.permutations(range(len(armature))))
    told = reordered(armature, order)
    rows = [told.index(name) for name in armature.names]
    for name, block in BLOCKS.items():
        np.testing.assert_allclose(
            block(told, HUMAN)[rows], block(armature, HUMAN), atol=1e-12, err_msg=name
        )


@given(creatures())
def test_in_a_mirror_left_and_right_columns_change_places(armature: Armature) -> None:
    if not any(armature.sides):
        return  # by its shape it may have its left and right along z, where this mirror is not
    across = [
        HUMAN_BONE_NAMES.index(name.translate(str.maketrans("LR", "RL")) if "." in name else name)
        for name in HUMAN_BONE_NAMES
    ]
    for name, block in BLOCKS.items():
        np.testing.assert_allclose(
            block(mirrored(armature), HUMAN)[:, across],
            block(armature, HUMAN),
            atol=1e-12,
            err_msg=name,
        )


@given(armatures(), armatures())
def test_a_path_counts_double_for_each_step_that_both_have(one: Armature, other: Armature) -> None:
    found = path_block(one, other)
    for bone, depth in enumerate(one.depths):
        for human, its in enumerate(other.depths):
            assert found[bone, human] == 2.0 ** (min(depth, its) - 1)


def test_sides_forbid_forgive_and_favour() -> None:
    armature = armature_of({"hub": "", "arm.L": "hub", "arm.R": "hub", "tail": "hub"})
    found = symmetry_block(armature, HUMAN)
    human = HUMAN_BONE_NAMES.index

    def cell(bone: str, name: str) -> float:
        return float(found[armature.index(bone), human(name)])

    assert cell("arm.L", "hand.L") == 2.0
    assert cell("arm.L", "foot.R") == 0.0
    assert cell("arm.R", "shin.L") == 0.0
    assert cell("arm.R", "chest") == 1.0
    assert cell("tail", "hand.R") == 1.0
    assert cell("tail", "head") == 2.0
    assert cell("hub", "pelvis") == 2.0


def test_where_nothing_has_a_side_the_middle_means_nothing() -> None:
    assert (symmetry_block(armature_of({"a": "", "b": "a"}), HUMAN) == 1.0).all()


@given(creatures(), st.integers(0, 2**32 - 1))
def test_each_degree_of_freedom_too_many_costs_a_third_of_the_similarity(
    armature: Armature, seed: int
) -> None:
    turns = np.random.default_rng(seed).random((len(armature), 3)) < 0.5
    bound = replace(armature, lower=np.where(turns, -1.0, 0.0), upper=np.where(turns, 1.0, 0.0))
    alike, found = similarity_block(bound, HUMAN), constraint_block(bound, HUMAN)
    for bone in range(len(bound)):
        for human, name in enumerate(HUMAN_BONE_NAMES):
            human_freedom = 3 if name == "pelvis" else 2
            expected = alike[bone, human] * abs(turns[bone].sum() - human_freedom) / 3
            assert found[bone, human] == pytest.approx(-expected)


@given(creatures())
def test_a_bone_that_turns_freely_can_follow_anything(armature: Armature) -> None:
    assert (constraint_block(armature, HUMAN) == 0.0).all()


# -- what can never be ------------------------------------------------------------------------

_MOVEMENTS: tuple[Movement, ...] = ("turn", "slide", "fixed")


@st.composite
def mechanisms(draw: st.DrawFn) -> Armature:
    """Creatures some of whose bones slide or are fixed."""
    armature = draw(st.one_of(creatures(), armatures(most=12)))
    movements: list[Movement] = [draw(st.sampled_from(_MOVEMENTS)) for _ in armature.names]
    return replace(armature, movements=tuple(movements))


@given(mechanisms())
def test_what_does_not_turn_scores_never_and_what_turns_scores_better(armature: Armature) -> None:
    for block in (constraint_block, combined_block):
        rows = (block(armature, HUMAN) == NEVER).all(axis=1)
        some = (block(armature, HUMAN) == NEVER).any(axis=1)
        stuck = [movement != "turn" for movement in armature.movements]
        assert rows.tolist() == stuck
        assert some.tolist() == stuck


@given(mechanisms())
def test_two_puppets_that_slide_alike_can_be_compared(armature: Armature) -> None:
    found = constraint_block(armature, armature)
    differ = np.not_equal.outer(np.array(armature.movements), np.array(armature.movements))
    np.testing.assert_array_equal(found == NEVER, differ)


@given(mechanisms(), st.booleans())
def test_fk_never_proposes_a_bone_that_slides_or_is_fixed(
    armature: Armature, leftovers: bool
) -> None:
    preferences = Preferences(shoulders=leftovers, leftovers=leftovers)
    for proposal in propose_forward(gather(armature, preferences), Verdicts(), 6):
        for pair in proposal.pairs:
            assert armature.movements[pair.bone] == "turn"


@given(mechanisms())
def test_ik_never_proposes_an_effector_that_nothing_could_turn(armature: Armature) -> None:
    for proposal in propose_effectors(armature, Verdicts("ik"), 6):
        for pair in proposal.pairs:
            bone, turning = pair.bone, False
            # The root is moved by the performer's way, and turns under no goal.
            while armature.parents[bone] >= 0:
                turning |= armature.movements[bone] == "turn"
                bone = int(armature.parents[bone])
            assert turning, pair.name


@given(mechanisms())
def test_topology_says_nothing_for_a_bone_that_does_not_turn(armature: Armature) -> None:
    scores = gather(armature).bones.sum(axis=0)
    stuck = [movement != "turn" for movement in armature.movements]
    np.testing.assert_allclose(scores[stuck], 0.0, atol=1e-8)  # parts are rounded
