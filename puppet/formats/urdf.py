"""ROS's robot description (URDF) to an armature: links become bones.

The joint above a link is how its bone moves: revolute and continuous joints are hinges, prismatic
ones slide, fixed ones hold, floating ones are free. Three revolute joints at one place, with
nothing to see between them, are how a URDF says shoulder: they become one bone with three axes.
Links that are only frames, ends without anything to see, tell where their parents end and are left
out.
"""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.errors import BadFileError
from puppet.formats.bone_names import listed
from puppet.formats.mechanism import Body, Hinge, mechanism_armature, merged
from puppet.formats.xml_tree import Attributes, read_xml
from puppet.kernel import Floats

_TYPES: Final = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
#: What to name at most of a cycle.
_NAMED: Final = 12


@dataclass(frozen=True, slots=True, eq=False)
class _Joint:
    """One joint. place: (3,), turn: (3, 3) parent_from_child at rest. axis: (3,), child's frame."""

    name: str
    kind: str
    parent: str
    child: str
    place: Floats
    turn: Floats
    axis: Floats
    lower: float
    upper: float


def read_urdf(path: Path) -> tuple[Armature, tuple[str, ...]]:
    """The armature of a robot, +Y up and facing +Z, and what had to be repaired.

    Raises BadFileError if the file is not URDF, a joint names a link that is not there, a link
    hangs on two joints, nothing or several things hang on none, links go round in a cycle, or a
    number is none.
    """
    warnings: dict[str, None] = {}

    def warn(text: str) -> None:
        warnings.setdefault(text)

    document = read_xml(path)
    if document.tag != "robot":
        raise BadFileError(
            "this is not a URDF robot", where=path, expected="<robot>", found=f"<{document.tag}>"
        )
    if any("xacro" in element.tag or "${" in str(element.attrib) for element in document.iter()):
        raise BadFileError(
            "this is a xacro, from which a URDF is made",
            where=path,
            hint="run it through xacro: xacro robot.urdf.xacro > robot.urdf",
        )
    links = _links(path, document, warn)
    joints = [
        _joint(path, number, element) for number, element in enumerate(document.findall("joint"))
    ]
    order = _parents_first(path, links, joints)
    bodies = _bodies(path, links, order, warn)
    bodies = merged(_without_frames(_without_world(bodies, warn), warn), warn)
    return mechanism_armature(path.stem, bodies, warn), tuple(warnings)


def _links(path: Path, document: ET.Element, warn: Callable[[str], None]) -> dict[str, ET.Element]:
    elements = document.findall("link")
    if not elements:
        raise BadFileError("the robot has no links, so there are no bones", where=path)
    names = [element.get("name", "").strip() for element in elements]
    if "" in names:
        raise BadFileError(
            "a link has no name, so no joint can hold it", where=f"{path}: link {names.index('')}"
        )
    repeated = [name for name, times in Counter(names).items() if times > 1]
    if repeated:
        warn(f"links that are there more than once count once: {listed(repeated)}")
    links: dict[str, ET.Element] = {}
    for name, element in zip(names, elements, strict=True):
        links.setdefault(name, element)
    return links


def _joint(path: Path, number: int, element: ET.Element) -> _Joint:
    name = element.get("name", "").strip() or f"joint {number}"
    where = f"{path}: joint {name!r}"

    def part(tag: str) -> Attributes:
        found = element.find(tag)
        return Attributes({} if found is None else found.attrib, f"{where}: {tag}")

    kind = element.get("type", "").strip()
    if kind not in _TYPES:
        raise BadFileError(
            "there is no such type of joint",
            where=where,
            expected=", ".join(_TYPES),
            found=repr(kind),
        )
    for tag in ("parent", "child"):
        if not part(tag).text("link"):
            raise BadFileError(f"the joint has no {tag} link", where=where)
    axis = part("axis").numbers("xyz", 3, (1.0, 0.0, 0.0))
    length = float(np.linalg.norm(axis))
    if length < 1e-9 and kind != "fixed":
        raise BadFileError("the axis has no direction", where=f"{where}: axis")
    limit = part("limit")
    place, turn = _origin(part("origin"))
    return _Joint(
        name,
        kind,
        part("parent").text("link"),
        part("child").text("link"),
        place,
        turn,
        axis / max(length, 1e-9),
        limit.number("lower", 0.0),
        limit.number("upper", 0.0),
    )


def _origin(own: Attributes) -> tuple[Floats, Floats]:
    """(3,) and (3, 3), the transform that an `origin` says."""
    angles = own.numbers("rpy", 3, (0.0, 0.0, 0.0))
    turn: Floats = Rotation.from_euler("xyz", angles).as_matrix()
    return own.place("xyz"), turn


def _parents_first(
    path: Path, links: dict[str, ET.Element], joints: Sequence[_Joint]
) -> list[tuple[str, _Joint | None]]:
    """Each link with the joint above it, None for the root, in an order that starts there."""
    above: dict[str, _Joint] = {}
    below: dict[str, list[_Joint]] = {}
    for joint in joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                raise BadFileError(
                    f"the joint's {role} is not there",
                    where=f"{path}: joint {joint.name!r}",
                    expected=f"one of the {len(links)} links, {listed(list(links))}",
                    found=repr(link),
                )
        if joint.child in above:
            raise BadFileError(
                "a link hangs on two joints",
                where=f"{path}: link {joint.child!r}",
                found=f"{above[joint.child].name!r} and {joint.name!r}",
                hint="URDF has no loops: leave one of the joints out",
            )
        above[joint.child] = joint
        below.setdefault(joint.parent, []).append(joint)
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        raise BadFileError(
            "the robot has several roots",
            where=path,
            expected="one link that no joint holds",
            found=listed(roots),
            hint="join them with a joint of type fixed, or leave the loose links out",
        )
    order: list[tuple[str, _Joint | None]] = []
    waiting: list[tuple[str, _Joint | None]] = [(root, None) for root in roots]
    while waiting:
        order.append(waiting.pop())
        waiting.extend((one.child, one) for one in reversed(below.get(order[-1][0], [])))
    if len(order) < len(links):
        link = next(iter(links.keys() - {link for link, _ in order}))
        line: dict[str, None] = {}
        while link not in line:
            line[link] = None
            link = above[link].parent
        cycle = [*itertools.dropwhile(lambda one: one != link, line), link]
        raise BadFileError(
            "links go round in a cycle", where=path, found=" → ".join(reversed(cycle[:_NAMED]))
        )
    return order


def _bodies(
    path: Path,
    links: dict[str, ET.Element],
    order: Sequence[tuple[str, _Joint | None]],
    warn: Callable[[str], None],
) -> list[Body]:
    index = {link: number for number, (link, _) in enumerate(order)}
    bodies: list[Body] = []
    for link, joint in order:
        if joint is None:
            body = Body(link, -1, np.zeros(3), np.eye(3))
        else:
            parent = bodies[index[joint.parent]]
            place = parent.place + parent.turn @ joint.place
            body = Body(link, index[joint.parent], place, parent.turn @ joint.turn)
            _move(body, joint, warn)
        element = links[link]
        shapes = [*element.findall("visual"), *element.findall("collision")]
        body.shown = bool(shapes)
        for shape in shapes:
            marks = _shape_marks(shape, f"{path}: link {link!r}: {shape.tag}")
            body.marks.extend(body.place + body.turn @ mark for mark in marks)
        bodies.append(body)
    return bodies


def _move(body: Body, joint: _Joint, warn: Callable[[str], None]) -> None:
    match joint.kind:
        case "revolute" | "continuous" | "planar":
            hinge = Hinge(body.turn @ joint.axis, body.place)
            if joint.kind == "revolute":
                hinge.lower, hinge.upper = joint.lower, joint.upper
                if joint.lower > joint.upper:
                    hinge.lower, hinge.upper = joint.upper, joint.lower
                    warn(f"bone {body.name!r} has a range that runs backwards: turned about")
                if joint.lower == joint.upper:
                    hinge.lower, hinge.upper = -math.inf, math.inf
                    warn(f"bone {body.name!r} has no range: it turns freely")
            body.hinges.append(hinge)
            body.slides = joint.kind == "planar"
        case "prismatic":
            body.slides = True
        case "floating":
            body.free = True


def _shape_marks(shape: ET.Element, where: str) -> list[Floats]:
    """Places at the outside of a visual or collision shape, (3,) each, in its link's frame.

    The size of a mesh is not known here: its place is all there is.
    """

    def part(tag: str) -> Attributes | None:
        found = shape.find(tag)
        return None if found is None else Attributes(found.attrib, f"{where}: {tag}")

    place, turn = _origin(part("origin") or Attributes({}, where))
    corners = np.zeros((1, 3))
    if box := part("geometry/box"):
        half = 0.5 * box.numbers("size", 3, (0.0, 0.0, 0.0))
        corners = half * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    elif ball := part("geometry/sphere"):
        half = np.full(3, ball.number("radius", 0.0))
        corners = np.vstack([np.diag(half), -np.diag(half)])
    elif round_one := part("geometry/cylinder") or part("geometry/capsule"):
        radius, half_length = round_one.number("radius", 0.0), 0.5 * round_one.number("length", 0.0)
        half = np.array([radius, radius, half_length])
        corners = np.vstack([np.diag(half), -np.diag(half)])
    return list(place + corners @ turn.T)


def _without_world(bodies: list[Body], warn: Callable[[str], None]) -> list[Body]:
    """The bodies without a root that has nothing to see and only holds the robot or lets it go."""
    if not any(body.shown for body in bodies):
        return bodies
    children = Counter(body.parent for body in bodies)
    root = 0
    # Parents come first, and depth first: an only child is the next body.
    while not bodies[root].shown and children[root] == 1 and _is_loose(bodies[root + 1]):
        root += 1
    if root:
        names = listed([body.name for body in bodies[:root]])
        warn(f"no part of the robot: {names}; its root is {bodies[root].name!r}")
    return [replace(body, parent=max(body.parent - root, -1)) for body in bodies[root:]]


def _is_loose(body: Body) -> bool:
    """Fixed, or let go: in either case what it hangs on says nothing of how it moves."""
    return body.free or body.movement == "fixed"


def _without_frames(bodies: Sequence[Body], warn: Callable[[str], None]) -> list[Body]:
    """The bodies without ends that are fixed and have nothing to see, in a robot that has."""
    if not any(body.shown for body in bodies):
        return list(bodies)
    needed = [body.shown or body.movement != "fixed" for body in bodies]
    for index in reversed(range(len(bodies))):
        if needed[index] and bodies[index].parent >= 0:
            needed[bodies[index].parent] = True
    now = {old: new for new, old in enumerate(i for i, keep in enumerate(needed) if keep)}
    frames = [index for index, need in enumerate(needed) if not need]
    for index in frames:
        above = bodies[index].parent
        while not needed[above]:
            above = bodies[above].parent
        bodies[above].marks.append(bodies[index].place)
    if frames:
        names = [bodies[index].name for index in frames]
        warn(f"left out frames, which have nothing to see: {listed(names)}")
    return [replace(bodies[old], parent=now.get(bodies[old].parent, -1)) for old in now]
