"""A benchmark for automatic mapping onto rigs of any shape: proposals against what people said.

A case is a rig with a truth file (`puppet.mapping.truth`) under one mode. Each is also tried in
harder dress: without the names of its bones, so that left and right have to be found by shape.
docs/mapping-benchmark.md describes it, for other programs too.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np

from puppet.armature import Armature
from puppet.errors import BadFileError
from puppet.formats.armature_toml import load_puppet
from puppet.formats.model import MODEL_SUFFIXES
from puppet.mapping.blocks import NEVER, combined_block, similarity_block
from puppet.mapping.confidence import LIKELY, SURE
from puppet.mapping.human import HUMAN, HUMAN_LIMBS
from puppet.mapping.proposal import Mode, Pair, Proposal
from puppet.mapping.ranking import best_first, hungarian
from puppet.mapping.service import Rig
from puppet.mapping.truth import Judged, ModeTruth, Truth, check_names, judge, load_truth
from puppet.mapping.verdicts import Verdicts

ENDING: Final = ".truth.toml"
Dress = Literal["as it is", "without names"]
DRESSES: Final[tuple[Dress, ...]] = ("as it is", "without names")


@dataclass(frozen=True, slots=True)
class Case:
    """A rig, what is right for it, and where that was said."""

    name: str
    rig: Rig
    truth: Truth
    path: Path


@dataclass(frozen=True, slots=True)
class Result:
    """One case under one mode in one dress. seconds: for the proposal, without reading files."""

    case: Case
    mode: Mode
    dress: Dress
    judged: tuple[Judged, ...]
    baseline: tuple[Judged, ...]
    seconds: float

    @property
    def right(self) -> int:
        """How many bones the proposal is right about."""
        return sum(one.right for one in self.judged)


@dataclass(frozen=True, slots=True)
class Band:
    """Pairs shown with one word: how often they are right, and how often they claim to be.

    rigs: how many rigs these pairs are of.
    """

    word: str
    pairs: int
    rigs: int
    right: float
    claimed: float


def find_cases(folders: Iterable[Path], rigs: Sequence[Path] = ()) -> list[Case]:
    """Every truth file in the folders with its rig, which lies beside it or in one of `rigs`.

    Raises BadFileError for a truth file or a rig that cannot be read, for a rig that is nowhere,
    and for a folder that is not there or has no truth file.
    """
    cases = []
    for folder in folders:
        if not folder.is_dir():
            raise BadFileError(
                "there is no such folder",
                where=folder,
                hint="leave it out to measure the cast that comes with the program",
            )
        found = sorted(folder.glob(f"*{ENDING}"))
        if not found:
            raise BadFileError(
                "there is no truth file in this folder",
                where=folder,
                expected=f"files that end in {ENDING}",
                hint="docs/mapping-benchmark.md describes them",
            )
        cases += [_case(path, rigs) for path in found]
    return cases


def _case(path: Path, rigs: Sequence[Path]) -> Case:
    truth = load_truth(path)
    stem = path.name.removesuffix(ENDING)
    names = [truth.rig] if truth.rig else [stem + ending for ending in (".toml", *MODEL_SUFFIXES)]
    folders = list(dict.fromkeys((path.parent, *rigs)))
    places = [folder / name for folder in folders for name in names]
    rig = next((place for place in places if place.is_file()), None)
    if rig is None:
        raise BadFileError(
            "the rig of this truth file is nowhere",
            where=path,
            expected=names[0],
            found=f"not in {', '.join(map(str, folders))}",
            hint="name its folder with --rigs",
        )
    puppet = load_puppet(rig)
    check_names(truth, puppet.model.armature.names, path)
    traits = puppet.traits
    return Case(
        stem,
        Rig(puppet.model.armature, traits.preferences, dict(traits.masters)),
        truth,
        path,
    )


def run(cases: Iterable[Case], dresses: Sequence[Dress] = DRESSES) -> Iterator[Result]:
    """Every case under every mode that its truth speaks of."""
    modes: tuple[Mode, ...] = ("fk", "ik")
    for case in cases:
        for mode in modes:
            truth = case.truth.of(mode)
            if not (truth.expect or truth.unmapped):
                continue
            for dress in dresses:
                rig, renamed = _dressed(case.rig, truth, dress)
                started = time.perf_counter()
                proposal = rig.propose(_verdicts(rig, renamed, mode))[0]
                seconds = time.perf_counter() - started
                yield Result(
                    case,
                    mode,
                    dress,
                    tuple(judge(proposal, renamed)),
                    tuple(judge(_plain(rig.armature, mode, renamed.masters), renamed)),
                    seconds,
                )


def _verdicts(rig: Rig, truth: ModeTruth, mode: Mode) -> Verdicts:
    return Verdicts(mode, masters={**rig.masters, **truth.masters})


def _dressed(rig: Rig, truth: ModeTruth, dress: Dress) -> tuple[Rig, ModeTruth]:
    if dress == "as it is":
        return rig, truth
    armature = rig.armature
    new = {name: f"b{bone}" for bone, name in enumerate(armature.names)}

    def called(name: str) -> str:
        return new.get(name, name)

    return (
        replace(
            rig,
            armature=replace(armature, names=tuple(new.values())),
            masters={m: tuple(map(called, bones)) for m, bones in rig.masters.items()},
        ),
        ModeTruth(
            expect={called(bone): partners for bone, partners in truth.expect.items()},
            unmapped=tuple(map(called, truth.unmapped)),
            ordered=tuple(tuple(map(called, run)) for run in truth.ordered),
            masters={m: tuple(map(called, bones)) for m, bones in truth.masters.items()},
        ),
    )


def calibration(results: Iterable[Result]) -> list[Band]:
    """How much the words for certainty are worth, the surest first.

    Each pair counts once, with the names of its bones: without them it is nearly always the same.
    """
    pairs = [
        (one.pair.confidence, one.right, result.case.path)
        for result in results
        if result.dress == "as it is"
        for one in result.judged
        if one.pair is not None
    ]
    bands = []
    for word, low, high in (
        ("sure", SURE, 2.0),
        ("likely", LIKELY, SURE),
        ("doubtful", -1.0, LIKELY),
    ):
        inside = [pair for pair in pairs if low <= pair[0] < high]
        count = len(inside)
        claimed = float(np.mean([claim for claim, _, _ in inside])) if count else float("nan")
        right = float(np.mean([right for _, right, _ in inside])) if count else float("nan")
        bands.append(Band(word, count, len({rig for _, _, rig in inside}), right, claimed))
    return bands


def _plain(armature: Armature, mode: Mode, masters: Mapping[str, tuple[str, ...]]) -> Proposal:
    """The baseline: the paper's matrix, and nothing else.

    FK: the Hungarian algorithm over single bones. IK: leaves and masters to control points, the
    best node-edge similarity first.
    """
    found: list[tuple[str, tuple[int, ...], int]]
    if mode == "fk":
        scores = combined_block(armature, HUMAN)
        pairs = hungarian(np.maximum(scores, 0.0), scores > NEVER)
        found = [(armature.names[bone], (bone,), human) for bone, human in pairs]
    else:
        rows = {name: tuple(map(armature.index, bones)) for name, bones in masters.items()}
        held = {bone for bones in rows.values() for bone in bones}
        for bone, children in enumerate(armature.children):
            if not children and bone not in held:
                rows[armature.names[bone]] = (bone,)
        tips = [limb.tip for limb in HUMAN_LIMBS]
        alike = similarity_block(armature, HUMAN)[:, tips]
        scores = np.array([alike[list(bones)].mean(axis=0) for bones in rows.values()])
        names = list(rows)
        pairs = best_first(scores, np.ones(scores.shape, bool))
        found = [(names[row], rows[names[row]], tips[column]) for row, column in pairs]
    return Proposal(
        armature, mode, tuple(Pair(name, bones, human, 0.0) for name, bones, human in found)
    )
