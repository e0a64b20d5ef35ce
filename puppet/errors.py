"""The errors that people meet.

Each says where it happened, what was expected, what was found and what to do next. An unreachable
goal, a lost performer or an unplugged camera is never an error: it is a state of the show.
"""

from __future__ import annotations

from pathlib import Path


class PuppetError(Exception):
    """Something a person has to mend.

    what: the sentence that says what went wrong.
    where: the file, message or address, with the place inside it (``show.toml: puppets[0].yaw``).
    expected, found: what should be there, and what is.
    hint: what to do now.
    """

    def __init__(
        self,
        what: str,
        *,
        where: str | Path | None = None,
        expected: str | None = None,
        found: str | None = None,
        hint: str | None = None,
    ) -> None:
        super().__init__(what)
        self.what = what
        self.where = None if where is None else str(where)
        self.expected = expected
        self.found = found
        self.hint = hint

    def __str__(self) -> str:
        lines = [self.what if self.where is None else f"{self.where}: {self.what}"]
        for label, text in (("expected", self.expected), ("found", self.found), ("try", self.hint)):
            if text is not None:
                lines.append(f"  {label + ':':<10}{text}")
        return "\n".join(lines)


class BadFileError(PuppetError):
    """A file that cannot be read as what it was given for."""


class BadShowError(PuppetError):
    """A show, or an option on the command line, that does not make sense."""


class BadMessageError(PuppetError):
    """A message from the bus that this version cannot understand."""


class UnavailableError(PuppetError):
    """Something outside the program is missing: a model, a device, a display, a free port."""


class BadDecisionError(PuppetError):
    """A correction of a mapping that is not possible, or contradicts another."""
