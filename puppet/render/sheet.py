"""Contact sheets: many pictures on one, with what they show written below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from puppet.render.overlay import font

_PAPER: Final = (24, 23, 22)
_INK: Final = (222, 216, 206)


def contact_sheet(
    images: Sequence[NDArray[np.uint8]],
    columns: int,
    labels: Sequence[str] = (),
    *,
    gap: int | None = None,
) -> NDArray[np.uint8]:
    """All images in rows of `columns`, each over its label.

    images: (h, w, 3) sRGB; where sizes differ they are centred in the largest. labels: as many as
    images, or none. gap: pixels between them; None chooses.

    Raises ValueError without images, without columns, or with labels that do not match.
    """
    if not images or columns < 1 or len(labels) not in {0, len(images)}:
        raise ValueError("a contact sheet needs images, columns, and a label for each or for none")
    height = max(image.shape[0] for image in images)
    width = max(image.shape[1] for image in images)
    gap = max(2, round(width / 48)) if gap is None else gap
    text = max(11, round(height / 20))
    strip = round(1.9 * text) if labels else 0
    columns = min(columns, len(images))
    rows = -(-len(images) // columns)
    size = (gap + columns * (width + gap), gap + rows * (height + strip + gap))
    sheet = Image.new("RGB", size, _PAPER)
    draw = ImageDraw.Draw(sheet)
    for index, image in enumerate(images):
        row, column = divmod(index, columns)
        x, y = gap + column * (width + gap), gap + row * (height + strip + gap)
        inset = ((width - image.shape[1]) // 2, (height - image.shape[0]) // 2)
        sheet.paste(Image.fromarray(image), (x + inset[0], y + inset[1]))
        if labels:
            middle = (x + width / 2, y + height + strip / 2)
            draw.text(middle, labels[index], _INK, font(text), anchor="mm")
    return np.asarray(sheet).copy()
