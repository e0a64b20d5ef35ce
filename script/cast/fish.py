"""The fish: a round clownfish with big eyes, a smile, and fins like fans. 0.9 m, and it floats."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from cast.face import eye
from cast.fan import fan
from cast.puppet_glb import Paint, PuppetFile, Weights, along
from cast.surface import Floats, Surface, grid, smoothstep, spline, tube

ORANGE = Paint("orange", "#f5641a", 0.38)
WHITE = Paint("white", "#fff6e6", 0.42)
DARK = Paint("dark", "#3a2226", 0.5)
FIN = Paint("fin", "#ff9a2e", 0.45)
MOUTH = Paint("mouth", "#8c2b2b", 0.6)
TONGUE = Paint("tongue", "#f28a86", 0.6)
IRIS = Paint("iris", "#2f8f9d", 0.25)

#: z, middle y, half height, half width of the body, from the root of the tail to the lips.
BODY = (
    (-0.270, 0.012, 0.040, 0.020),
    (-0.210, 0.010, 0.055, 0.036),
    (-0.130, 0.004, 0.101, 0.076),
    (-0.030, 0.000, 0.166, 0.128),
    (0.080, 0.000, 0.205, 0.166),
    (0.190, 0.000, 0.206, 0.178),
    (0.290, -0.004, 0.172, 0.158),
    (0.365, -0.010, 0.115, 0.112),
    (0.402, -0.014, 0.058, 0.060),
    (0.412, -0.015, 0.000, 0.000),
)


@cache
def body_stations() -> Floats:
    """(U, 4) the body's profile, drawn smoothly: z, middle y, half height, half width."""
    mirror = np.array([1.0, 1.0, -1.0, -1.0])
    both = np.array([*BODY, *(np.array(row) * mirror for row in BODY[-2::-1])])
    smooth = spline(both, 47)[:24]
    smooth[-1, 2:] = 0.0
    return smooth


def on_face(x: float, y: float, lift: float = 0.0) -> Floats:
    """The point on the front half of the body at (x, y), `lift` metres in front of the skin."""
    front = body_stations()[12:]
    z, middle, high, wide = front.T
    inside = (x / np.maximum(wide, 1e-6)) ** 2 + ((y - middle) / np.maximum(high, 1e-6)) ** 2
    return np.array([x, y, np.interp(1.0, inside, z) + lift])


def rimmed(
    puppet: PuppetFile,
    fin: tuple[Surface, Floats],
    weights: str | Callable[[Surface], Weights],
    *,
    width: float = 0.016,
) -> None:
    """Put a fin on the puppet, with a dark rim."""
    blade, distance = fin
    inner, rest = blade.cut(distance - width)
    puppet.add(inner, FIN, weights)
    puppet.add(rest, DARK, weights)


def build() -> PuppetFile:
    """The fish."""
    puppet = PuppetFile(
        "fish",
        {
            "back": ("", (0.0, 0.008, -0.225)),
            "middle": ("back", (0.0, 0.0, -0.02)),
            "head": ("middle", (0.0, 0.0, 0.165)),
            "fin.R": ("middle", (-0.140, -0.055, 0.085)),
            "fin_tip.R": ("fin.R", (-0.225, -0.175, 0.055)),
            "fin.L": ("middle", (0.140, -0.055, 0.085)),
            "fin_tip.L": ("fin.L", (0.225, -0.175, 0.055)),
            "dorsal": ("middle", (0.0, 0.170, 0.02)),
        },
    )
    _body(puppet)
    _face(puppet)
    _tail(puppet)
    _dorsal(puppet)
    _anal(puppet)
    _arms(puppet)
    return puppet


def _trunk(surface: Surface) -> Weights:
    return along(surface.positions[:, 2], ("back", "middle", "head"), (-0.03, 0.165), 0.085)


def _body(puppet: PuppetFile) -> None:
    stations = body_stations()
    spine = np.stack([0 * stations[:, 0], stations[:, 1], stations[:, 0]], axis=1)
    skin = tube(spine, stations[:, 3], stations[:, 2], sides=24, roundness=2.15)

    def z_of(rest: Surface) -> Floats:
        return rest.positions[:, 2]

    def bow(rest: Surface) -> Floats:
        """0 at the middle of the flank, 1 at the back and the belly."""
        return np.abs(rest.positions[:, 1] / 0.2) ** 2

    bands = ((0.150, 0.036, -0.045), (-0.075, 0.030, 0.05), (-0.212, 0.021, 0.0))
    for middle, half, curve in bands:
        for paint, extra in ((WHITE, 0.0), (DARK, 0.009)):
            gap = np.abs(z_of(skin) - middle - curve * bow(skin)) - half - extra
            skin, band = skin.cut(gap)
            puppet.add(band, paint, _trunk)
    puppet.add(skin, ORANGE, _trunk)


def _face(puppet: PuppetFile) -> None:
    for side in (-1.0, 1.0):
        centre = np.array([side * 0.098, 0.062, 0.292])
        gaze = np.array([side * 0.40, 0.08, 0.86])
        gaze /= np.linalg.norm(gaze)
        eye(puppet, "head", centre, 0.074, gaze, IRIS)
        brow = spline(
            [
                on_face(side * x, y, 0.0)
                for x, y in ((0.045, 0.150), (0.085, 0.163), (0.122, 0.146))
            ],
            9,
        )
        thick = 0.0075 * np.sqrt(np.sin(np.linspace(0.0, np.pi, 9)))
        puppet.add(tube(brow, thick, thick, sides=5), DARK, "head")

    # An open smile: a crescent between two curves, laid on the skin, with a lip around it.
    x = np.linspace(-1.0, 1.0, 17)
    half = 0.074
    upper = np.array([on_face(half * a, -0.058 + 0.024 * a * a, 0.0025) for a in x])
    lower = np.array(
        [on_face(half * a, -0.058 + 0.024 * a * a - 0.038 * (1 - a * a), 0.0025) for a in x]
    )
    t = np.linspace(0.0, 1.0, 4)[:, None, None]
    hollow = grid(_laid(lower * (1 - t) + upper * t, 0.0025))
    puppet.add(hollow, MOUTH, "head")
    tongue = (np.abs(x) < 0.52).nonzero()[0]
    low = lower[tongue]
    crest = np.sqrt(np.clip(1.0 - (x[tongue] / 0.52) ** 2, 0.0, 1.0))[:, None] * (0.0, 0.019, 0.0)
    puppet.add(grid(_laid(low * (1 - t) + (low + crest) * t, 0.0045)), TONGUE, "head")
    lip = np.concatenate([lower, upper[-2:0:-1]])
    ring = spline(lip, 28, closed=True)
    ring = np.concatenate([ring, ring[:1]])
    puppet.add(tube(ring, 0.0062, 0.0062, up=(0.0, 0.0, 1.0), sides=5), DARK, "head")


def _laid(points: Floats, lift: float) -> Floats:
    """A grid of points pushed onto the skin of the face."""
    flat = points.reshape(-1, 3)
    return np.array([on_face(p[0], p[1], lift) for p in flat]).reshape(points.shape)


def _tail(puppet: PuppetFile) -> None:
    def root(v: Floats) -> Floats:
        return np.stack([0 * v, 0.012 + 0.034 * (1 - 2 * v), -0.225 + 0 * v], axis=1)

    def reach(v: Floats) -> Floats:
        s = 1 - 2 * v
        angle = np.radians(58.0 * np.sign(s) * np.abs(s) ** 0.9)
        length = 0.165 + 0.135 * smoothstep(np.abs(s), 0.05, 0.85) - 0.03 * np.abs(s) ** 6
        return np.asarray(
            length[:, None] * np.stack([0 * v, np.sin(angle), -np.cos(angle)], axis=1)
        )

    blade, distance = fan(root, reach, thickness=0.034, rays=7, rows=6, columns=25, ripple=0.012)
    rimmed(puppet, (blade, distance), "back")


def _dorsal(puppet: PuppetFile) -> None:
    def root(v: Floats) -> Floats:
        z = 0.175 - 0.31 * v
        z_, middle, high, _ = body_stations().T
        top = np.interp(z, z_, middle + high)
        return np.stack([0 * v, top - 0.02, z], axis=1)

    def reach(v: Floats) -> Floats:
        angle = np.radians(62.0 - 42.0 * v)
        length = 0.03 + 0.125 * np.sin(np.pi * np.clip(v * 0.86 + 0.10, 0, 1)) ** 0.75
        length = length * (1.0 + 0.35 * v)
        return np.asarray(
            length[:, None] * np.stack([0 * v, np.sin(angle), -np.cos(angle)], axis=1)
        )

    def weights(surface: Surface) -> Weights:
        free = smoothstep(surface.params[:, 0], 0.05, 0.40)
        return {"dorsal": free, **{b: w * (1 - free) for b, w in _trunk(surface).items()}}

    rimmed(
        puppet, fan(root, reach, thickness=0.026, rays=6, rows=5, columns=19, ripple=0.006), weights
    )


def _anal(puppet: PuppetFile) -> None:
    def root(v: Floats) -> Floats:
        z = -0.03 - 0.13 * v
        z_, middle, high, _ = body_stations().T
        return np.stack([0 * v, np.interp(z, z_, middle - high) + 0.02, z], axis=1)

    def reach(v: Floats) -> Floats:
        angle = np.radians(-72.0 + 40.0 * v)
        length = 0.05 + 0.075 * np.sin(np.pi * np.clip(v * 0.8 + 0.15, 0, 1)) ** 0.8
        return np.asarray(
            length[:, None] * np.stack([0 * v, np.sin(angle), -np.cos(angle)], axis=1)
        )

    fin = fan(root, reach, thickness=0.022, rays=4, rows=4, columns=13, ripple=0.005)
    rimmed(puppet, fin, _trunk, width=0.013)


def _arms(puppet: PuppetFile) -> None:
    shoulder, tip = puppet.origin("fin.L"), puppet.origin("fin_tip.L")
    out = (tip - shoulder) / np.linalg.norm(tip - shoulder)
    forward = np.array([0.42, 0.18, 0.90])
    across = np.cross(forward, out)
    across /= np.linalg.norm(across)  # from the fin's outer edge towards the belly

    def root(v: Floats) -> Floats:
        return shoulder - 0.03 * out + np.outer(v - 0.5, 0.070 * across)

    def reach(v: Floats) -> Floats:
        angle = np.radians(84.0 * (v - 0.5))
        length = 0.315 * (1.0 - 0.55 * np.abs(2 * v - 1.0) ** 3.2)
        length = length * (1.0 + 0.10 * (0.5 - v))
        way = np.outer(np.cos(angle), out) + np.outer(np.sin(angle), across)
        return np.asarray(length[:, None] * way)

    half = float(np.linalg.norm(tip - shoulder))
    left = fan(root, reach, thickness=0.030, rays=5, rows=6, columns=19, ripple=0.007)

    def weights(side: str) -> Callable[[Surface], Weights]:
        def shares(surface: Surface) -> Weights:
            flip = np.array([1.0 if side == "L" else -1.0, 1.0, 1.0])
            far = (surface.positions * flip - shoulder) @ out
            return along(far, (f"fin.{side}", f"fin_tip.{side}"), (half,), 0.07)

        return shares

    rimmed(puppet, left, weights("L"))
    rimmed(puppet, (left[0].mirrored(), left[1]), weights("R"))
