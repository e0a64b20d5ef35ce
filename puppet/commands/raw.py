"""`puppet record --raw`: what a camera sees, to be looked at again and again."""

from __future__ import annotations

import threading
from pathlib import Path

from puppet.commands.files import check_fresh, err, recording_progress, warn
from puppet.commands.signals import stop_event
from puppet.errors import BadShowError
from puppet.tracking.cameras.camera import Camera


def record_raw(path: Path, source: str, seconds: float | None, overwrite: bool) -> None:
    """Record a camera until it ends, `seconds` are over or Ctrl-C is pressed."""
    from puppet.tracking.cameras.open_camera import open_camera
    from puppet.tracking.cameras.raw_writer import RawWriter

    check_fresh(path, overwrite)
    stop = stop_event()
    camera = open_camera(source)
    threading.Thread(target=_close_when, args=(stop, camera), daemon=True).start()
    # What was there before stays until the new recording is complete.
    part = path.with_name(path.name + ".part")
    written = with_depth = lost = 0
    started: float | None = None
    last: int | None = None
    try:
        with (
            recording_progress("size") as progress,
            RawWriter(part, camera.info) as writer,
        ):
            task = progress.add_task(
                f"recording {Path(source).name}", total=len(camera) or None, size=""
            )
            for shot in camera:
                started = shot.time if started is None else started
                if stop.is_set() or (seconds is not None and shot.time - started > seconds):
                    break
                writer.write(shot)
                written += 1
                with_depth += shot.depth is not None
                lost += 0 if last is None else max(shot.sequence - last - 1, 0)
                last = shot.sequence
                progress.update(task, completed=written, size=f"{writer.size / 1e6:.0f} MB")
    finally:
        camera.close()
        if written == 0:
            part.unlink(missing_ok=True)
    if written == 0:
        raise BadShowError("the camera gave no picture: nothing was recorded", where=source)
    part.replace(path)
    err.print(
        f"{path}: {written} shots, depth in {with_depth} of them, "
        f"{path.stat().st_size / 1e6:.1f} MB",
        highlight=False,
    )
    if lost:
        warn(f"{lost} shots were lost on the way: the camera is quicker than this machine writes")
    for warning in camera.warnings:
        warn(warning)


def _close_when(stop: threading.Event, camera: Camera) -> None:
    """A camera in trouble gives no shot after which to look whether it is time to end."""
    stop.wait()
    camera.close()
