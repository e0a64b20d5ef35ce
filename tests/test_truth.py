"""What people said is right: the file, and how a proposal is judged by it."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.errors import BadFileError
from puppet.formats.armature_toml import load_puppet
from puppet.mapping.proposal import Mode, Pair, Proposal
from puppet.mapping.truth import ModeTruth, Truth, check_names, judge, load_truth
from puppet.skeleton import HUMAN_BONE_NAMES
from tests.armatures import armature_of
from tests.rig_changes import ARMATURES, propose, shipped

ARM = armature_of({"hub": "", "a": "hub", "b": "a", "c": "b", "tail": "hub"})
SHIPPED = sorted(ARMATURES.glob("*.truth.toml"))
RIGS = sorted((Path(__file__).parents[1] / "benchmarks" / "rigs").glob("*.truth.toml"))


def proposal(**pairs: str) -> Proposal:
    """One that drives these bones by these."""
    return Proposal(
        ARM,
        "fk",
        tuple(
            Pair(bone, (ARM.index(bone),), HUMAN_BONE_NAMES.index(human), 0.5)
            for bone, human in pairs.items()
        ),
    )


def verdicts(found: Proposal, truth: ModeTruth) -> dict[str, bool]:
    return {judged.name: judged.right for judged in judge(found, truth)}


def written(folder: Path, text: str) -> Path:
    path = folder / "rig.truth.toml"
    path.write_text(text)
    return path


# -- judging ----------------------------------------------------------------------------------


@given(st.sampled_from(HUMAN_BONE_NAMES), st.sets(st.sampled_from(HUMAN_BONE_NAMES), min_size=1))
def test_a_pair_is_right_if_it_is_one_of_those_that_were_named(
    partner: str, named: set[str]
) -> None:
    truth = ModeTruth(expect={"a": tuple(named)})
    assert verdicts(proposal(a=partner), truth) == {"a": partner in named}


def test_nothing_is_right_only_where_that_was_said() -> None:
    assert verdicts(proposal(), ModeTruth(expect={"a": ("hand.L",)})) == {"a": False}
    assert verdicts(proposal(), ModeTruth(expect={"a": ("hand.L", "")})) == {"a": True}
    assert verdicts(proposal(a="head"), ModeTruth(expect={"a": ("",)})) == {"a": False}


def test_what_must_stay_unmapped_may_have_no_partner_at_all() -> None:
    truth = ModeTruth(unmapped=("tail",))
    assert verdicts(proposal(), truth) == {"tail": True}
    assert verdicts(proposal(tail="head"), truth) == {"tail": False}


def test_a_bone_that_nobody_spoke_of_does_not_count() -> None:
    assert judge(proposal(a="head", b="chest"), ModeTruth()) == []
    assert verdicts(proposal(a="head", b="chest"), ModeTruth(expect={"a": ("head",)})) == {
        "a": True
    }


def test_what_was_judged_comes_with_its_pair() -> None:
    found = proposal(a="head")
    truth = ModeTruth(expect={"a": ("head",), "b": ("",)}, unmapped=("tail",))
    assert [(j.name, j.pair) for j in judge(found, truth)] == [
        ("a", found.pairs[0]),
        ("b", None),
        ("tail", None),
    ]


ANY_ARM = tuple(f"{word}.{side}" for word in ("upper_arm", "forearm", "hand") for side in "LR")


@pytest.mark.parametrize(
    ("partners", "right"),
    [
        (("upper_arm.L", "forearm.L", "hand.L"), True),
        (("upper_arm.L", "", "hand.L"), True),  # a bone between may follow
        (("forearm.L", "upper_arm.L", "hand.L"), False),  # the wrong way round
        (("upper_arm.L", "forearm.R", "hand.L"), False),  # torn over two arms
        (("upper_arm.L", "upper_arm.L", "hand.L"), False),  # twice the same
        (("hand.L", "", ""), True),
        (("", "", ""), True),
    ],
)
def test_bones_in_a_row_are_driven_by_bones_in_a_row(
    partners: tuple[str, ...], right: bool
) -> None:
    run = ("a", "b", "c")
    truth = ModeTruth(expect=dict.fromkeys(run, (*ANY_ARM, "")), ordered=(run,))
    pairs = {bone: partner for bone, partner in zip(run, partners, strict=True) if partner}
    assert set(verdicts(proposal(**pairs), truth).values()) == {right}


def test_an_arm_is_no_leg_even_on_one_side() -> None:
    truth = ModeTruth(expect={"a": ("upper_arm.L",), "b": ("shin.L",)}, ordered=(("a", "b"),))
    assert not any(verdicts(proposal(a="upper_arm.L", b="shin.L"), truth).values())


def test_a_torn_row_spoils_only_its_own_bones() -> None:
    truth = ModeTruth(
        expect={"a": ("forearm.L",), "b": ("upper_arm.L",), "tail": ("head",)},
        ordered=(("a", "b"),),
    )
    found = verdicts(proposal(a="forearm.L", b="upper_arm.L", tail="head"), truth)
    assert found == {"a": False, "b": False, "tail": True}


def test_masters_are_judged_by_their_name() -> None:
    rig = shipped("seagull_with_master")
    truth = ModeTruth(expect={"wings": ("hand.L", "hand.R")})
    assert verdicts(propose(rig, "ik")[0], truth) == {"wings": True}


# -- the files --------------------------------------------------------------------------------


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name.split(".")[0])
def test_the_cast_is_right_in_every_word_of_its_truth(path: Path) -> None:
    truth = load_truth(path)
    rig = shipped(path.name.split(".")[0])
    modes: tuple[Mode, ...] = ("fk", "ik")
    for mode in modes:
        wrong = [j for j in judge(propose(rig, mode)[0], truth.of(mode)) if not j.right]
        assert not wrong, [(j.name, j.pair and j.pair.partner) for j in wrong]


@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.name.split(".")[0])
def test_every_truth_of_the_benchmark_is_about_its_rig(path: Path, shared: Path) -> None:
    truth = load_truth(path)
    assert truth.rig
    found = sorted((shared / "armatures").rglob(Path(truth.rig).name))
    assert found, truth.rig
    check_names(truth, load_puppet(found[0]).model.armature.names, path)
    assert truth.fk.expect or truth.ik.expect


def test_a_truth_may_say_little() -> None:
    assert Truth().fk == Truth().ik == ModeTruth()


def test_a_file_is_read_as_it_is_written(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        'rig = "x.glb"\n[fk]\nunmapped = ["tail"]\nordered = [["a", "b"]]\n'
        '[fk.expect]\na = ["head", ""]\n'
        '[ik]\nmasters = { m = ["b", "c"] }\n[ik.expect]\nm = ["hand.L"]\n',
    )
    assert load_truth(path) == Truth(
        "x.glb",
        ModeTruth({"a": ("head", "")}, ("tail",), (("a", "b"),)),
        ModeTruth({"m": ("hand.L",)}, masters={"m": ("b", "c")}),
    )


@pytest.mark.parametrize(
    ("text", "where", "found"),
    [
        ('[fk.expect]\na = ["nose"]', "fk.expect.a", "nose"),
        ("[fk.expect]\na = []", "fk.expect.a", "nothing"),
        ('[ik.expect]\na = ["shin.L"]', "ik.expect.a", "shin.L"),
        ('[ik.expect]\na = ["hand.L", "arm.L"]', "ik.expect.a", "arm.L"),
    ],
)
def test_what_can_drive_nothing_is_told_with_its_place(
    tmp_path: Path, text: str, where: str, found: str
) -> None:
    with pytest.raises(BadFileError, match="not something that drives") as error:
        load_truth(written(tmp_path, text))
    assert str(error.value.where).endswith(where)
    assert error.value.found == found


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("[fk]\nunmaped = []", "$.fk"),
        ("[fk]\nordered = [3]", "$.fk.ordered[0]"),
        ('rig = ["x"]', "$.rig"),
        ("[fk", ""),
    ],
)
def test_what_is_no_truth_file_is_told_with_its_place(
    tmp_path: Path, text: str, place: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(BadFileError, match="not a truth file") as error:
        load_truth(path)
    assert str(path) in str(error.value.where)
    assert place in str(error.value.where)
    assert error.value.hint


def test_bytes_that_are_no_text_are_no_truth(tmp_path: Path) -> None:
    path = tmp_path / "rig.truth.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadFileError, match="not a truth file"):
        load_truth(path)


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(BadFileError, match="cannot be read"):
        load_truth(tmp_path / "none.truth.toml")


@pytest.mark.parametrize(
    "part",
    [
        ModeTruth(expect={"beak": ("head",)}),
        ModeTruth(unmapped=("beak",)),
        ModeTruth(ordered=(("a", "beak"),)),
        ModeTruth(masters={"m": ("a", "beak")}),
    ],
)
@pytest.mark.parametrize("mode", ["fk", "ik"])
def test_bones_that_the_rig_does_not_have_are_told_with_those_it_has(
    part: ModeTruth, mode: str
) -> None:
    truth = Truth(fk=part) if mode == "fk" else Truth(ik=part)
    with pytest.raises(BadFileError, match="no such bone") as error:
        check_names(truth, ARM.names, Path("rig.truth.toml"))
    assert error.value.found == "beak"
    assert "tail" in str(error.value.expected)
    assert str(error.value.where).endswith(mode)


def test_a_master_of_the_truth_is_no_bone_of_the_rig() -> None:
    truth = Truth(ik=ModeTruth(expect={"m": ("hand.L",)}, masters={"m": ("a", "b")}))
    check_names(truth, ARM.names, Path("rig.truth.toml"))
