"""MuJoCo's XML (MJCF) to an armature: bodies become bones, and hinges the axes they turn about.

What is read: nested bodies and frames, all ways to write an orientation, joints with their default
classes, ranges and reference angles, the compiler's settings, and files that are included from the
same folder. Of geometry only what tells where a bone ends.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from puppet.armature import Armature
from puppet.errors import BadFileError
from puppet.formats.bone_names import listed, unique_names
from puppet.formats.mechanism import Body, Hinge, mechanism_armature, merged
from puppet.formats.mjcf_files import whole_document
from puppet.formats.mjcf_geometry import Orientation, geom_marks
from puppet.formats.xml_tree import Attributes
from puppet.kernel import Floats

#: Elements that make bodies in ways that are not followed.
_NOT_FOLLOWED: Final = ("composite", "flexcomp", "replicate", "attach")


def read_mjcf(path: Path) -> tuple[Armature, tuple[str, ...]]:
    """The armature of a MuJoCo model, +Y up and facing +Z, and what had to be repaired.

    Raises BadFileError if the file is not MJCF, has no bodies, has a number that is none, or
    includes a file from outside its folder, or one twice.
    """
    warnings: dict[str, None] = {}

    def warn(text: str) -> None:
        warnings.setdefault(text)

    document = whole_document(path, warn)
    bodies = _Reader(path, document, warn).bodies()
    bodies = merged(_performing(bodies, warn), warn)
    if not bodies:
        raise BadFileError("there are no bodies in it, so there are no bones", where=path)
    return mechanism_armature(path.stem, bodies, warn), tuple(warnings)


@dataclass(frozen=True, slots=True)
class _Place:
    """Where an element of the tree stands.

    body: index of the body that it belongs to, -1 for the world. place: (3,), turn: (3, 3) the
    frame that its numbers are given in, in the world. default: the class for what has none.
    """

    body: int
    place: Floats
    turn: Floats
    default: str


class _Reader:
    """Reads the bodies of one document."""

    def __init__(self, path: Path, document: ET.Element, warn: Callable[[str], None]) -> None:
        self._path, self._document, self._warn = path, document, warn
        compiler = Attributes(
            {key: value for one in document.iter("compiler") for key, value in one.items()},
            f"{path}: compiler",
        )
        self._degrees = compiler.text("angle", "degree") != "radian"
        self._limits_by_range = compiler.text("autolimits", "true") != "false"
        self._orientation = Orientation(self._degrees, compiler, warn)
        if compiler.text("coordinate", "local") == "global":
            raise BadFileError(
                "global coordinates cannot be read, nor can MuJoCo read them any more",
                where=compiler.where,
                expected='coordinate="local"',
                hint="save the model again with MuJoCo 2.3 or older",
            )
        self._defaults = self._read_defaults()
        self._bodies: list[Body] = []
        self._given_names: list[str | None] = []
        self._weak_marks: list[list[Floats]] = []

    def bodies(self) -> list[Body]:
        """All bodies below the world, parents first, at rest."""
        world = _Place(-1, np.zeros(3), np.eye(3), "main")
        stack = [
            (element, world)
            for section in reversed(self._document.findall("worldbody"))
            for element in reversed(section)
        ]
        # A stack of our own: nothing says that a snake has fewer bodies than Python has frames.
        while stack:
            element, at = stack.pop()
            if element.tag in ("body", "frame"):
                inside = self._entered(element, at)
                stack.extend((child, inside) for child in reversed(element))
            elif element.tag in _NOT_FOLLOWED:
                self._warn(f"<{element.tag}> makes bodies by itself: left out")
            elif at.body >= 0:
                self._add(element, at)
        names = unique_names(
            self._given_names, [f"body_{n}" for n in range(len(self._bodies))], self._warn
        )
        return [
            replace(body, name=name, marks=body.marks or weak)
            for body, name, weak in zip(self._bodies, names, self._weak_marks, strict=True)
        ]

    def _entered(self, element: ET.Element, at: _Place) -> _Place:
        """The place of what is inside a body or a frame."""
        label = f"{element.tag} {element.get('name') or len(self._bodies)!r}"
        own = Attributes(element.attrib, f"{self._path}: {label}")
        place = at.place + at.turn @ own.place("pos")
        turn = at.turn @ self._orientation.matrix(own, label)
        body = at.body
        if element.tag == "body":
            self._bodies.append(Body("", at.body, place, turn, shown=False))
            self._given_names.append(element.get("name"))
            self._weak_marks.append([])
            body = len(self._bodies) - 1
        return _Place(body, place, turn, own.text("childclass") or at.default)

    def _add(self, element: ET.Element, at: _Place) -> None:
        """Give a body what this element says of it."""
        body, weak = self._bodies[at.body], self._weak_marks[at.body]
        match element.tag:
            case "freejoint":
                body.free = True
            case "joint":
                self._add_joint(body, self._attributes(element, at), at)
            case "geom":
                body.shown = True
                own = self._attributes(element, at)
                marks, sure = geom_marks(own, self._orientation)
                (body.marks if sure else weak).extend(at.place + at.turn @ mark for mark in marks)
            case "site" | "inertial":
                own = self._attributes(element, at)
                weak.append(at.place + at.turn @ own.place("pos"))

    def _attributes(self, element: ET.Element, at: _Place) -> Attributes:
        """An element's attributes, with those of its default class behind them."""
        default = element.get("class") or at.default
        if default not in self._defaults:
            self._warn(f"there is no default class {default!r}: the main one is used")
            default = "main"
        behind = self._defaults[default].get(element.tag, {})
        body = self._given_names[at.body] or f"body_{at.body}"
        label = f"body {body!r}: {element.tag} {element.get('name', '')!r}"
        return Attributes({**behind, **element.attrib}, f"{self._path}: {label}")

    def _add_joint(self, body: Body, joint: Attributes, at: _Place) -> None:
        kind = joint.text("type", "hinge")
        unit = math.radians(1.0) if self._degrees else 1.0
        bounds = joint.numbers("range", 2, (0.0, 0.0)) * unit
        limited = joint.text("limited", "auto")
        is_limited = limited == "true" or (
            limited == "auto" and self._limits_by_range and "range" in joint
        )
        match kind:
            case "free":
                body.free = True
            case "slide":
                body.slides = True
            case "ball":
                body.ball = float(max(bounds)) if is_limited else math.inf
            case "hinge":
                axis = joint.numbers("axis", 3, (0.0, 0.0, 1.0))
                length = float(np.linalg.norm(axis))
                if length < 1e-9:
                    raise BadFileError("the axis has no direction", where=f"{joint.where}: axis")
                hinge = Hinge(
                    axis=at.turn @ (axis / length),
                    anchor=at.place + at.turn @ joint.place("pos"),
                )
                if is_limited:
                    # The angles in the file are such that the model as written is at `ref`.
                    rest = joint.number("ref", 0.0) * unit
                    hinge.lower, hinge.upper = sorted((bounds - rest).tolist())
                body.hinges.append(hinge)
            case _:
                raise BadFileError(
                    "there is no such type of joint",
                    where=f"{joint.where}: type",
                    expected="hinge, ball, slide or free",
                    found=kind,
                )

    def _read_defaults(self) -> dict[str, dict[str, dict[str, str]]]:
        """For each class its attributes by element, those that it inherits included."""
        sections = self._document.findall("default")
        table: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for section in sections:
            _overlay(table["main"], section)
        stack = [(one, "main") for section in reversed(sections) for one in _classes(section)]
        while stack:
            element, parent = stack.pop()
            name = element.get("class", "")
            table[name] = {tag: dict(values) for tag, values in table[parent].items()}
            _overlay(table[name], element)
            stack.extend((one, name) for one in _classes(element))
        for section in sections:
            # The outermost class is main, whatever it is called.
            table.setdefault(section.get("class", "main"), table["main"])
        return table


def _classes(element: ET.Element) -> Iterator[ET.Element]:
    return reversed(element.findall("default"))


def _overlay(attributes: dict[str, dict[str, str]], section: ET.Element) -> None:
    for element in section:
        if element.tag != "default":
            attributes.setdefault(element.tag, {}).update(element.attrib)


def _performing(bodies: Sequence[Body], warn: Callable[[str], None]) -> list[Body]:
    """The bodies without the scenery: trees in which nothing moves, beside others that do."""
    roots: list[int] = []
    moving: set[int] = set()
    for index, body in enumerate(bodies):
        roots.append(index if body.parent < 0 else roots[body.parent])
        if body.hinges or body.slides or body.free or body.ball is not None:
            moving.add(roots[index])
    if not moving:
        return list(bodies)
    kept = [index for index in range(len(bodies)) if roots[index] in moving]
    scenery = [body.name for index, body in enumerate(bodies) if roots[index] not in moving]
    if scenery:
        warn(f"left out what stands on the stage and never moves: {listed(scenery)}")
    now = {old: new for new, old in enumerate(kept)}
    result = [replace(bodies[old], parent=now.get(bodies[old].parent, -1)) for old in kept]
    trees = [body.name for body in result if body.parent < 0]
    if len(trees) > 1:
        warn(f"it has {len(trees)} roots, which are moved as one: {listed(trees)}")
    return result
