"""The snake: green and friendly, in gentle curves, its head raised to look at you. 1.8 m long."""

from __future__ import annotations

from functools import cache

import numpy as np

from cast.blend import Blend, Limb, limb, lump
from cast.face import eye, stroke
from cast.puppet_glb import Paint, PuppetFile
from cast.surface import Floats, Surface, smoothstep, spline, turned

GREEN = Paint("green", "#6cbf2c", 0.4)
FOREST = Paint("forest", "#2b7d3a", 0.42)
YELLOW = Paint("yellow", "#ffe07a", 0.45)
AMBER = Paint("amber", "#f3b63f", 0.45)
DARK = Paint("dark", "#2c3a22", 0.5)
TONGUE = Paint("tongue", "#e8364f", 0.4)
IRIS = Paint("iris", "#f0a41c", 0.25)

#: x, y, z, radius along the body, from the tip of the tail to the back of the head.
COURSE = (
    (0.640, 0.034, -0.120, 0.026),
    (0.560, 0.029, 0.000, 0.031),
    (0.430, 0.035, 0.070, 0.037),
    (0.290, 0.043, 0.030, 0.045),
    (0.180, 0.049, -0.090, 0.051),
    (0.050, 0.052, -0.190, 0.054),
    (-0.110, 0.052, -0.190, 0.054),
    (-0.230, 0.052, -0.090, 0.054),
    (-0.240, 0.051, 0.050, 0.053),
    (-0.130, 0.056, 0.125, 0.052),
    (-0.035, 0.135, 0.115, 0.052),
    (-0.005, 0.250, 0.085, 0.052),
    (0.000, 0.360, 0.090, 0.052),
    (0.000, 0.440, 0.130, 0.052),
)
#: Where the bones begin, in metres from the tip of the tail, as the skin lies along the body.
ORIGINS = {
    "tail": 0.20,
    "tail.3": 0.38,
    "tail.2": 0.55,
    "tail.1": 0.72,
    "root": 0.82,
    "body.1": 0.92,
    "body.2": 1.06,
    "body.3": 1.20,
    "body.4": 1.34,
    "body.5": 1.48,
    "body.6": 1.62,
    "head": 1.76,
}
HEAD = np.array([0.0, 0.475, 0.180])


def build() -> PuppetFile:
    """The snake."""
    parents = {"root": "", "head": "body.6", "tail": "tail.3", "body.1": "root", "tail.1": "root"}
    for chain, count in (("body", 6), ("tail", 3)):
        parents |= {f"{chain}.{k}": f"{chain}.{k - 1}" for k in range(2, count + 1)}
    order = ["root", *(f"body.{k}" for k in range(1, 7)), "head"]
    order += [*(f"tail.{k}" for k in range(1, 4)), "tail"]
    puppet = PuppetFile("snake", {bone: (parents[bone], _at(ORIGINS[bone])) for bone in order})
    _skin(puppet)
    _tail_tip(puppet)
    _face(puppet)
    return puppet


@cache
def trunk() -> Limb:
    """The body from the tip of the tail to the head."""
    course = np.array(COURSE)
    joints = [at for bone, at in ORIGINS.items() if bone != "root"]
    return limb(
        course[:, :3],
        course[:, 3].tolist(),
        tuple(ORIGINS),
        joints=joints,
        soft=0.05,
        count=64,
    )


def body() -> Blend:
    """All of the snake that is one skin."""
    skull = lump(HEAD + (0.0, 0.012, 0.000), (0.096, 0.074, 0.094), "head", melt=0.05)
    jaw = lump(HEAD + (0.0, -0.016, 0.068), (0.078, 0.050, 0.082), "head", melt=0.05)
    lid = lump(HEAD + (0.054, 0.059, 0.034), 0.047, "head", melt=0.03)
    return Blend((trunk(), skull, jaw, lid, lid.mirrored()), floor=True)


def _at(passed: float) -> tuple[float, float, float]:
    """The place in the body, metres from the tip of its tail."""
    path = trunk().path
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    x, y, z = (float(np.interp(passed, length, column)) for column in path.T)
    return (x, y, z)


def _passed(surface: Surface) -> Floats:
    return trunk().nearest(surface.positions)[1]


def _belly(surface: Surface) -> Floats:
    """How far the skin looks away from the back: 1 on the midline of the belly."""
    raised = smoothstep(_passed(surface), 1.26, 1.52)[:, None]
    below = (1.0 - raised) * (0.0, -1.0, 0.0) + raised * (0.0, -0.45, 0.90)
    below /= np.linalg.norm(below, axis=1, keepdims=True)
    return np.asarray((surface.normals * below).sum(axis=1))


def _skin(puppet: PuppetFile) -> None:
    snake = body()
    skin = snake.skin(0.0208)
    behind = _passed(skin) < 1.74
    # The chin is belly too, up to the mouth.
    x, y, z = skin.positions.T
    chin = 0.462 + 0.10 * (x / 0.08) ** 2 - y - 2.2 * np.maximum(0.155 - z, 0.0)
    under = np.where(behind, _belly(skin) - 0.42, 8.0 * chin)
    belly, back = skin.cut(under)
    # Plates under the throat: each line is cut twice, so that it is straight on any triangles.
    for at in np.arange(1.06, 1.74, 0.045):
        before, belly = belly.cut(at - _passed(belly))
        line, belly = belly.cut(at + 0.006 - _passed(belly))
        puppet.add(before, YELLOW, snake.weights)
        puppet.add(line, AMBER, snake.weights)
    puppet.add(belly, YELLOW, snake.weights)
    # Spots along the back.
    along = _passed(back)
    off = ((along / 0.125) % 1.0 - 0.5) * 0.125
    spot = 1.0 - (off / 0.043) ** 2 - 2.6 * (1.0 + _belly(back))
    spot = np.where((along > 0.13) & (along < 1.70), spot, -1.0)
    spots, plain = back.cut(spot)
    puppet.add(spots, FOREST, snake.weights)
    puppet.add(plain, GREEN, snake.weights)


def _tail_tip(puppet: PuppetFile) -> None:
    """A dark point over the end of the tail, which is too thin for the skin's own triangles."""
    tapering = [
        (0.0295, 0.000),
        (0.0300, 0.020),
        (0.0285, 0.048),
        (0.0230, 0.076),
        (0.0150, 0.102),
        (0.0070, 0.122),
        (0.0000, 0.130),
    ]
    profile = [(0.024, 0.0), *((max(float(r), 0.0), float(h)) for r, h in spline(tapering, 12))]
    start, end = np.array(_at(0.06)), np.array(_at(0.0))
    puppet.add(turned(profile, origin=start, axis=end - start, sides=16), FOREST, "tail")


def _face(puppet: PuppetFile) -> None:
    snake = body()
    for side in (-1.0, 1.0):
        gaze = np.array([side * 0.22, 0.02, 0.97])
        gaze /= np.linalg.norm(gaze)
        centre = HEAD + (side * 0.054, 0.058, 0.052)
        eye(puppet, "head", centre, 0.044, gaze, IRIS, wide=(50.0, 36.0))
        nostril = HEAD + np.array(
            [(side * x, y, 0.4) for x, y in ((0.017, 0.008), (0.021, 0.012), (0.025, 0.010))]
        )
        line = snake.seen_from(nostril, (0, 0, -1))
        puppet.add(stroke(line, 0.010, count=6), DARK, "head")
        # Each half of the smile runs from the middle round to the cheek.
        angle = np.radians(np.array([0.0, 22.0, 45.0, 66.0]))
        high = np.array([-0.030, -0.027, -0.014, 0.008])
        out = np.stack([side * np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
        start = HEAD + (0.0, 0.0, 0.055) + 0.25 * out + np.outer(high, (0.0, 1.0, 0.0))
        puppet.add(stroke(snake.seen_from(start, -out), 0.009, up=(0, 1, 0)), DARK, "head")
    fork = HEAD + (0.0, -0.030, 0.140)
    stem = [fork, fork + (0.0, -0.008, 0.032), fork + (0.0, -0.034, 0.054)]
    puppet.add(stroke(stem, 0.014, up=(1, 0, 0), count=8), TONGUE, "head")
    for side in (-1.0, 1.0):
        tip = stem[2] + np.array(
            [(0.0, 0.010, -0.006), (side * 0.006, -0.006, 0.004), (side * 0.022, -0.024, 0.013)]
        )
        puppet.add(stroke(tip, 0.011, up=(0, 0, 1), count=8), TONGUE, "head")
