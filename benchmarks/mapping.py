"""Mapping, against the paper's own form of it, and against what it may take.

    python -m benchmarks.mapping

Node-edge similarity, as walks from parents to children, is timed against the same iteration with
the matrices of Sanna 2015, equation 1, built and multiplied; and a new proposal after a decision,
in memory and with a mapping file, against working out everything anew from those matrices. Rounds
alternate. Both ways must come to the same scores and the same proposals, before and after a
decision, and a decision in memory must not take longer than its bound; else the exit status is 1.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np

from puppet.armature import Armature
from puppet.cast import rig_of
from puppet.formats.armature_toml import load_puppet
from puppet.kernel import Floats, Ints
from puppet.mapping.decisions import Decision
from puppet.mapping.human import HUMAN
from puppet.mapping.proposal import Mode
from puppet.mapping.service import MappingService, Rig
from puppet.mapping.similarity import APPLICATIONS, similarity

REPOSITORY = Path(__file__).resolve().parents[1]
CAST = ("fish", "lamp", "dog", "seagull", "ostrich", "snake")
MODES: tuple[Mode, ...] = ("fk", "ik")
ROUNDS = 9
#: Milliseconds that a decision in memory may take, by the number of bones.
BOUND = {True: 16.0, False: 1.0}
#: From so many bones on a rig is a large one, and rounds of seconds are fewer.
LARGE, FEW_ROUNDS = 100, 3


def kronecker(a_parents: Sequence[int] | Ints, b_parents: Sequence[int] | Ints) -> Floats:
    """Equation 1 as it is written: one matrix of (n·m)² entries, applied again and again."""
    (a, a_out, a_in), (b, b_out, b_in) = _matrices(a_parents), _matrices(b_parents)
    step = np.kron(a, b) + np.kron(a.T, b.T) + np.kron(a_out, b_out) + np.kron(a_in, b_in)
    x = np.ones(len(a) * len(b))
    for _ in range(APPLICATIONS):
        x = step @ x
        length = float(np.linalg.norm(x))
        x = x / length if length > 0 else x
    return np.asarray(x.reshape(len(a), len(b)))


def _matrices(parents: Sequence[int] | Ints) -> tuple[Floats, Floats, Floats]:
    """Adjacency, and the diagonal matrices of out- and in-degrees."""
    count = len(parents)
    adjacency = np.zeros((count, count))
    for bone, parent in enumerate(parents):
        if parent >= 0:
            adjacency[int(parent), bone] = 1.0
    return adjacency, np.diag(adjacency.sum(axis=1)), np.diag(adjacency.sum(axis=0))


@contextmanager
def papers_matrices() -> Iterator[None]:
    """Whatever evidence is gathered meanwhile rests on `kronecker`."""

    def block(armature: Armature, human: Armature) -> Floats:
        return kronecker(armature.parents, human.parents)

    with patch("puppet.mapping.evidence.similarity_block", block):
        yield


def creature(count: int) -> Armature:
    """A random tree of `count` bones."""
    rng = np.random.default_rng(0)
    parents = [-1] + [int(rng.integers(max(0, bone - 30), bone)) for bone in range(1, count)]
    names = [f"b{bone}" for bone in range(count)]
    return Armature.build("creature", names, parents, rng.normal(size=(count, 3)) * 0.1)


def alternating(*runs: Callable[[], object], rounds: int = ROUNDS) -> list[float]:
    """Median milliseconds of each."""
    times: list[list[float]] = [[] for _ in runs]
    for run in runs[:1]:
        run()  # compiles, and fills caches
    for _ in range(rounds):
        for run, kept in zip(runs, times, strict=True):
            started = time.perf_counter()
            run()
            kept.append(1e3 * (time.perf_counter() - started))
    return [statistics.median(kept) for kept in times]


def again(rig: Rig, mode: Mode, path: Path | None = None) -> Callable[[], object]:
    """Forbids the first pair and clears that again, in turn; each is a decision.

    path: the mapping file in which it is kept, on the disk before the proposal is given.
    """
    service = MappingService({"it": rig}, {"it": mode}, path)
    pair = service.propose("it")[0].pairs[0]
    acts = [
        [Decision("forbid", mode, pair.name, pair.partner)],
        [Decision("clear", mode, pair.name, pair.partner)],
    ]

    def decide() -> None:
        acts.append(acts.pop(0))
        service.decide("it", acts[0])

    decide()
    decide()
    return decide


def afresh(rig: Rig) -> Rig:
    """The same, of which nothing has been worked out yet."""
    return replace(rig, armature=replace(rig.armature))


def anew(rig: Rig, mode: Mode) -> Callable[[], object]:
    """A proposal from the beginning, on the paper's matrices."""

    def propose() -> None:
        with papers_matrices():
            MappingService({"it": afresh(rig)}, {"it": mode}).propose("it")

    return propose


def answers(rig: Rig, mode: Mode) -> list[object]:
    """The three best proposals, before and after the best pair of the first was forbidden."""
    service = MappingService({"it": rig}, {"it": mode})
    before = service.propose("it", k=3)
    pair = before[0].pairs[0]
    service.decide("it", [Decision("forbid", mode, pair.name, pair.partner)])
    after = service.propose("it", k=3)
    return [proposal.as_json(explain=True) for proposal in (*before, *after)]


def same_answers(rig: Rig, mode: Mode) -> bool:
    """Whether the paper's matrices lead to the same proposals as ours do."""
    with papers_matrices():
        theirs = answers(afresh(rig), mode)
    return theirs == answers(afresh(rig), mode)


def main() -> None:
    rigs = {
        name: rig_of(load_puppet(REPOSITORY / f"configs/armatures/{name}.glb")) for name in CAST
    }
    rigs["500 bones"] = Rig(creature(500))
    worst, wrong = 0.0, list[str]()
    print(f"mapping, milliseconds, median of {ROUNDS} alternating rounds", end="")
    print(f" ({FEW_ROUNDS} where the paper's matrices are large)")
    print(f"{'':11}{'similarity':>11}{'Kronecker':>11}{'ratio':>8}", end="")
    print(f"{'mode':>6}{'decision':>10}{'saved':>8}{'anew':>9}{'ratio':>8}{'bound':>7}")
    for name, rig in rigs.items():
        parents, human = rig.armature.parents, HUMAN.parents
        large = len(rig.armature) >= LARGE
        rounds, bound = FEW_ROUNDS if large else ROUNDS, BOUND[large]
        worst = max(
            worst, float(np.abs(similarity(parents, human) - kronecker(parents, human)).max())
        )
        fast, dense = alternating(
            partial(similarity, parents, human), partial(kronecker, parents, human), rounds=rounds
        )
        print(f"{name:11}{fast:11.3f}{dense:11.2f}{dense / fast:6.0f} ×", end="")
        for mode in MODES:
            with tempfile.TemporaryDirectory() as folder:
                kept = Path(folder) / "kept.mappings.toml"
                memory, saved = alternating(again(rig, mode), again(rig, mode, kept))
            (scratch,) = alternating(anew(rig, mode), rounds=rounds)
            print(" " * (0 if mode == MODES[0] else 41), end="")
            print(f"{mode.upper():>6}{memory:10.2f}{saved:8.1f}{scratch:9.1f}", end="")
            print(f"{scratch / memory:6.0f} ×{bound:7.0f}")
            if memory > bound:
                wrong.append(f"{name}, {mode.upper()}: a decision takes more than {bound:g} ms")
            if not same_answers(rig, mode):
                wrong.append(f"{name}, {mode.upper()}: the paper's matrices propose something else")
    print(f"similarities differ by at most {worst:.1e}")
    if worst > 1e-9:
        wrong.append("the similarities are not the same")
    print("\n".join(wrong) or "all bounds hold, and all proposals are the same")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
