"""Which end of a body is which: legs at one, arms and head at the other.

Everything is taken from the armature's own parts, so it turns, grows and moves with it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.mapping.anatomy import Anatomy, Limb, anatomy


def body_axis(armature: Armature, shape: Anatomy) -> Floats | None:
    """(3,) from the legs' end of the body to the arms' end, at rest; None where nothing says.

    Along the trunk, if limbs hang on it in different places. Where everything hangs on one bone,
    from the pair of limbs that reaches furthest, and so can carry the body, to the next.
    """
    positions = armature.rest[0]
    near, far = _hubs(armature, shape)
    if near != far:
        return np.asarray(
            np.mean([positions[b] for b in far], axis=0)
            - np.mean([positions[b] for b in near], axis=0)
        )
    pairs = _pairs([limb for limb in shape.limbs if limb.side])
    if len(pairs) < 2:
        return None
    (a, b), (c, d) = pairs[:2]
    start, end = (
        (positions[one.bones[0]] + positions[other.bones[0]]) / 2.0
        for one, other in ((a, b), (c, d))
    )
    return np.asarray(end - start) if float(np.linalg.norm(end - start)) > 1e-9 else None


def stands_upright(armature: Armature) -> bool:
    """Whether the body goes up from its legs, as ours does, and not along the ground."""
    axis = body_axis(armature, anatomy(armature))
    return axis is None or cosine(axis, np.array([0.0, 1.0, 0.0])) > 0.5


def forwardness(
    armature: Armature, shape: Anatomy, limbs: Sequence[Limb], axis: Floats | None
) -> list[float]:
    """For each limb where it hangs: 0 at the legs' end of the body, 1 at the arms' end."""
    near, far = _hubs(armature, shape)
    if near != far:
        least, most = armature.depths[near[0]], armature.depths[far[0]]
        return [
            min(max((armature.depths[limb.hub] - least) / (most - least), 0.0), 1.0)
            if limb.hub >= 0
            else 0.5
            for limb in limbs
        ]
    if axis is not None:
        places = [float(armature.rest[0][limb.bones[0]] @ axis) for limb in limbs]
        extent = max(places) - min(places)
        if extent > 1e-9:
            return [(place - min(places)) / extent for place in places]
    # One hub, and one pair at most. A trunk that leads up to it makes it a chest; if it is the
    # root itself, it is a pelvis. Arms and wings spread sideways, legs do not.
    chest = 1.0 if any(armature.parents[hub] >= 0 for hub in near) else 0.0
    return [0.5 * chest + 0.5 * _spread(armature, limb, limbs) for limb in limbs]


def way_of(armature: Armature, limb: Limb) -> Floats:
    """(3,) from where a limb begins to where it ends, at rest."""
    return np.asarray(armature.rest_tips[limb.bones[-1]] - armature.rest[0][limb.bones[0]])


def cosine(a: Floats, b: Floats) -> float:
    """Of the angle between two directions; 0 if either has no length."""
    length = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / length if length > 1e-9 else 0.0


def _hubs(armature: Armature, shape: Anatomy) -> tuple[list[int], list[int]]:
    """The hubs nearest to the root, and those furthest from it; twigs do not make a hub."""
    hubs = sorted({limb.hub for limb in shape.limbs if limb.hub >= 0 and not limb.is_twig})
    if not hubs:
        return [], []
    depths = [int(armature.depths[hub]) for hub in hubs]
    near = [hub for hub, depth in zip(hubs, depths, strict=True) if depth == min(depths)]
    far = [hub for hub, depth in zip(hubs, depths, strict=True) if depth == max(depths)]
    return near, far


def _pairs(limbs: Sequence[Limb]) -> list[tuple[Limb, Limb]]:
    """Left and right limbs that hang together, those that reach furthest first."""
    left = [limb for limb in limbs if limb.side == "L"]
    right = [limb for limb in limbs if limb.side == "R"]
    pairs = []
    for limb in left:
        across = [other for other in right if other.hub == limb.hub]
        if across:
            partner = min(across, key=lambda other: abs(other.reach - limb.reach))
            right.remove(partner)
            pairs.append((limb, partner))
    return pairs


def _spread(armature: Armature, limb: Limb, limbs: Sequence[Limb]) -> float:
    """How far a limb and the one across part: 0 side by side, 1 straight away from each other."""
    across = [other for other in limbs if limb.side and other.side and other.side != limb.side]
    if not across:
        return 0.5
    partner = min(across, key=lambda other: (other.hub != limb.hub, abs(other.reach - limb.reach)))
    return 0.5 - 0.5 * cosine(way_of(armature, limb), way_of(armature, partner))
