"""XML files that describe machines: read whole, and never more than what is in the file."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any, Final

import numpy as np

from puppet.errors import BadFileError
from puppet.kernel import Floats

#: Metres; whatever the machine, no part of it is farther away.
FARTHEST: Final = 1e6


class _DoctypeError(Exception):
    """The document brings definitions of its own."""


class _Builder(ET.TreeBuilder):
    def doctype(self, *_: object) -> None:
        """A few lines of entities can unfold into gigabytes, or name files of this machine."""
        raise _DoctypeError


def read_xml(path: Path, role: str = "the armature") -> ET.Element:
    """The root element of the file at `path`.

    Raises BadFileError if it is missing, empty, not XML, or has a document type definition.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise BadFileError(f"{role} is not there", where=path, hint="check the path") from None
    except (OSError, ValueError) as error:
        raise BadFileError(f"{role} cannot be read", where=path, found=str(error)) from error
    if not data.strip():
        raise BadFileError(f"{role} is empty", where=path, found=f"{len(data)} bytes")
    parser = ET.XMLParser(target=_Builder())
    try:
        parser.feed(data)
        root = parser.close()
    except _DoctypeError:
        raise BadFileError(
            "the file has a document type definition, which is never read",
            where=path,
            found="<!DOCTYPE",
            hint="take the <!DOCTYPE …> out of it",
        ) from None
    except (ET.ParseError, ValueError, LookupError) as error:
        raise BadFileError(
            "this is not XML, or it was cut off",
            where=path,
            found=str(error),
            hint="copy or export it again",
        ) from error
    if not isinstance(root, ET.Element):
        raise BadFileError("this is not XML", where=path, found="no element")
    return root


class Attributes:
    """The attributes of one element, as what they should be. Numbers are finite.

    where: the file and the place in it, for people.
    """

    def __init__(self, values: dict[str, str], where: str) -> None:
        self._values = values
        self.where = where

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def text(self, key: str, default: str = "") -> str:
        """An attribute as it is, without the space around it."""
        return self._values.get(key, default).strip()

    def number(self, key: str, default: float) -> float:
        """An attribute that is one number."""
        return float(self.numbers(key, 1)[0]) if key in self else default

    def place(self, key: str) -> Floats:
        """An attribute that is a point, (3,); the origin without it. Raises BadFileError."""
        place = self.numbers(key, 3, (0.0, 0.0, 0.0))
        if np.abs(place).max() > FARTHEST:
            raise BadFileError(
                f"{key} is out of this world",
                where=f"{self.where}: {key}",
                expected=f"less than {FARTHEST:g} metres",
                found=repr(self._values[key][:60]),
            )
        return place

    def numbers(self, key: str, count: int, default: Any = None) -> Floats:
        """An attribute that is `count` numbers. -> (count,). Raises BadFileError if it is not."""
        if key not in self:
            return np.array(default, float)
        words = self._values[key].replace(",", " ").split()
        values = self._floats(words)
        if values is None or len(values) != count:
            expected = "a number" if count == 1 else f"{count} numbers"
            raise BadFileError(
                f"{key} is not {expected}",
                where=f"{self.where}: {key}",
                expected=expected,
                found=repr(self._values[key][:60]),
            )
        return values

    def some_numbers(self, key: str) -> Floats:
        """An attribute that is any count of numbers; what is no number ends it. -> (N,)"""
        words = self._values.get(key, "").replace(",", " ").split()
        values = self._floats(words)
        return np.zeros(0) if values is None else values

    @staticmethod
    def _floats(words: list[str]) -> Floats | None:
        try:
            values = [float(word) for word in words]
        except ValueError:
            return None
        return np.array(values) if all(map(math.isfinite, values)) else None
