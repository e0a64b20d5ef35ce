"""Text files from other programs: read whole, whatever their byte order mark and line ends."""

from __future__ import annotations

import codecs
from pathlib import Path

from puppet.errors import BadFileError


def read_text(path: Path) -> str:
    """The text of a file, lines ended by a line feed, without a byte order mark.

    Raises BadFileError for a file that is missing, empty, not a plain file, or not text.
    """
    try:
        if not path.exists():
            raise BadFileError("there is no such file", where=path)
        if not path.is_file():
            raise BadFileError("this is not a file", where=path, expected="a recording")
        data = path.read_bytes()
    except OSError as error:
        raise BadFileError(
            "the file cannot be read", where=path, found=error.strerror or str(error)
        ) from None
    if not data.strip():
        raise BadFileError("the file is empty", where=path, found=f"{len(data)} bytes")
    encoding = (
        "utf-16" if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig"
    )
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        # Old exporters write names in the code page of their country; the numbers are ASCII.
        text = data.decode("latin-1")
    if "\0" in text:
        raise BadFileError(
            "this is not a text file", where=path, found=f"bytes that begin with {data[:8]!r}"
        )
    return text.replace("\r\n", "\n").replace("\r", "\n")
