"""Using what `puppet calibrate` has saved beside a show."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from puppet.formats.calibration_file import calibration_path, read_calibration
from puppet.mapping.stance import Stance
from puppet.tracking.calibration.calibration import calibration_of, stance_in
from puppet.tracking.source import Source
from puppet.tracking.watcher import Watcher


def use_calibration(source: Source, show: Path, warn: Callable[[str], None]) -> bool:
    """Tell a source where its camera stands, before it is gone through. True if that is known.

    warn: called if there is only the calibration of other cameras; it is not used then. A source
    whose skeletons are on the stage already needs none. Raises BadFileError for a file that makes
    no sense.
    """
    if not isinstance(source, Watcher):
        return False
    found, why = calibration_of(read_calibration(calibration_path(show)), source.camera.info)
    if why:
        warn(why)
    source.use(found)
    return found is not None


def saved_stance(show: Path) -> Stance | None:
    """The neutral stance that was captured, on the calibrated stage; None if there is none.

    It means nothing for a source that is not calibrated: its stage is another. Raises BadFileError.
    """
    return stance_in(read_calibration(calibration_path(show)))
