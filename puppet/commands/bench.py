"""`puppet bench`: how well and how fast, measured on this machine."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from rich.console import Console
from rich.progress import track
from rich.table import Table

from puppet.mapping.benchmark import DRESSES, Case, Result, calibration, find_cases, run

_err = Console(stderr=True)


def bench_mapping(
    folders: Sequence[Path], rigs: Sequence[Path], *, as_json: bool, wrong: bool
) -> None:
    """Map every rig that has a truth file, and print how often that was right."""
    places = [*rigs, *folders]
    cases = find_cases(folders, places)
    # The first proposal of a process compiles what all others use.
    for _ in run(cases[:1]):
        pass
    results = [
        result
        for case in track(cases, "mapping", console=_err, transient=True)
        for result in run([case])
    ]
    if as_json:
        sys.stdout.write(json.dumps(_document(results), indent=2) + "\n")
        return
    console = Console()
    console.print(_by_rig(cases, results))
    console.print(_overall(results))
    console.print(_certainty(results))
    if wrong:
        console.print(_mistakes(results))


def _share(results: Sequence[Result], *, baseline: bool = False) -> tuple[int, int]:
    judged = [one for r in results for one in (r.baseline if baseline else r.judged)]
    return sum(one.right for one in judged), len(judged)


def _cell(results: Sequence[Result]) -> str:
    right, total = _share(results)
    return f"{right}/{total}" if total else "—"


def _by_rig(cases: Sequence[Case], results: Sequence[Result]) -> Table:
    table = Table(title="bones and effectors that were mapped right")
    table.add_column("rig")
    table.add_column("bones", justify="right")
    for mode in ("FK", "IK"):
        for dress in DRESSES:
            table.add_column(f"{mode} {dress}", justify="right")
    table.add_column("ms", justify="right")
    for case in cases:
        row = [case.name, str(len(case.rig.armature))]
        its = [result for result in results if result.case is case]
        for mode in ("fk", "ik"):
            row += [_cell([r for r in its if (r.mode, r.dress) == (mode, d)]) for d in DRESSES]
        table.add_row(*row, f"{1000 * median([r.seconds for r in its] or [0.0]):.1f}")
    return table


def _overall(results: Sequence[Result]) -> Table:
    table = Table(title="overall")
    for column in ("", "right", "of", "", "the paper's matrix alone"):
        table.add_column(column, justify="right")
    for mode in ("fk", "ik"):
        for dress in DRESSES:
            some = [r for r in results if (r.mode, r.dress) == (mode, dress)]
            right, total = _share(some)
            plain, _ = _share(some, baseline=True)
            table.add_row(
                f"{mode.upper()} {dress}",
                str(right),
                str(total),
                f"{right / max(total, 1):.1%}",
                f"{plain / max(total, 1):.1%}",
            )
    return table


def _certainty(results: Sequence[Result]) -> Table:
    table = Table(title="how much its certainty is worth, with the names of bones")
    for column in ("shown as", "pairs", "rigs", "right", "claimed"):
        table.add_column(column, justify="right")
    for band in calibration(results):
        shares = [f"{share:.1%}" if band.pairs else "—" for share in (band.right, band.claimed)]
        table.add_row(band.word, str(band.pairs), str(band.rigs), *shares)
    return table


def _mistakes(results: Sequence[Result]) -> Table:
    table = Table(title="what was wrong")
    for column in ("rig", "", "bone", "proposed", "right"):
        table.add_column(column)
    for result in results:
        expect = result.case.truth.of(result.mode).expect
        names = result.case.rig.armature.names
        for one in result.judged:
            if one.right:
                continue
            name = one.name
            if result.dress == "without names" and name.startswith("b") and name[1:].isdigit():
                name = names[int(name[1:])]
            partners = ", ".join(partner or "none" for partner in expect.get(name, ("",)))
            proposed = one.pair.partner if one.pair else "none"
            table.add_row(
                result.case.name, f"{result.mode.upper()} {result.dress}", name, proposed, partners
            )
    return table


def _document(results: Sequence[Result]) -> dict[str, Any]:
    return {
        "results": [
            {
                "rig": result.case.name,
                "bones": len(result.case.rig.armature),
                "mode": result.mode,
                "dress": result.dress,
                "right": result.right,
                "of": len(result.judged),
                "baseline_right": sum(one.right for one in result.baseline),
                "ms": round(1000 * result.seconds, 3),
            }
            for result in results
        ],
        "calibration": [
            {
                "certainty": band.word,
                "pairs": band.pairs,
                "rigs": band.rigs,
                "right": round(band.right, 4),
                "claimed": round(band.claimed, 4),
            }
            for band in calibration(results)
            if band.pairs
        ],
    }
