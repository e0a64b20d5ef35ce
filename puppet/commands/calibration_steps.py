"""The steps in which one camera is calibrated: look, floor, mark or board, result."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

from puppet.commands.guide import Guide
from puppet.errors import PuppetError
from puppet.formats.calibration_file import CalibrationFile, CameraRow
from puppet.skeleton import Joint, Moment
from puppet.tracking.calibration.board_watch import BoardWatch, Lying, stage_by_board
from puppet.tracking.calibration.calibration import (
    CameraCalibration,
    device_of,
    lens_row,
    stance_row,
)
from puppet.tracking.calibration.lens import LensWatch
from puppet.tracking.calibration.on_mark import FoundStage, OnMark
from puppet.tracking.calibration.stage_frame import StageFromCamera
from puppet.tracking.calibration.stage_pictures import NOW, StagePictures, picture
from puppet.tracking.cameras.camera import Shot
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.watcher import Watcher

#: Seconds that a performer gets to walk from the keyboard to the mark.
WALK: Final = 5.0


@dataclass(frozen=True)
class Wishes:
    """How to calibrate. board: by a printed board instead of a performer. lying: where it is; None
    lets its direction decide. board_height: metres, of the middle of one that stands. square:
    metres, as printed. lens: measure that first. pictures: the folder for them."""

    board: bool = False
    lying: Lying | None = None
    board_height: float | None = None
    square: float | None = None
    lens: bool = False
    pictures: Path | None = None


class CameraSteps:
    """One camera, from the first picture to the row of the file."""

    def __init__(
        self,
        watcher: Watcher,
        kept: CalibrationFile,
        wishes: Wishes,
        pictures: StagePictures,
        guide: Guide,
        stopped: Callable[[], bool],
    ) -> None:
        self._watcher, self._kept, self._wishes = watcher, kept, wishes
        self._pictures, self._guide = pictures, guide
        self._is_stopped = stopped
        self._lens_told = ""

    def go(self) -> CalibrationFile | None:
        """All steps. -> what is to be saved; None if it was stopped."""
        info = self._watcher.camera.info
        self._guide.step(1, f"camera: {info.name}")
        known = self._kept.camera(device_of(info))
        if known is not None and known.lens is not None:
            lens = CameraCalibration.of(known).lens
            self._watcher.use(_only_lens(known.width, known.height, lens))
        if self._wishes.lens and not self._measure_lens():
            return None
        found = self._by_board() if self._wishes.board else self._by_performer()
        if found is None:
            return None
        shot, stage = found
        self._guide.step(3 if self._wishes.board else 4, "result")
        self._guide.say(f"floor: from {stage.floor}")
        self._guide.say(f"origin: {stage.origin}")
        self._guide.say(stage.quality)
        height, width = shot.colour.shape[:2]
        when = datetime.now().astimezone().isoformat(timespec="minutes")
        x, y, z, w = stage.stage_from_camera.quaternion.tolist()
        left, up, front = stage.stage_from_camera.shift.tolist()
        file = self._kept.with_camera(
            CameraRow(
                device_of(info),
                width,
                height,
                (x, y, z, w),
                (left, up, front),
                stage.floor,
                stage.origin,
                when,
                "; ".join(filter(None, [stage.quality, self._lens_told])),
                lens_row(shot.intrinsics),
            )
        )
        if stage.stance is not None and stage.kind is not None:
            file = file.with_stance(stance_row(stage.stance, stage.kind, when))
        return file

    def _measure_lens(self) -> bool:
        watch, last = LensWatch(), None
        self._guide.say("show the board to the camera: near, tilted to all sides, in all corners")
        for shot, _ in self._shots():
            last = shot
            watch.look(shot.colour)
            self._guide.progress("views of the board", watch.progress)
            self._now(shot, f"{watch.progress:.0%} of the views that are needed")
            if watch.progress >= 1.0:
                break
        if last is None or self._is_stopped():
            return False
        found = watch.lens()
        self._lens_told = found.quality
        self._guide.say(f"lens: {found.quality}")
        height, width = last.colour.shape[:2]
        self._watcher.use(_only_lens(width, height, found.lens))
        return True

    def _by_performer(self) -> tuple[Shot, FoundStage] | None:
        live = self._watcher.info.live
        mark, last, told = OnMark(WALK if live else 0.0), None, False
        self._guide.step(2, "the floor")
        for shot, moment in self._shots():
            last = (shot, moment)
            mark.step(moment, self._watcher.level)
            self._guide.progress(mark.saying, mark.progress)
            if mark.floor_known and not told:
                told = True
                level = self._watcher.level
                caption = f"Floor: from {level.origin}. The grid should lie flat on it."
                self._keep("2-floor", shot, caption, moment, level.stage_from_camera())
                self._guide.step(3, "your mark")
            floor = self._watcher.level.stage_from_camera() if told else None
            self._now(shot, mark.saying, moment, floor)
            if mark.stage is not None:
                break
        if last is None or self._is_stopped():
            return None
        stage = mark.finish(self._watcher.level)
        if stage is None:
            raise PuppetError(
                "nobody was seen for long enough",
                where=self._watcher.info.name,
                expected="one person, wholly in the picture, for some seconds",
                hint="step back until your feet are seen, too; see 1-camera.png",
            )
        shot, moment = last
        self._keep_stage("3-stage", shot, stage, moment)
        return shot, stage

    def _by_board(self) -> tuple[Shot, FoundStage] | None:
        watch, last = BoardWatch(self._wishes.square), None
        self._guide.step(2, "the board: leave it where it is")
        for shot, moment in self._shots():
            last = shot if watch.look(shot) is not None or last is None else last
            self._guide.progress("shots of the board", watch.progress)
            self._now(shot, f"{watch.progress:.0%} of the shots of the board", moment)
            if watch.enough:
                break
        if last is None or self._is_stopped():
            return None
        height, width = last.colour.shape[:2]
        lens = last.intrinsics or Intrinsics.assumed(width, height)
        if last.intrinsics is None:
            self._guide.warn(
                "nothing is known of this lens, so distances are a guess: measure it with --lens"
            )
        pose = watch.pose(lens, self._watcher.level)
        stage = stage_by_board(
            pose, self._watcher.level, self._wishes.lying, self._wishes.board_height
        )
        captions = [f"Origin: {stage.origin}. The grid should lie flat on the floor.", pose.quality]
        image = picture(last, captions, stage=stage.stage_from_camera, board=pose)
        self._pictures.keep("3-stage", image)
        return last, stage

    def _shots(self) -> Iterator[tuple[Shot, Moment]]:
        first = True
        for shot, moment in self._watcher.unlevelled():
            if first:
                first = False
                told = self._about(shot)
                self._guide.say(told)
                self._keep("1-camera", shot, told, moment)
            yield shot, moment
            if self._is_stopped():
                break
        self._guide.progress("", None)

    def _about(self, shot: Shot) -> str:
        height, width = shot.colour.shape[:2]
        facts = [
            f"{width}x{height} pixels",
            "depth" if shot.depth is not None else "no depth",
            "gravity" if shot.up is not None else "no gravity",
            "a known lens" if shot.intrinsics is not None else "an unknown lens",
        ]
        return f"{self._watcher.info.name}: " + ", ".join(facts)

    def _keep(
        self,
        name: str,
        shot: Shot,
        caption: str,
        moment: Moment | None = None,
        floor: StageFromCamera | None = None,
    ) -> None:
        image = picture(shot, [caption], moment=moment, floor=floor, centre=_under(moment, floor))
        self._guide.say(f"picture: {self._pictures.keep(name, image)}")

    def _keep_stage(self, name: str, shot: Shot, stage: FoundStage, moment: Moment) -> None:
        captions = [
            f"Floor: from {stage.floor}. Origin: {stage.origin}.",
            "The grid should lie on the floor, the cross between the feet, and the arrow should "
            "point to the audience.",
        ]
        image = picture(shot, captions, moment=moment, stage=stage.stage_from_camera)
        self._guide.say(f"picture: {self._pictures.keep(name, image)}")

    def _now(
        self,
        shot: Shot,
        caption: str,
        moment: Moment | None = None,
        floor: StageFromCamera | None = None,
    ) -> None:
        if self._pictures.due(shot.time):
            centre = _under(moment, floor)
            image = picture(shot, [caption], moment=moment, floor=floor, centre=centre)
            self._pictures.keep(NOW, image)


def _only_lens(width: int, height: int, lens: Intrinsics | None) -> CameraCalibration:
    return CameraCalibration(None, width, height, lens)


def _under(moment: Moment | None, floor: StageFromCamera | None) -> tuple[float, float]:
    """Where on the floor the first performer is; before the camera if there is none."""
    if floor is None:
        return 0.0, 0.0
    if moment is None or not moment.frames:
        return 0.0, -3.0
    hip = floor.to_stage(moment.frames[0].positions[[Joint.HIP_CENTER]])[0]
    return float(hip[0]), float(hip[2])
