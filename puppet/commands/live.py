"""`puppet run`, `track`, `stage` and `view`: the processes of a live show."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import msgspec
from rich.console import Console

from puppet.cast import load_cast
from puppet.commands.signals import stop_event
from puppet.errors import BadShowError
from puppet.line import Line
from puppet.net.bus import Bus
from puppet.net.run import Supervisor, write_report
from puppet.net.stage import Stage
from puppet.net.track import run_track
from puppet.net.view import Viewer, run_headless, run_window
from puppet.render.background import BackgroundOutput
from puppet.render.context import headless_context
from puppet.render.output import open_output
from puppet.render.window import Window, display_available
from puppet.show import BusConfig, Show, load_show
from puppet.tracking.calibration.calibrated import saved_stance, use_calibration
from puppet.tracking.open import check_source, open_source


def _say(text: str) -> None:
    sys.stderr.write(text + "\n")
    sys.stderr.flush()


def _load(path: Path, port: int | None) -> Show:
    show = load_show(path)
    if port is None:
        return show
    return msgspec.structs.replace(show, bus=BusConfig(endpoint=f"tcp/127.0.0.1:{port}"))


def run_show(
    path: Path,
    headless: bool,
    seconds: float | None,
    report: Path | None,
    port: int | None,
    source: str | None,
    outputs: dict[str, Path | None],
) -> int:
    """Supervise a whole show. -> exit code"""
    show = _load(path, port)
    if source is not None:
        show = with_source(show, source)
    # What is wrong with sources and puppets is told once, before anything starts.
    _check_sources(show, path, source)
    load_cast(show, path)
    if not headless and not display_available():
        headless = True
        _say("there is no display: running without a window")
        if not any(outputs.values()):
            outputs = {**outputs, "png": Path("puppet-view.png")}
            _say("the newest picture is kept in puppet-view.png, once a second")
    view = ["--headless"] if headless else []
    for option, target in outputs.items():
        if target is not None:
            view += [f"--{option}", str(target)]
    common = [] if port is None else ["--port", str(port)]
    supervisor = Supervisor(
        path,
        show,
        {
            "stage": common,
            "track": [*common, *([] if source is None else ["--source", source])],
            "view": [*common, *view],
        },
        _say,
    )
    stop = stop_event()
    _say(f"starting {show.name} (the first time takes a while)")
    console = Console(stderr=True)
    if console.is_terminal:
        with console.status("starting …") as status:
            code = supervisor.run(stop, seconds, lambda: status.update(supervisor.status_line()))
    else:
        code = supervisor.run(stop, seconds, None)
    if supervisor.has_drawn:
        _say(supervisor.status_line())
    if report is not None:
        write_report(supervisor.report(), report)
        _say(f"the report is in {report}")
    return code


def with_source(show: Show, text: str) -> Show:
    """The show with one source instead of its own; how it is played stays as the show says."""
    config = msgspec.structs.replace(show.all_sources[0], path=text, name="", remote=False)
    return msgspec.structs.replace(show, source=config, sources=())


def _check_sources(show: Show, path: Path, source: str | None) -> None:
    """See whether each source is there, as far as that takes no time: nothing is kept open."""
    for config in show.all_sources:
        if not config.remote:
            check_source(config.path, None if source else path.parent)


def track_show(
    path: Path, source: str | None, port: int | None, camera: str | None, stage: str | None
) -> None:
    """Publish one source until it ends."""
    show = _load(path, port)
    if stage is not None:
        show = msgspec.structs.replace(show, bus=BusConfig(endpoint=stage))
    if camera is None and len(show.all_sources) > 1 and source is None:
        raise BadShowError(
            "the show has several sources",
            where=path,
            expected="--camera with one of: " + ", ".join(one.name for one in show.sources),
            found="none",
        )
    config = show.source_named(camera)
    stop = stop_event()
    opened = open_source(
        source or config.path,
        folder=None if source else path.parent,
        repeat=config.repeat,
        speed=config.speed,
        max_rate=config.max_rate,
        tracking=show.tracking,
        oak=config.oak,
        warn=lambda warning: _say(f"puppet track: {warning}"),
    )
    use_calibration(opened, path, lambda warning: _say(f"puppet track: {warning}"))
    with Bus.join(show.bus.endpoint, show.key) as bus:
        told: set[str] = set()

        def warn(text: str) -> None:
            told.add(text)
            _say(f"puppet track: {text}")

        run_track(opened, bus, stop, camera or "", warn)
    for warning in getattr(opened, "warnings", ()):  # a video knows some only when it is over
        if warning not in told:
            warn(warning)
    if opened.info.live and not stop.is_set():
        _say(f"puppet track: {opened.info.name} gives no more pictures")
        sys.exit(3)  # not the end of a recording: to be started again


def stage_show(path: Path, port: int | None) -> None:
    """Be the hub of a show."""
    show = _load(path, port)
    stop = stop_event()
    with Bus.host(show.bus.endpoint, show.key) as bus:
        cast = load_cast(show, path)
        for puppet in cast:
            for warning in puppet.model.warnings:
                _say(f"puppet stage: {puppet.name}: {warning}")
            for warning in cast.mappings.warnings(puppet.name):
                _say(f"puppet stage: {warning}")
        line = Line.of(show, cast)
        line.warm_up()
        fusion = None
        if len(show.all_sources) > 1:
            from puppet.tracking.fusion.fusion import Fusion

            fusion = Fusion()
            fusion.warm_up()
        Stage(line, bus, cast.mappings, fusion, saved_stance(path)).run(stop)


def view_show(
    path: Path,
    headless: bool,
    port: int | None,
    outputs: dict[str, Path | None],
) -> None:
    """Draw a show."""
    show = _load(path, port)
    stop = stop_event()
    if not headless and not display_available():
        _say("puppet view: there is no display: drawing without a window")
        headless = True
    targets = {kind: target for kind, target in outputs.items() if target is not None}
    sinks = [
        # A picture to look at is replaced once a second; films take every picture.
        BackgroundOutput(open_output(target), every=1.0 if kind == "png" else 0.0)
        for kind, target in targets.items()
    ]
    view = show.view
    window = None if headless else Window(f"puppet — {show.name}", (view.width, view.height))
    ctx = headless_context() if window is None else window.ctx
    with Bus.join(show.bus.endpoint, show.key) as bus:
        viewer = Viewer(ctx, bus, view, show.puppets)
        if window is None:
            run_headless(viewer, stop, sinks)
        else:
            window.on_picture = lambda: _keep_picture(viewer)
            run_window(viewer, window, stop, sinks)
            window.close()
    for sink, target in zip(sinks, targets.values(), strict=True):
        if sink.failure is not None:
            raise sink.failure
        if sink.left_out:
            _say(
                f"puppet view: {sink.left_out} pictures came too fast to be kept in "
                f"{target}; `puppet render` draws every one, without hurry"
            )


def _keep_picture(viewer: Viewer) -> None:
    """Key P: a picture of what is seen, beside nothing that was there before."""
    path = Path(time.strftime("puppet-%Y%m%d-%H%M%S.png"))
    output = open_output(path)
    output.write(viewer.renderer.read(), 0.0)
    output.close()
    _say(f"puppet view: {path}")
