"""BVH motion files, in all the dialects that are about.

The format says neither units nor which way is up, and programs differ in nearly all the rest:
the order of channels (joint by joint), six channels on every joint, tabs, case, byte order marks,
row counts that are wrong. What can be read is read, and what was odd is said in `warnings`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from puppet.errors import BadFileError
from puppet.formats.text import read_text
from puppet.kernel import Floats, frozen

_CHANNEL = re.compile(r"(?P<axis>[xyz])(?P<kind>position|rotation)$", re.IGNORECASE)
#: Seconds; what a file without a usable frame time is taken to have.
USUAL_FRAME_TIME: Final = 1.0 / 30.0
#: Seconds; a longer frame time is a mistake.
LONGEST_FRAME_TIME: Final = 1.0
#: Whatever the unit, nothing in a file is larger than this.
LARGEST: Final = 1e9
#: Of many warnings of one kind, so many are given in full.
_SAID: Final = 8


@dataclass(frozen=True, slots=True, eq=False)
class BvhMotion:
    """A hierarchy of J joints and its motion over F frames, in the file's own units and axes.

    names: J names, unique (repeated ones get a number). parents: (J,), -1 for a root; parents come
    first. offsets: (J, 3). ends: for joints with an End Site its offset. channels: for each joint
    its channels in the order of the file ("Xposition", "Zrotation"); C in all. frame_time: s.
    values: (F, C), degrees and units. warnings: what was odd, for people.
    """

    name: str
    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Floats
    ends: dict[int, Floats]
    channels: tuple[tuple[str, ...], ...]
    frame_time: float
    values: Floats
    warnings: tuple[str, ...] = ()

    def every(self, stride: int) -> BvhMotion:
        """The same motion with one of `stride` frames."""
        return replace(self, values=self.values[::stride], frame_time=self.frame_time * stride)

    def forward(self) -> tuple[Floats, list[Rotation]]:
        """Joint positions (F, J, 3) and for each joint F rotations world_from_joint.

        A frame with an impossible number has NaN at the joints that hang on it.
        """
        count = len(self.values)
        values = np.where(np.abs(self.values) < LARGEST, self.values, np.nan)
        positions = np.empty((count, len(self.names), 3))
        rotations: list[Rotation] = []
        added = self._positions_are_added()
        column = 0
        for joint, parent in enumerate(self.parents):
            offset = np.tile(self.offsets[joint], (count, 1))
            order, angles = "", []
            for channel in self.channels[joint]:
                axis = "XYZ".index(channel[0])
                if channel.endswith("rotation"):
                    order += channel[0]
                    angles.append(values[:, column])
                elif added and parent >= 0:
                    offset[:, axis] += values[:, column]
                else:
                    offset[:, axis] = values[:, column]
                column += 1
            turned, broken = _rotations(order, angles, count)
            if parent < 0:
                positions[:, joint] = offset
            else:
                positions[:, joint] = positions[:, parent] + rotations[parent].apply(offset)
                turned = rotations[parent] * turned
            positions[broken, joint] = np.nan
            rotations.append(turned)
        return positions, rotations

    def _positions_are_added(self) -> bool:
        """Whether position channels of inner joints are added to the offsets, not put in place.

        Both are about. Bones have lengths: positions near zero can only be additions.
        """
        moves, lengths = 0.0, 0.0
        column = 0
        for joint, channels in enumerate(self.channels):
            for channel in channels:
                if channel.endswith("position") and self.parents[joint] >= 0 and len(self.values):
                    rest = self.offsets[joint]["XYZ".index(channel[0])]
                    moved = float(np.median(self.values[:, column]))
                    moves += abs(moved - rest)
                    lengths += abs(moved)
                column += 1
        return lengths < moves


def _rotations(order: str, angles: list[Floats], count: int) -> tuple[Rotation, NDArray[np.bool_]]:
    """F rotations from angles in degrees, the first channel outermost; and which are broken."""
    if not order:
        return Rotation.identity(count), np.zeros(count, bool)
    table = np.column_stack(angles)
    broken = np.asarray(~np.isfinite(table).all(axis=1))
    table[broken] = 0.0
    turned = Rotation.identity(count)
    # One by one, as files with fewer or more than three angles on a joint are about.
    for axis, column in zip(order, table.T, strict=True):
        turned = turned * Rotation.from_euler(axis, column[:, None], degrees=True)
    return turned, broken


def read_bvh(path: Path) -> BvhMotion:
    """Read a BVH file. Raises BadFileError with the line for what cannot be understood."""
    text = read_text(path)
    split = re.search(r"^[ \t]*MOTION[ \t]*$", text, re.IGNORECASE | re.MULTILINE)
    if not re.match(r"\s*HIERARCHY\b", text, re.IGNORECASE):
        raise BadFileError(
            "this is not a BVH file",
            where=f"{path}: line 1",
            expected="HIERARCHY",
            found=repr(text.lstrip()[:20]),
        )
    if split is None:
        raise BadFileError(
            "the BVH file ends before its motion",
            where=path,
            expected="a line MOTION",
            hint="the file was cut off: export or download it again",
        )
    hierarchy = _Hierarchy(path)
    hierarchy.read(text[: split.start()])
    before = text[: split.end()].count("\n") + 1
    width = sum(map(len, hierarchy.channels))
    if width == 0:
        raise BadFileError("no joint has a channel, so nothing can move", where=path)
    frame_time, values, warnings = _motion(path, text[split.end() :], before, width)
    return BvhMotion(
        name=path.stem,
        names=_unique(hierarchy.names, hierarchy.warnings),
        parents=tuple(hierarchy.parents),
        offsets=frozen(hierarchy.offsets),
        ends=hierarchy.ends,
        channels=tuple(map(tuple, hierarchy.channels)),
        frame_time=frame_time,
        values=frozen(values),
        warnings=(*hierarchy.warnings, *warnings),
    )


@dataclass(slots=True)
class _Hierarchy:
    """The first half of a file, as it is read."""

    path: Path
    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[tuple[float, float, float]] = field(default_factory=list)
    ends: dict[int, Floats] = field(default_factory=dict)
    channels: list[list[str]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def read(self, text: str) -> None:
        words = [
            (word, number)
            for number, line in enumerate(text.split("\n"), 1)
            for word in re.sub(r"([{}])", r" \1 ", line).split()
        ]
        at = 1  # past HIERARCHY
        open_joints: list[int] = []  # the End Site of joint j is -1 - j
        while at < len(words):
            word, line = words[at]
            at += 1
            match word.upper():
                case "ROOT" | "JOINT":
                    name, at = self._name(words, at, line)
                    above = open_joints[-1] if open_joints else -1
                    self.names.append(name)
                    self.parents.append(above if above >= 0 else -1)
                    self.offsets.append((0.0, 0.0, 0.0))
                    self.channels.append([])
                    open_joints.append(len(self.names) - 1)
                case "END" if open_joints:
                    _, at = self._name(words, at, line)
                    open_joints.append(-1 - open_joints[-1])
                case "OFFSET" if open_joints:
                    offset = self._offset(words[at : at + 3], line)
                    at += 3
                    if open_joints[-1] >= 0:
                        self.offsets[open_joints[-1]] = offset
                    else:
                        self.ends.setdefault(-1 - open_joints[-1], np.array(offset))
                case "CHANNELS" if open_joints and open_joints[-1] >= 0:
                    at = self._channels(words, at, line, open_joints[-1])
                case "}":
                    if open_joints:
                        open_joints.pop()
                    else:
                        self.warnings.append(f"line {line}: a brace too many")
                case _:
                    raise BadFileError(
                        "a word that does not belong here",
                        where=f"{self.path}: line {line}",
                        expected="ROOT, JOINT, End Site, OFFSET, CHANNELS or a brace",
                        found=repr(word),
                    )
        if not self.names:
            raise BadFileError("the hierarchy has no joints", where=self.path)
        if open_joints:
            self.warnings.append(f"{len(open_joints)} braces are not closed")

    def _name(self, words: list[tuple[str, int]], at: int, line: int) -> tuple[str, int]:
        """A name may hold spaces, or be missing; the brace ends it."""
        first = at
        while at < len(words) and words[at][0] != "{":
            if words[at][1] != line:
                raise BadFileError(
                    "a joint does not open",
                    where=f"{self.path}: line {line}",
                    expected="{ after its name",
                    found=repr(words[at][0]),
                )
            at += 1
        return " ".join(word for word, _ in words[first:at]) or "joint", at + 1

    def _offset(self, words: list[tuple[str, int]], line: int) -> tuple[float, float, float]:
        try:
            x, y, z = (float(word) for word, _ in words)
        except ValueError:
            x = y = z = np.nan
        if not (abs(x) < LARGEST and abs(y) < LARGEST and abs(z) < LARGEST):
            raise BadFileError(
                "an offset is not three numbers",
                where=f"{self.path}: line {line}",
                found=repr(" ".join(word for word, _ in words)),
            )
        return x, y, z

    def _channels(self, words: list[tuple[str, int]], at: int, line: int, joint: int) -> int:
        declared, at = (words[at][0] if at < len(words) else ""), at + 1
        if not declared.isdigit():
            raise BadFileError(
                "the number of channels is missing",
                where=f"{self.path}: line {line}",
                found=repr(declared),
            )
        found = self.channels[joint]
        while at < len(words) and (match := _CHANNEL.match(words[at][0])):
            found.append(match["axis"].upper() + match["kind"].lower())
            at += 1
        if len(found) != int(declared):
            if at < len(words) and len(found) < int(declared) and words[at][1] == line:
                raise BadFileError(
                    "this is not a channel",
                    where=f"{self.path}: line {line}",
                    expected="Xposition … Zposition, Xrotation … Zrotation",
                    found=repr(words[at][0]),
                )
            self.warnings.append(
                f"line {line}: {declared} channels declared, {len(found)} there; these are used"
            )
        return at


def _unique(names: list[str], warnings: list[str]) -> tuple[str, ...]:
    """Number the repeated names, Blender's way: Hand, Hand.001."""
    taken = set(names)
    seen: set[str] = set()
    numbers: dict[str, int] = {}
    result, renamed = list[str](), list[str]()
    for name in names:
        unique = name
        while unique in seen or (unique != name and unique in taken):
            numbers[name] = numbers.get(name, 0) + 1
            unique = f"{name}.{numbers[name]:03d}"
        if unique != name:
            renamed.append(f"two joints are called {name}; the second is now {unique}")
        seen.add(unique)
        result.append(unique)
    warnings.extend(renamed[:_SAID])
    if len(renamed) > _SAID:
        warnings.append(f"{len(renamed) - _SAID} more joints have a name that was there: numbered")
    return tuple(result)


def _motion(path: Path, text: str, before: int, width: int) -> tuple[float, Floats, list[str]]:
    """Frame time in s, values (F, width) and warnings. `before`: the line that MOTION is on."""
    warnings: list[str] = []
    lines = [(n, line.split()) for n, line in enumerate(text.split("\n"), before) if line.strip()]
    declared, frame_time = -1, USUAL_FRAME_TIME
    while lines and re.match(r"[A-Za-z]", lines[0][1][0]) and not _is_number(lines[0][1][0]):
        number, words = lines.pop(0)
        sentence = " ".join(words)
        if match := re.match(r"frames\s*:?\s*(\d+)$", sentence, re.IGNORECASE):
            declared = int(match[1])
        elif match := re.match(r"frame\s*time\s*:?\s*(\S+)$", sentence, re.IGNORECASE):
            frame_time = float(match[1]) if _is_number(match[1]) else 0.0
        else:
            raise BadFileError(
                "a line that does not belong here",
                where=f"{path}: line {number}",
                expected="Frames: N, Frame Time: seconds, or numbers",
                found=repr(sentence[:60]),
            )
    if not 0.0 < frame_time <= LONGEST_FRAME_TIME:
        warnings.append(f"a frame time of {frame_time:g} s cannot be true; taken as 1/30 s")
        frame_time = USUAL_FRAME_TIME
    values = _rows(path, lines, declared, width, warnings)
    if declared >= 0 and declared != len(values):
        warnings.append(f"{declared} frames declared, {len(values)} there; all of these are used")
    if len(values) == 0:
        raise BadFileError("the BVH file has no frames", where=path, expected=f"{width} numbers")
    return frame_time, values, warnings


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _rows(
    path: Path,
    lines: list[tuple[int, list[str]]],
    declared: int,
    width: int,
    warnings: list[str],
) -> Floats:
    total = sum(len(words) for _, words in lines)
    if any(len(words) != width for _, words in lines):
        if total == width * declared:
            warnings.append("frames do not keep to lines; taken as one run of numbers")
        elif lines and len(lines[-1][1]) < width and all(len(w) == width for _, w in lines[:-1]):
            warnings.append(f"line {lines[-1][0]}: the last frame is cut off and left out")
            lines = lines[:-1]
        else:
            number, words = next((n, w) for n, w in lines if len(w) != width)
            raise BadFileError(
                "a frame has the wrong number of values",
                where=f"{path}: line {number}, column {min(len(words), width) + 1}",
                expected=f"{width}, one for each channel",
                found=str(len(words)),
            )
    try:
        return np.array([w for _, words in lines for w in words], float).reshape(-1, width)
    except ValueError:
        number, column, word = next(_not_numbers(lines))
        raise BadFileError(
            "this is not a number",
            where=f"{path}: line {number}, column {column + 1}",
            found=repr(word),
        ) from None


def _not_numbers(lines: list[tuple[int, list[str]]]) -> Iterator[tuple[int, int, str]]:
    for number, words in lines:
        for column, word in enumerate(words):
            if not _is_number(word):
                yield number, column, word
