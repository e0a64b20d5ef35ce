"""MJCF's ways to say how something is turned, and where its shapes end."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from puppet.errors import BadFileError
from puppet.formats.xml_tree import Attributes
from puppet.kernel import Floats
from puppet.rotation import swing

#: How many numbers of `size` each shape needs.
_SIZES: Final = {"sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "box": 3}
#: Geoms in this group and above are not shown by MuJoCo: they are collision and muscle shapes.
_HIDDEN: Final = 3


class Orientation:
    """Reads `quat`, `axisangle`, `euler`, `xyaxes` or `zaxis`, as the compiler's settings say."""

    def __init__(self, degrees: bool, compiler: Attributes, warn: Callable[[str], None]) -> None:
        self._unit = math.radians(1.0) if degrees else 1.0
        self._sequence = compiler.text("eulerseq", "xyz")
        self._warn = warn
        if len(self._sequence) != 3 or not set(self._sequence.lower()) <= set("xyz"):
            raise BadFileError(
                "this is not an order of axes",
                where=f"{compiler.where}: eulerseq",
                expected="three of x, y, z, X, Y, Z",
                found=repr(self._sequence),
            )

    def matrix(self, own: Attributes, label: str) -> Floats:
        """(3, 3) parent_from_own of an element."""
        if "quat" in own:
            w, x, y, z = own.numbers("quat", 4)
            turn = np.array([x, y, z, w])
            if np.linalg.norm(turn) < 1e-9:
                return self._meaningless(label)
            return _matrix(Rotation.from_quat(turn))
        if "axisangle" in own:
            *axis, angle = own.numbers("axisangle", 4)
            length = float(np.linalg.norm(axis))
            if length < 1e-9:
                return self._meaningless(label)
            return _matrix(Rotation.from_rotvec(np.array(axis) / length * angle * self._unit))
        if "euler" in own:
            turned = Rotation.identity()
            angles = own.numbers("euler", 3) * self._unit
            for letter, angle in zip(self._sequence, angles, strict=True):
                step = Rotation.from_euler(letter.lower(), angle)
                # Small letters turn with the body, capitals stand still.
                turned = turned * step if letter.islower() else step * turned
            return _matrix(turned)
        if "xyaxes" in own:
            x, y = own.numbers("xyaxes", 6).reshape(2, 3)
            x = x / max(float(np.linalg.norm(x)), 1e-12)
            y = y - x * np.dot(x, y)
            if np.linalg.norm(x) < 0.5 or np.linalg.norm(y) < 1e-9:
                return self._meaningless(label)
            y = y / np.linalg.norm(y)
            return np.column_stack([x, y, np.cross(x, y)])
        if "zaxis" in own:
            return _matrix(
                Rotation.from_quat(swing(np.array([0.0, 0, 1]), own.numbers("zaxis", 3)))
            )
        return np.eye(3)

    def _meaningless(self, label: str) -> Floats:
        self._warn(f"{label} has an orientation without meaning: ignored")
        return np.eye(3)


def geom_marks(geom: Attributes, orientation: Orientation) -> tuple[list[Floats], bool]:
    """Places at the outside of a geom, (3,) each, in its body's frame; and whether they are sure.

    Of a mesh only the place is known here, and that is not sure to be on it.
    """
    kind = geom.text("type", "sphere")
    size = geom.some_numbers("size")
    if kind == "plane" or geom.number("group", 0.0) >= _HIDDEN:
        return [], True
    if "fromto" in geom:
        ends = geom.numbers("fromto", 6).reshape(2, 3)
        along = ends[1] - ends[0]
        radius = size[0] if len(size) and kind == "capsule" else 0.0
        reach = along * (radius / max(float(np.linalg.norm(along)), 1e-9))
        return [ends[0] - reach, ends[1] + reach], True
    place = geom.place("pos")
    if "mesh" in geom or len(size) < _SIZES.get(kind, 99):
        return [place], False
    if kind == "sphere":
        half = np.full(3, size[0])
    elif kind in ("capsule", "cylinder"):
        half = np.array([size[0], size[0], size[1] + (size[0] if kind == "capsule" else 0.0)])
    else:
        half = size[:3]
    corners = np.vstack([np.diag(half), -np.diag(half)])
    if kind == "box":
        corners = half * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    turn = orientation.matrix(geom, "geom")
    return list(place + corners @ turn.T), True


def _matrix(rotation: Rotation) -> Floats:
    matrix: Floats = rotation.as_matrix()
    return matrix
