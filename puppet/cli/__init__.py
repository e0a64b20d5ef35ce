"""The command line. Nothing heavy is imported before a command needs it."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from puppet import __version__

# In the order in which `puppet --help` lists their commands.
from puppet.cli import live

# isort: split
from puppet.cli import files

# isort: split
from puppet.cli import calibrate

# isort: split
from puppet.cli import mapping

# isort: split
from puppet.cli.options import app, bench
from puppet.errors import PuppetError

__all__ = ["app", "calibrate", "files", "live", "main", "mapping"]

app.add_typer(bench, name="bench")


def main() -> None:
    """Run a command; errors that people can mend are told, not traced."""
    try:
        app(standalone_mode=True)
    except PuppetError as error:
        sys.stderr.write(f"puppet: {error}\n")
        sys.stderr.flush()
        sys.exit(2)


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        typer.echo(f"puppet {__version__}")
        raise typer.Exit
