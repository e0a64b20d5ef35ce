"""The seven mappings that Sanna 2015 prints come out of the shipped cast, however it is told."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.mapping.proposal import Mode
from puppet.mapping.service import Rig
from tests.armatures import quaternions
from tests.rig_changes import (
    by_name,
    numbered,
    placed,
    propose,
    renamed,
    reordered,
    retold,
    shipped,
)

PUBLISHED = ("lamp", "fish", "dog", "seagull", "seagull_with_master", "snake", "ostrich")
_DOWNWARDS = ("shoulder", "upper_arm", "forearm", "hand", "thigh", "shin", "foot")


@dataclass(frozen=True)
class Told:
    """A shipped rig told in another way. names: its new name for each of its own."""

    rig: Rig
    names: dict[str, str] = field(default_factory=dict)

    def mapping(self, mode: Mode) -> dict[str, str]:
        """What drives each bone, effector or master, by the names that the paper knows."""
        own = {new: old for old, new in self.names.items()}
        proposal = propose(self.rig, mode)[0]
        return {own.get(name, name): partner for name, partner in by_name(proposal).items()}


def check(told: Told, facts: dict[str, Any]) -> None:
    """That the mapping is the published one."""
    found = told.mapping(facts["mode"])
    for bone, allowed in facts["expect"].items():
        assert found.get(bone) in allowed, f"{bone} is driven by {found.get(bone)}"
    for bone in facts.get("unmapped", ()):
        assert bone not in found
    for run in facts.get("ordered", ()):
        words = [found[bone].split(".")[0] for bone in run]
        assert len({found[bone].split(".")[1] for bone in run}) == 1, f"{run} is torn: {words}"
        places = [_DOWNWARDS.index(word) for word in words]
        assert places == sorted(set(places)), f"{run} are not in order: {words}"
    assert len(set(found.values())) == len(found), "something of the performer drives two things"


def test_there_are_seven(published: dict[str, Any]) -> None:
    assert set(published) == set(PUBLISHED)


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_shipped_cast_gives_the_published_mapping(published: dict[str, Any], name: str) -> None:
    check(Told(shipped(name)), published[name])


@pytest.mark.parametrize("name", PUBLISHED)
@given(data=st.data())
def test_the_order_of_bones_does_not_matter(
    published: dict[str, Any], name: str, data: st.DataObject
) -> None:
    rig = shipped(name)
    order = data.draw(st.permutations(range(len(rig.armature))))
    check(Told(retold(rig, reordered(rig.armature, order))), published[name])


@pytest.mark.parametrize("name", PUBLISHED)
@given(data=st.data())
def test_names_do_not_matter_but_for_their_sides(
    published: dict[str, Any], name: str, data: st.DataObject
) -> None:
    rig = shipped(name)
    numbers = list(numbered(rig.armature).values())
    shuffled = data.draw(st.permutations(range(len(numbers))))
    names = {
        old: f"b{number}" + (old[-2:] if old[-2:] in (".L", ".R") else "")
        for old, number in zip(rig.armature.names, shuffled, strict=True)
    }
    check(Told(retold(rig, renamed(rig.armature, names), names), names), published[name])


@pytest.mark.parametrize("name", PUBLISHED)
@pytest.mark.parametrize("scale", [100.0, 0.01])
def test_size_does_not_matter(published: dict[str, Any], name: str, scale: float) -> None:
    rig = shipped(name)
    check(Told(retold(rig, placed(rig.armature, scale))), published[name])


places = st.tuples(*[st.floats(-1000.0, 1000.0)] * 3)


@pytest.mark.parametrize("name", PUBLISHED)
@given(turn=quaternions(), place=places)
def test_where_it_stands_and_looks_does_not_matter(
    published: dict[str, Any], name: str, turn: Any, place: tuple[float, float, float]
) -> None:
    rig = shipped(name)
    turned = placed(rig.armature, 1.0, Rotation.from_quat(turn))
    check(Told(retold(rig, turned)), published[name])
    check(Told(retold(rig, placed(rig.armature, 1.0, None, place))), published[name])


@pytest.mark.parametrize("name", PUBLISHED)
@given(data=st.data(), turn=quaternions(), place=places)
def test_nothing_of_all_that_matters_at_once(
    published: dict[str, Any],
    name: str,
    data: st.DataObject,
    turn: Any,
    place: tuple[float, float, float],
) -> None:
    rig = shipped(name)
    order = data.draw(st.permutations(range(len(rig.armature))))
    armature = reordered(rig.armature, order)
    names = numbered(armature)
    armature = placed(renamed(armature, names), 100.0, Rotation.from_quat(turn), place)
    check(Told(retold(rig, armature, names), names), published[name])
