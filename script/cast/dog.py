"""The dog: a puppy with floppy ears, a patch over one eye, and its tongue out. 0.75 m tall."""

from __future__ import annotations

import numpy as np

from cast.blend import Blend, Limb, limb, lump
from cast.face import eye, stroke
from cast.puppet_glb import Paint, PuppetFile
from cast.surface import ball, sheet, smoothstep, spline, spot, tube

TAN = Paint("tan", "#dd8636", 0.55)
WHITE = Paint("white", "#fff4e2", 0.55)
BROWN = Paint("brown", "#74391f", 0.55)
DARK = Paint("dark", "#33211f", 0.5)
NOSE = Paint("nose", "#221a1c", 0.22)
TONGUE = Paint("tongue", "#f0707a", 0.45)
COLLAR = Paint("collar", "#d8342f", 0.4)
GOLD = Paint("gold", "#f2b632", 0.28, 0.55)
IRIS = Paint("hazel", "#7a4a1e", 0.25)

NECK = np.array([[0.0, 0.375, 0.125], [0.0, 0.465, 0.185]])


def build() -> PuppetFile:
    """The dog."""
    puppet = PuppetFile(
        "dog",
        {
            "hips": ("", (0.0, 0.345, -0.215)),
            "belly": ("hips", (0.0, 0.335, -0.085)),
            "chest": ("belly", (0.0, 0.345, 0.045)),
            "head": ("chest", (0.0, 0.445, 0.175)),
            "fore_leg.L": ("chest", (0.088, 0.285, 0.125)),
            "fore_paw.L": ("fore_leg.L", (0.092, 0.150, 0.130)),
            "fore_leg.R": ("chest", (-0.088, 0.285, 0.125)),
            "fore_paw.R": ("fore_leg.R", (-0.092, 0.150, 0.130)),
            "hind_leg.L": ("hips", (0.090, 0.300, -0.205)),
            "hind_paw.L": ("hind_leg.L", (0.104, 0.150, -0.235)),
            "hind_leg.R": ("hips", (-0.090, 0.300, -0.205)),
            "hind_paw.R": ("hind_leg.R", (-0.104, 0.150, -0.235)),
            "tail": ("hips", (0.0, 0.405, -0.300)),
        },
    )
    skin = body()
    _coat(puppet, skin)
    _face(puppet, skin)
    _ears(puppet)
    _collar(puppet, skin)
    _toes(puppet, skin)
    return puppet


def body() -> Blend:
    """All of the dog that is one skin."""
    trunk = limb(
        [(0, 0.345, -0.215), (0, 0.330, -0.085), (0, 0.335, 0.045), (0, 0.350, 0.110)],
        (0.112, 0.108, 0.120, 0.118),
        ("hips", "belly", "chest"),
        joints=(0.130, 0.260),
        soft=0.075,
        stretch=(1.05, 1.0, 1.0),
    )
    neck = limb(NECK, (0.096, 0.088), ("chest", "head"), joints=(0.070,), soft=0.05, melt=0.06)
    skull = lump((0, 0.590, 0.226), (0.168, 0.156, 0.148), "head", melt=0.045)
    muzzle = limb(
        [(0, 0.540, 0.299), (0, 0.528, 0.406)],
        (0.086, 0.070),
        "head",
        melt=0.05,
        stretch=(1.14, 0.94, 1.0),
    )
    tail = limb(
        [(0, 0.385, -0.270), (0, 0.440, -0.345), (0, 0.520, -0.385), (0, 0.610, -0.375)],
        (0.042, 0.038, 0.036, 0.029),
        ("hips", "tail"),
        joints=(0.050,),
        soft=0.04,
        melt=0.05,
    )
    fore = limb(
        [(0.088, 0.300, 0.120), (0.090, 0.190, 0.125), (0.092, 0.060, 0.135)],
        (0.066, 0.050, 0.046),
        ("chest", "fore_leg.L", "fore_paw.L"),
        joints=(0.020, 0.150),
        soft=0.035,
        melt=0.05,
    )
    fore_paw = lump((0.093, 0.036, 0.158), (0.057, 0.040, 0.072), "fore_paw.L", melt=0.035)
    haunch = limb(
        [(0.082, 0.315, -0.205), (0.098, 0.225, -0.190)],
        (0.088, 0.060),
        ("hips", "hind_leg.L"),
        joints=(0.015,),
        soft=0.045,
        melt=0.06,
    )
    hind = limb(
        [(0.098, 0.220, -0.195), (0.104, 0.145, -0.238), (0.106, 0.055, -0.225)],
        (0.058, 0.045, 0.045),
        ("hind_leg.L", "hind_paw.L"),
        joints=(0.085,),
        soft=0.03,
        melt=0.04,
    )
    hind_paw = lump((0.107, 0.036, -0.198), (0.057, 0.040, 0.072), "hind_paw.L", melt=0.035)
    limbs: list[Limb] = [trunk, neck, skull, muzzle, tail]
    for part in (fore, fore_paw, haunch, hind, hind_paw):
        limbs += [part, part.mirrored()]
    return Blend(tuple(limbs), floor=True)


def _coat(puppet: PuppetFile, body: Blend) -> None:
    coat = body.skin(0.028)

    # White: muzzle with a blaze, chest and belly, socks, and the tip of the tail.
    for edge in (
        lambda c: np.minimum(
            spot(c, (0, 0.500, 0.446), (0.130, 0.096, 0.153)),
            spot(c, (0, 0.658, 0.367), (0.038, 0.170, 0.113)),
        ),
        lambda c: spot(c, (0, 0.285, 0.185), (0.085, 0.145, 0.110)),
        lambda c: c.positions[:, 1] - 0.098,
        lambda c: (
            0.545
            + 0.25 * (c.positions[:, 2] + 0.38)
            - np.where(c.positions[:, 2] < -0.30, c.positions[:, 1], 0.0)
        ),
    ):
        coat, part = coat.cut(edge(coat))
        puppet.add(part, WHITE, body.weights)
    # Brown: a saddle, and the patch over the left eye.
    for edge in (
        lambda c: spot(c, (0, 0.470, -0.090), (0.125, 0.105, 0.155)),
        lambda c: spot(c, (0.099, 0.645, 0.310), (0.075, 0.084, 0.124)),
    ):
        coat, part = coat.cut(edge(coat))
        puppet.add(part, BROWN, body.weights)
    puppet.add(coat, TAN, body.weights)


def _face(puppet: PuppetFile, body: Blend) -> None:
    for side in (-1.0, 1.0):
        gaze = np.array([side * 0.20, 0.05, 0.97])
        gaze /= np.linalg.norm(gaze)
        eye(
            puppet,
            "head",
            np.array([side * 0.076, 0.632, 0.324]),
            0.052,
            gaze,
            IRIS,
            wide=(52.0, 40.0),
        )
        brow = [(side * x, y, 0.6) for x, y in ((0.045, 0.699), (0.075, 0.715), (0.102, 0.703))]
        puppet.add(stroke(body.seen_from(brow, (0, 0, -1)), 0.013), DARK, "head")
        cheek = [
            (side * x, y, 0.6)
            for x, y in ((0.001, 0.497), (0.029, 0.482), (0.059, 0.489), (0.077, 0.514))
        ]
        puppet.add(stroke(body.seen_from(cheek, (0, 0, -1)), 0.009), DARK, "head")
    puppet.add(ball((0, 0.563, 0.469), (0.041, 0.029, 0.027), rings=10, sides=18), NOSE, "head")
    lip = body.seen_from([(0, y, 0.6) for y in (0.545, 0.523, 0.494)], (0, 0, -1))
    puppet.add(stroke(lip, 0.009, up=(1.0, 0.0, 0.0)), DARK, "head")

    middle = spline([(0, 0.491, 0.446), (0, 0.466, 0.478), (0, 0.419, 0.482)], 10)
    wide = 0.030 * np.sqrt(1.0 - 0.85 * np.linspace(0.0, 1.0, 10) ** 4)
    across = np.linspace(-1.0, 1.0, 9)
    flat = middle[:, None] + np.stack(
        np.broadcast_arrays(wide[:, None] * across, 0.004 * across**2, 0.0), axis=-1
    )
    puppet.add(sheet(flat, 0.016, rim=0.008), TONGUE, "head")


def _ears(puppet: PuppetFile) -> None:
    path = spline(
        (
            (0.090, 0.703, 0.203),
            (0.158, 0.715, 0.197),
            (0.210, 0.624, 0.203),
            (0.215, 0.500, 0.222),
        ),
        13,
    )
    t = np.linspace(0.0, 1.0, 13)
    wide = 0.034 + 0.043 * smoothstep(t, 0.1, 0.75)
    wide *= np.sqrt(np.clip(1.0 - np.clip((t - 0.72) / 0.28, 0.0, 1.0) ** 2, 0.0, 1.0))
    thick = 0.35 * wide + 0.006 * (t < 1.0)
    thick[-1] = wide[-1] = 0.0
    ear = tube(path, thick, wide, up=(0.0, 0.0, 1.0), sides=14)
    puppet.add_both(ear, BROWN, "head")


def _collar(puppet: PuppetFile, body: Blend) -> None:
    axis = (NECK[1] - NECK[0]) / np.linalg.norm(NECK[1] - NECK[0])
    forward = np.cross((1.0, 0.0, 0.0), axis)
    angle = np.linspace(0.0, 2.0 * np.pi, 29)
    around = np.outer(np.sin(angle), (1.0, 0.0, 0.0)) + np.outer(np.cos(angle), forward)
    ring = body.seen_from(NECK[0] + 0.45 * (NECK[1] - NECK[0]) + 0.2 * around, -around, 0.004)
    puppet.add(tube(ring, 0.011, 0.017, up=axis, sides=8, roundness=3.0), COLLAR, body.weights)
    tag = ball(ring[0] + (0.0, -0.026, 0.010), (0.024, 0.026, 0.008), rings=9, sides=16)
    puppet.add(tag, GOLD, "chest")


def _toes(puppet: PuppetFile, body: Blend) -> None:
    for x, z, bone in ((0.093, 0.158, "fore_paw"), (0.107, -0.198, "hind_paw")):
        for side, name in ((1.0, "L"), (-1.0, "R")):
            for off in (-0.019, 0.019):
                high = [(side * x + off, y, z + 0.2) for y in (0.055, 0.036, 0.016)]
                line = body.seen_from(high, (0, 0, -1))
                toe = stroke(line, 0.008, up=(1.0, 0.0, 0.0), count=6, sides=5)
                puppet.add(toe, DARK, f"{bone}.{name}")
