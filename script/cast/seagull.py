"""The seagull: a round herring gull with its wings half open, as if to say "mine". 0.6 m tall."""

from __future__ import annotations

import numpy as np

from cast.blend import Blend, Limb, limb, lump
from cast.face import eye, stroke
from cast.fan import fan
from cast.puppet_glb import Paint, PuppetFile, Weights, along
from cast.surface import Floats, Surface, spline, spot

WHITE = Paint("white", "#fbfaf5", 0.55)
GREY = Paint("grey", "#93a7ba", 0.5)
PALE = Paint("pale", "#dde5ea", 0.55)
BLACK = Paint("black", "#2c2f38", 0.45)
BEAK = Paint("beak", "#ffb521", 0.35)
RED = Paint("red", "#e0402c", 0.35)
LEGS = Paint("legs", "#ff8f2e", 0.45)
DARK = Paint("dark", "#3a2a2a", 0.5)
IRIS = Paint("amber", "#e8a514", 0.25)

SHOULDER = (0.100, 0.375, 0.030)
WRIST = (0.255, 0.455, 0.020)
KNUCKLE = (0.415, 0.410, -0.020)
HIP = (0.060, 0.190, -0.020)
ANKLE = (0.064, 0.026, 0.000)


def build() -> PuppetFile:
    """The seagull."""
    puppet = PuppetFile(
        "seagull",
        {
            "pelvis": ("", (0.0, 0.255, -0.070)),
            "chest": ("pelvis", (0.0, 0.300, 0.010)),
            "neck": ("chest", (0.0, 0.385, 0.065)),
            "head": ("neck", (0.0, 0.455, 0.085)),
            "wing.L": ("chest", SHOULDER),
            "wing_mid.L": ("wing.L", WRIST),
            "wing_tip.L": ("wing_mid.L", KNUCKLE),
            "wing.R": ("chest", _other(SHOULDER)),
            "wing_mid.R": ("wing.R", _other(WRIST)),
            "wing_tip.R": ("wing_mid.R", _other(KNUCKLE)),
            "leg.L": ("pelvis", HIP),
            "paw.L": ("leg.L", ANKLE),
            "leg.R": ("pelvis", _other(HIP)),
            "paw.R": ("leg.R", _other(ANKLE)),
            "tail": ("pelvis", (0.0, 0.235, -0.165)),
        },
    )
    _body(puppet)
    _face(puppet)
    _wings(puppet)
    _tail(puppet)
    _feet(puppet)
    return puppet


def _other(point: tuple[float, float, float]) -> tuple[float, float, float]:
    return (-point[0], point[1], point[2])


def body() -> Blend:
    """All that is feathers and one skin, down to the thighs."""
    trunk = limb(
        [(0, 0.232, -0.180), (0, 0.262, -0.085), (0, 0.312, 0.030)],
        (0.048, 0.108, 0.120),
        ("tail", "pelvis", "chest"),
        joints=(0.020, 0.140),
        soft=0.05,
        stretch=(1.05, 1.0, 1.0),
    )
    neck = limb(
        [(0, 0.330, 0.040), (0, 0.400, 0.072), (0, 0.480, 0.092)],
        (0.090, 0.072, 0.072),
        ("chest", "neck", "head"),
        joints=(0.065, 0.135),
        soft=0.04,
        melt=0.06,
    )
    head = lump((0, 0.512, 0.100), (0.090, 0.086, 0.092), "head", melt=0.04)
    thigh = limb(
        [(0.056, 0.215, -0.025), (0.062, 0.160, -0.012)],
        (0.056, 0.034),
        ("pelvis", "leg.L"),
        joints=(0.025,),
        soft=0.03,
        melt=0.04,
    )
    limbs: tuple[Limb, ...] = (trunk, neck, head, thigh, thigh.mirrored())
    return Blend(limbs)


def _body(puppet: PuppetFile) -> None:
    feathers = body()
    skin = feathers.skin(0.0215)
    skin, mantle = skin.cut(spot(skin, (0.0, 0.385, -0.090), (0.120, 0.115, 0.135)))
    puppet.add(mantle, GREY, feathers.weights)
    puppet.add(skin, WHITE, feathers.weights)


def _face(puppet: PuppetFile) -> None:
    feathers = body()
    for side in (-1.0, 1.0):
        gaze = np.array([side * 0.34, 0.04, 0.94])
        gaze /= np.linalg.norm(gaze)
        centre = np.array([side * 0.050, 0.531, 0.148])
        eye(puppet, "head", centre, 0.037, gaze, IRIS, wide=(50.0, 37.0))
        brow = [(side * x, y, 0.4) for x, y in ((0.018, 0.573), (0.046, 0.584), (0.074, 0.575))]
        line = feathers.seen_from(brow, (0, 0, -1), 0.001)
        puppet.add(stroke(line, 0.011, count=9), DARK, "head")

    bill = Blend(
        (
            limb(
                [(0, 0.503, 0.165), (0, 0.503, 0.225), (0, 0.492, 0.272), (0, 0.470, 0.288)],
                (0.034, 0.026, 0.019, 0.009),
                "head",
                stretch=(0.95, 1.0, 1.0),
            ),
            limb(
                [(0, 0.484, 0.165), (0, 0.478, 0.215), (0, 0.474, 0.258)],
                (0.026, 0.021, 0.010),
                "head",
                melt=0.008,
            ),
        )
    )
    yellow = bill.skin(0.017)
    yellow, red = yellow.cut(spot(yellow, (0.0, 0.456, 0.243), (0.040, 0.019, 0.020)))
    puppet.add(yellow, BEAK, "head")
    puppet.add(red, RED, "head")
    for side in (-1.0, 1.0):
        smile = [(side * 0.2, y, z) for y, z in ((0.493, 0.180), (0.488, 0.220), (0.482, 0.262))]
        line = bill.seen_from(smile, (-side, 0, 0), 0.0005)
        puppet.add(stroke(line, 0.006, up=(1.0, 0.0, 0.0), count=8), DARK, "head")
        nostril = [(side * 0.2, 0.508, z) for z in (0.212, 0.222, 0.232)]
        line = bill.seen_from(nostril, (-side, 0, 0), 0.0005)
        puppet.add(stroke(line, 0.007, up=(1.0, 0.0, 0.0), count=6), DARK, "head")


def _wings(puppet: PuppetFile) -> None:
    lead = spline(
        [
            (0.060, 0.350, 0.065),
            (0.150, 0.425, 0.068),
            (0.255, 0.467, 0.055),
            (0.430, 0.428, 0.002),
            (0.590, 0.300, -0.090),
        ],
        65,
    )
    # How far the feathers reach behind the leading edge, and where to, from shoulder to tip.
    reach = spline(
        [
            (0.00, -0.005, -0.100, -0.150),
            (0.25, 0.010, -0.150, -0.150),
            (0.50, 0.030, -0.185, -0.130),
            (0.75, 0.075, -0.170, -0.105),
            (1.00, 0.070, -0.085, -0.065),
        ],
        65,
    )[:, 1:]

    def at(table: Floats, v: Floats) -> Floats:
        even = np.linspace(0.0, 1.0, len(table))
        return np.stack([np.interp(v, even, column) for column in table.T], axis=1)

    def weights(surface: Surface) -> Weights:
        # Feathers follow the bone above them, so what counts is where their quill is.
        out = at(lead, surface.params[:, 1])[:, 0]
        bones = ("chest", "wing.L", "wing_mid.L", "wing_tip.L")
        return along(out, bones, (0.085, WRIST[0], KNUCKLE[0]), 0.045)

    def feathers(length: float, thickness: float, rays: int, rows: int, scallop: float) -> Surface:
        blade, _ = fan(
            lambda v: at(lead, v),
            lambda v: length * at(reach, v),
            thickness=thickness,
            rays=rays,
            rows=rows,
            columns=4 * rays + 1,
            ripple=0.002,
            scallop=scallop,
        )
        return blade

    flight = feathers(1.0, 0.017, 9, 6, 0.16)
    coverts = feathers(0.52, 0.026, 8, 4, 0.10).moved((0.0, 0.007, -0.006))
    for blade in (flight, coverts):
        upper = np.arange(len(blade.positions)) < len(blade.positions) // 2
        for part, paint in zip(blade.cut(np.where(upper, 1.0, -1.0)), (GREY, PALE), strict=True):
            black, rest = part.cut(part.params[:, 1] - 0.70 + 0.05 * part.params[:, 0])
            white, rest = rest.cut(rest.params[:, 0] - 0.90)
            for piece, color in ((black, BLACK), (white, WHITE), (rest, paint)):
                puppet.add_both(piece, color, weights)


def _tail(puppet: PuppetFile) -> None:
    def root(v: Floats) -> Floats:
        return np.stack([0.044 * (2 * v - 1), 0.235 + 0 * v, -0.185 + 0 * v], axis=1)

    def reach(v: Floats) -> Floats:
        angle = np.radians(30.0 * (2 * v - 1))
        way = np.stack([np.sin(angle), -0.22 + 0 * v, -np.cos(angle)], axis=1)
        return np.asarray(0.135 * way)

    blade, _ = fan(root, reach, thickness=0.036, rays=5, rows=6, columns=26, scallop=0.12)
    tip, rest = blade.cut(blade.params[:, 0] - 0.72)
    puppet.add(tip, BLACK, "tail")
    puppet.add(rest, WHITE, "tail")


def _feet(puppet: PuppetFile) -> None:
    x, _, z = ANKLE
    leg = Blend(
        (
            limb(
                [(0.061, 0.150, -0.012), (0.063, 0.085, -0.012), (0.064, 0.020, 0.002)],
                (0.0135, 0.0145, 0.0135),
                ("leg.L", "paw.L"),
                joints=(0.125,),
                soft=0.018,
            ),
            lump((x, 0.016, z), (0.019, 0.014, 0.020), "paw.L", melt=0.02),
        ),
        floor=True,
    )

    def root(v: Floats) -> Floats:
        return np.stack([x + 0.016 * (2 * v - 1), 0.014 + 0 * v, z - 0.008 + 0 * v], axis=1)

    def reach(v: Floats) -> Floats:
        angle = np.radians(34.0 * (2 * v - 1) + 8.0)
        way = np.stack([np.sin(angle), -0.035 + 0 * v, np.cos(angle)], axis=1)
        return np.asarray(0.118 * way)

    web, _ = fan(root, reach, thickness=0.020, rays=3, rows=6, columns=22, scallop=0.20)
    web = web.moved((0.0, -float(web.positions[:, 1].min()), 0.0))
    puppet.add_both(leg.skin(0.018), LEGS, leg.weights)
    puppet.add_both(web, LEGS, "paw.L")
