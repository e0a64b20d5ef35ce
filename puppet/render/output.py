"""Pictures to files: PNG, MP4 and GIF behind one interface."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import Any, Final, Protocol

import av
import numpy as np
from av.error import FFmpegError
from numpy.typing import NDArray
from PIL import Image

from puppet.errors import BadShowError, UnavailableError

Picture8 = NDArray[np.uint8]

#: Encoders by preference; the second is in every build of FFmpeg.
_ENCODERS: Final = (("libx264", {"crf": "18", "preset": "veryfast"}), ("mpeg4", {"qscale": "3"}))
#: Ticks a second of an MP4: divides 24, 25, 30 and 60 Hz, and is fine enough for any other rate.
_TICKS: Final = 90_000
#: zlib level: a live picture must not cost the cores that draw the next one.
PNG_LEVEL: Final = 1
#: The shortest time that browsers grant to a picture of a GIF, in seconds.
_GIF_STEP: Final = 0.02
_GIF_PICTURES: Final = 900
#: An ordered 4×4 screen, in 8-bit steps around zero, about as wide as palette colours lie apart.
_SCREEN: Final = 0.45 * (
    np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]]) - 7.5
)


class Output(Protocol):
    """Where pictures go."""

    def write(self, image: Picture8, time: float) -> None:
        """Take a picture (height, width, 3) sRGB, top row first, shown from `time` on, seconds."""
        ...

    def close(self) -> None:
        """Finish the file. May be called twice."""
        ...


def open_output(path: Path, *, fps: float = 15.0, width: int | None = 640) -> Output:
    """The output that the name of `path` asks for: ``.png``, ``.mp4`` or ``.gif``.

    A PNG whose name holds a pattern such as ``%04d`` makes a file of each picture, counted from 0;
    another PNG is overwritten and ends as the last picture. fps: at most so many pictures a second
    go into a GIF. width: pixels to which a GIF is made smaller; None leaves it as it is.

    Raises BadShowError for another suffix, UnavailableError where no file can be written.
    """
    suffix = path.suffix.lower()
    if suffix == ".png":
        return PngOutput(path)
    if suffix == ".mp4":
        return Mp4Output(path)
    if suffix == ".gif":
        return GifOutput(path, fps=fps, width=width)
    raise BadShowError(
        "there is no such kind of picture",
        where=path,
        expected="a name that ends in .png, .mp4 or .gif",
        found=suffix or "no suffix",
    )


class PngOutput:
    """One file, or one for each picture."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._count = 0
        self._numbered = _numbered(path, 0) != path
        _try_out(_numbered(path, 0))

    def write(self, image: Picture8, time: float) -> None:  # noqa: ARG002
        """Write the picture at once: whoever looks at the file sees the newest."""
        path = _numbered(self._path, self._count) if self._numbered else self._path
        with _writing(path):
            # Whole or not at all, so that a reader never meets half a picture.
            draft = path.with_name(f".{path.name}.part")
            Image.fromarray(image).save(draft, "PNG", compress_level=PNG_LEVEL)
            draft.replace(path)
        self._count += 1

    def close(self) -> None:
        """Nothing is left to do."""


class Mp4Output:
    """H.264 where the encoder is there, else MPEG-4; every picture at its own time."""

    def __init__(self, path: Path) -> None:
        _try_out(path)
        self._path = path
        self._container: Any = None
        self._stream: Any = None
        self._start = 0.0
        self._last = -1

    def write(self, image: Picture8, time: float) -> None:
        """Encode the picture. All have the size of the first; time that stands still is nudged."""
        with _writing(self._path):
            if self._container is None:
                self._open(image, time)
            stream = self._stream
            even = image[: stream.height, : stream.width]
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format="rgb24")
            self._last = max(round((time - self._start) * _TICKS), self._last + 1)
            frame.pts, frame.time_base = self._last, Fraction(1, _TICKS)
            self._container.mux(stream.encode(frame))

    def close(self) -> None:
        """Write what the encoder still holds, and the index. Without a picture there is no file."""
        if self._container is None:
            if self._last < 0:
                _drop_if_empty(self._path)
            return
        container, self._container = self._container, None
        with _writing(self._path):
            container.mux(self._stream.encode(None))
            container.close()

    def _open(self, image: Picture8, time: float) -> None:
        height, width = image.shape[:2]
        self._container = av.open(str(self._path), "w", options={"movflags": "+faststart"})
        name, options = next(
            (encoder for encoder in _ENCODERS if encoder[0] in av.codecs_available), _ENCODERS[-1]
        )
        self._stream = self._container.add_stream(name, rate=60, options=options)
        # yuv420p halves the colour both ways: the last odd row and column are left away.
        self._stream.width, self._stream.height = width - width % 2, height - height % 2
        self._stream.pix_fmt = "yuv420p"
        self._stream.time_base = self._stream.codec_context.time_base = Fraction(1, _TICKS)
        self._start = time


class GifOutput:
    """A GIF that repeats, with one palette for all its pictures, written when it is closed.

    It is for a short scene: after 900 pictures no more are taken, so that memory stays bounded.
    """

    def __init__(self, path: Path, *, fps: float = 15.0, width: int | None = 640) -> None:
        _try_out(path)
        self._path = path
        self._step = max(1.0 / max(fps, 0.1), _GIF_STEP)
        self._width = width
        #: Each picture as PNG, a fraction of its size, and when it is shown.
        self._shown: list[tuple[bytes, float]] = []
        self._next = -np.inf
        self._end = 0.0

    def write(self, image: Picture8, time: float) -> None:
        """Keep the picture, if its turn has come."""
        if len(self._shown) >= _GIF_PICTURES:
            return
        self._end = time
        # Half a millisecond of tolerance: capture times are not exact multiples of anything.
        if time < self._next - 5e-4:
            return
        # From its turn, not from its time: or every other picture of a near multiple would go.
        late = self._next + 0.5 * self._step < time
        self._next = (time if late else self._next) + self._step
        small = Image.fromarray(image)
        if self._width is not None and self._width < small.width:
            height = max(1, round(small.height * self._width / small.width))
            small = small.resize((self._width, height), Image.Resampling.LANCZOS)
        packed = BytesIO()
        small.save(packed, "PNG", compress_level=1)
        self._shown.append((packed.getvalue(), time))

    def close(self) -> None:
        """Choose the palette, and write the file. Without a picture there is no file."""
        shown, self._shown = self._shown, []
        if not shown:
            _drop_if_empty(self._path)
            return
        picks = np.linspace(0, len(shown) - 1, min(12, len(shown))).astype(int)
        palette = common_palette([_unpacked(shown[pick][0]) for pick in picks])
        images = [_quantized(_unpacked(packed), palette) for packed, _ in shown]
        with _writing(self._path):
            images[0].save(
                self._path,
                "GIF",
                save_all=True,
                append_images=images[1:],
                duration=self._durations([time for _, time in shown]),
                loop=0,
                optimize=True,
                disposal=1,
            )

    def _durations(self, times: list[float]) -> list[int]:
        """Milliseconds of each picture, in whole hundredths of a second whose errors do not add."""
        ends = np.array([*times, max(self._end, times[-1] + self._step)])
        hundredths = np.round((ends - ends[0]) * 100.0).astype(int)
        return [max(2, int(step)) * 10 for step in np.diff(hundredths)]


def common_palette(images: Sequence[Picture8]) -> Image.Image:
    """255 colours for all of these, as an image that has them.

    A colour counts by the root of how often it is there: or the dark room, which is most of every
    picture, would leave nothing for the puppets.
    """
    colors = np.concatenate([image.reshape(-1, 3) for image in images])
    bins = (colors >> 2).astype(np.int32) @ np.array([1 << 12, 1 << 6, 1])
    counts = np.bincount(bins)
    used = np.flatnonzero(counts)
    middles = np.stack([used >> 12, used >> 6 & 63, used & 63], axis=1) * 4 + 2
    swatch = np.repeat(middles, np.ceil(np.sqrt(counts[used])).astype(int), axis=0)
    row = Image.fromarray(swatch[None].astype(np.uint8))
    # One is left over for Pillow, which marks with it what stays as it was.
    return row.quantize(255, method=Image.Quantize.MEDIANCUT, kmeans=2)


def _quantized(image: Picture8, palette: Image.Image) -> Image.Image:
    """With the colours of the palette, through a fixed screen: what does not move does not change.

    Dithering by error diffusion is finer, but carries every movement over the rest of the picture.
    """
    height, width = image.shape[:2]
    screen = np.tile(_SCREEN, (-(-height // 4), -(-width // 4)))[:height, :width, None]
    shifted = np.clip(image + screen, 0, 255).round().astype(np.uint8)
    return Image.fromarray(shifted).quantize(palette=palette, dither=Image.Dither.NONE)


def _unpacked(packed: bytes) -> Picture8:
    with Image.open(BytesIO(packed)) as image:
        return np.asarray(image.convert("RGB"))


def _drop_if_empty(path: Path) -> None:
    if path.exists() and path.stat().st_size == 0:
        path.unlink()


def _numbered(path: Path, count: int) -> Path:
    """The path with ``%d`` or ``%04d`` in its name replaced by a number."""
    try:
        return path.with_name(path.name % count)
    except (TypeError, ValueError):
        return path


def _try_out(path: Path) -> None:
    """Find out now, and not after an hour of drawing, that nothing can be written."""
    new = not path.exists()
    with _writing(path):
        with path.open("ab"):
            pass
        if new:
            path.unlink()  # an empty file would look like a broken picture


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, FFmpegError) as error:
        raise UnavailableError(
            "the picture cannot be written",
            where=path,
            found=getattr(error, "strerror", None) or str(error),
            hint="choose a folder that exists and that you may write to, with space left",
        ) from error
