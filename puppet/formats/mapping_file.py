"""What was decided of a show's puppets: a ``.mappings.toml`` beside the show.

An entry belongs to a puppet and its armature's fingerprint; the same rig is recognised under
another name too. Entries of rigs that are not on stage stay as they are. A file is replaced in one
go and is on the disk before anybody is told so: whatever happens, and whenever, the old file or the
new one is there, whole.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec
import tomli_w

from puppet.errors import BadFileError, UnavailableError
from puppet.mapping.decisions import Act, Decision
from puppet.mapping.proposal import Mode

VERSION: Final = 1
_HEADER: Final = """\
# What was decided of this show's puppets. puppet writes this file with every decision; it may be
# read, kept in version control and edited while no show is running. docs/formats.md describes it.
"""


class KeptRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A pair that was kept before the first step."""

    mode: Mode
    bone: str
    human: str
    act: Act


class BoneRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One bone of the armature that was decided about; see `fingerprint.BoneRecord`."""

    name: str
    parent: str
    rest: Annotated[tuple[float, ...], msgspec.Meta(min_length=7, max_length=7)]


class StepRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What was decided in one go."""

    decisions: tuple[Decision, ...]


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All about one armature.

    puppet: its name in the show. kept, banned, masters, mode: what held before the first step; the
    mode is the show's unless it was decided. steps: oldest first. holds: how many of them hold; the
    rest were undone.
    """

    puppet: str
    fingerprint: str
    mode: Mode | None = None
    holds: Annotated[int, msgspec.Meta(ge=0)] = 0
    steps: tuple[StepRow, ...] = ()
    kept: tuple[KeptRecord, ...] = ()
    banned: tuple[KeptRecord, ...] = ()
    masters: dict[str, tuple[str, ...]] = {}
    bones: tuple[BoneRow, ...] = ()


class MappingFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The file."""

    version: int = VERSION
    puppets: tuple[Entry, ...] = ()

    def entry(self, puppet: str, fingerprint: str) -> Entry | None:
        """The entry of an armature: that of this puppet, or else of another with the same rig."""
        alike = [entry for entry in self.puppets if entry.fingerprint == fingerprint]
        return next((e for e in alike if e.puppet == puppet), alike[-1] if alike else None)

    def with_entry(self, entry: Entry) -> MappingFile:
        """The same with one entry more, or another one in its place."""
        key = (entry.puppet, entry.fingerprint)
        others = [e for e in self.puppets if (e.puppet, e.fingerprint) != key]
        return MappingFile(puppets=(*others, entry))


def mappings_path(show: Path) -> Path:
    """Where the decisions of a show are kept, if it says nothing else."""
    return show.with_name(f"{show.stem}.mappings.toml")


def read_mappings(path: Path) -> MappingFile:
    """The decisions in a file; none if there is no such file.

    Raises BadFileError for a file that was cut off, is of another version, or makes no sense.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return MappingFile()
    except OSError as error:
        raise BadFileError(
            "the mapping file cannot be read", where=path, found=error.strerror or str(error)
        ) from error
    try:
        document: Any = msgspec.toml.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise BadFileError(
            "this is not TOML, or it was cut off",
            where=path,
            found=str(error),
            hint="mend the line, or move the file away to start without decisions",
        ) from None
    version = document.get("version")
    if version != VERSION:
        raise BadFileError(
            "the mapping file is of another version",
            where=path,
            expected=f"version = {VERSION}",
            found=f"version = {version}" if version is not None else "no version",
            hint="use the puppet that wrote it, or move the file away to start without decisions",
        )
    try:
        return msgspec.convert(document, MappingFile)
    except msgspec.ValidationError as error:
        what, _, place = str(error).partition(" - at ")
        raise BadFileError(
            what[:1].lower() + what[1:],
            where=f"{path}: {place.strip('`').removeprefix('$').lstrip('.') or 'the whole file'}",
            hint="docs/formats.md describes the mapping file",
        ) from None


def write_mappings(path: Path, file: MappingFile) -> None:
    """Replace the file. When this returns, the decisions are on the disk.

    Raises UnavailableError if that is not possible; then the old file is as it was.
    """
    text = _HEADER + tomli_w.dumps(msgspec.to_builtins(file))
    try:
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", dir=path.parent, prefix=f".{path.name}.", delete=False
        ) as part:
            try:
                part.write(text)
                part.flush()
                os.fsync(part.fileno())
                Path(part.name).replace(path)
            except BaseException:
                Path(part.name).unlink(missing_ok=True)
                raise
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError as error:
        raise UnavailableError(
            "the decision cannot be saved, so it does not hold",
            where=path,
            found=error.strerror or str(error),
            hint="make the folder writable, or name another file: mappings = … in the show",
        ) from None
