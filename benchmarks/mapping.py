"""Mapping, against the paper's own form of it.

    python -m benchmarks.mapping

Two things are timed in alternating rounds. The node-edge similarity, as walks from parents to
children, against the same iteration with the matrices of Sanna 2015, equation 1, built and
multiplied: both must give the same scores. And a new proposal after a decision, which only reads
what was worked out before, against working everything out again with those matrices.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from puppet.armature import Armature
from puppet.cast import rig_of
from puppet.formats.armature_toml import load_puppet
from puppet.kernel import Floats
from puppet.mapping.decisions import Decision
from puppet.mapping.human import HUMAN
from puppet.mapping.proposal import Mode
from puppet.mapping.service import MappingService, Rig
from puppet.mapping.similarity import APPLICATIONS, similarity

REPOSITORY = Path(__file__).resolve().parents[1]
CAST = ("fish", "lamp", "dog", "seagull", "ostrich", "snake")
ROUNDS = 7


def kronecker(a_parents: Floats, b_parents: Floats) -> Floats:
    """Equation 1 as it is written: one matrix of (n·m)² entries, applied again and again."""
    (a, a_out, a_in), (b, b_out, b_in) = _matrices(a_parents), _matrices(b_parents)
    step = np.kron(a, b) + np.kron(a.T, b.T) + np.kron(a_out, b_out) + np.kron(a_in, b_in)
    x = np.ones(len(a) * len(b))
    for _ in range(APPLICATIONS):
        x = step @ x
        length = float(np.linalg.norm(x))
        x = x / length if length > 0 else x
    return np.asarray(x.reshape(len(a), len(b)))


def _matrices(parents: Floats) -> tuple[Floats, Floats, Floats]:
    """Adjacency, and the diagonal matrices of out- and in-degrees."""
    count = len(parents)
    adjacency = np.zeros((count, count))
    for bone, parent in enumerate(parents):
        if parent >= 0:
            adjacency[int(parent), bone] = 1.0
    return adjacency, np.diag(adjacency.sum(axis=1)), np.diag(adjacency.sum(axis=0))


def creature(count: int) -> Armature:
    """A random tree of `count` bones."""
    rng = np.random.default_rng(0)
    parents = [-1] + [int(rng.integers(max(0, bone - 30), bone)) for bone in range(1, count)]
    names = [f"b{bone}" for bone in range(count)]
    return Armature.build("creature", names, parents, rng.normal(size=(count, 3)) * 0.1)


def alternating(ours: Callable[[], object], theirs: Callable[[], object]) -> tuple[float, float]:
    """Median seconds of each."""
    times: tuple[list[float], list[float]] = ([], [])
    ours()  # compiles, and fills caches
    for _ in range(ROUNDS):
        for run, kept in zip((ours, theirs), times, strict=True):
            started = time.perf_counter()
            run()
            kept.append(time.perf_counter() - started)
    return statistics.median(times[0]), statistics.median(times[1])


def again(rig: Rig, mode: Mode) -> Callable[[], object]:
    """Forbids the first pair and clears that again, in turn; each is a decision."""
    service = MappingService({"it": rig}, {"it": mode})
    pair = service.propose("it")[0].pairs[0]
    acts = [
        [Decision("forbid", mode, pair.name, pair.partner)],
        [Decision("clear", mode, pair.name, pair.partner)],
    ]

    def decide() -> None:
        acts.append(acts.pop(0))
        service.decide("it", acts[0])

    return decide


def anew(armature: Armature, mode: Mode) -> Callable[[], object]:
    """Everything from the beginning, with the paper's matrices."""

    def propose() -> None:
        kronecker(armature.parents.astype(float), HUMAN.parents.astype(float))
        MappingService({"it": Rig(armature)}, {"it": mode}).propose("it")

    return propose


def main() -> None:
    rigs = {
        name: rig_of(load_puppet(REPOSITORY / f"configs/armatures/{name}.glb")) for name in CAST
    }
    rigs["500 bones"] = Rig(creature(500))
    worst = 0.0
    print(f"mapping, median of {ROUNDS} alternating rounds")
    print(f"{'':12}{'similarity':>14}{'Kronecker':>14}{'ratio':>9}", end="")
    print(f"{'decision FK':>14}{'IK':>11}{'anew FK':>13}{'ratio':>9}")
    for name, rig in rigs.items():
        parents, human = rig.armature.parents, HUMAN.parents
        a, b = parents.astype(float), human.astype(float)
        worst = max(worst, float(np.abs(similarity(parents, human) - kronecker(a, b)).max()))
        fast, dense = alternating(partial(similarity, parents, human), partial(kronecker, a, b))
        forward, scratch = alternating(again(rig, "fk"), anew(rig.armature, "fk"))
        effectors, _ = alternating(again(rig, "ik"), lambda: None)
        print(f"{name:12}{1e3 * fast:11.3f} ms{1e3 * dense:11.2f} ms{dense / fast:7.0f} ×", end="")
        print(f"{1e3 * forward:11.2f} ms{1e3 * effectors:8.2f} ms", end="")
        print(f"{1e3 * scratch:10.1f} ms{scratch / forward:7.0f} ×")
    print(f"similarities differ by at most {worst:.1e}")
    if worst > 1e-9:
        sys.exit(1)


if __name__ == "__main__":
    main()
