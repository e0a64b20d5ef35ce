"""Commands about the mapping: proposing it, correcting it live, measuring it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from puppet.cli.options import Port, ShowFile, app, bench


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

    cast = Path(__file__).resolve().parents[2] / "configs" / "armatures"
    measure(folders or [cast], rigs or (), as_json=json, wrong=wrong)
