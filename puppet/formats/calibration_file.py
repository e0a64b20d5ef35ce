"""Where a show's cameras stand, and the performer's neutral stance: a ``.stage.toml`` beside it.

Metres, radians and pixels; rotations are quaternions xyzw. A file is replaced in one go, and the
one before it is kept beside it. It ends with a line that says that it is whole.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import msgspec

from puppet.errors import BadFileError, UnavailableError
from puppet.formats.replace import replace_file
from puppet.skeleton import JOINT_COUNT, JOINT_NAMES

VERSION: Final = 1
_HEADER: Final = """\
# Where this show's cameras stand, and how its performer stands who does nothing. `puppet calibrate`
# writes this file, and keeps the one before it with .bak. docs/calibration.md describes it.
"""
_END: Final = "[end]  # without this line the file counts as cut off\n"

Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Pixels = Annotated[int, msgspec.Meta(ge=1)]
Kind = Literal["I", "T", "still"]


class LensRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A lens, pixels: focal lengths, and the middle of the image."""

    focal_x: float
    focal_y: float
    centre_x: float
    centre_y: float


class CameraRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where one camera stands. Its axes: x right, y up, z from the scene to the camera.

    device: what the camera is known by. width, height: of its image, pixels. rotation, translation:
    stage_from_camera, a quaternion xyzw and metres. floor, origin: what told them. when: as text.
    quality: one sentence. lens: if it was measured, or is the camera's own.
    """

    device: str
    width: Pixels
    height: Pixels
    rotation: Quaternion
    translation: Triple
    floor: str = ""
    origin: str = ""
    when: str = ""
    quality: str = ""
    lens: LensRow | None = None


class StanceRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A neutral stance: the joints of a skeleton, metres in the stage frame, by their names."""

    kind: Kind
    joints: dict[str, Triple]
    when: str = ""


class CalibrationFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The file. end: the mark of its last line; nothing is in it."""

    version: int = VERSION
    stance: StanceRow | None = None
    cameras: tuple[CameraRow, ...] = ()
    end: dict[str, bool] = {}

    def camera(self, device: str) -> CameraRow | None:
        """The row of a camera."""
        return next((row for row in self.cameras if row.device == device), None)

    def with_camera(self, row: CameraRow) -> CalibrationFile:
        """The same with one camera more, or another row in its place."""
        others = tuple(other for other in self.cameras if other.device != row.device)
        return msgspec.structs.replace(self, cameras=(*others, row))

    def with_stance(self, row: StanceRow) -> CalibrationFile:
        """The same with another neutral stance."""
        return msgspec.structs.replace(self, stance=row)


def calibration_path(show: Path) -> Path:
    """Where the calibration of a show is kept."""
    return show.with_name(f"{show.stem}.stage.toml")


def backup_path(path: Path) -> Path:
    """Where the calibration is kept that was there before the last one."""
    return path.with_name(f"{path.name}.bak")


def read_calibration(path: Path) -> CalibrationFile:
    """The calibration in a file; an empty one if there is no such file.

    Raises BadFileError for a file that was cut off, is of another version, or makes no sense.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return CalibrationFile()
    except OSError as error:
        raise BadFileError(
            "the stage calibration cannot be read", where=path, found=error.strerror or str(error)
        ) from error
    try:
        document: Any = msgspec.toml.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise _bad("this is not TOML, or it was cut off", path, found=str(error)) from None
    version = document.get("version")
    if version != VERSION:
        raise _bad(
            "the stage calibration is of another version",
            path,
            expected=f"version = {VERSION}",
            found="no version" if version is None else f"version = {version}",
        )
    if "end" not in document:
        raise _bad(
            "the stage calibration was cut off",
            path,
            expected="[end] as its last line",
            found="no such line",
        )
    try:
        file = msgspec.convert(document, CalibrationFile)
    except msgspec.ValidationError as error:
        what, _, place = str(error).partition(" - at ")
        place = place.strip("`").removeprefix("$").lstrip(".") or "the whole file"
        raise _bad(what[:1].lower() + what[1:], f"{path}: {place}") from None
    for place, what, found in _nonsense(file):
        raise _bad(what, f"{path}: {place}", found=found)
    return file


def write_calibration(path: Path, file: CalibrationFile) -> None:
    """Replace the calibration, and keep the one before it. When this returns, it is on the disk.

    Raises UnavailableError if that is not possible; then the old file is as it was.
    """
    try:
        if path.exists():
            replace_file(backup_path(path), path.read_bytes())
        replace_file(path, "".join(_lines(file)).encode())
    except OSError as error:
        raise UnavailableError(
            "the stage calibration cannot be saved",
            where=path,
            found=error.strerror or str(error),
            hint="make the folder of the show writable",
        ) from None


def swap_with_backup(path: Path) -> CalibrationFile:
    """Bring the calibration back that was there before; a second time undoes that.

    Raises BadFileError if there is none, or it makes no sense, and UnavailableError.
    """
    backup = backup_path(path)
    if not backup.exists():
        raise BadFileError("there is no calibration before this one", where=backup)
    file = read_calibration(backup)
    write_calibration(path, file)
    return file


def _bad(
    what: str, where: Path | str, *, expected: str | None = None, found: str | None = None
) -> BadFileError:
    hint = "calibrate anew with `puppet calibrate`, or move the file away"
    return BadFileError(what, where=where, expected=expected, found=found, hint=hint)


def _nonsense(file: CalibrationFile) -> Iterator[tuple[str, str, str]]:
    """Place, what is wrong, and what is there."""
    devices = [row.device for row in file.cameras]
    for index, row in enumerate(file.cameras):
        place = f"cameras[{index}]"
        if row.device in devices[:index]:
            yield f"{place}.device", "this camera is there twice", row.device
        length = math.hypot(*row.rotation)
        if not 0.99 < length < 1.01:
            yield f"{place}.rotation", "a rotation has the length 1", f"{length:.3f}"
        if not all(map(math.isfinite, row.translation)):
            yield f"{place}.translation", "not a place", str(row.translation)
        lens = row.lens
        if lens is not None:
            numbers = (lens.focal_x, lens.focal_y, lens.centre_x, lens.centre_y)
            if not all(map(math.isfinite, numbers)) or min(lens.focal_x, lens.focal_y) <= 1.0:
                yield f"{place}.lens", "there is no such lens", str(numbers)
    if file.stance is not None:
        joints = file.stance.joints
        if set(joints) != set(JOINT_NAMES):
            odd = ", ".join(sorted(set(joints) ^ set(JOINT_NAMES)))
            yield "stance.joints", f"these must be the {JOINT_COUNT} joints", f"amiss: {odd}"
        for name, place_of in joints.items():
            if not all(map(math.isfinite, place_of)):
                yield f"stance.joints.{name}", "not a place", str(place_of)


def _lines(file: CalibrationFile) -> Iterator[str]:
    yield f"{_HEADER}version = {file.version}\n"
    for row in file.cameras:
        yield "\n[[cameras]]\n"
        yield from _fields(row, ("rotation", "translation"))
    if file.stance is not None:
        yield "\n[stance]\n"
        yield f"kind = {_inline(file.stance.kind)}\n"
        if file.stance.when:
            yield f"when = {_inline(file.stance.when)}\n"
        yield "\n[stance.joints]  # metres on the stage: left of who faces front, up, front\n"
        for name in JOINT_NAMES:
            yield f"{name} = {_inline(file.stance.joints[name])}\n"
    yield f"\n{_END}"


def _fields(row: CameraRow, transform: Iterable[str]) -> Iterator[str]:
    for key, value in msgspec.structs.asdict(row).items():
        if value is None or value == "":
            continue
        plain = msgspec.structs.asdict(value) if isinstance(value, LensRow) else value
        comment = "  # the stage from the camera" if key in transform else ""
        yield f"{key} = {_inline(plain)}{comment}\n"


def _inline(value: object) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_inline(one)}" for key, one in value.items()) + "}"
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_inline, value)) + "]"
    if isinstance(value, float):
        return repr(round(value, 7))
    return repr(value)
