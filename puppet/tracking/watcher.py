"""The way from a camera's shots to skeletons, the same for every camera, live or replayed.

shot ──people──▶ landmarks of each performer ──body──▶ joints ──level──▶ stage frame
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

from puppet.errors import UnavailableError
from puppet.show import TrackingConfig
from puppet.skeleton import Moment, SkeletonFrame
from puppet.tracking.body.body import Body
from puppet.tracking.calibration.calibration import CameraCalibration
from puppet.tracking.calibration.floor_watch import FloorWatch
from puppet.tracking.calibration.level import Level
from puppet.tracking.cameras.camera import Camera, Shot
from puppet.tracking.people.models import PoseModels
from puppet.tracking.people.people import People, Seen
from puppet.tracking.source import Plane, SourceInfo
from puppet.tracking.stopwatch import Stopwatch

#: A recording is levelled by so many seconds of its first performer; only then do moments come out.
LEVEL_SECONDS = 1.0
FLOOR: Plane = (0.0, 1.0, 0.0, 0.0)


class Watcher:
    """Skeletons of the people before a camera. It is a `Source`.

    Moments in which nobody is seen are there, too, and empty. What is not live can be gone through
    again and again, with the same result each time.
    """

    def __init__(
        self,
        camera: Camera,
        models: PoseModels,
        tracking: TrackingConfig | None = None,
        *,
        floor: float | None = None,
        calibration: CameraCalibration | None = None,
    ) -> None:
        """floor: metres from the floor up to the camera; None if that is to be learnt.
        calibration: where the camera stands, if that was saved; then nothing is learnt.

        Closes the camera and raises UnavailableError for models that cannot be loaded.
        """
        self.camera = camera
        self._stopwatch = Stopwatch()
        self._events: Counter[str] = Counter()
        self._tracking = tracking or TrackingConfig()
        self._floor = floor
        self._calibration = calibration
        self._misfit = ""
        self._has_depth = False
        self._level: Level | None = None
        about = camera.info
        self._info = SourceInfo(
            about.name,
            about.kind,
            about.rate,
            live=about.live,
            floor=FLOOR,
            note=about.note,
            licence=about.licence,
        )
        try:
            self._people = People(
                models, self._tracking.performers, second_look=self._tracking.second_look
            )
        except UnavailableError:
            camera.close()
            raise

    @property
    def info(self) -> SourceInfo:
        return self._info

    @property
    def trouble(self) -> str:
        return self.camera.trouble

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was wrong and could be lived with; complete when the moments are over."""
        return (*self.camera.warnings, *filter(None, [self._misfit]))

    def use(self, calibration: CameraCalibration | None) -> None:
        """Take where the camera stands from a saved calibration, from the first shot on."""
        self._calibration = calibration

    @property
    def level(self) -> Level:
        """What is known of up and the floor; of nothing before the first shot."""
        return self._level or Level()

    @property
    def floor(self) -> str:
        """What tells where the floor is, for people: "depth", "feet", "a saved calibration"."""
        return "nothing yet" if self._level is None else self._level.origin

    @property
    def lens(self) -> tuple[float, float, float] | None:
        """Where the lens is on the calibrated stage, metres; None if that is not known."""
        if self._level is None or not self._level.saved:
            return None
        x, y, z = self._level.stage_from_camera().shift.tolist()
        return x, y, z

    @property
    def has_depth(self) -> bool:
        """Whether the last shot had depth."""
        return self._has_depth

    @property
    def milliseconds(self) -> dict[str, float]:
        """What each stage takes, on average over the last moments."""
        return self._stopwatch.milliseconds

    @property
    def events(self) -> Mapping[str, int]:
        """How often performers entered, were hidden, returned and left so far."""
        return self._events

    def __len__(self) -> int:
        return len(self.camera)

    def __iter__(self) -> Iterator[Moment]:
        moments = (moment for _shot, moment in self.unlevelled())
        return self._live(moments) if self.info.live else self._settled(moments)

    def close(self) -> None:
        """Let go of the camera. May be called twice."""
        self.camera.close()

    def unlevelled(self) -> Iterator[tuple[Shot, Moment]]:
        """Shots, and who is in them, in the camera's own axes (see `Body.joints`)."""
        self._people.reset()
        self._bodies: dict[int, Body] = {}
        self._level = None
        return self._looks()

    def _looks(self) -> Iterator[tuple[Shot, Moment]]:
        self._stopwatch.start()
        for shot in map(self._with_lens, self.camera):
            self._stopwatch.lap("camera_ms")
            self._has_depth = shot.depth is not None
            if self._level is None:
                self._level, self._floor_watch = self._first_level(shot), FloorWatch()
            if not self._level.fixed and self._floor_watch.look(shot, *self._level.about_up):
                assert self._floor_watch.plane is not None
                self._level.see_floor(self._floor_watch.plane)
            seen = self._people.look(shot)
            self._stopwatch.lap("people_ms")
            self._remember()
            frames = tuple(self._frame(one, shot) for one in seen)
            self._stopwatch.lap("bodies_ms")
            yield shot, Moment(shot.time, shot.sequence, frames)
            self._stopwatch.start()

    def _with_lens(self, shot: Shot) -> Shot:
        """The shot with the lens that the calibration knows, if the camera does not."""
        known = self._calibration
        if known is None or known.lens is None or shot.intrinsics is not None:
            return shot
        height, width = shot.colour.shape[:2]
        return shot if known.misfit(width, height) else replace(shot, intrinsics=known.lens)

    def _first_level(self, shot: Shot) -> Level:
        up = None if shot.up is None else shot.up * (1.0, -1.0, -1.0)
        saved = None
        if self._calibration is not None:
            height, width = shot.colour.shape[:2]
            self._misfit = self._calibration.misfit(width, height)
            saved = None if self._misfit else self._calibration.stage_from_camera
        return Level(up, self._floor, saved=saved)

    def _remember(self) -> None:
        """A body is learnt as long as its performer is known, hidden for a moment or not."""
        known = self._people.known
        self._bodies = {
            number: self._bodies.get(number) or Body(self._tracking.seated) for number in known
        }
        for event in self._people.events:
            self._events[event.kind] += 1

    def _frame(self, one: Seen, shot: Shot) -> SkeletonFrame:
        again = partial(self._people.look_again, shot, one)
        positions, states = self._bodies[one.performer].joints(one.landmarks, shot, again)
        return SkeletonFrame(shot.time, shot.sequence, one.performer, positions, states)

    def _live(self, moments: Iterator[Moment]) -> Iterator[Moment]:
        for moment in moments:
            self._observe(moment)
            yield self._levelled(moment)

    def _settled(self, moments: Iterator[Moment]) -> Iterator[Moment]:
        """Nothing before the first performer needs levelling; from there on moments wait until
        enough has been seen of them, and the level stays as it is then."""
        waiting: list[Moment] = []
        settled = False
        for moment in moments:
            assert self._level is not None
            settled = settled or self._level.fixed
            if settled or not (waiting or moment.present):
                yield self._levelled(moment)
                continue
            waiting.append(moment)
            self._observe(moment)
            if moment.time - waiting[0].time >= LEVEL_SECONDS:
                settled = True
                yield from self._all_levelled(waiting)
                waiting.clear()
        yield from self._all_levelled(waiting)

    def _observe(self, moment: Moment) -> None:
        assert self._level is not None
        for frame in moment.frames:
            self._level.observe(frame.positions, frame.states)

    def _all_levelled(self, moments: list[Moment]) -> Iterator[Moment]:
        if self._level is not None:
            self._level.settle()
        yield from map(self._levelled, moments)

    def _levelled(self, moment: Moment) -> Moment:
        level = self._level
        assert level is not None
        frames = tuple(
            SkeletonFrame(
                frame.time,
                frame.sequence,
                frame.performer,
                level.to_stage(frame.positions),
                frame.states,
            )
            for frame in moment.frames
        )
        return Moment(moment.time, moment.sequence, frames)
