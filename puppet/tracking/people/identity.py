"""Who somebody is, as far as a camera can tell: where they were, how large, and what they wear."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from puppet.kernel import Floats
from puppet.tracking.cameras.camera import Shot
from puppet.tracking.cameras.intrinsics import Intrinsics
from puppet.tracking.people.appearance import colours, difference, inside, light, torso_points
from puppet.tracking.people.blazepose import Landmarks

_CORE: Final = [11, 12, 13, 14, 23, 24, 25, 26]
_BODY: Final = slice(11, 33)
#: A body shows at least so many of shoulders, elbows, hips and knees; else there is none.
LEAST_JOINTS: Final = 3
VISIBLE: Final = 0.5
#: Metres: how long a torso may be, and how far a performer may be away. The torso is the network's,
#: which takes everybody for one size.
TORSO_LENGTHS: Final = (0.2, 1.0)
DISTANCES: Final = (0.2, 20.0)
#: With measured depth: how many times as large as the network takes them for people may be.
SIZES: Final = (0.35, 1.6)
#: The share of the torso of which depth has to be known.
LEAST_DEPTH: Final = 0.25

#: How sure a prediction is, and by how much less with each second that nobody is seen: across the
#: line of sight in metres, along it as a share of the distance, measured and guessed from size.
ACROSS, ACROSS_GROWTH, ACROSS_LIMIT = 0.10, 0.8, 4.0
ALONG, ALONG_MEASURED, ALONG_GROWTH, ALONG_LIMIT = 0.10, 0.05, 0.3, 1.0
#: How much colours (ΔE) and measured size (share) of one performer vary.
COLOURS: Final = 5.0
SIZE: Final = 0.1
#: A misfit beyond this is another person; beyond the next when they were out of sight, where the
#: network must be rather sure, too. Squares of standard deviations, as all misfits are.
GATE: Final = 12.0
FOUND_GATE: Final = 8.0
FOUND_SCORE: Final = 0.8
#: Stage lights change, and people walk from one light into another: while somebody is followed, not
#: out of sight for so long (s), and seen well, colours alone do not make them another, ...
COLOURS_ALONE: Final = 8.0
FOLLOWED: Final = 0.07
#: ... unless they change by so much (ΔE) from one shot to the next, and the whole image does not.
ABRUPT: Final = 9.0
LIGHT: Final = 3.0
#: Half-lives, s: of the measured velocity, of its going on unseen, of what is learnt.
VELOCITY, COASTING, LEARNING = 0.08, 0.3, 1.0
#: Half-life of the trust, s. One who is seen well has more than 0.99.
TRUST: Final = 0.1
TRUSTED: Final = 0.98
#: Colours that changed more (ΔE) are not learnt where another performer may have covered them.
FOREIGN: Final = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """One body in one shot, as far as it tells who it is.

    ray: (2,) x right, y down at a distance of 1: where the middle of the hips is seen.
    distance: metres along the lens's axis; measured: by depth, not guessed from the size.
    size: how many times as large as the network takes everybody for; NaN without depth.
    colours: (3, 3), see `appearance.colours`. score: the network's, in 0..1.
    light: (3,) the mean colour of the whole image, CIE L*a*b*.
    """

    time: float
    ray: Floats
    distance: float
    measured: bool
    size: float
    colours: Floats
    score: float
    light: Floats

    @property
    def position(self) -> Floats:
        """(3,) metres, x right, y down, z away."""
        return np.array([*(self.ray * self.distance), self.distance])


def lens_of(shot: Shot) -> Intrinsics:
    """The shot's lens, or what is assumed if it is not known."""
    height, width = shot.colour.shape[:2]
    return shot.intrinsics or Intrinsics.assumed(width, height)


def sight(landmarks: Landmarks, shot: Shot) -> Sighting | None:
    """What the body tells; None if it cannot be one: a ghost."""
    pixels, world = landmarks.pixels, landmarks.world
    if not (np.isfinite(pixels).all() and np.isfinite(world).all()):
        return None
    height, width = shot.colour.shape[:2]
    core = pixels[_CORE]
    shown = ((core >= 0.0) & (core < (width, height))).all(axis=1)
    if np.count_nonzero(shown & (landmarks.visibility[_CORE] > VISIBLE)) < LEAST_JOINTS:
        return None
    torso = float(np.linalg.norm(world[[11, 12]].mean(axis=0) - world[[23, 24]].mean(axis=0)))
    spread = float(world[_BODY, :2].var(axis=0).sum())
    if not (TORSO_LENGTHS[0] < torso < TORSO_LENGTHS[1] and spread > 0.0):
        return None
    scale = math.sqrt(float(pixels[_BODY].var(axis=0).sum()) / spread)
    lens = lens_of(shot)
    distance = math.sqrt(lens.focal_x * lens.focal_y) / max(scale, 1e-6)
    depth = _torso_depth(landmarks, shot)
    size = depth / distance
    if math.isfinite(depth):
        distance = depth
        if not SIZES[0] < size < SIZES[1]:
            return None
    if not DISTANCES[0] < distance < DISTANCES[1]:
        return None
    ray = lens.rays(pixels[[23, 24]].mean(axis=0)[None])[0]
    clothes = colours(shot.colour, landmarks)
    return Sighting(
        shot.time,
        ray,
        distance,
        math.isfinite(depth),
        size,
        clothes,
        landmarks.score,
        light(shot.colour),
    )


def _torso_depth(landmarks: Landmarks, shot: Shot) -> float:
    """Metres; NaN if it is not known."""
    if shot.depth is None:
        return math.nan
    rows, columns = shot.depth.shape[:2]
    height, width = shot.colour.shape[:2]
    to_depth = (columns / width, rows / height)
    points = torso_points(landmarks.pixels)
    at = inside((points + 0.5) * to_depth - 0.5, rows, columns)
    known = shot.depth[at[:, 1], at[:, 0]]
    known = known[known > 0]
    if len(known) < LEAST_DEPTH * len(points):
        return math.nan
    return float(np.median(known)) / 1000.0


class Identity:
    """What is remembered of one performer."""

    def __init__(self, first: Sighting) -> None:
        self._last = first
        self._velocity = np.zeros(3)
        self._colours = first.colours
        self._size = first.size
        self._trust = 1.0
        self._sure = first.time

    @property
    def doubtful(self) -> bool:
        """Whether they are seen so badly that it may be something else."""
        return self._trust < TRUSTED

    @property
    def trust(self) -> float:
        """The network's score, smoothed: it wavers where it looks at the wrong place."""
        return self._trust

    @property
    def last(self) -> Sighting:
        """When they were seen for the last time, and how."""
        return self._last

    def position(self, time: float) -> Floats:
        """(3,) metres: where they are expected at that time. Unseen they come to a stop."""
        age = max(0.0, time - self._last.time)
        decay = math.log(2.0) / COASTING
        at = self._last.position + self._velocity * (1.0 - math.exp(-decay * age)) / decay
        at[2] = min(max(at[2], DISTANCES[0]), DISTANCES[1])
        return at

    def misfit(self, sighting: Sighting) -> float:
        """How badly the sighting fits this performer; see `fits`."""
        age = max(0.0, sighting.time - self._last.time)
        across, along = self._spread(sighting)
        at = self.position(sighting.time)
        middle = math.sqrt(at[2] * sighting.distance)
        sideways = float(np.linalg.norm(sighting.ray - at[:2] / at[2])) * middle
        misfit = (sideways / across) ** 2 + (math.log(sighting.distance / at[2]) / along) ** 2
        clothes = difference(self._colours, sighting.colours)
        if math.isfinite(clothes):
            unlike = (clothes / COLOURS) ** 2
            misfit += min(unlike, COLOURS_ALONE) if self._goes_on(sighting, age) else unlike
        if math.isfinite(self._size) and math.isfinite(sighting.size):
            misfit += (math.log(sighting.size / self._size) / SIZE) ** 2
        return misfit

    def fits(self, sighting: Sighting) -> bool:
        """Whether it may be them."""
        misfit = self.misfit(sighting)
        if sighting.time - self._last.time < FOLLOWED:
            return misfit < GATE
        return misfit < FOUND_GATE and sighting.score > FOUND_SCORE

    def cost(self, sighting: Sighting) -> float:
        """Minus twice the logarithm of how likely the sighting is for this performer, up to a
        constant: the misfit, and more the less is known of where they are."""
        across, along = self._spread(sighting)
        return self.misfit(sighting) + 4.0 * math.log(across) + 2.0 * math.log(along)

    def learn(self, sighting: Sighting, *, crowded: bool) -> None:
        """This was them. crowded: others are so near that they may have covered parts of them."""
        step = sighting.time - self._last.time
        if step > 0.0:
            keep = 0.5 ** (step / VELOCITY)
            moved = (sighting.position - self._last.position) / step
            self._velocity = keep * self._velocity + (1.0 - keep) * moved
            # After a gap the old velocity says nothing, and the new one is that of the gap.
            if step > FOLLOWED:
                self._velocity = np.zeros(3)
            keep = 0.5 ** (step / TRUST)
            self._trust = keep * self._trust + (1.0 - keep) * sighting.score
            self._learn_looks(sighting, 0.5 ** (step / LEARNING), crowded)
        self._last = sighting
        if not self.doubtful:
            self._sure = sighting.time

    def _goes_on(self, sighting: Sighting, age: float) -> bool:
        """Whether the sighting follows the last one so closely that colours matter less."""
        if age >= FOLLOWED or self.doubtful:
            return False
        changed = difference(self._last.colours, sighting.colours)
        return not changed > ABRUPT or difference(self._last.light, sighting.light) > LIGHT

    def _learn_looks(self, sighting: Sighting, keep: float, crowded: bool) -> None:
        if not crowded or difference(self._colours, sighting.colours) < FOREIGN:
            mixed = keep * self._colours + (1.0 - keep) * sighting.colours
            mixed = np.where(np.isnan(mixed), self._colours, mixed)
            self._colours = np.where(np.isnan(mixed), sighting.colours, mixed)
        if math.isfinite(sighting.size):
            known = self._size if math.isfinite(self._size) else sighting.size
            self._size = keep * known + (1.0 - keep) * sighting.size

    def _spread(self, sighting: Sighting) -> tuple[float, float]:
        """Standard deviations of where they are, across and along the line of sight."""
        # Who was seen badly may have been somewhere else.
        age = max(0.0, sighting.time - self._sure)
        both = sighting.measured and self._last.measured
        across = min(ACROSS + ACROSS_GROWTH * age, ACROSS_LIMIT)
        along = min((ALONG_MEASURED if both else ALONG) + ALONG_GROWTH * age, ALONG_LIMIT)
        return across, along
