"""What was decided of a show's puppets: a ``.mappings.toml`` beside the show.

An entry belongs to a puppet and its armature's fingerprint. Entries of rigs that are not on stage
stay as they are. A file is replaced in one go and is on the disk before anybody is told so:
whatever happens, and whenever, the old file or the new one is there, whole. It ends with a line
that says so, because a TOML file that was cut off between two tables is still TOML.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import re
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec

from puppet.errors import BadFileError, UnavailableError
from puppet.formats.replace import replace_file
from puppet.mapping.decisions import Act, Decision
from puppet.mapping.proposal import Mode

VERSION: Final = 1
_HEADER: Final = """\
# What was decided of this show's puppets. puppet writes this file with every decision; it may be
# read, kept in version control and edited while no show is running. docs/formats.md describes it.
"""
_END: Final = "[end]  # without this line the file counts as cut off\n"


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


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
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
    """The file. end: the mark of its last line; nothing is in it."""

    version: int = VERSION
    puppets: tuple[Entry, ...] = ()
    end: dict[str, bool] = {}

    def entry(self, puppet: str, fingerprint: str, others: Collection[str] = ()) -> Entry | None:
        """The entry of an armature: that of this puppet, or else of another with the same rig.

        others: puppets that are on stage themselves; what was decided of them is theirs alone.
        """
        alike = [entry for entry in self.puppets if entry.fingerprint == fingerprint]
        its = next((entry for entry in alike if entry.puppet == puppet), None)
        return its or next((entry for entry in alike[::-1] if entry.puppet not in others), None)

    def with_entry(self, entry: Entry) -> MappingFile:
        """The same with one entry more, or another one in its place."""
        key = (entry.puppet, entry.fingerprint)
        others = [e for e in self.puppets if (e.puppet, e.fingerprint) != key]
        return MappingFile(puppets=(*others, entry))


class KeptMappings:
    """A mapping file in use: what it holds, and how one entry of it is replaced.

    Several shows may keep their decisions in one file; each replaces the entry that it changes.
    """

    def __init__(self, path: Path) -> None:
        """Raises BadFileError for a file that makes no sense."""
        self.path = path
        self.read()

    def read(self) -> MappingFile:
        """The file as it is now. Raises BadFileError; then `file` is what it was."""
        seen = _signature(self.path)
        self.file = read_mappings(self.path)
        self._seen = seen
        return self.file

    def put(self, entry: Entry | None = None) -> None:
        """Write the file with an entry more, or in its place. When this returns, it is on the disk.

        Raises UnavailableError if that is not possible, and BadFileError if somebody has edited
        the file meanwhile and it makes no sense any more; then the file is as it was.
        """
        with _only_writer(self.path):
            found = _signature(self.path)
            file = self.file if found in (None, self._seen) else read_mappings(self.path)
            file = file if entry is None else file.with_entry(entry)
            write_mappings(self.path, file)
            self.file, self._seen = file, _signature(self.path)


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
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadFileError(
            "this is not TOML, or it was cut off",
            where=path,
            found=str(error),
            hint="mend the line, or move the file away to start without decisions",
        ) from None
    version = document.get("version")
    if version is None:
        raise BadFileError(
            "this is not a mapping file, or it was cut off",
            where=path,
            expected=f"version = {VERSION}",
            found="no version",
            hint="move the file away to start without decisions",
        )
    if version != VERSION:
        raise BadFileError(
            "the mapping file is of another version",
            where=path,
            expected=f"version = {VERSION}",
            found=f"version = {version}",
            hint="use the puppet that wrote it, or move the file away to start without decisions",
        )
    if "end" not in document:
        raise BadFileError(
            "the mapping file was cut off",
            where=path,
            expected="[end] as its last line",
            found="no such line",
            hint="get it back from a copy, or add the line if nothing is missing",
        )
    try:
        file = msgspec.convert(document, MappingFile)
    except msgspec.ValidationError as error:
        what, _, place = str(error).partition(" - at ")
        raise BadFileError(
            what[:1].lower() + what[1:],
            where=f"{path}: {place.strip('`').removeprefix('$').lstrip('.') or 'the whole file'}",
            hint="docs/formats.md describes the mapping file",
        ) from None
    for index, entry in enumerate(file.puppets):
        if entry.holds > len(entry.steps):
            raise BadFileError(
                "more steps hold than there are",
                where=f"{path}: puppets[{index}].holds",
                expected=f"0 to {len(entry.steps)}",
                found=str(entry.holds),
                hint="docs/formats.md describes the mapping file",
            )
    return file


def write_mappings(path: Path, file: MappingFile) -> None:
    """Replace the file. When this returns, the decisions are on the disk.

    Raises UnavailableError if that is not possible; then the old file is as it was.
    """
    try:
        replace_file(path, "".join(_lines(file)).encode())
    except OSError as error:
        raise _not_saved(path, error) from None


@contextlib.contextmanager
def _only_writer(path: Path) -> Iterator[None]:
    """Nobody else who asks for the same writes a mapping file of this folder meanwhile."""
    try:
        folder = os.open(path.resolve().parent, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise _not_saved(path, error) from None
    try:
        with contextlib.suppress(OSError):  # a file system without locks: as good as it gets
            fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


def _signature(path: Path) -> tuple[int, int, int] | None:
    """Differs whenever somebody has replaced or edited the file; None if there is none."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_ino, stat.st_size, stat.st_mtime_ns


def _not_saved(path: Path, error: OSError) -> UnavailableError:
    return UnavailableError(
        "the decision cannot be saved, so it does not hold",
        where=path,
        found=error.strerror or str(error),
        hint="make the folder writable, or name another file in the show: mappings = …",
    )


def _lines(file: MappingFile) -> Iterator[str]:
    """The file as people like to read it: a line for each step and bone, and what it says."""
    yield f"{_HEADER}version = {file.version}\n"
    for entry in file.puppets:
        fields: dict[str, Any] = msgspec.to_builtins(entry)
        steps = [_sentence(row) for row in entry.steps]
        yield "\n[[puppets]]\n"
        for key, value in fields.items():
            if isinstance(value, list | tuple):
                yield from _rows(key, value, steps if key == "steps" else ())
            else:
                yield f"{key} = {_inline(value)}\n"
    yield f"\n{_END}"


def _rows(key: str, rows: Iterable[Any], comments: Iterable[str]) -> Iterator[str]:
    yield f"{key} = [\n"
    says = iter(comments)
    for row in rows:
        comment = next(says, None)
        yield "" if comment is None else f"    # {comment}\n"
        yield f"    {_inline(row)},\n"
    yield "]\n"


def _sentence(row: StepRow) -> str:
    text = "; ".join(decision.sentence() for decision in row.decisions)
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def _inline(value: object) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(k)} = {_inline(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return repr(value)


def _key(text: str) -> str:
    return text if re.fullmatch(r"[A-Za-z0-9_-]+", text) else _inline(text)
