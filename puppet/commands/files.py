"""`puppet record`, `import` and `models`: commands that read and write files."""

from __future__ import annotations

import contextlib
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from puppet.commands.signals import stop_event
from puppet.errors import BadShowError, PuppetError

err = Console(stderr=True, soft_wrap=True)


def warn(text: str) -> None:
    err.print(text, style="yellow", markup=False, highlight=False)


def check_fresh(path: Path, overwrite: bool) -> None:
    """Raises BadShowError if writing `path` would lose something, or cannot work."""
    if path.exists() and not overwrite:
        raise BadShowError(
            "there is such a file already", where=path, hint="another name, or --overwrite"
        )
    if not path.resolve().parent.is_dir():
        raise BadShowError("there is no such folder", where=path.resolve().parent)


def recording_progress(field: str) -> Progress:
    """How far a recording is. field: what of its own it tells beside that."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(f"{{task.fields[{field}]}}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=err,
    )


def record_take(path: Path, source: str, seconds: float | None, overwrite: bool) -> None:
    """Record a source until it ends, `seconds` are over or Ctrl-C is pressed."""
    from puppet.tracking.open import open_source
    from puppet.tracking.takes.take import TakeWriter

    check_fresh(path, overwrite)
    stop = stop_event()
    opened = open_source(source, warn=warn)
    # What was there before stays until the new take is complete.
    part = path.with_name(path.name + ".part")
    written = present = 0
    started: float | None = None
    with (
        recording_progress("seen") as progress,
        TakeWriter(part, opened.info) as writer,
    ):
        task = progress.add_task(
            f"recording {Path(source).name}", total=len(opened) or None, seen=""
        )
        try:
            for moment in opened:
                started = moment.time if started is None else started
                if stop.is_set() or (seconds is not None and moment.time - started > seconds):
                    break
                writer.write(moment)
                written += 1
                present += moment.present
                progress.update(task, completed=written, seen=f"{present} with somebody")
        finally:
            opened.close()
    if written == 0:
        part.unlink()
        raise BadShowError("the source gave no frame: nothing was recorded", where=source)
    part.replace(path)
    err.print(
        f"{path}: {written} frames, somebody in {present} of them, "
        f"{path.stat().st_size / 1000:.0f} kB",
        highlight=False,
    )
    for warning in getattr(opened, "warnings", ()):  # a video knows only when it is over
        warn(warning)
    if present == 0:
        err.print("nobody was seen: is the whole person in the picture?", style="yellow")


def import_files(files: list[Path], output: Path | None, overwrite: bool) -> int:
    """Import each file; one that cannot be read does not keep the others back. -> exit code"""
    from puppet.tracking.takes.recording import import_recording
    from puppet.tracking.takes.take import write_take

    into_folder = output is not None and (len(files) > 1 or output.is_dir())
    if output is not None and into_folder:
        output.mkdir(parents=True, exist_ok=True)
    failed = 0
    for file in files:
        if output is None:
            target = Path(file.stem + ".mcap")
        else:
            target = output / (file.stem + ".mcap") if into_folder else output
        try:
            check_fresh(target, overwrite)
            imported = import_recording(file)
            part = target.with_name(target.name + ".part")
            write_take(part, imported.info, imported.take)
            part.replace(target)
        except PuppetError as error:
            failed += 1
            err.print(f"puppet: {error}", markup=False, highlight=False)
            continue
        err.print(f"{file.name} → {target}", highlight=False)
        for line in imported.report.lines():
            err.print(f"  {line}", markup=False, highlight=False)
    return 2 if failed else 0


def get_models(cache: Path | None, wheel: Path | None) -> None:
    """Fetch the pose models, if they are not there; from a wheel, if one is given."""
    from puppet.tracking.people.models import fetch_models, model_paths

    with contextlib.suppress(PuppetError):
        found = model_paths(cache)
        err.print(f"the pose models are in {found.detector.parent}", highlight=False)
        return
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), console=err
    ) as progress:
        task = progress.add_task("pose models", total=1.0)
        found = fetch_models(
            lambda what, share: progress.update(task, description=what, completed=share),
            cache,
            wheel=wheel,
        )
    err.print(f"the pose models are in {found.detector.parent}", highlight=False)
