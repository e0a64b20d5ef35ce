"""The ostrich: a black cloud of feathers on long legs, with lashes to bat. 1.9 m tall."""

from __future__ import annotations

import numpy as np

from cast.blend import Blend, Limb, limb, lump
from cast.face import eye, stroke, towards
from cast.puppet_glb import Paint, PuppetFile
from cast.surface import spot

FEATHER = Paint("feather", "#2f2b38", 0.7)
PLUME = Paint("plume", "#fff8ee", 0.6)
SKIN = Paint("skin", "#f08d80", 0.5)
BEAK = Paint("beak", "#f58a45", 0.4)
NAIL = Paint("nail", "#5b3a3a", 0.4)
DARK = Paint("dark", "#2a2024", 0.5)
IRIS = Paint("iris", "#8a5a2b", 0.25)

NECK = (
    (0.0, 1.130, 0.205),
    (0.0, 1.225, 0.275),
    (0.0, 1.335, 0.300),
    (0.0, 1.445, 0.292),
    (0.0, 1.550, 0.275),
    (0.0, 1.650, 0.270),
    (0.0, 1.745, 0.290),
)
HIP = (0.115, 0.900, -0.045)
KNEE = (0.130, 0.520, -0.075)
ANKLE = (0.136, 0.085, 0.000)


def build() -> PuppetFile:
    """The ostrich."""
    bones: dict[str, tuple[str, tuple[float, float, float]]] = {
        "hips": ("", (0.0, 1.010, -0.110)),
        "body": ("hips", (0.0, 1.050, 0.040)),
    }
    above = "body"
    for name, origin in zip([*(f"neck.{k}" for k in range(1, 7)), "head"], NECK, strict=True):
        bones[name] = (above, origin)
        above = name
    for side, sign in (("L", 1.0), ("R", -1.0)):
        above = "hips"
        for name, (x, y, z) in (("thigh", HIP), ("shin", KNEE), ("paw", ANKLE)):
            bones[f"{name}.{side}"] = (above, (sign * x, y, z))
            above = f"{name}.{side}"
    puppet = PuppetFile("ostrich", bones)
    _feathers(puppet)
    _neck(puppet)
    _face(puppet)
    _legs(puppet)
    return puppet


def _feathers(puppet: PuppetFile) -> None:
    core = limb(
        [(0, 1.020, -0.270), (0, 1.050, -0.080), (0, 1.075, 0.120)],
        (0.150, 0.235, 0.185),
        ("hips", "body"),
        joints=(0.300,),
        soft=0.12,
        stretch=(1.05, 1.0, 1.0),
    )
    tufts: list[Limb] = []
    for ring, (z, size, count) in enumerate(
        (
            (-0.375, 0.085, 5),
            (-0.275, 0.180, 9),
            (-0.150, 0.232, 11),
            (-0.010, 0.240, 11),
            (0.120, 0.205, 9),
            (0.225, 0.125, 7),
        )
    ):
        # Rings of tufts, one at the top of every other ring, so that they lie like tiles.
        turn = np.pi / count if ring % 2 else 0.0
        for k in range(count):
            angle = 2.0 * np.pi * k / count + turn
            x, y = 1.06 * size * np.sin(angle), size * np.cos(angle)
            if x < -1e-9:
                continue
            root = np.array([x if x > 1e-9 else 0.0, 1.052 + 0.10 * z + y, z])
            out = np.array([root[0], y, 0.0]) / size
            tuft = limb(
                [root - 0.020 * out, root + 0.020 * out + (0.0, -0.020, -0.115)],
                (0.068, 0.040),
                "hips" if z < -0.05 else "body",
                melt=0.055,
                count=4,
            )
            tufts += [tuft] if root[0] == 0.0 else [tuft, tuft.mirrored()]
    cloud = Blend((core, *tufts))
    puppet.add(cloud.skin(0.050), FEATHER, cloud.weights)

    tail = []
    for x, high, long in ((0.0, 1.0, 1.0), (0.065, 0.86, 0.95), (0.120, 0.62, 0.84)):
        tail.append(
            limb(
                [
                    (0.5 * x, 1.075, -0.330),
                    (x, 1.075 + 0.130 * high, -0.330 - 0.110 * long),
                    (1.3 * x, 1.075 + 0.150 * high, -0.330 - 0.215 * long),
                    (1.5 * x, 1.075 + 0.060 * high, -0.330 - 0.270 * long),
                ],
                (0.040, 0.055, 0.058, 0.030),
                "hips",
                melt=0.025,
            )
        )
    plumes = Blend((tail[0], *(part for one in tail[1:] for part in (one, one.mirrored()))))
    puppet.add(plumes.skin(0.043), PLUME, "hips")

    wing = Blend(
        (
            limb(
                [(0.225, 1.150, 0.120), (0.285, 1.110, 0.000), (0.290, 1.060, -0.120)],
                (0.060, 0.095, 0.080),
                "body",
                stretch=(0.62, 1.0, 1.0),
            ),
            *(
                limb(
                    [
                        (0.290, 1.055 - 0.30 * drop, -0.080 + 0.6 * drop),
                        (0.315, 1.030 - 0.75 * drop, -0.190 + 0.7 * drop),
                        (0.330, 1.050 - 1.00 * drop, -0.280 + 0.9 * drop),
                    ],
                    (0.050, 0.046, 0.024),
                    "body",
                    melt=0.02,
                )
                for drop in (-0.06, 0.03, 0.12)
            ),
        )
    )
    feathers = wing.skin(0.044)
    white, black = feathers.cut(spot(feathers, (0.290, 1.140, 0.090), (0.200, 0.240, 0.235)))
    puppet.add_both(white, PLUME, "body")
    puppet.add_both(black, FEATHER, "body")


def neck() -> Blend:
    """The neck, from within the feathers to the head."""
    origins = np.array(NECK)
    path = [(0.0, 1.095, 0.165), *NECK, (0.0, 1.800, 0.315)]
    column = limb(
        path,
        (0.095, 0.082, 0.066, 0.056, 0.051, 0.049, 0.049, 0.051, 0.052),
        ("body", *(f"neck.{k}" for k in range(1, 7)), "head"),
        soft=0.042,
        count=25,
    ).jointed(*origins)
    skull = lump((0.0, 1.812, 0.330), (0.112, 0.100, 0.112), "head", melt=0.045)
    return Blend((column, skull))


def _neck(puppet: PuppetFile) -> None:
    bare = neck()
    puppet.add(bare.skin(0.031), SKIN, bare.weights)
    # A ruff of white tufts where the neck comes out of the feathers.
    ruff = []
    way = np.array([0.0, 0.80, 0.60])
    middle, ahead = np.array([0.0, 1.195, 0.254]), np.array([0.0, -0.60, 0.80])
    for angle in np.linspace(0.0, 2.0 * np.pi, 10, endpoint=False):
        out = np.sin(angle) * np.array([1.0, 0.0, 0.0]) + np.cos(angle) * ahead
        ruff.append(
            lump(middle + 0.078 * out - 0.012 * way, (0.045, 0.038, 0.045), "neck.1", melt=0.02)
        )
    collar = Blend(tuple(ruff))
    puppet.add(collar.skin(0.034), PLUME, {"neck.1": 0.5, "body": 0.5})


def _face(puppet: PuppetFile) -> None:
    for side in (-1.0, 1.0):
        gaze = np.array([side * 0.36, 0.03, 0.93])
        gaze /= np.linalg.norm(gaze)
        centre = np.array([side * 0.063, 0.0, 0.0]) + (0.0, 1.850, 0.392)
        eye(puppet, "head", centre, 0.053, gaze, IRIS, wide=(50.0, 38.0))
        for yaw in (-8.0, 22.0, 50.0):
            root, tip = (
                centre + size * towards(gaze, side * turn, lift)
                for size, turn, lift in ((0.051, yaw, 42.0), (0.090, 1.25 * yaw, 47.0))
            )
            lash = np.array([root, 0.5 * (root + tip) + (0.0, -0.004, 0.004), tip])
            puppet.add(stroke(lash, 0.012, up=(1.0, 0.3, 0.2), count=6, sides=5), DARK, "head")
    for x, lean in ((-0.022, -0.035), (0.0, 0.0), (0.022, 0.035)):
        hair = [(x, 1.900, 0.318), (x + 0.4 * lean, 1.938, 0.308), (x + 1.6 * lean, 1.960, 0.278)]
        puppet.add(stroke(hair, 0.017, count=7, sides=5), DARK, "head")

    bill = Blend(
        (
            limb(
                [(0, 1.801, 0.401), (0, 1.797, 0.476), (0, 1.781, 0.539)],
                (0.057, 0.053, 0.030),
                "head",
                stretch=(1.25, 0.72, 1.0),
            ),
            limb(
                [(0, 1.770, 0.401), (0, 1.763, 0.464), (0, 1.760, 0.512)],
                (0.050, 0.046, 0.025),
                "head",
                stretch=(1.20, 0.60, 1.0),
                melt=0.008,
            ),
        )
    )
    puppet.add(bill.skin(0.023), BEAK, "head")
    smile = [
        (side * x, y, 0.62)
        for side, x, y in (
            (-1, 0.052, 1.783),
            (-1, 0.030, 1.771),
            (1, 0.0, 1.768),
            (1, 0.030, 1.771),
            (1, 0.052, 1.783),
        )
    ]
    puppet.add(stroke(bill.seen_from(smile, (0, 0, -1)), 0.007, count=14), DARK, "head")
    for side in (-1.0, 1.0):
        corner = [(side * 0.2, y, z) for y, z in ((1.795, 0.435), (1.785, 0.470), (1.775, 0.504))]
        line = bill.seen_from(corner, (-side, 0, 0))
        puppet.add(stroke(line, 0.007, up=(1.0, 0.0, 0.0), count=7), DARK, "head")


def _legs(puppet: PuppetFile) -> None:
    bones = ("hips", "thigh.L", "shin.L", "paw.L")
    leg = Blend(
        (
            limb(
                [
                    (0.112, 0.900, -0.045),
                    (0.122, 0.720, -0.050),
                    KNEE,
                    (0.134, 0.300, -0.030),
                    ANKLE,
                ],
                (0.088, 0.052, 0.038, 0.027, 0.032),
                bones,
                soft=0.05,
                count=24,
            ).jointed(HIP, KNEE, ANKLE),
            lump(KNEE, 0.047, "shin.L", melt=0.04),
            limb(
                [ANKLE, (0.130, 0.040, 0.080), (0.128, 0.030, 0.185)],
                (0.042, 0.040, 0.031),
                "paw.L",
                melt=0.03,
                count=8,
            ),
            limb(
                [ANKLE, (0.175, 0.034, 0.045), (0.205, 0.026, 0.110)],
                (0.036, 0.033, 0.025),
                "paw.L",
                melt=0.03,
                count=8,
            ),
        ),
        floor=True,
    )
    skin = leg.skin(0.0285)
    for nail in ((0.128, 0.030, 0.208), (0.212, 0.024, 0.128)):
        skin, tip = skin.cut(spot(skin, nail, (0.036, 0.042, 0.026)))
        puppet.add_both(tip, NAIL, leg.weights)
    puppet.add_both(skin, SKIN, leg.weights)
