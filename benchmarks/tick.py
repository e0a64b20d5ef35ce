"""The numeric tick, compiled against the same functions as plain Python.

    python -m benchmarks.tick

One tick is what the stage does between a message and its answer: decode, condition, map, drive, FK
of every bone, encode; for the two puppets of the rehearsal show. The reference is this very program
in a second process with NUMBA_DISABLE_JIT=1. Rounds alternate, the median of rounds counts, and
both must give the same poses, or there is nothing to compare.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

REPOSITORY = Path(__file__).resolve().parents[1]
SHOW = REPOSITORY / "configs/shows/rehearsal.toml"
ROUNDS = 5


def measure(frames: int) -> dict[str, Any]:
    """Run `frames` ticks. -> seconds per tick, and a sample of the poses for comparison."""
    from puppet.cast import load_cast
    from puppet.line import Line
    from puppet.net.messages import Decoder, SkeletonMessage, encode
    from puppet.net.scene import scene_of
    from puppet.pose import forward_kinematics
    from puppet.show import load_show
    from puppet.tracking.takes.rehearsal import Rehearsal

    show = load_show(SHOW)
    cast = load_cast(show, SHOW)
    line = Line(cast, show.conditioning)
    line.warm_up()
    messages = [
        encode(SkeletonMessage.of(moment, source="b", synthetic=True, stream_ns=0, sent_ns=0))
        for moment, _ in zip(Rehearsal(), range(frames), strict=False)
    ]
    decode = Decoder(SkeletonMessage)
    armatures = {puppet.name: puppet.model.armature for puppet in cast}
    for armature in armatures.values():  # compile what the warm-up of the line does not use
        from puppet.pose import rest_pose

        forward_kinematics(armature, rest_pose(armature))
    samples = []
    started = time.perf_counter()
    for data in messages:
        tick = line.step(decode(data).moment())
        for name, pose in tick.poses.items():
            positions, _ = forward_kinematics(armatures[name], pose)
            samples.append(positions[-1])
        encode(scene_of(tick, sequence=0, frame_sent_ns=0, cast=0, source="b", synthetic=True))
    seconds = (time.perf_counter() - started) / frames
    return {"seconds": seconds, "poses": np.array(samples).tolist()}


def main() -> None:
    compiled, plain = [], []
    frames = 300
    for _ in range(ROUNDS):
        compiled.append(_in_process(frames, jit=True))
        plain.append(_in_process(frames, jit=False))
    same = np.allclose(compiled[0]["poses"], plain[0]["poses"], atol=1e-9)
    a = statistics.median(run["seconds"] for run in compiled)
    b = statistics.median(run["seconds"] for run in plain)
    print(f"tick, fish and lamp, {frames} frames, median of {ROUNDS} alternating rounds")
    print(f"  numba          {1e6 * a:9.0f} µs")
    print(f"  JIT off        {1e6 * b:9.0f} µs")
    print(f"  ratio          {b / a:9.1f} ×   (poses equal within 1e-9 m: {same})")
    if not same:
        sys.exit(1)


def _in_process(frames: int, *, jit: bool) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.tick", "--measure", str(frames)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "0" if jit else "1"},
        cwd=REPOSITORY,
        check=True,
        capture_output=True,
        text=True,
    )
    result: dict[str, Any] = json.loads(done.stdout)
    return result


if __name__ == "__main__":
    if sys.argv[1:2] == ["--measure"]:
        print(json.dumps(measure(int(sys.argv[2]))))
    else:
        main()
