"""The benchmark: what it counts as right, and that its figures are about the program."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from puppet.errors import BadFileError
from puppet.mapping.benchmark import Result, calibration, find_cases, run

REPOSITORY = Path(__file__).resolve().parents[1]
CAST = REPOSITORY / "configs" / "armatures"
RIGS = REPOSITORY / "benchmarks" / "rigs"


def right(results: list[Result]) -> float:
    judged = [one for result in results for one in result.judged]
    return sum(one.right for one in judged) / len(judged)


@pytest.fixture(scope="module")
def cast() -> list[Result]:
    return list(run(find_cases([CAST])))


def test_the_cast_is_mapped_right_with_and_without_the_names_of_its_bones(
    cast: list[Result],
) -> None:
    assert {result.case.name for result in cast} >= {"lamp", "fish", "dog", "seagull_with_master"}
    assert {result.dress for result in cast} == {"as it is", "without names"}
    for result in cast:
        wrong = [one.name for one in result.judged if not one.right]
        assert not wrong, f"{result.case.name} {result.mode} {result.dress}: {wrong}"


def test_real_rigs_are_mapped_right_nine_times_of_ten(shared: Path) -> None:
    results = list(run(find_cases([RIGS], [shared / "armatures"])))
    for dress in ("as it is", "without names"):
        assert right([result for result in results if result.dress == dress]) > 0.9


def test_pairs_shown_as_sure_are_right_more_often_than_doubtful_ones(
    shared: Path, cast: list[Result]
) -> None:
    bands = {
        band.word: band
        for band in calibration([*cast, *run(find_cases([RIGS], [shared / "armatures"]))])
    }
    assert bands["sure"].right > bands["doubtful"].right + 0.02
    assert bands["sure"].claimed > bands["likely"].claimed > bands["doubtful"].claimed
    # What it claims on rigs that it was tuned on is less than what is found there.
    assert all(band.claimed <= band.right for band in bands.values())


def test_a_pair_counts_once_for_certainty_whatever_it_is_dressed_in(cast: list[Result]) -> None:
    shown = [
        one.pair
        for result in cast
        if result.dress == "as it is"
        for one in result.judged
        if one.pair is not None
    ]
    bands = calibration(cast)
    assert sum(band.pairs for band in bands) == len(shown)
    for band in bands:
        its = [pair.confidence for pair in shown if pair.certainty == band.word]
        assert len(its) == band.pairs
        assert not its or sum(its) / len(its) == pytest.approx(band.claimed)
        assert (band.rigs > 0) == (band.pairs > 0)
        assert band.rigs <= len({result.case.name for result in cast})


def test_limbs_geometry_and_preferences_do_better_than_the_matrix_alone(cast: list[Result]) -> None:
    plain = [one for result in cast for one in result.baseline]
    assert sum(one.right for one in plain) < 0.7 * len(plain)


def test_a_wrong_answer_is_counted_as_wrong(tmp_path: Path) -> None:
    (tmp_path / "fish.truth.toml").write_text(
        'rig = "fish.glb"\n[fk]\nunmapped = ["middle"]\n'
        'ordered = [["fin_tip.L", "fin.L"]]\n'
        '[fk.expect]\nhead = ["foot.L"]\nback = ["pelvis"]\n'
        '"fin.L" = ["upper_arm.L"]\n"fin_tip.L" = ["forearm.L"]\n'
    )
    result = next(iter(run(find_cases([tmp_path], [CAST]))))
    judged = {one.name: one.right for one in result.judged}
    assert judged == {
        "head": False,
        "back": True,
        "fin.L": False,  # they are in order, but not in the one that was said
        "fin_tip.L": False,
        "middle": False,
    }


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("[fk.expect]\nnose = ['head']", "no such bone"),
        ("[fk.expect]\nhead = ['snout']", "not something that drives"),
        ("[ik.expect]\nhead = ['pelvis']", "not something that drives"),
        ("[fk.expect]\nhead = []", "not something that drives"),
        ("[fkk]\n", "not a truth file"),
        ("rig = 'nowhere.glb'", "nowhere"),
        ("[fk", "not a truth file"),
    ],
)
def test_a_truth_file_that_makes_no_sense_is_an_error_that_names_it(
    tmp_path: Path, text: str, what: str
) -> None:
    (tmp_path / "fish.truth.toml").write_text(text)
    with pytest.raises(BadFileError, match=what) as caught:
        find_cases([tmp_path], [CAST])
    assert "fish.truth.toml" in str(caught.value)


def test_a_folder_without_truth_files_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(BadFileError, match=r"no truth file"):
        find_cases([tmp_path])


def test_a_folder_that_is_not_there_is_told_as_such(tmp_path: Path) -> None:
    with pytest.raises(BadFileError, match="no such folder") as caught:
        find_cases([tmp_path / "nothere"])
    assert caught.value.where == str(tmp_path / "nothere")


def test_a_folder_is_looked_into_and_named_once(tmp_path: Path) -> None:
    (tmp_path / "fish.truth.toml").write_text("")
    with pytest.raises(BadFileError, match="nowhere") as caught:
        find_cases([tmp_path], [tmp_path, tmp_path])
    assert caught.value.found == f"not in {tmp_path}"


def bench(*arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "puppet", "bench", "mapping", *arguments],
        capture_output=True,
        text=True,
        check=True,
        cwd=REPOSITORY,
    )
    return done.stdout


def test_the_command_prints_tables_for_people_and_json_for_programs() -> None:
    table = bench("--wrong")
    for word in ("seagull", "overall", "sure", "doubtful", "claimed"):
        assert word in table
    document = json.loads(bench("--json"))
    assert {"results", "calibration"} == set(document)
    assert sum(result["right"] for result in document["results"]) > 150
