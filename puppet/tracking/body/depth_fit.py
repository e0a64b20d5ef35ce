"""How far away and how large a performer is, as depth says; and whether depth is of them at all.

A camera that is set up wrongly, or a sensor that is stuck, gives depth that has nothing to do with
what colour shows. So depth counts only while most of what it says of a body agrees with the body's
shape; what does not is as good as no depth.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from puppet.kernel import Floats

#: Visibility from which depth is looked up at a landmark.
VISIBLE: Final = 0.5
#: Metres by which depth may differ from the body's shape to agree with it; the share of the seen
#: landmarks for which it has to; and the half-life of that share, s.
AGREES: Final = 0.25
AGREEMENT: Final = 0.5
HALF_LIFE: Final = 0.2
#: The share from which one image alone is believed, and the performer's size learnt from it.
SURE: Final = 0.65
#: How many times smaller or larger than the network's idea of a person somebody can be.
SMALLEST, LARGEST = 0.4, 1.7
#: Seconds over which a performer's size is averaged, and the longest step that counts as one.
SIZE_MEMORY: Final = 3.0
LONGEST_STEP: Final = 0.1

_TRUNK: Final = (11, 12, 23, 24)


class DepthFit:
    """What depth says of one performer, frame after frame."""

    def __init__(self) -> None:
        #: How many times larger the performer is than the network takes them for; 1 until depth
        #: has said something. It is theirs, and stays when depth is gone.
        self.size = 1.0
        self._sized = 0.0
        self._agreement: float | None = None
        self._time = 0.0

    def away(
        self, measured: Floats, z: Floats, distance: float, visibility: Floats, time: float
    ) -> float | None:
        """Metres to the hips, and learn the performer's size; None if depth is not to be believed.

        measured: (33,) metres; NaN where not known. z: (33,) metres behind the hips, in the
        network's size, and distance to them at which the body looks as it does. time: capture, s.
        """
        step = min(max(time - self._time, 0.0), LONGEST_STEP)
        self._time = time
        seen = visibility > VISIBLE
        known = seen & np.isfinite(measured)
        trunk = [index for index in _TRUNK if known[index]]
        if len(trunk) < 2:
            return None
        # What is seen under the same angle is as much larger as it is farther away.
        ratio = float(np.median(measured[trunk] / (z[trunk] + distance)))
        plausible = SMALLEST <= ratio <= LARGEST
        shape = measured[known] - ratio * z[known]
        shape -= np.median(measured[trunk] - ratio * z[trunk])
        share = float((np.abs(shape) < AGREES).sum()) / float(seen.sum()) if plausible else 0.0
        if self._agreement is None:
            self._agreement = share if share >= SURE else 0.0
        self._agreement += (1.0 - 0.5 ** (step / HALF_LIFE)) * (share - self._agreement)
        if not plausible or self._agreement < AGREEMENT:
            return None
        if share >= SURE:
            # The mean of all that was seen at first; later, of the last while.
            self._sized = min(self._sized + max(step, 1e-3), SIZE_MEMORY)
            self.size += max(step, 1e-3) / self._sized * (ratio - self.size)
        if self._sized <= 0.0:
            return None
        return float(np.median(measured[trunk] - self.size * z[trunk]))
