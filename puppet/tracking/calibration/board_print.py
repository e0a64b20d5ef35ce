"""The board as a page to print: true to size, with a bar to measure whether the printer was."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image as Pictures
from PIL import ImageDraw, ImageFont

from puppet.errors import BadShowError, UnavailableError
from puppet.tracking.calibration.board import BOARDS, COLUMNS, ROWS, Board

DOTS_PER_INCH: Final = 300
INCH: Final = 0.0254
#: Metres.
BAR: Final = 0.1
#: Dots of a square before it is brought to size.
CELL: Final = 600
FORMS: Final = (".pdf", ".png")


def board_for(paper: str) -> Board:
    """The board for a size of paper. Raises BadShowError for a size that there is not."""
    for board in BOARDS:
        if board.paper.lower() == paper.lower():
            return board
    names = ", ".join(board.paper for board in BOARDS)
    raise BadShowError(
        "there is no board of this size", where="--paper", expected=names, found=paper
    )


def print_board(path: Path, board: Board) -> None:
    """Write the page, as .pdf or .png. Raises BadShowError for another ending, UnavailableError."""
    if path.suffix.lower() not in FORMS:
        raise BadShowError(
            "a board is not written in this form",
            where=path,
            expected=" or ".join(FORMS),
            found=path.suffix or "no ending",
        )
    try:
        page(board).save(
            path,
            **(
                {"resolution": DOTS_PER_INCH}
                if path.suffix.lower() == ".pdf"
                else {"dpi": (DOTS_PER_INCH, DOTS_PER_INCH)}
            ),
        )
    except OSError as error:
        raise UnavailableError(
            "the board cannot be written", where=path, found=error.strerror or str(error)
        ) from None


def page(board: Board) -> Pictures.Image:
    """The whole page, 300 dots an inch."""
    width, height = (_dots(side) for side in board.page)
    sheet = Pictures.new("L", (width, height), 255)
    across, up = (_dots(side) for side in board.size)
    left, top = (width - across) // 2, _dots(0.4 * (board.page[1] - board.size[1]))
    # At this size every cell of a marker is a whole number of dots.
    pattern = board.pattern.generateImage((COLUMNS * CELL, ROWS * CELL), marginSize=0)
    sheet.paste(
        Pictures.fromarray(np.asarray(pattern)).resize((across, up), Pictures.Resampling.BOX),
        (left, top),
    )
    draw = ImageDraw.Draw(sheet)
    scale = board.page[1] / BOARDS[0].page[1]
    foot = top + up + _dots(0.007 * scale)
    _bar(draw, left, foot, scale)
    _arrow(draw, left + across - _dots(0.012 * scale), foot, scale)
    text = (
        f"Print at 100 % (actual size) on {board.paper}. This bar is {1000 * BAR:.0f} mm long, a "
        f"square {1000 * board.square:.0f} mm.\n"
        f"Lay it flat on the floor, the arrow to the audience; or hang it up, facing the audience. "
        f"puppet board {COLUMNS}x{ROWS}"
    )
    draw.text(
        (left, foot + _dots(0.0045 * scale)), text, 0, _font(0.0034 * scale), spacing=_dots(0.001)
    )
    return sheet


def _bar(draw: ImageDraw.ImageDraw, left: int, top: int, scale: float) -> None:
    pen, tick = _dots(0.0004 * scale), _dots(0.0016 * scale)
    right = left + _dots(BAR)
    draw.line([(left, top), (right, top)], 0, pen)
    for share in range(11):
        x, half = left + _dots(BAR * share / 10), tick if share % 5 == 0 else tick // 2
        draw.line([(x, top - half), (x, top + half)], 0, pen)


def _arrow(draw: ImageDraw.ImageDraw, x: int, top: int, scale: float) -> None:
    wide, high = _dots(0.004 * scale), _dots(0.009 * scale)
    draw.polygon([(x - wide, top), (x + wide, top), (x, top + high)], 0)
    draw.text((x - 2 * wide, top), "audience", 0, _font(0.0034 * scale), anchor="ra")


def _font(metres: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(_dots(metres))


def _dots(metres: float) -> int:
    return round(metres / INCH * DOTS_PER_INCH)
