"""One Euro (Casiez 2012): still joints are smoothed, quick ones are let through.

Its cut-off grows with speed; here as half-lives, so that the rate of frames does not matter.
"""

from __future__ import annotations

from puppet.kernel import kernel


@kernel
def blend(half_life: float, dt: float) -> float:
    """The share of the way that is gone in `dt`."""
    return 1.0 - 2.0 ** (-dt / half_life) if half_life > 1e-6 else 1.0


@kernel
def one_euro(
    speed: float, trust: float, smoothing: float, quickness: float, slower: float, dt: float
) -> float:
    """The share of the way to where it is seen that a joint goes in `dt`.

    speed: m/s, smoothed. trust: 0.1..1; little trust makes a joint slow, and deaf to its own speed.
    smoothing: half-life at rest, seconds; quickness: by how much more than once it is divided at
    1 m/s; slower: what it is multiplied by.
    """
    return blend(slower * smoothing / (trust * trust * (1.0 + quickness * speed * trust)), dt)
