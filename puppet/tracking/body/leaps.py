"""A joint that leaps further than a body can is not believed.

Where it was on the body it stays, and is called inferred, until time has made the leap possible:
neither may it be faster than a body, nor get there from rest, or from how it moved, by more than
muscles can do.
Along the line of sight the network's guesses leap more often than people do, and a joint that is
seen keeps its place in the image meanwhile.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from puppet.kernel import Floats
from puppet.skeleton import Joint, TrackingState

#: Metres a second on the body, seen from its hips: the fastest kicks and punches of the recorded
#: martial artists stay below it. And metres of noise.
FASTEST: Final = 12.0
NOISE: Final = 0.08
#: And the hardest that a hand is thrown or stopped, metres a second squared.
HARDEST: Final = 400.0
#: Half-life of the velocity that a joint is known to have, s.
VELOCITY_HALF_LIFE: Final = 0.02
#: The same along the line of sight.
FASTEST_DEEP: Final = 5.0
NOISE_DEEP: Final = 0.06
#: After so long anything is possible, s.
GAP: Final = 0.5


class Leaps:
    """One performer's joints, frame after frame."""

    def __init__(self) -> None:
        self._last: Floats | None = None
        self._believed = np.zeros(0)
        self._velocity = np.zeros(0)
        self._time = 0.0

    def held_back(
        self, positions: Floats, states: NDArray[np.uint8], time: float
    ) -> tuple[Floats, NDArray[np.uint8]]:
        """Joints (20, 3), metres from the lens, z from the scene to the camera, and states (20,),
        without leaps. time: capture time, s."""
        on_body = positions - positions[Joint.HIP_CENTER]
        last = self._last
        if last is None or not 0.0 <= time - self._time <= GAP:
            self._believed = np.full(len(positions), time)
            self._velocity = np.zeros_like(positions)
            self._last, self._time = on_body, time
            return positions, states
        since = time - self._believed
        way = on_body - last
        going_on = way - since[:, None] * self._velocity
        least = np.minimum(_across(way), _across(going_on))
        leapt = least > NOISE + np.minimum(FASTEST * since, 0.5 * HARDEST * since * since)
        leapt &= states > TrackingState.NOT_TRACKED
        kept = positions.copy()
        most = NOISE_DEEP + FASTEST_DEEP * since
        deep = np.clip(way[:, 2], -most, most)
        z = positions[Joint.HIP_CENTER, 2] + last[:, 2] + deep
        ahead = positions[:, 2] < -0.1
        factor = np.where(ahead, np.minimum(z, -0.1) / np.where(ahead, positions[:, 2], 1.0), 1.0)
        kept *= factor[:, None]
        kept[leapt] = positions[Joint.HIP_CENTER] + last[leapt]
        self._believed = np.where(leapt, self._believed, time)
        now = kept - kept[Joint.HIP_CENTER]
        step = time - self._time
        if step > 0.0:
            keep = 0.5 ** (step / VELOCITY_HALF_LIFE)
            self._velocity = keep * self._velocity + (1.0 - keep) / step * (now - last)
        self._last, self._time = now, time
        inferred = np.minimum(states, np.uint8(TrackingState.INFERRED))
        return kept, np.where(leapt, inferred, states).astype(np.uint8)


def _across(ways: Floats) -> Floats:
    """(N, 3) -> (N,) metres across the line of sight."""
    return np.asarray(np.hypot(ways[:, 0], ways[:, 1]))
