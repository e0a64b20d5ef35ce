"""What is right for a rig, as people said it, and how a proposal compares with that.

A truth file lies beside a rig, or names one::

    rig = "husky.glb"                 # relative to this file, or looked for in the rigs' folder
    [fk]
    unmapped = ["Tail.1"]             # must have no partner
    ordered = [["Upper.L", "Lower.L"]]  # must follow each other down one limb
    [fk.expect]
    "Head" = ["head"]                 # bone -> what is right; "" says that no partner is right too
    [ik]
    masters = { wings = ["Wing.L", "Wing.R"] }
    [ik.expect]
    "Head" = ["head"]                 # effector -> control points

A bone that is not mentioned does not count. docs/mapping-benchmark.md tells how to judge a rig.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import msgspec

from puppet.errors import BadFileError
from puppet.mapping.decisions import partners_of
from puppet.mapping.proposal import Mode, Pair, Proposal

_DOWNWARDS = ("shoulder", "upper_arm", "forearm", "hand", "thigh", "shin", "foot")


class ModeTruth(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is right under one mode; see the module."""

    expect: dict[str, tuple[str, ...]] = {}
    unmapped: tuple[str, ...] = ()
    ordered: tuple[tuple[str, ...], ...] = ()
    masters: dict[str, tuple[str, ...]] = {}


class Truth(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A truth file."""

    rig: str | None = None
    fk: ModeTruth = ModeTruth()
    ik: ModeTruth = ModeTruth()

    def of(self, mode: Mode) -> ModeTruth:
        """What is right under `mode`."""
        return self.fk if mode == "fk" else self.ik


@dataclass(frozen=True, slots=True)
class Judged:
    """One bone that the truth speaks of. pair: what was proposed for it, None for nothing."""

    name: str
    pair: Pair | None
    right: bool


def load_truth(path: Path) -> Truth:
    """Raises BadFileError for what is not a truth file, with the place in it."""
    try:
        truth = msgspec.toml.decode(path.read_bytes(), type=Truth)
    except OSError as error:
        raise BadFileError("the truth file cannot be read", where=path, found=str(error)) from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        what, _, place = str(error).partition(" - at ")
        raise BadFileError(
            "this is not a truth file",
            where=f"{path}: {place.strip('`')}" if place else path,
            found=what,
            hint="docs/mapping-benchmark.md describes the format",
        ) from error
    modes: tuple[Mode, ...] = ("fk", "ik")
    for mode in modes:
        for bone, partners in truth.of(mode).expect.items():
            unknown = [p for p in partners if p and p not in partners_of(mode)]
            if unknown or not partners:
                raise BadFileError(
                    "this is not something that drives a bone",
                    where=f"{path}: {mode}.expect.{bone}",
                    expected=f'"" or one of {", ".join(partners_of(mode))}',
                    found=", ".join(unknown) or "nothing",
                )
    return truth


def check_names(truth: Truth, names: tuple[str, ...], path: Path) -> None:
    """Raises BadFileError if the truth speaks of bones that the rig does not have."""
    modes: tuple[Mode, ...] = ("fk", "ik")
    for mode in modes:
        part = truth.of(mode)
        spoken = [*part.expect, *part.unmapped, *(bone for run in part.ordered for bone in run)]
        spoken += [bone for effectors in part.masters.values() for bone in effectors]
        for bone in spoken:
            if bone not in names and bone not in part.masters:
                raise BadFileError(
                    "the rig has no such bone",
                    where=f"{path}: {mode}",
                    expected=f"one of {', '.join(names)}",
                    found=bone,
                )


def judge(proposal: Proposal, truth: ModeTruth) -> list[Judged]:
    """Each bone that the truth speaks of, and whether the proposal is right about it."""
    pairs = {pair.name: pair for pair in proposal.pairs}
    torn = {bone for run in truth.ordered if not _in_order(run, pairs) for bone in run}
    judged = []
    for name, partners in truth.expect.items():
        pair = pairs.get(name)
        right = (pair.partner if pair else "") in partners and name not in torn
        judged.append(Judged(name, pair, right))
    for name in truth.unmapped:
        judged.append(Judged(name, pairs.get(name), name not in pairs))
    return judged


def _in_order(run: tuple[str, ...], pairs: dict[str, Pair]) -> bool:
    """Whether bones that follow each other are driven by bones that do."""
    words = [pairs[bone].partner.split(".") for bone in run if bone in pairs]
    limbs = {(word in _DOWNWARDS[:4], side) for word, side in ((w[0], w[-1]) for w in words)}
    places = [_DOWNWARDS.index(word[0]) if word[0] in _DOWNWARDS else -1 for word in words]
    return len(limbs) <= 1 and places == sorted(set(places))
