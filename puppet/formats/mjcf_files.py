"""A MuJoCo model with the files that it includes, as one document."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

from puppet.errors import BadFileError
from puppet.formats.xml_tree import read_xml


def whole_document(path: Path, warn: Callable[[str], None]) -> ET.Element:
    """The root element of a model, with what it includes in its place.

    A file that is not there is left out, with a warning: muscles and sensors are often given
    separately. Raises BadFileError for a file from outside the model's folder, and, as MuJoCo
    does, for a file that is included a second time, which may go on for ever.
    """
    root = read_xml(path)
    if root.tag != "mujoco":
        raise BadFileError(
            "this is not a MuJoCo model", where=path, expected="<mujoco>", found=f"<{root.tag}>"
        )
    read = {path.resolve()}
    stack = [(root, path)]
    while stack:
        element, file = stack.pop()
        if element.find("include") is None:
            stack.extend((child, file) for child in element)
            continue
        children: list[ET.Element] = []
        for child in element:
            if child.tag != "include":
                children.append(child)
                stack.append((child, file))
                continue
            target = _target(path, file, child.get("file", ""))
            if not target.exists():
                warn(f"the file {child.get('file')!r} that it includes is not there: left out")
                continue
            if target in read:
                raise BadFileError(
                    "a file is included a second time", where=file, found=child.get("file")
                )
            read.add(target)
            included = read_xml(target, f"a file that {file.name} includes")
            # What is included may include again, so it is looked through as one of our own.
            holder = ET.Element("included")
            holder.extend(included)
            children.append(holder)
            stack.append((holder, target))
        element[:] = children
    return _without_holders(root)


def _target(model: Path, file: Path, name: str) -> Path:
    """Where an included file lies: seen from the model, or from the file that includes it."""
    folder = model.parent.resolve()
    if "\0" in name or not name:
        raise BadFileError("an include names no file", where=file, found=repr(name))
    places = [(base / name).resolve() for base in (folder, file.parent.resolve())]
    inside = [place for place in places if place.is_relative_to(folder)]
    if not inside:
        raise BadFileError(
            "the model includes a file from outside its folder",
            where=file,
            expected="a file beside it",
            found=name[:80],
            hint="put all its files into one folder",
        )
    return next((place for place in inside if place.is_file()), inside[0])


def _without_holders(root: ET.Element) -> ET.Element:
    """The document with what was included standing where the include stood."""
    stack = [root]
    while stack:
        element = stack.pop()
        while element.find("included") is not None:
            flat: list[ET.Element] = []
            for child in element:
                flat.extend(child if child.tag == "included" else (child,))
            element[:] = flat
        stack.extend(element)
    return root
