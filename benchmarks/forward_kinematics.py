"""Forward kinematics of 60 bones against SciPy's rotations.

    python -m benchmarks.forward_kinematics

Both walk the same random tree from the root; SciPy composes `Rotation` objects bone by bone, as one
would write it with the library, and in the second row level by level with stacked rotations, as one
would write it for speed. Rounds alternate; the median counts; the results must agree.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.pose import Pose, forward_kinematics

BONES = 60
ROUNDS = 15


def tree(seed: int) -> Armature:
    """A random armature, of creature-like depth."""
    rng = np.random.default_rng(seed)
    parents = [-1] + [int(rng.integers(max(0, bone - 4), bone)) for bone in range(1, BONES)]
    return Armature.build(
        "tree", [f"b{i}" for i in range(BONES)], parents, rng.normal(size=(BONES, 3))
    )


def scipy_by_bone(armature: Armature, pose: Pose) -> Floats:
    world: list[Rotation] = []
    positions = np.empty((BONES, 3))
    root = Rotation.from_quat(pose.rotation)
    local = [Rotation.from_quat(q) for q in pose.bones]
    for bone, parent in enumerate(armature.parents):
        if parent < 0:
            world.append(root * local[bone])
            positions[bone] = pose.translation + root.apply(armature.offsets[bone].copy())
        else:
            world.append(world[parent] * local[bone])
            positions[bone] = positions[parent] + world[parent].apply(armature.offsets[bone].copy())
    return positions


def scipy_by_level(armature: Armature, pose: Pose) -> Floats:
    positions, rotations = np.empty((BONES, 3)), np.empty((BONES, 4))
    for depth in range(int(armature.depths.max()) + 1):
        level = np.flatnonzero(armature.depths == depth)
        parents = armature.parents[level]
        if depth == 0:
            above = Rotation.from_quat(np.tile(pose.rotation, (len(level), 1)))
            origin = np.tile(pose.translation, (len(level), 1))
        else:
            above = Rotation.from_quat(rotations[parents])
            origin = positions[parents]
        positions[level] = origin + above.apply(armature.offsets[level])
        rotations[level] = (above * Rotation.from_quat(pose.bones[level])).as_quat()
    return positions


def main() -> None:
    armature = tree(1)
    local = Rotation.random(BONES, random_state=2).as_quat()
    pose = Pose(np.ones(3), Rotation.random(random_state=3).as_quat(), local)
    ways: dict[str, tuple[Callable[[], Floats], int]] = {
        "puppet": (lambda: forward_kinematics(armature, pose)[0], 2000),
        "SciPy, bone by bone": (lambda: scipy_by_bone(armature, pose), 20),
        "SciPy, level by level": (lambda: scipy_by_level(armature, pose), 20),
    }
    reference = ways["SciPy, bone by bone"][0]()
    for name, (way, _) in ways.items():
        if not np.allclose(way(), reference, atol=1e-9):
            print(f"{name} does not agree with SciPy")
            sys.exit(1)
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(ROUNDS):
        for name, (way, repeats) in ways.items():
            started = time.perf_counter()
            for _ in range(repeats):
                way()
            times[name].append((time.perf_counter() - started) / repeats)
    ours = statistics.median(times["puppet"])
    print(f"forward kinematics, {BONES} bones, median of {ROUNDS} alternating rounds")
    for name, values in times.items():
        median = statistics.median(values)
        print(f"  {name:<22} {1e6 * median:9.1f} µs {median / ours:9.1f} ×")


if __name__ == "__main__":
    main()
