"""Pictures in files, opened again with other eyes."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from puppet.errors import BadShowError, PuppetError, UnavailableError
from puppet.render.output import GifOutput, Picture8, open_output
from puppet.render.overlay import lines, text_plate
from puppet.render.scene import Picture, Status
from puppet.render.sheet import contact_sheet
from puppet.skeleton import TrackingState
from tests.stage_models import standing


def moving(count: int, size: tuple[int, int] = (64, 48)) -> list[Picture8]:
    """Pictures of a bright bar that walks over a gradient."""
    width, height = size
    made = []
    for step in range(count):
        image = np.zeros((height, width, 3), np.uint8)
        image[..., 2] = np.linspace(20, 90, height)[:, None]
        at = step * (width - 8) // max(1, count - 1)
        image[:, at : at + 8] = (250, 140, 20)
        made.append(image)
    return made


def write(path: Path, images: list[Picture8], rate: float, **options: float) -> None:
    output = open_output(path, **options)  # type: ignore[arg-type]
    for index, image in enumerate(images):
        output.write(image, 5.0 + index / rate)
    output.close()
    output.close()


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def frames_of(gif: Image.Image) -> int:
    return int(getattr(gif, "n_frames", 1))


def test_a_png_is_the_last_picture_exactly(tmp_path: Path) -> None:
    images = moving(3)
    write(tmp_path / "a.png", images, 30)
    assert (np.asarray(Image.open(tmp_path / "a.png")) == images[-1]).all()
    assert names(tmp_path) == ["a.png"]


def test_a_numbered_png_keeps_every_picture(tmp_path: Path) -> None:
    images = moving(3)
    write(tmp_path / "a%02d.png", images, 30)
    assert names(tmp_path) == ["a00.png", "a01.png", "a02.png"]
    assert (np.asarray(Image.open(tmp_path / "a01.png")) == images[1]).all()


def test_a_percent_sign_that_is_no_pattern_is_a_name(tmp_path: Path) -> None:
    write(tmp_path / "100%.png", moving(2), 30)
    assert names(tmp_path) == ["100%.png"]


@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0])
def test_an_mp4_has_every_picture_at_its_time(tmp_path: Path, rate: float) -> None:
    write(tmp_path / "a.mp4", moving(20), rate)
    with av.open(str(tmp_path / "a.mp4")) as container:
        stream = container.streams.video[0]
        frames = list(container.decode(video=0))
        assert stream.codec_context.pix_fmt == "yuv420p"
        times = [float(frame.time or 0.0) for frame in frames]
    assert len(frames) == 20
    np.testing.assert_allclose(times, np.arange(20) / rate, atol=1e-4)
    # The bar is still where it was, and orange.
    seen = frames[-1].to_ndarray(format="rgb24").astype(int)
    assert seen[24, 60, 0] > seen[24, 60, 2] + 100


def test_an_mp4_takes_odd_sizes_and_a_clock_that_stands_still(tmp_path: Path) -> None:
    output = open_output(tmp_path / "a.mp4")
    for image in moving(5, (63, 47)):
        output.write(image, 1.0)
    output.close()
    with av.open(str(tmp_path / "a.mp4")) as container:
        frames = list(container.decode(video=0))
    assert [(frame.width, frame.height) for frame in frames] == [(62, 46)] * 5


def test_a_gif_keeps_its_rate_and_its_length(tmp_path: Path) -> None:
    write(tmp_path / "a.gif", moving(60), 60.0, fps=15)
    with Image.open(tmp_path / "a.gif") as gif:
        assert frames_of(gif) == 15
        shown = []
        for index in range(frames_of(gif)):
            gif.seek(index)
            shown.append(gif.info["duration"])
        assert gif.info["loop"] == 0
    assert sum(shown) == pytest.approx(1000, abs=40)


def test_a_gif_is_made_smaller_and_keeps_its_colours(tmp_path: Path) -> None:
    images = moving(6, (128, 96))
    write(tmp_path / "a.gif", images, 10.0, width=64, fps=10)
    with Image.open(tmp_path / "a.gif") as gif:
        assert gif.size == (64, 48)
        for index in range(frames_of(gif)):
            gif.seek(index)
            seen = np.asarray(gif.convert("RGB")).astype(int)
            wanted = np.asarray(Image.fromarray(images[index]).resize((64, 48))).astype(int)
            assert np.abs(seen - wanted).mean() < 8


def test_a_gif_that_never_ends_stops_growing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("puppet.render.output._GIF_PICTURES", 5)
    output = GifOutput(tmp_path / "a.gif", fps=10)
    for index, image in enumerate(moving(9)):
        output.write(image, index / 10)
    output.close()
    with Image.open(tmp_path / "a.gif") as gif:
        assert frames_of(gif) == 5


@pytest.mark.parametrize("name", ["a.gif", "a.mp4"])
def test_without_a_picture_there_is_no_file(tmp_path: Path, name: str) -> None:
    open_output(tmp_path / name).close()
    assert names(tmp_path) == []


@pytest.mark.parametrize("name", ["a.png", "a%03d.png", "a.mp4", "a.gif"])
def test_a_place_that_does_not_exist_is_found_out_at_once(tmp_path: Path, name: str) -> None:
    with pytest.raises(UnavailableError) as caught:
        open_output(tmp_path / "nowhere" / name)
    assert "nowhere" in str(caught.value)
    assert "No such file or directory" in str(caught.value)


@pytest.mark.parametrize("name", ["a.png", "a.mp4", "a.gif"])
def test_a_folder_in_place_of_the_file_is_an_error(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    with pytest.raises(PuppetError):
        open_output(tmp_path / name)


@pytest.mark.parametrize("name", ["a.bmp", "a", "a.mov"])
def test_an_unknown_suffix_is_an_error_that_names_the_known(tmp_path: Path, name: str) -> None:
    with pytest.raises(BadShowError, match=r"\.png, \.mp4 or \.gif"):
        open_output(tmp_path / name)


def test_a_contact_sheet_has_all_images_in_rows() -> None:
    images = [np.full((40, 60, 3), 30 * i + 20, np.uint8) for i in range(5)]
    sheet = contact_sheet(images, 3, [f"{i} s" for i in range(5)], gap=4)
    strip = (sheet.shape[0] - 3 * 4 - 2 * 40) // 2
    assert sheet.shape[1] == 4 + 3 * 64
    for index in range(5):
        row, column = divmod(index, 3)
        y, x = 4 + row * (40 + strip + 4), 4 + column * 64
        assert (sheet[y : y + 40, x : x + 60] == images[index]).all()
        assert sheet[y + 40 : y + 40 + strip, x : x + 60].max() > 100
    with pytest.raises(ValueError, match="needs images"):
        contact_sheet([], 3)


def test_the_overlay_says_what_is_known_and_no_more() -> None:
    nobody = Picture(status=Status(source="cam01.mp4"))
    assert lines(nobody) == ("nobody on stage", "cam01.mp4")
    frame = standing()
    frame.states[:6] = TrackingState.INFERRED
    known = Picture(performers=[frame], status=Status(59.6, 0.0213, "rehearsal", ("synthetic",)))
    assert lines(known) == ("14/20 joints   60 fps   21 ms", "rehearsal  ·  synthetic")
    assert known.state is TrackingState.INFERRED
    assert nobody.state is TrackingState.NOT_TRACKED
    assert Picture(performers=[standing()]).state is TrackingState.TRACKED


def test_the_dot_of_the_overlay_shows_the_state() -> None:
    dots = []
    for state in TrackingState:
        plate = np.asarray(text_plate("text", "", state, 20).convert("RGB")).astype(int)
        dots.append(plate[25, 21])
    grey, amber, green = dots
    assert np.ptp(grey) < 20
    assert amber[0] > amber[1] > amber[2]
    assert green[1] > max(green[0], green[2])
