"""Colours of the 17 human bones: one hue a limb, lighter towards its end.

The five hues are those of Okabe and Ito, which stay apart under every common colour blindness; the
steps of lightness within a limb do so by themselves.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from puppet.kernel import Floats, frozen
from puppet.skeleton import HUMAN_BONE_NAMES

#: sRGB, as a web page or a text terminal wants them, by human bone.
HUMAN_BONE_HEX: Final[dict[str, str]] = {
    "pelvis": "#c79a1e",
    "chest": "#ecc02c",
    "head": "#f9e07a",
    "shoulder.R": "#a8430c",
    "upper_arm.R": "#d85f08",
    "forearm.R": "#f58a42",
    "hand.R": "#ffb98a",
    "shoulder.L": "#1c5c9c",
    "upper_arm.L": "#1f7fcb",
    "forearm.L": "#58acec",
    "hand.L": "#9ed2fa",
    "thigh.R": "#9d4a83",
    "shin.R": "#cf77ab",
    "foot.R": "#efb1d3",
    "thigh.L": "#04785a",
    "shin.L": "#12a880",
    "foot.L": "#74d8b6",
}


def srgb(code: str) -> tuple[int, int, int]:
    """Red, green and blue in 0..255 of a colour written ``#rrggbb``."""
    return int(code[1:3], 16), int(code[3:5], 16), int(code[5:7], 16)


def linear(code: str) -> Floats:
    """Linear RGB in 0..1 of an sRGB colour written ``#rrggbb``. -> (3,)"""
    value = np.array(srgb(code)) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


#: (17, 3) linear RGB in the order of `HUMAN_BONES`.
HUMAN_BONE_COLORS: Final = frozen([linear(HUMAN_BONE_HEX[name]) for name in HUMAN_BONE_NAMES])
#: (3,) linear RGB of a human bone that no puppet follows.
NEUTRAL: Final = frozen(linear("#8d8983"))
#: (3,) linear RGB of the performer's joints.
JOINT: Final = frozen(linear("#d9d4ca"))
