"""BlazePose: 33 landmarks of one person in an image, in pixels and in metres.

A detector looks for people in the whole image; a landmark network then looks at a square, turned so
that the body stands upright in it, and finds with the landmarks where that square has to be in the
next image. (Bazarevsky 2020, "BlazePose"; the numbers below are those with which the two networks
were trained.) Each finds one person well and others badly: so those who are known are painted out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import cv2
import numpy as np
import onnxruntime
from numpy.typing import NDArray

from puppet.errors import UnavailableError
from puppet.kernel import Floats, frozen
from puppet.tracking.cameras.camera import Image
from puppet.tracking.people.models import GET_MODELS, PoseModels
from puppet.tracking.people.paint_out import paint_out

LANDMARK_COUNT: Final = 33
#: Two more points that the network gives, from which the next region is made.
POINT_COUNT: Final = 39
REGION_CENTRE, REGION_EDGE = 33, 34

DETECTOR_SIDE: Final = 224
#: Cells along a side of each of the detector's grids, and boxes at each cell.
DETECTOR_GRIDS: Final = ((28, 2), (14, 2), (7, 6))
DETECTION_SCORE: Final = 0.5
DETECTION_OVERLAP: Final = 0.3

LANDMARK_SIDE: Final = 256
#: Below it the landmark network says that there is nobody in the region.
PRESENCE_SCORE: Final = 0.5
#: The region is larger than the circle about the body by this factor.
REGION_MARGIN: Final = 1.25
#: Metres by which the two looks of `BlazePose.look(twice=True)` may differ, on average.
DISAGREEMENT: Final = 0.4
HEATMAP_WINDOW: Final = 7
HEATMAP_SCORE: Final = 0.5


def _exchange() -> list[int]:
    order = list(range(LANDMARK_COUNT))
    for left, right in ((1, 4), (2, 5), (3, 6), *((i, i + 1) for i in range(7, 33, 2))):
        order[left], order[right] = right, left
    return order


#: The landmark on the other side of the body, for each.
EXCHANGED: Final = _exchange()
Singles = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """A square in the image in which a body stands upright.

    centre: (2,) pixels, as in `Landmarks.pixels`. side: pixels.
    angle: radians, how far the body is turned clockwise, as seen, from upright in the image.
    """

    centre: Floats
    side: float
    angle: float

    @classmethod
    def around(cls, centre: Floats, edge: Floats) -> Region:
        """The region of a body from the middle of its hips to a point on the circle about it that
        lies in the direction of its head. Both (2,), pixels."""
        along = edge - centre
        angle = math.atan2(along[0], -along[1])
        return cls(centre, 2.0 * REGION_MARGIN * math.hypot(*along), angle)

    def turned(self, angle: float) -> Region:
        """The same square, turned clockwise by `angle` (rad) about its middle."""
        return Region(self.centre, self.side, self.angle + angle)

    def image_from_region(self) -> Floats:
        """(2, 3): takes (x, y, 1), x and y in -0.5..0.5 of the side, to pixels."""
        c, s = self.side * math.cos(self.angle), self.side * math.sin(self.angle)
        return np.array([[c, -s, self.centre[0]], [s, c, self.centre[1]]])


@dataclass(frozen=True, slots=True, eq=False)
class Landmarks:
    """One person in one image.

    pixels: (33, 2), x right, y down, pixel centres at whole numbers; may lie outside the image.
    world: (33, 3) metres from the middle of the hips, camera axes: x right, y down, z away.
    visibility: (33,) in 0..1, seen and not hidden. It is optimistic.
    presence: (33,) in 0..1, inside the image, seen or not.
    score: in 0..1, that there is a person at all. region: where it was looked for.
    following: where to look in the next image; None if that is not known.
    """

    pixels: Floats
    world: Floats
    visibility: Floats
    presence: Floats
    score: float
    region: Region
    following: Region | None = None

    @property
    def extent(self) -> float:
        """The side of the square about the body, pixels."""
        return (self.following or self.region).side


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """points: (39, 2) in 0..1 of the region's side. world: (33, 3) metres, upright in the region.
    chances: (33, 2) visibility and presence."""

    points: Floats
    world: Floats
    chances: Floats
    score: float

    def mirrored(self) -> _Seen:
        """What would have been seen in the mirror image."""
        points = self.points.copy()
        points[:LANDMARK_COUNT] = points[EXCHANGED]
        points[:, 0] = 1.0 - points[:, 0]
        world = self.world[EXCHANGED] * (-1.0, 1.0, 1.0)
        return _Seen(points, world, self.chances[EXCHANGED], self.score)


class BlazePose:
    """Finds people in images. It remembers nothing, and may be asked from several threads."""

    def __init__(self, models: PoseModels) -> None:
        self._detector = _session(models.detector)
        self._landmarker = _session(models.landmarks)
        self._mirrors = ThreadPoolExecutor(1, "mirrored")

    def look(
        self,
        image: Image,
        region: Region,
        without: Sequence[Landmarks] = (),
        *,
        twice: bool = False,
    ) -> Landmarks | None:
        """The person in that region of `image`, (H, W, 3), BGR; None if there is nobody.

        without: people who are painted out first. twice: look at the mirror image as well, on
        another core at the same time; what the two agree on trembles less and is more often right.
        """
        image_from_region = region.image_from_region()
        crop = _crop(image, image_from_region, without)
        other = self._mirrors.submit(self._see, _mirrored(crop)) if twice else None
        seen = self._see(crop)
        if other is not None:
            seen = _agreed(seen, other.result())
        if seen is None:
            return None
        pixels = (seen.points - 0.5) @ image_from_region[:, :2].T + image_from_region[:, 2]
        centre, edge = pixels[[REGION_CENTRE, REGION_EDGE]]
        following = Region.around(centre, edge) if math.dist(centre, edge) > 1.0 else None
        # The world landmarks are upright in the region, too: they turn back with it.
        metres = seen.world.copy()
        metres[:, :2] = metres[:, :2] @ (image_from_region[:, :2] / region.side).T
        visibility, presence = seen.chances.T
        return Landmarks(
            pixels[:LANDMARK_COUNT], metres, visibility, presence, seen.score, region, following
        )

    def _see(self, crop: Singles) -> _Seen | None:
        """What the landmark network says of a crop."""
        names = ["landmarks", "score", "heatmap", "world"]
        points, score, heatmap, world = self._landmarker.run(names, {"input_1": crop})
        # `not >`: a network that gives NaN has found nobody either.
        if not score[0, 0] > PRESENCE_SCORE:
            return None
        # x, y, z in pixels of the crop, logit of visibility, logit of presence
        points = points.reshape(POINT_COUNT, 5).astype(float)
        inside = points[:, :2] / LANDMARK_SIDE
        _refine(inside, heatmap[0])
        return _Seen(
            inside,
            world.reshape(POINT_COUNT, 3)[:LANDMARK_COUNT].astype(float),
            _sigmoid(points[:LANDMARK_COUNT, 3:]),
            float(score[0, 0]),
        )

    def detect(
        self,
        image: Image,
        without: Sequence[Landmarks] = (),
        columns: tuple[int, int] | None = None,
    ) -> list[Region]:
        """The people in `image`, (H, W, 3), BGR, the largest first.

        without: people who are painted out first. columns: look only between these.
        """
        first, last = columns or (0, image.shape[1])
        height, width = image.shape[0], last - first
        # The network takes the image in the middle of a black square.
        scale = DETECTOR_SIDE / max(height, width)
        shift = 0.5 * (DETECTOR_SIDE - scale * np.array([width, height]))
        from_part = np.column_stack([np.eye(2) * scale, shift + 0.5 * (scale - 1.0)])
        part = image[:, first:last]
        square = np.asarray(
            cv2.warpAffine(part, from_part, (DETECTOR_SIDE, DETECTOR_SIDE)), np.uint8
        )
        shift[0] -= scale * first
        to_square = np.column_stack([np.eye(2) * scale, shift + 0.5 * (scale - 1.0)])
        paint_out(square, [(one.pixels, one.extent) for one in without], to_square)
        pixels = square[None, :, :, ::-1].astype(np.float32) * (2.0 / 255.0) - 1.0
        boxes, scores = self._detector.run(["boxes", "scores"], {"input_1": pixels})
        # A score comes as a logit. Boxes: middle, size, then four points, in pixels of the square
        # from the middle of their cell.
        chances = _sigmoid(scores[0, :, 0])
        likely = chances > DETECTION_SCORE
        boxes, chances = boxes[0, likely].astype(float), chances[likely]
        cells = _cell_centres()[likely]
        boxes[:, 0:2] += cells
        boxes[:, 4:] += np.tile(cells, 4)
        regions = []
        for box in _merge_overlapping(boxes, chances):
            centre, edge = (box[4:8].reshape(2, 2) - shift) / scale - 0.5
            if math.dist(centre, edge) > 1.0:
                regions.append(Region.around(centre, edge))
        return sorted(regions, key=lambda region: -region.side)


def _mirrored(crop: Singles) -> Singles:
    return np.ascontiguousarray(crop[:, :, ::-1])


def _agreed(seen: _Seen | None, other: _Seen | None) -> _Seen | None:
    """The mean of what was seen and what was seen in the mirror, where they mean the same body."""
    if seen is None or other is None:
        return seen
    other = other.mirrored()
    apart = float(np.linalg.norm(other.world - seen.world, axis=1).mean())
    if apart > DISAGREEMENT:
        return seen  # front and back exchanged, most likely: there is no body in between
    return _Seen(
        0.5 * (seen.points + other.points),
        0.5 * (seen.world + other.world),
        0.5 * (seen.chances + other.chances),
        seen.score,
    )


def _session(path: Any) -> Any:
    options = onnxruntime.SessionOptions()
    # One thread each: more cost other processes their time and gain little on nets this small.
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the library's own errors have no useful common base
        raise UnavailableError(
            "this pose model cannot be loaded", where=path, found=str(error), hint=GET_MODELS
        ) from None


@cache
def _cell_centres() -> Floats:
    """(N, 2) pixels in the detector's square: the middle of the cell of each box."""
    centres = []
    for side, boxes in DETECTOR_GRIDS:
        row, column, _ = np.indices((side, side, boxes))
        cell = np.stack([column.ravel(), row.ravel()], axis=1) + 0.5
        centres.append(cell * (DETECTOR_SIDE / side))
    return frozen(np.concatenate(centres))


def _merge_overlapping(boxes: Floats, scores: Floats) -> list[Floats]:
    """One box for each group of boxes that overlap: their mean, weighted by score; best first.

    (N, 4 + ...) boxes that begin with middle and size, (N,) scores.
    """
    low = boxes[:, 0:2] - 0.5 * boxes[:, 2:4]
    high = boxes[:, 0:2] + 0.5 * boxes[:, 2:4]
    area = np.prod(np.maximum(high - low, 0.0), axis=1)
    left = np.argsort(-scores)
    merged = []
    while len(left):
        best = left[0]
        sides = np.minimum(high[best], high[left]) - np.maximum(low[best], low[left])
        common = np.prod(np.maximum(sides, 0.0), axis=1)
        same = common > DETECTION_OVERLAP * (area[best] + area[left] - common)
        same[0] = True  # even if it has no area
        group = left[same]
        merged.append(np.average(boxes[group], axis=0, weights=scores[group]))
        left = left[~same]
    return merged


def _crop(image: Image, image_from_region: Floats, without: Sequence[Landmarks] = ()) -> Singles:
    """(1, 256, 256, 3) in 0..1, RGB: what the landmark network sees of the region."""
    # The crop's pixels have their middles half a step from its sides.
    step = 1.0 / LANDMARK_SIDE
    region_from_crop = np.array(
        [[step, 0.0, 0.5 * step - 0.5], [0.0, step, 0.5 * step - 0.5], [0.0, 0.0, 1.0]]
    )
    image_from_crop = image_from_region @ region_from_crop
    crop = cv2.warpAffine(
        image,
        image_from_crop,
        (LANDMARK_SIDE, LANDMARK_SIDE),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    seen: Image = np.asarray(crop, np.uint8)
    if without:
        crop_from_image = np.asarray(cv2.invertAffineTransform(image_from_crop), float)
        paint_out(seen, [(one.pixels, one.extent) for one in without], crop_from_image)
    return seen[None, :, :, ::-1].astype(np.float32) * np.float32(1.0 / 255.0)


def _refine(points: Floats, heatmap: Singles) -> None:
    """Move each point to the middle of the heat around it, where that is clear. In place.

    points: (39, 2) in 0..1 of the side. heatmap: (h, w, 39) logits.
    """
    height, width, _ = heatmap.shape
    reach = HEATMAP_WINDOW // 2
    columns = np.floor(np.nan_to_num(points[:, 0]) * width).astype(int)
    rows = np.floor(np.nan_to_num(points[:, 1]) * height).astype(int)
    for i, (column, row) in enumerate(zip(columns.tolist(), rows.tolist(), strict=True)):
        if not (0 <= column < width and 0 <= row < height):
            continue
        left, top = max(0, column - reach), max(0, row - reach)
        heat = _sigmoid(heatmap[top : row + reach + 1, left : column + reach + 1, i].astype(float))
        if heat.max() < HEATMAP_SCORE:
            continue
        total = heat.sum()
        points[i, 0] = (left + heat.sum(axis=0) @ np.arange(heat.shape[1]) / total) / width
        points[i, 1] = (top + heat.sum(axis=1) @ np.arange(heat.shape[0]) / total) / height


def _sigmoid(logits: NDArray[Any]) -> Floats:
    clipped = np.clip(logits, -60.0, 60.0)
    return np.asarray(1.0 / (1.0 + np.exp(-clipped)), dtype=float)
