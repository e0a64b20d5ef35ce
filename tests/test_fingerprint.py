"""A rig is recognised by its bones, their parents and its rest pose, and by nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.formats.armature_toml import load_puppet
from puppet.mapping.fingerprint import bone_records, differences, fingerprint
from tests.armatures import armature_of, armatures

ARMATURES = Path(__file__).resolve().parents[1] / "configs/armatures"
FISH = {"back": "", "middle": "back", "head": "middle", "fin.L": "middle", "fin.R": "middle"}


def shuffled(armature: Armature, seed: int) -> Armature:
    order = np.random.default_rng(seed).permutation(len(armature))
    place = {int(old): new for new, old in enumerate(order)}
    return Armature.build(
        armature.name,
        [armature.names[old] for old in order],
        [place.get(int(armature.parents[old]), -1) for old in order],
        armature.offsets[order],
        armature.rotations[order],
        armature.tips[order],
    )


def scaled(armature: Armature, factor: float) -> Armature:
    return replace(armature, offsets=armature.offsets * factor, tips=armature.tips * factor)


def said(was: Armature, now: Armature) -> list[str]:
    return list(differences(bone_records(was), bone_records(now)))


@given(armatures(), st.integers(0, 2**32 - 1))
def test_the_order_of_the_bones_does_not_matter(armature: Armature, seed: int) -> None:
    assert fingerprint(shuffled(armature, seed)) == fingerprint(armature)
    assert said(armature, shuffled(armature, seed)) == []


@given(armatures(), st.sampled_from([0.01, 0.5, 2.0, 39.37, 100.0]))
def test_the_scale_does_not_matter(armature: Armature, factor: float) -> None:
    assert fingerprint(scaled(armature, factor)) == fingerprint(armature)
    assert said(armature, scaled(armature, factor)) == []


@given(armatures(), st.integers(0, 2**32 - 1))
def test_a_rotation_and_its_negative_are_the_same_rest(armature: Armature, seed: int) -> None:
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (len(armature), 1))
    same = replace(armature, rotations=armature.rotations * signs)
    assert fingerprint(same) == fingerprint(armature)


@pytest.mark.parametrize("w", [1e-17, -1e-17, 0.0, -0.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_half_a_turn_is_the_same_on_either_side_of_its_rounding(w: float, sign: float) -> None:
    """Half a turn is common in rigs, and there the sign of w is noise."""

    def turned(rotation: list[float]) -> Armature:
        rests = np.array([[0.0, 0.0, 0.0, 1.0], rotation])
        return Armature.build("a", ["a", "b"], [-1, 0], [[0, 0, 0], [0, 1, 0]], rests)

    assert fingerprint(turned([0.0, 0.6 * sign, 0.8 * sign, w])) == fingerprint(
        turned([0.0, 0.6, 0.8, 0.0])
    )


@given(armatures(), st.data())
def test_another_name_parent_or_rest_is_another_rig_and_is_told_bone_by_bone(
    armature: Armature, data: st.DataObject
) -> None:
    bone = data.draw(st.integers(0, len(armature) - 1))
    name = armature.names[bone]
    renamed = replace(armature, names=tuple("new" if n == name else n for n in armature.names))
    assert fingerprint(renamed) != fingerprint(armature)
    told = said(armature, renamed)
    assert told[0] == f"{name} is gone"
    assert sum(text.startswith("new is new") for text in told) == 1
    children = {n for n, p in zip(armature.names, armature.parents, strict=True) if p == bone}
    moved_over = {f"{child} hung on {name}, and now on new" for child in children}
    assert {text for text in told if " hung on " in text} == moved_over
    assert len(told) == 2 + len(children)

    rotations = np.array(armature.rotations)
    rotations[bone] = np.roll(rotations[bone], 1)
    turned = replace(armature, rotations=rotations)
    assert fingerprint(turned) != fingerprint(armature)
    assert said(armature, turned) == [f"{name} rests differently"]

    if bone >= 1 and len(armature) >= 6:
        offsets = np.array(armature.offsets)
        offsets[bone] *= 1.5
        moved = replace(armature, offsets=offsets)
        assert fingerprint(moved) != fingerprint(armature)
        assert said(armature, moved) == [f"{name} rests differently"]

    if bone >= 2:
        elsewhere = next(b for b in range(bone) if b != armature.parents[bone])
        parents = np.array(armature.parents)
        parents[bone] = elsewhere
        hung = replace(armature, parents=parents)
        assert fingerprint(hung) != fingerprint(armature)
        before, after = armature.names[int(armature.parents[bone])], armature.names[elsewhere]
        assert f"{name} hung on {before}, and now on {after}" in said(armature, hung)


def test_a_bone_that_came_or_became_a_root_is_told() -> None:
    fish = armature_of(FISH)
    grown = armature_of({**FISH, "dorsal": "back"})
    assert "dorsal is new, on back" in said(fish, grown)
    assert "dorsal is gone" in said(grown, fish)
    loose = armature_of({**FISH, "head": ""})
    assert "head hung on middle, and now on nothing" in said(fish, loose)


def test_no_two_of_our_own_rigs_are_taken_for_each_other() -> None:
    names = ["dog", "fish", "lamp", "ostrich", "seagull", "snake"]
    prints = {fingerprint(load_puppet(ARMATURES / f"{n}.glb").model.armature) for n in names}
    assert len(prints) == len(names)
    assert all(len(text) == 16 and int(text, 16) >= 0 for text in prints)


def test_a_master_is_no_part_of_the_rig() -> None:
    plain = load_puppet(ARMATURES / "seagull.glb").model.armature
    master = load_puppet(ARMATURES / "seagull_with_master.toml").model.armature
    assert fingerprint(plain) == fingerprint(master)
