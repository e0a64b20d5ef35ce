"""Trunk and limbs: what carries others, and what hangs on it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.mapping.anatomy import Limb, anatomy
from tests.armatures import armature_of, armatures, quaternions
from tests.rig_changes import bare, creatures, limb, placed, reordered, shipped

any_armature = st.one_of(armatures(), creatures())


def trunk_of(armature: Armature) -> list[str]:
    return [armature.names[bone] for bone in anatomy(armature).trunk]


def limbs_of(armature: Armature) -> list[list[str]]:
    return [[armature.names[bone] for bone in found.bones] for found in anatomy(armature).limbs]


def ending_in(armature: Armature, bone: str) -> Limb:
    tip = armature.index(bone)
    return next(found for found in anatomy(armature).limbs if found.bones[-1] == tip)


# -- the cast ---------------------------------------------------------------------------------

CAST = {
    "fish": (["back", "middle"], ["head", "fin_tip.L", "fin_tip.R", "dorsal"]),
    "dog": (["hips", "belly", "chest"], ["head", "tail", "fore_paw.L", "hind_paw.R"]),
    "seagull": (["pelvis", "chest"], ["head", "wing_tip.L", "wing_tip.R", "paw.L", "tail"]),
    "ostrich": (["hips"], ["head", "paw.L", "paw.R"]),
    "snake": (["root"], ["head", "tail"]),
    "lamp": ([], ["shade"]),
}


@pytest.mark.parametrize("name", list(CAST))
def test_the_cast_is_seen_as_a_puppeteer_sees_it(name: str) -> None:
    armature = shipped(name).armature
    trunk, tips = CAST[name]
    assert trunk_of(armature) == trunk
    assert {found[-1] for found in limbs_of(armature)} >= set(tips)


# -- what holds for all -----------------------------------------------------------------------


@given(any_armature)
def test_limbs_are_chains_that_hang_on_the_trunk(armature: Armature) -> None:
    shape = anatomy(armature)
    trunk = set(shape.trunk)
    used: set[int] = set()
    for found in shape.limbs:
        assert not used & set(found.bones)
        assert not trunk & set(found.bones)
        used |= set(found.bones)
        for parent, bone in zip(found.bones, found.bones[1:], strict=False):
            assert armature.parents[bone] == parent
        assert found.hub == armature.parents[found.bones[0]]


@given(any_armature)
def test_the_trunk_is_in_one_piece_in_the_middle_and_comes_from_the_root(
    armature: Armature,
) -> None:
    shape = anatomy(armature)
    for bone in shape.trunk:
        assert not shape.sides[bone]
        parent = int(armature.parents[bone])
        assert parent < 0 or parent in shape.trunk
    depths = [int(armature.depths[bone]) for bone in shape.trunk]
    assert depths == sorted(depths)


@given(any_armature)
def test_limbs_that_reach_furthest_come_first_and_twigs_last(armature: Armature) -> None:
    shape = anatomy(armature)
    twigs = [found.is_twig for found in shape.limbs]
    assert twigs == sorted(twigs)
    reaches = [found.reach for found in shape.limbs if not found.is_twig]
    assert (np.diff(reaches) <= 1e-5 * armature.size).all()
    assert not all(twigs)


def told(armature: Armature) -> tuple[object, ...]:
    """An anatomy by names; limbs of equal reach in any order."""
    shape, names = anatomy(armature), armature.names
    return (
        [names[bone] for bone in shape.trunk],
        {
            (
                tuple(names[bone] for bone in found.bones),
                found.side,
                names[found.hub] if found.hub >= 0 else "",
                found.is_twig,
            )
            for found in shape.limbs
        },
    )


@given(creatures(), st.data())
def test_the_order_of_bones_means_nothing(armature: Armature, data: st.DataObject) -> None:
    order = data.draw(st.permutations(range(len(armature))))
    other = reordered(armature, order)
    assert told(other) == told(armature)
    assert limbs_of(other) == limbs_of(armature)


@given(armatures(), st.data())
def test_the_order_of_bones_means_nothing_where_nothing_is_named(
    armature: Armature, data: st.DataObject
) -> None:
    order = data.draw(st.permutations(range(len(armature))))
    assert told(reordered(armature, order)) == told(armature)


@pytest.mark.parametrize("name", list(CAST))
@given(scale=st.floats(1e-3, 1e3), turn=quaternions())
def test_size_place_and_direction_mean_nothing(name: str, scale: float, turn: np.ndarray) -> None:
    armature = shipped(name).armature
    other = placed(armature, scale, Rotation.from_quat(turn), (3.0, -2.0, 1.0))
    assert told(other) == told(armature)


# -- twigs, bunches and other growths ---------------------------------------------------------


def body(**more: dict[str, tuple[str, tuple[float, float, float]]]) -> Armature:
    """Hips, chest and head, arms and legs of three bones, and what more is wanted."""
    bones = {
        "hips": ("", (0.0, 1.0, 0.0)),
        "chest": ("hips", (0.0, 0.4, 0.0)),
        "neck": ("chest", (0.0, 0.1, 0.0)),
        "head": ("neck", (0.0, 0.2, 0.0)),
        **limb("arm", "chest", (0.3, 0.0, 0.0), 3),
        **limb("leg", "hips", (0.0, -0.3, 0.0), 3, (0.1, 0.0, 0.0)),
    }
    for growth in more.values():
        bones |= growth
    return bare(bones)


@pytest.mark.parametrize("sided", [True, False])
def test_ears_do_not_make_a_head_a_trunk(sided: bool) -> None:
    ears = {
        f"ear{suffix}": ("head", (x, 0.1, 0.0))
        for suffix, x in ((".L" if sided else "1", 0.05), (".R" if sided else "2", -0.05))
    }
    armature = body(ears=ears)
    assert trunk_of(armature) == ["hips", "chest"]
    assert ending_in(armature, "head").bones[0] == armature.index("neck")
    assert ["neck", "head"] in limbs_of(armature)
    assert all(ending_in(armature, ear).is_twig for ear in ears)


def test_a_jaw_and_a_crest_do_not_either() -> None:
    growth = {"jaw": ("head", (0.0, -0.02, 0.06)), "crest": ("head", (0.0, 0.05, -0.02))}
    armature = body(growth=growth)
    assert trunk_of(armature) == ["hips", "chest"]
    assert ["neck", "head"] in limbs_of(armature)


@pytest.mark.parametrize("fingers", [3, 5])
def test_fingers_end_a_hand(fingers: int) -> None:
    growth = {
        f"finger{finger}_{bone}.{side}": (
            f"finger{finger}_{bone - 1}.{side}" if bone else f"arm2.{side}",
            ((0.06 if bone else 0.1) * (1 if side == "L" else -1), 0.0, 0.02 * finger),
        )
        for side in ("L", "R")
        for finger in range(fingers)
        for bone in range(3)
    }
    armature = body(growth=growth)
    assert trunk_of(armature) == ["hips", "chest"]
    for side in ("L", "R"):
        arms = [found for found in limbs_of(armature) if found[0] == f"arm0.{side}"]
        assert len(arms) == 1
        # The first bone of one finger may stand for the hand's end; the rest of it may not.
        assert arms[0][:3] == [f"arm0.{side}", f"arm1.{side}", f"arm2.{side}"]
        assert len(arms[0]) <= 4


def test_a_thumb_does_not_end_an_arm() -> None:
    """Two ways on are an arm with something at it; the longer one is the arm."""
    growth = {f"thumb.{side}": (f"arm1.{side}", (0.0, 0.0, 0.05)) for side in ("L", "R")}
    assert ["arm0.L", "arm1.L", "arm2.L"] in limbs_of(body(growth=growth))


def test_small_fins_are_all_that_a_fish_has() -> None:
    """They are short against its tail, but nothing at the sides is longer."""
    bones = {
        "root": ("", (0.0, 0.0, 0.0)),
        "head": ("root", (0.0, 0.0, 0.5)),
        **{f"tail{i}": (f"tail{i - 1}" if i else "root", (0.0, 0.0, -0.8)) for i in range(4)},
        **limb("fin", "root", (0.1, -0.05, 0.0), 1, (0.1, 0.0, 0.0)),
    }
    armature = bare(bones)
    assert not ending_in(armature, "fin0.L").is_twig
    assert not ending_in(armature, "fin0.R").is_twig


def test_a_left_limb_and_the_right_one_are_twigs_together_or_not_at_all() -> None:
    shape = anatomy(body(ears={"ear.L": ("head", (0.05, 0.1, 0)), "ear.R": ("head", (-0.2, 1, 0))}))
    twigs = {limb.is_twig for limb in shape.limbs if limb.hub >= 0 and limb.side}
    by_hub: dict[int, set[bool]] = {}
    for found in shape.limbs:
        if found.side:
            by_hub.setdefault(found.hub, set()).add(found.is_twig)
    assert twigs
    assert all(len(kinds) == 1 for kinds in by_hub.values())


def test_a_chain_without_branches_is_one_limb_and_no_trunk() -> None:
    armature = armature_of({"a": "", "b": "a", "c": "b"})
    assert trunk_of(armature) == []
    assert limbs_of(armature) == [["a", "b", "c"]]


def test_a_bare_hierarchy_is_measured_by_its_bones() -> None:
    """All at one point: every bone counts the same."""
    names = ["hub", "long", "long1", "long2", "short"]
    armature = Armature.build(
        "bare", names, [-1, 0, 1, 2, 0], np.zeros((5, 3)), tips=np.zeros((5, 3))
    )
    assert limbs_of(armature) == [["long", "long1", "long2"], ["short"]]
