"""The lamp: a balanced-arm desk lamp in profile, with springs, a bell shade and a glowing bulb.

1.1 m tall. Every part is rigid and follows one bone. All joints turn about z, so that an arm raised
sideways by the performer bends the lamp in the plane that the audience sees.
"""

from __future__ import annotations

import numpy as np

from cast.hardware import plate, rod, spring, stadium
from cast.puppet_glb import Paint, PuppetFile
from cast.surface import Floats, Surface, ball, merged, spline, turned

ENAMEL = Paint("enamel", "#1f9aa3", 0.32)
CREAM = Paint("cream", "#ffe9bd", 0.5, glow=0.30)
STEEL = Paint("steel", "#c9ced3", 0.28, 0.85)
BRASS = Paint("brass", "#e8b04a", 0.3, 0.6)
RUBBER = Paint("rubber", "#2b2f36", 0.8)
BULB = Paint("bulb", "#ffcf5e", 0.3, glow=1.0)
BUTTON = Paint("button", "#f2604c", 0.35)

Z = np.array([0.0, 0.0, 1.0])
LOWER = np.array([np.sin(np.radians(35.0)), np.cos(np.radians(35.0)), 0.0])
UPPER = np.array([-np.cos(np.radians(25.0)), np.sin(np.radians(25.0)), 0.0])
FOOT = np.array([0.0, 0.135, 0.0])
ELBOW = FOOT + 0.63 * LOWER
WRIST = ELBOW + np.array([-0.030, 0.082, 0.0])
NECK = WRIST + 0.67 * UPPER
#: Where the shade points: down and outwards, and a little to the audience, who see it glow.
SHINE = np.array([-0.42, -0.84, 0.34]) / np.linalg.norm((-0.42, -0.84, 0.34))


def build() -> PuppetFile:
    """The lamp."""
    puppet = PuppetFile(
        "lamp",
        {
            "base": ("", (0.0, 0.0, 0.0)),
            "lower_arm": ("base", _xyz(FOOT)),
            "elbow": ("lower_arm", _xyz(ELBOW)),
            "upper_arm": ("elbow", _xyz(WRIST)),
            "shade": ("upper_arm", _xyz(NECK)),
        },
    )
    _base(puppet)
    _arm(puppet, "lower_arm", FOOT, ELBOW, gap=0.027, coils=((0.10, 0.56),))
    _elbow(puppet)
    _arm(puppet, "upper_arm", WRIST, NECK, gap=0.023, coils=((0.07, 0.40),))
    _shade(puppet)
    return puppet


def _xyz(point: Floats) -> tuple[float, float, float]:
    return (float(point[0]), float(point[1]), float(point[2]))


def _screw(centre: Floats, half: float, radius: float) -> tuple[Surface, Surface]:
    """A bolt through a joint, along z: the bolt, and a domed cap at each end."""
    bolt = rod(centre - half * Z, centre + half * Z, 0.55 * radius, sides=8)
    caps = []
    for side in (-1.0, 1.0):
        dome = [(radius, 0.0), (radius, 0.006), (0.8 * radius, 0.0115)]
        caps.append(
            turned(
                [(0.0, 0.0), *dome, (0.0, 0.0135)],
                origin=centre + side * half * Z,
                axis=(0, 0, side),
                sides=10,
            )
        )
    return bolt, merged(caps)


def _base(puppet: PuppetFile) -> None:
    felt = turned([(0.0, 0.0), (0.176, 0.0), (0.180, 0.004), (0.180, 0.010)], sides=22)
    puppet.add(felt, RUBBER, "base")
    dome = spline(
        [
            (0.194, 0.010),
            (0.198, 0.022),
            (0.190, 0.036),
            (0.150, 0.050),
            (0.088, 0.060),
            (0.052, 0.072),
            (0.040, 0.092),
        ],
        9,
    )
    profile = [(0.0, 0.010), *((float(r), float(y)) for r, y in dome), (0.034, 0.096), (0.0, 0.097)]
    puppet.add(turned(profile, sides=24), ENAMEL, "base")
    puppet.add(turned(_ring(0.0425, 0.0065, 0.088), sides=16), BRASS, "base")
    for z in (-0.030, 0.030):
        cheek = plate(stadium((0.0, 0.088), FOOT[:2], 0.030, 0.030), 0.009)
        puppet.add(cheek.moved((0.0, 0.0, z)), STEEL, "base")
    bolt, caps = _screw(FOOT, 0.0345, 0.019)
    puppet.add(bolt, STEEL, "base")
    puppet.add(caps, BRASS, "base")
    puppet.add(
        turned(_ring(0.026, 0.005, 0.0), origin=(0.0, 0.0475, 0.138), axis=_tilt(), sides=16),
        BRASS,
        "base",
    )
    puppet.add(ball((0.0, 0.049, 0.1385), (0.021, 0.015, 0.021), rings=5, sides=12), BUTTON, "base")


def _tilt() -> tuple[float, float, float]:
    """Square to the base where its button is."""
    return (0.0, 1.0, 0.22)


def _ring(radius: float, thick: float, height: float) -> list[tuple[float, float]]:
    """The profile of a ring of round stock."""
    angle = np.linspace(-np.pi, np.pi, 6)
    return [(radius + thick * float(np.cos(a)), height + thick * float(np.sin(a))) for a in angle]


def _arm(
    puppet: PuppetFile,
    bone: str,
    start: Floats,
    end: Floats,
    *,
    gap: float,
    coils: tuple[tuple[float, float], ...],
) -> None:
    """Two parallel rods, joined at both ends, with springs between them."""
    way = end - start
    side = np.array([-way[1], way[0], 0.0]) / np.linalg.norm(way)
    inset = 0.045 * way / np.linalg.norm(way)
    rods = [
        rod(start + sign * gap * side + inset, end + sign * gap * side - inset, 0.0105)
        for sign in (-1.0, 1.0)
    ]
    puppet.add(merged(rods), ENAMEL, bone)
    ends = []
    for place in (start, end):
        other = place + (0.055 if place is start else -0.055) * way / np.linalg.norm(way)
        ends.append(plate(stadium(other[:2], place[:2], gap + 0.013, 0.026), 0.026))
    puppet.add(merged(ends), STEEL, bone)
    for low, high in coils:
        hooks = [start + low * way, start + high * way]
        for z in (-0.021, 0.021):
            puppet.add(
                spring(hooks[0] + z * Z, hooks[1] + z * Z, 0.018, 0.0044, 7, per_turn=6),
                STEEL,
                bone,
            )
        pins = [rod(hook - 0.031 * Z, hook + 0.031 * Z, 0.0075, sides=8) for hook in hooks]
        bars = [
            rod(hook - 1.05 * gap * side, hook + 1.05 * gap * side, 0.0065, sides=8)
            for hook in hooks[1:]
        ]
        puppet.add(merged([*pins, *bars]), BRASS, bone)


def _elbow(puppet: PuppetFile) -> None:
    outline = stadium(ELBOW[:2], WRIST[:2], 0.036, 0.034)
    plates = [plate(outline, 0.010).moved((0.0, 0.0, z)) for z in (-0.0275, 0.0275)]
    puppet.add(merged(plates), ENAMEL, "elbow")
    for joint in (ELBOW, WRIST):
        bolt, caps = _screw(joint, 0.0325, 0.019)
        puppet.add(bolt, STEEL, "elbow")
        puppet.add(caps, BRASS, "elbow")


def _shade(puppet: PuppetFile) -> None:
    cheek = NECK + 0.052 * SHINE
    for z in (-0.0195, 0.0195):
        fork = plate(stadium(cheek[:2], NECK[:2], 0.020, 0.024), 0.009)
        puppet.add(fork.moved((0.0, 0.0, z)), STEEL, "shade")
    bolt, caps = _screw(NECK, 0.025, 0.017)
    puppet.add(bolt, STEEL, "shade")
    puppet.add(caps, BRASS, "shade")

    bell = spline(
        [
            (0.026, 0.036),
            (0.050, 0.048),
            (0.062, 0.075),
            (0.066, 0.125),
            (0.078, 0.165),
            (0.118, 0.222),
            (0.166, 0.292),
        ],
        11,
    )
    bell_profile = [(0.0, 0.034), *((float(r), float(h)) for r, h in bell)]
    outside = turned(bell_profile, origin=NECK, axis=SHINE, sides=22)
    puppet.add(outside, ENAMEL, "shade")
    inner = [(r - 0.006, h + 0.004) for r, h in bell_profile[4:]]
    # From the mouth inwards, so that it faces the bulb.
    inside = turned([*inner[::-1], (0.0, inner[0][1])], origin=NECK, axis=SHINE, sides=22)
    puppet.add(inside, CREAM, "shade")
    rim = turned(_ring(0.1625, 0.006, 0.2945), origin=NECK, axis=SHINE, sides=22)
    puppet.add(rim, BRASS, "shade")
    for height in (0.086, 0.110):
        ring = turned(_ring(0.0640, 0.0042, height), origin=NECK, axis=SHINE, sides=16)
        puppet.add(ring, STEEL, "shade")
    puppet.add(
        turned(
            [(0.0, 0.15), (0.030, 0.15), (0.030, 0.205), (0.0, 0.205)],
            origin=NECK,
            axis=SHINE,
            sides=14,
        ),
        BRASS,
        "shade",
    )
    glass = spline(
        [(0.026, 0.195), (0.034, 0.222), (0.062, 0.268), (0.048, 0.318), (0.0, 0.336)], 7
    )
    puppet.add(
        turned([(float(r), float(h)) for r, h in glass], origin=NECK, axis=SHINE, sides=14),
        BULB,
        "shade",
    )
