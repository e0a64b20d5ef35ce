"""One clock out of several cameras' clocks, and which camera's moments are answered.

The fused clock is the leading camera's own, shifted by a constant; so the spacing of its moments
stays what it was, and with one camera nothing is changed at all. Others are placed on it by what is
known of their clocks. A moment of the lead is answered at once and waits for nobody.
"""

from __future__ import annotations

from typing import Final

from puppet.tracking.fusion.clock import CameraClock, Heard

#: Another camera leads if the lead is silent for so many of its intervals, and so many seconds.
SILENT_INTERVALS: Final = 2.5
SILENT_SECONDS: Final = 0.05
#: ... or if the other's moments are so much fresher, in interval and lag, after so many of them.
FRESHER: Final = 0.75
KNOWN: Final = 15


class Lead:
    """Who leads, and where each moment lies on the fused clock."""

    def __init__(self) -> None:
        self._clocks: dict[str, CameraClock] = {}
        self._lead: str | None = None
        #: Fused minus the lead's own time, seconds; constant while it leads.
        self._shift = 0.0

    @property
    def camera(self) -> str | None:
        """The camera that leads."""
        return self._lead

    @property
    def alone(self) -> bool:
        """Whether one camera was ever heard."""
        return len(self._clocks) == 1

    def hear(self, camera: str, time: float, arrived: float) -> tuple[Heard, float]:
        """What a moment of a camera is, and its time on the fused clock. Seconds."""
        clock = self._clocks.setdefault(camera, CameraClock())
        leads = camera == self._lead
        before = self._offset(clock) if leads else 0.0
        heard = clock.hear(time, arrived)
        if heard is Heard.LATE:
            return heard, time
        clock.mean_lag(arrived - time - self._offset(clock))
        if heard is Heard.RESTARTED or (heard is Heard.JUMPED and not self.alone):
            # Where its clock has jumped the fused clock goes on as the stage's does.
            self._shift += self._offset(clock) - before if leads else 0.0
        if self._lead is None:
            self._lead = camera
        return heard, time + self._shift_of(clock)

    def answers(self, camera: str, arrived: float) -> bool:
        """Whether the moment of a camera that was just heard is to be answered."""
        if camera != self._lead and self._takes_over(camera, arrived):
            self._shift = self._shift_of(self._clocks[camera])
            self._lead = camera
        return camera == self._lead

    def _takes_over(self, camera: str, arrived: float) -> bool:
        assert self._lead is not None
        lead, other = self._clocks[self._lead], self._clocks[camera]
        if arrived - lead.heard > max(SILENT_INTERVALS * lead.interval, SILENT_SECONDS):
            return True
        known = lead.count >= KNOWN and other.count >= KNOWN
        return known and other.interval + other.lag < FRESHER * (lead.interval + lead.lag)

    def _offset(self, clock: CameraClock) -> float:
        """The stage's clock minus a camera's, as far as it can be told.

        Of a foreign clock only arrival is known. Its moments are taken to be as old by then as
        those of the cameras on this machine are, where there are any.
        """
        if clock.shared:
            return 0.0
        ages = [one.delay for one in self._clocks.values() if one.count and one.shared]
        return clock.delay - min(ages, default=0.0)

    def _shift_of(self, clock: CameraClock) -> float:
        lead = self._clocks[self._lead] if self._lead is not None else clock
        if clock is lead:
            return self._shift
        return self._offset(clock) - self._offset(lead) + self._shift
