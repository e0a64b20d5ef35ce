"""The application that commands are added to, and the arguments that several of them have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    help="A person moves before a camera, and puppets of any shape move with them.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
bench = typer.Typer(help="How well and how fast, measured here.", no_args_is_help=True)

ShowFile = Annotated[Path, typer.Argument(help="The show, a .toml (see configs/shows).")]
Port = Annotated[
    int | None,
    typer.Option(help="Use this port on 127.0.0.1 for the bus instead of the show's."),
]
