"""The command line. Nothing heavy is imported before a command needs it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from puppet import __version__
from puppet.errors import PuppetError

app = typer.Typer(
    help="A person moves before a camera, and puppets of any shape move with them.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

ShowFile = Annotated[Path, typer.Argument(help="The show, a .toml (see configs/shows).")]
Port = Annotated[
    int | None,
    typer.Option(help="Use this port on 127.0.0.1 for the bus instead of the show's."),
]


def main() -> None:
    """Run a command; errors that people can mend are told, not traced."""
    try:
        app(standalone_mode=True)
    except PuppetError as error:
        _say(f"puppet: {error}")
        sys.exit(2)


def _say(text: str) -> None:
    sys.stderr.write(text + "\n")
    sys.stderr.flush()


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        typer.echo(f"puppet {__version__}")
        raise typer.Exit


@app.command()
def run(
    show: ShowFile,
    headless: Annotated[bool, typer.Option(help="No window, even if there is a display.")] = False,
    seconds: Annotated[
        float | None,
        typer.Option(help="Stop so long after the first picture."),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Write what happened as JSON."),
    ] = None,
    port: Port = None,
    source: Annotated[
        str | None,
        typer.Option(help="Use this source instead of the show's: a path, webcam:0, rehearsal."),
    ] = None,
    png: Annotated[Path | None, typer.Option(help="Keep the newest picture here.")] = None,
    mp4: Annotated[Path | None, typer.Option(help="Film the show.")] = None,
    gif: Annotated[Path | None, typer.Option(help="Film the show as a GIF.")] = None,
) -> None:
    """Run a show: tracker, stage and viewer together.

    It ends with Ctrl-C, or when its window is closed.
    """
    from puppet.commands.live import run_show

    sys.exit(
        run_show(
            show,
            headless,
            seconds,
            report,
            port,
            source,
            {"png": png, "mp4": mp4, "gif": gif},
        )
    )


@app.command()
def track(
    show: ShowFile,
    source: Annotated[
        str | None,
        typer.Option(help="Use this source instead of the show's: a path, webcam:0, rehearsal."),
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option(help="Which of the show's sources, if it has several."),
    ] = None,
    stage: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Where the stage is, if elsewhere: tcp/192.168.1.20:7447."
        ),
    ] = None,
    port: Port = None,
) -> None:
    """Publish the skeletons of one source. Start, stop and replace it while a show runs."""
    from puppet.commands.live import track_show

    track_show(show, source, port, camera, stage)


@app.command()
def stage(show: ShowFile, port: Port = None) -> None:
    """Turn skeletons into poses: the hub of a show."""
    from puppet.commands.live import stage_show

    stage_show(show, port)


@app.command()
def view(
    show: ShowFile,
    headless: Annotated[bool, typer.Option(help="No window, even if there is a display.")] = False,
    port: Port = None,
    png: Annotated[Path | None, typer.Option(help="Keep the newest picture here.")] = None,
    mp4: Annotated[Path | None, typer.Option(help="Film the show.")] = None,
    gif: Annotated[Path | None, typer.Option(help="Film the show as a GIF.")] = None,
) -> None:
    """Draw a show, in a window or without one. There may be several."""
    from puppet.commands.live import view_show

    view_show(show, headless, port, {"png": png, "mp4": mp4, "gif": gif})


@app.command()
def render(
    show: ShowFile,
    output: Annotated[
        Path,
        typer.Argument(
            help="Where to: .mp4, .gif, .png (the last moment), or %04d.png for one file each."
        ),
    ],
    source: Annotated[
        str | None,
        typer.Option(help="Use this source instead of the show's."),
    ] = None,
    start: Annotated[float, typer.Option(help="Begin so many seconds into the source.")] = 0.0,
    seconds: Annotated[
        float | None,
        typer.Option(help="How long; all of the source if not given."),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(help="Pictures a second of the film: 30, and 15 for a GIF, if not given."),
    ] = None,
    width: Annotated[int | None, typer.Option(help="Pixels.")] = None,
    height: Annotated[int | None, typer.Option(help="Pixels.")] = None,
    sheet: Annotated[
        int,
        typer.Option(help="A contact sheet of so many moments instead (.png)."),
    ] = 0,
    at: Annotated[
        str,
        typer.Option(help="A contact sheet of these moments: seconds, with commas between."),
    ] = "",
) -> None:
    """Draw a show offline: every frame, smooth edges, no hurry, the same each time."""
    from puppet.commands.offline import render_show

    render_show(
        show,
        output,
        source=source,
        start=start,
        seconds=seconds,
        fps=fps,
        size=(width, height),
        sheet=sheet,
        at=at,
    )


@app.command()
def record(
    take: Annotated[Path, typer.Argument(help="The take to write, .mcap.")],
    source: Annotated[str, typer.Option(help="A video file, webcam:0, rehearsal, another take.")],
    seconds: Annotated[
        float | None,
        typer.Option(help="Stop after so long."),
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a take that is there.")] = False,
) -> None:
    """Record a source as a take. Ctrl-C ends a recording and keeps it."""
    from puppet.commands.files import record_take

    record_take(take, source, seconds, overwrite)


@app.command(name="import")
def import_(
    files: Annotated[list[Path], typer.Argument(help="Kinect .csv and .skl, or .bvh files.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The take to write, or a folder for several."),
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace takes that are there.")] = False,
) -> None:
    """Turn other programs' recordings into takes."""
    from puppet.commands.files import import_files

    sys.exit(import_files(files, output, overwrite))


@app.command(name="map")
def map_(
    armature: Annotated[
        Path,
        typer.Argument(help="The puppet: .glb .gltf .bvh .urdf .xml (MuJoCo), or its .toml."),
    ],
    mode: Annotated[
        str, typer.Option(help="How it is driven: fk, bone to bone, or ik, by its ends.")
    ] = "fk",
    json: Annotated[bool, typer.Option("--json", help="For programs.")] = False,
    explain: Annotated[
        bool, typer.Option(help="Also say why, and what else there was for each pair.")
    ] = False,
    k: Annotated[int, typer.Option("--k", help="So many mappings, best first.")] = 1,
    lock: Annotated[
        list[str] | None,
        typer.Option(
            metavar="BONE=HUMAN",
            help="Keep this pair, and map around it; HUMAN may be a limb (arm.R). Repeatable.",
        ),
    ] = None,
    forbid: Annotated[
        list[str] | None,
        typer.Option(metavar="BONE=HUMAN", help="Never this pair. Repeatable."),
    ] = None,
    matrix: Annotated[
        str | None,
        typer.Option(
            metavar="BLOCK",
            help="Print one block of the score matrix instead: similarity, constraint, path, "
            "symmetry, combined.",
        ),
    ] = None,
) -> None:
    """Propose how the human body drives an armature."""
    from puppet.commands.mapping import map_armature

    map_armature(
        armature,
        mode,
        as_json=json,
        explain=explain,
        k=k,
        lock=lock or (),
        forbid=forbid or (),
        matrix=matrix,
    )


@app.command()
def decide(
    show: ShowFile,
    puppet: Annotated[
        str | None, typer.Argument(help="Which puppet; all are listed if it is left out.")
    ] = None,
    mode: Annotated[str | None, typer.Option(help="Drive it by fk or ik from now on.")] = None,
    lock: Annotated[
        list[str] | None,
        typer.Option(metavar="BONE=HUMAN", help="Keep this pair; the rest is mapped around it."),
    ] = None,
    accept: Annotated[
        list[str] | None, typer.Option(metavar="BONE=HUMAN", help="This proposal was right.")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="BONE=HUMAN", help="By hand; HUMAN may drive other bones as well."
        ),
    ] = None,
    reject: Annotated[
        list[str] | None, typer.Option(metavar="BONE=HUMAN", help="This proposal was wrong.")
    ] = None,
    forbid: Annotated[
        list[str] | None, typer.Option(metavar="BONE=HUMAN", help="Never this pair.")
    ] = None,
    clear: Annotated[
        list[str] | None,
        typer.Option(metavar="BONE", help="Forget what was decided of this bone."),
    ] = None,
    group: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=BONE,BONE", help="Make a master that moves several ends (IK)."),
    ] = None,
    ungroup: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Take a master apart.")
    ] = None,
    undo: Annotated[bool, typer.Option("--undo", help="Take the last step back.")] = False,
    redo: Annotated[bool, typer.Option("--redo", help="Bring it back.")] = False,
    explain: Annotated[
        bool, typer.Option("--explain", help="Also say why, and what else there was.")
    ] = False,
    reload: Annotated[
        bool, typer.Option("--reload", help="Read the mapping file anew, as somebody edited it.")
    ] = False,
    port: Port = None,
) -> None:
    """Correct the mapping of a show that is running; without options, show it.

    What is given in one call is one step. It is kept in a file beside the show.
    """
    from puppet.commands.mapping import decide_live

    decide_live(
        show,
        puppet,
        port,
        pairs=(
            ("lock", lock or ()),
            ("accept", accept or ()),
            ("set", set_ or ()),
            ("reject", reject or ()),
            ("forbid", forbid or ()),
        ),
        clear=clear or (),
        mode=mode,
        group=group or (),
        ungroup=ungroup or (),
        undo=undo,
        redo=redo,
        explain=explain,
        reload=reload,
    )


@app.command()
def parts(
    show: ShowFile,
    part: Annotated[
        str | None, typer.Argument(help="Which part; all are listed if it is left out.")
    ] = None,
    give: Annotated[
        int | None, typer.Option(metavar="PERFORMER", help="Give it to this performer.")
    ] = None,
    release: Annotated[
        bool, typer.Option("--release", help="Take it from whoever plays it; its puppets rest.")
    ] = False,
    reopen: Annotated[
        bool, typer.Option("--reopen", help="Let the part's rule choose again, among everybody.")
    ] = False,
    port: Port = None,
) -> None:
    """Who drives whom in a show that is running: list it, and change it."""
    from puppet.commands.parts import parts_live

    parts_live(show, part, port, give=give, release=release, reopen=reopen)


bench = typer.Typer(help="How well and how fast, measured here.", no_args_is_help=True)
app.add_typer(bench, name="bench")


@bench.command(name="mapping")
def bench_mapping(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(help="Folders with NAME.truth.toml files; the cast if none is given."),
    ] = None,
    rigs: Annotated[
        list[Path] | None,
        typer.Option(help="Where else to look for the rigs that truth files name. Repeatable."),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="For programs.")] = False,
    wrong: Annotated[bool, typer.Option("--wrong", help="Also list every mistake.")] = False,
) -> None:
    """Map rigs whose right mapping is known: accuracy, time, and what the certainty is worth."""
    from puppet.commands.bench import bench_mapping as measure

    cast = Path(__file__).resolve().parents[1] / "configs" / "armatures"
    measure(folders or [cast], rigs or (), as_json=json, wrong=wrong)


@app.command()
def models(
    cache: Annotated[
        Path | None,
        typer.Option(help="Keep them here instead of in the user's cache."),
    ] = None,
    wheel: Annotated[
        Path | None,
        typer.Option(help="Take them out of this mediapipe wheel: for a machine without network."),
    ] = None,
) -> None:
    """Get the pose models that webcams and videos need (35 MB, once)."""
    from puppet.commands.files import get_models

    get_models(cache, wheel)
