"""The only door to depthai: what is imported here neither calls home nor writes files.

Left to itself, depthai reports its use to its maker's servers from the moment it is imported, keeps
what it could not send under the home directory, uploads what is left of a crash, and calibrates
cameras anew behind one's back. It reads these switches when it is imported, so they are set
here, before, whatever they were; everybody else takes ``dai`` from here.

To find cameras on the network, depthai asks all of the local network (UDP, port 11491). That stays;
``DEPTHAI_PROTOCOL=usb`` in the environment stops it.
"""

from __future__ import annotations

import os
from typing import Final

from puppet.errors import UnavailableError

SWITCHES: Final = {
    "DEPTHAI_TELEMETRY": "0",
    "DEPTHAI_DISABLE_CRASHDUMP_COLLECTION": "1",
    "DEPTHAI_CRASHDUMP": "0",
    "DEPTHAI_DISABLE_FEEDBACK": "1",
    "DEPTHAI_DISABLE_STARTUP_NOTIFICATIONS": "1",
    "DEPTHAI_ZOO_INTERNET_CHECK": "0",
    # A calibration that changes by itself would make the stage's calibration wrong.
    "DEPTHAI_AUTOCALIBRATION": "OFF",
}
#: What goes wrong is said by our own errors and states; depthai's log is for those who ask for it.
LEVEL: Final = "DEPTHAI_LEVEL"

os.environ.update(SWITCHES)
os.environ.setdefault(LEVEL, "off")

try:
    import depthai as dai
except ImportError as error:
    raise UnavailableError(
        "an OAK needs depthai, and depthai cannot be loaded",
        found=str(error),
        hint="pip install depthai; webcams, videos and takes work without it",
    ) from error

__all__ = ["SWITCHES", "dai"]
