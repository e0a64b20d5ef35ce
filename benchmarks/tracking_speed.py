"""How fast people are tracked, and where the time goes, against the pose network alone.

    python -m benchmarks.tracking_speed [--wheel pose2sim-0.10.49-py3-none-any.whl]

Clips of one and of two people (Pose2Sim's demonstrations) are written anew at 720p and go the whole
way from the file to skeletons in the stage frame, as `puppet track` goes it. The reference is the
landmark network alone, once for each performer in each image, on one thread: that much has to be
spent. Rounds alternate; the median counts.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
import zipfile
from pathlib import Path
from typing import Final

import cv2
import numpy as np
import onnxruntime

from benchmarks.clips import POSE2SIM, download
from puppet.tracking.cameras.video_file import VideoFile
from puppet.tracking.people.models import PoseModels, model_paths
from puppet.tracking.watcher import Watcher

CLIPS: Final = {
    "one performer": ("Pose2Sim/Demo_SinglePerson/videos/cam01.mp4", 1, 30.0),
    "two performers": ("Pose2Sim/Demo_MultiPerson/videos/cam01.mp4", 2, 20.0),
}
LONG_SIDE: Final = 1280
ROUNDS: Final = 3


def at_720p(clip: Path, target: Path) -> Path:
    """The clip with so many pixels along its longer side."""
    capture = cv2.VideoCapture(str(clip))
    writer = None
    while (read := capture.read())[0]:
        height, width = read[1].shape[:2]
        scale = LONG_SIDE / max(height, width)
        size = (round(width * scale), round(height * scale))
        if writer is None:
            code = cv2.VideoWriter.fourcc(*"mp4v")
            writer = cv2.VideoWriter(str(target), code, capture.get(cv2.CAP_PROP_FPS), size)
        writer.write(cv2.resize(read[1], size, interpolation=cv2.INTER_AREA))
    capture.release()
    if writer is None:
        raise SystemExit(f"{clip} cannot be read")
    writer.release()
    return target


def network_seconds(models: PoseModels, looks: int) -> float:
    """Seconds of one look of the landmark network."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(str(models.landmarks), options)
    crop = np.random.default_rng(0).random((1, 256, 256, 3), np.float32)
    session.run(None, {"input_1": crop})
    started = time.perf_counter()
    for _ in range(looks):
        session.run(None, {"input_1": crop})
    return (time.perf_counter() - started) / looks


def measure(clip: Path, models: PoseModels) -> tuple[float, dict[str, float], list[int]]:
    """Seconds a frame, milliseconds by stage, and how many performers each moment has."""
    watcher = Watcher(VideoFile(clip), models)
    started = time.perf_counter()
    people = [len(moment.frames) for moment in watcher]
    return (time.perf_counter() - started) / len(people), watcher.milliseconds, people


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--wheel", type=Path, help=f"{POSE2SIM}, already downloaded")
    wheel = parser.parse_args().wheel
    models = model_paths()
    met = True
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        with zipfile.ZipFile(wheel or download(POSE2SIM, scratch)) as archive:
            for index, (clip, _, _) in enumerate(CLIPS.values()):
                (scratch / f"{index}.mp4").write_bytes(archive.read(clip))
        for index, (what, (_, performers, least)) in enumerate(CLIPS.items()):
            small = at_720p(scratch / f"{index}.mp4", scratch / f"small{index}.mp4")
            rounds, network = [], []
            for _ in range(ROUNDS):
                rounds.append(measure(small, models))
                network.append(network_seconds(models, 60))
            seconds = statistics.median(one[0] for one in rounds)
            alone = performers * statistics.median(network)
            seen = np.bincount(rounds[0][2], minlength=performers + 1)
            print(f"{what}: {1000 * seconds:.1f} ms a frame, {1 / seconds:.0f} frames a second")
            print(f"  the network alone {1000 * alone:.1f} ms: ratio {seconds / alone:.2f} ×")
            stages = ", ".join(f"{key[:-3]} {value:.1f}" for key, value in rounds[0][1].items())
            print(f"  by stage, ms: {stages}")
            print(f"  frames with 0, 1, 2, … performers: {seen.tolist()}")
            met = met and 1 / seconds >= least
    if not met:
        raise SystemExit("slower than 30 frames a second for one, or 20 for two")


if __name__ == "__main__":
    main()
