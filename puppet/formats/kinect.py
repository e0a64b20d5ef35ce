"""Recordings of the Kinect v1 and v2, as three programs write them.

Kinect space has x to the sensor's left, y up and z away from it, in metres. A performer who faces
the sensor has the left hand at -x, so half a turn about y gives the stage frame: (-x, y, -z). The
origin stays below the sensor.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from puppet.errors import BadFileError
from puppet.formats.performance import Performance
from puppet.formats.text import read_text
from puppet.kernel import Bytes, Floats
from puppet.rotation import rotate, swing
from puppet.skeleton import JOINT_COUNT, JOINT_NAMES, TrackingState

#: Frames a second of either Kinect; files without a clock are taken to have it.
KINECT_RATE: Final = 30.0
#: Kinect space to stage frame.
STAGE_FROM_KINECT: Final = np.array([-1.0, 1.0, -1.0])

#: The 25 joints of the Kinect SDK v2, in its order.
KINECT2_JOINTS: Final = (
    *("spine_base", "spine_mid", "neck", "head"),
    *("shoulder_left", "elbow_left", "wrist_left", "hand_left"),
    *("shoulder_right", "elbow_right", "wrist_right", "hand_right"),
    *("hip_left", "knee_left", "ankle_left", "foot_left"),
    *("hip_right", "knee_right", "ankle_right", "foot_right"),
    *("spine_shoulder", "hand_tip_left", "thumb_left", "hand_tip_right", "thumb_right"),
)
#: The joints of v2 that have another name in v1. Neck, hand tips and thumbs have no counterpart.
_KINECT2_NAMES: Final = {
    "hip_center": "spine_base",
    "spine": "spine_mid",
    "shoulder_center": "spine_shoulder",
}
#: For each of the 20 joints its index among the 25.
KINECT1_FROM_KINECT2: Final = tuple(
    KINECT2_JOINTS.index(_KINECT2_NAMES.get(name, name)) for name in JOINT_NAMES
)
_KINECT2_COLUMNS: Final = 1 + 4 * len(KINECT2_JOINTS)
_KINECT2_TICKS_A_SECOND: Final = 1e7
_MILLISECONDS_A_SECOND: Final = 1e3


def read_kinect1_csv(path: Path) -> Performance:
    """Read a semicolon table: a header of 20 joint names, cells ``x y z``, then maybe an action.

    There is no clock and there are no states. Raises BadFileError with line and column.
    """
    lines = _lines(path)
    _, header = lines[0]
    names = [_key(cell) for cell in header.split(";")]
    order = _columns(path, names, [_key(name) for name in JOINT_NAMES])
    rows = np.empty((len(lines) - 1, JOINT_COUNT, 3))
    actions = False
    for row, (number, line) in enumerate(lines[1:]):
        cells = line.split(";")
        if len(cells) < len(names):
            raise _short(path, number, len(names), len(cells), "joints")
        actions = actions or bool(cells[len(names) :] and cells[len(names)].strip())
        for joint, column in enumerate(order):
            values = cells[column].split()
            if len(values) != 3 or not all(map(_is_number, values)):
                raise BadFileError(
                    "a joint is not three numbers",
                    where=f"{path}: line {number}, column {column + 1} ({JOINT_NAMES[joint]})",
                    expected="x y z",
                    found=repr(cells[column].strip()),
                )
            rows[row, joint] = list(map(float, values))
    return Performance(
        kind="kinect1-csv",
        rate=KINECT_RATE,
        times=np.arange(len(rows)) / KINECT_RATE,
        positions=rows * STAGE_FROM_KINECT,
        states=np.full(rows.shape[:2], TrackingState.TRACKED, np.uint8),
        states_known=False,
        notes=(
            f"clock: none in the file, taken as {KINECT_RATE:g} frames a second",
            "states: none in the file, guessed from zeros and repeats",
            *(("the column of actions is not kept",) if actions else ()),
        ),
    )


def read_kinect1_skl(path: Path) -> Performance:
    """Read a tab-separated table: timestamp [ms], x y z tracked of 20 joints, the floor plane.

    y is the height above the floor already. Raises BadFileError with line and column.
    """
    lines = _lines(path)
    _, header = lines[0]
    names = [_key(cell) for cell in header.rstrip("\t").split("\t")]
    joints = [_key(name) for name in JOINT_NAMES]
    wanted = ["timestamp", *(joint + part for joint in joints for part in ("x", "y", "z"))]
    wanted += [joint + "tracked" for joint in joints]
    columns = _columns(path, names, wanted)
    table = _table(path, lines[1:], "\t", len(names), names)
    times = table[:, columns[0]] / _MILLISECONDS_A_SECOND
    positions = table[:, columns[1 : 1 + 3 * JOINT_COUNT]].reshape(-1, JOINT_COUNT, 3)
    states = _states(path, lines[1:], table[:, columns[1 + 3 * JOINT_COUNT :]])
    notes: tuple[str, ...] = ()
    if "floorplanea" in names:
        planes = table[:, _columns(path, names, [f"floorplane{letter}" for letter in "abcd"])]
        positions, note = _levelled(positions, states, planes)
        notes = (note,)
    _require_clock(path, times)
    return Performance(
        kind="kinect1-skl",
        rate=_rate(path, times),
        times=times,
        positions=positions * STAGE_FROM_KINECT,
        states=states,
        floor_known=True,
        notes=notes,
    )


def read_kinect2_csv(path: Path) -> Performance:
    """Read a comma table without header: timestamp [100 ns], x y z state of 25 joints.

    `KINECT1_FROM_KINECT2` says which joints stay. Raises BadFileError with line and column.
    """
    lines = _lines(path)
    names = ["timestamp"]
    names += [f"{joint} {part}" for joint in KINECT2_JOINTS for part in ("x", "y", "z", "state")]
    table = _table(path, lines, ",", _KINECT2_COLUMNS, names)
    times = table[:, 0] / _KINECT2_TICKS_A_SECOND
    _require_clock(path, times)
    joints = table[:, 1:].reshape(len(table), len(KINECT2_JOINTS), 4)[:, KINECT1_FROM_KINECT2]
    return Performance(
        kind="kinect2-csv",
        rate=_rate(path, times),
        times=times,
        positions=joints[..., :3] * STAGE_FROM_KINECT,
        states=_states(path, lines, joints[..., 3]),
    )


def _levelled(positions: Floats, states: Bytes, planes: Floats) -> tuple[Floats, str]:
    """Turn x and z upright as well: the recorder replaced y by the height above the plane only.

    positions: (F, 20, 3), planes: (F, 4), Kinect space. Lost joints are at (0, D, 0), that is the
    sensor itself; the reader gives them as zeros.
    """
    lost = (states == TrackingState.NOT_TRACKED) | (
        (positions[..., 0] == 0.0)
        & (positions[..., 2] == 0.0)
        & (positions[..., 1] == planes[:, 3:])
    )
    positions = np.where(lost[..., None], 0.0, positions)
    good = np.isfinite(planes).all(axis=1) & (planes[:, 1] > 0.5)
    if not good.any():
        return positions, "floor: no plane was found by the sensor, so a tilt would remain"
    a, b, c, d = np.median(planes[good], axis=0)
    length = float(np.sqrt(a * a + b * b + c * c))
    normal, height = np.array([a, b, c]) / length, float(d) / length
    sensor = positions.copy()
    # Numbers that are not finite stay so, and are counted later.
    with np.errstate(invalid="ignore", over="ignore"):
        sideways = normal[0] * positions[..., 0] + normal[2] * positions[..., 2]
        sensor[..., 1] = (positions[..., 1] - height - sideways) / normal[1]
    turn = swing(normal, np.array([0.0, 1.0, 0.0]))
    stage_from_sensor = np.column_stack([rotate(turn, axis) for axis in np.eye(3)])
    with np.errstate(invalid="ignore", over="ignore"):
        upright = sensor @ stage_from_sensor.T + (0.0, height, 0.0)
    tilt = np.degrees(np.arccos(np.clip(normal[1], -1.0, 1.0)))
    return (
        np.where(lost[..., None], 0.0, upright),
        f"floor: plane in the file, sensor {height:.2f} m above it and tilted by {tilt:.1f}°",
    )


def _lines(path: Path) -> list[tuple[int, str]]:
    """The lines with something in them, with their numbers from 1. A header alone is an error."""
    lines = [(n, line) for n, line in enumerate(read_text(path).split("\n"), 1) if line.strip()]
    if len(lines) < 2 and not re.match(r"[-+.\d]", lines[0][1].strip()):
        raise BadFileError("the recording has a header and no frames", where=path)
    return lines


def _key(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _columns(path: Path, names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    missing = [name for name in wanted if name not in names]
    if missing:
        raise BadFileError(
            "the header lacks columns",
            where=f"{path}: line 1",
            expected=f"{len(wanted)} columns, among them {', '.join(missing[:6])}",
            found=f"{len(names)} columns, {len(missing)} of the wanted ones missing",
        )
    return [names.index(name) for name in wanted]


def _table(
    path: Path,
    lines: Sequence[tuple[int, str]],
    separator: str,
    width: int,
    names: Sequence[str],
) -> Floats:
    """(F, width) numbers; cells beyond the width are left out if empty."""
    table = np.empty((len(lines), width))
    for row, (number, line) in enumerate(lines):
        cells = line.rstrip(separator + " ").split(separator)
        if len(cells) < width:
            raise _short(path, number, width, len(cells), "columns")
        if len(cells) > width:
            raise BadFileError(
                "a row is too long",
                where=f"{path}: line {number}, column {width + 1}",
                expected=f"{width} columns",
                found=str(len(cells)),
            )
        try:
            table[row] = list(map(float, cells))
        except ValueError:
            column = next(i for i, cell in enumerate(cells) if not _is_number(cell))
            raise BadFileError(
                "this is not a number",
                where=f"{path}: line {number}, column {column + 1} ({names[column]})",
                found=repr(cells[column].strip()),
            ) from None
    return table


def _short(path: Path, number: int, width: int, found: int, unit: str) -> BadFileError:
    return BadFileError(
        "a row is too short",
        where=f"{path}: line {number}, column {found + 1}",
        expected=f"{width} {unit}",
        found=str(found),
        hint="if the recorder was cut off, delete the last line",
    )


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _states(path: Path, lines: Sequence[tuple[int, str]], values: Floats) -> Bytes:
    wrong = ~np.isin(values, [int(state) for state in TrackingState])
    if wrong.any():
        row, joint = np.argwhere(wrong)[0]
        raise BadFileError(
            "this is not a tracking state",
            where=f"{path}: line {lines[row][0]} ({JOINT_NAMES[joint]})",
            expected="0 (not tracked), 1 (inferred) or 2 (tracked)",
            found=f"{values[row, joint]:g}",
        )
    return values.astype(np.uint8)


def _require_clock(path: Path, times: Floats) -> None:
    if not np.isfinite(times).all():
        row = int(np.flatnonzero(~np.isfinite(times))[0])
        raise BadFileError("a timestamp is not finite", where=f"{path}: frame {row}")


def _rate(path: Path, times: Floats) -> float:
    """Frames a second, from the usual step of the clock."""
    steps = np.diff(times)
    steps = steps[steps > 0.0]
    if len(steps) == 0:
        return KINECT_RATE
    rate = 1.0 / float(np.median(steps))
    if not 2.0 <= rate <= 240.0:
        raise BadFileError(
            "the clock of this recording cannot be true",
            where=path,
            expected="2 to 240 frames a second",
            found=f"{rate:g}",
        )
    return round(rate, 2)
