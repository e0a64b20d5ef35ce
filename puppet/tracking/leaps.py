"""A joint that leaps further than a body can is not believed.

Where it was on the body it stays, and is called inferred, until time has made the leap possible.
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
NOISE: Final = 0.10
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
            self._last, self._time = on_body, time
            return positions, states
        since = time - self._believed
        way = on_body - last
        leapt = np.linalg.norm(way[:, :2], axis=1) > NOISE + FASTEST * since
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
        self._last, self._time = kept - kept[Joint.HIP_CENTER], time
        inferred = np.minimum(states, np.uint8(TrackingState.INFERRED))
        return kept, np.where(leapt, inferred, states).astype(np.uint8)
