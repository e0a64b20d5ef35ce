"""Fans: thin blades of rays or feathers side by side, for fins, wings, tails and webbed feet."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from cast.surface import Floats, Surface, edge_distance, sheet


def fan(
    root: Callable[[Floats], Floats],
    reach: Callable[[Floats], Floats],
    *,
    thickness: float,
    rays: int,
    rows: int = 8,
    columns: int = 25,
    ripple: float = 0.0,
    scallop: float = 0.035,
) -> tuple[Surface, Floats]:
    """A fin or a wing. root, reach: across (V,) in 0..1 to where a ray begins, and its way (V, 3).

    rays: how many rays or feathers lie side by side. ripple: metres by which the outer edge waves
    to either side. scallop: how much shorter it is between rays, as a part of its reach.

    Returns the fan, and metres from each of its vertices to the outer edge. Its parameters run
    from root to edge and across; the first half of its vertices are the face that `across x reach`
    points out of.
    """
    # A last row close to the edge, so that the rim is round and the faces stay flat.
    v = np.concatenate([[0.0], np.linspace(0.03, 0.97, columns - 2), [1.0]])
    u = np.append(np.linspace(0.0, 0.955, rows - 1), 1.0)[:, None, None]
    begin, way = root(v), reach(v)
    notch = 1.0 - scallop * (1.0 - np.abs(np.sin(rays * np.pi * v)))[:, None]
    middle = begin + u * way * notch
    side = np.cross(np.gradient(begin + way, axis=0), way)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    middle = middle + side * (ripple * np.sin(rays * np.pi * v))[:, None] * u**2
    swell = 0.72 + 0.28 * np.abs(np.sin(rays * np.pi * v))
    blade = sheet(middle, thickness * (1.0 - 0.55 * u[..., 0]) * swell, rim=0.014)
    outline = np.concatenate([middle[2:, 0], middle[-1], middle[2:, -1]])
    dense = np.concatenate([np.linspace(a, b, 4) for a, b in pairwise(outline)])
    return blade, edge_distance(blade, dense)
