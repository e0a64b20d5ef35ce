"""Which OAK cameras there are, and the one that is meant."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal

from puppet.errors import UnavailableError
from puppet.tracking.cameras.quiet_depthai import dai

OakState = Literal["free", "in use", "no permission", "broken"]

USB_BUS: Final = Path("/dev/bus/usb")
UDEV_RULE: Final = 'SUBSYSTEM=="usb", ATTRS{idVendor}=="03e7", MODE="0666"'
UDEV_FILE: Final = Path("/etc/udev/rules.d/80-movidius.rules")

_PLATFORMS: Final = {
    dai.XLinkPlatform.X_LINK_MYRIAD_2: "Myriad 2",
    dai.XLinkPlatform.X_LINK_MYRIAD_X: "RVC2",
    dai.XLinkPlatform.X_LINK_RVC3: "RVC3",
    dai.XLinkPlatform.X_LINK_RVC4: "RVC4",
}
#: Devices that run already; who else could have started them but another program?
_RUNNING: Final = {
    dai.XLinkDeviceState.X_LINK_BOOTED,
    dai.XLinkDeviceState.X_LINK_BOOTED_NON_EXCLUSIVE,
    dai.XLinkDeviceState.X_LINK_GATE_BOOTED,
}
_OK: Final = {
    dai.XLinkError_t.X_LINK_SUCCESS,
    # Left behind by a program that let go of it the hard way; opening it starts it anew.
    dai.XLinkError_t.X_LINK_COMMUNICATION_NOT_OPEN,
}


class OakMissingError(UnavailableError):
    """No such OAK is plugged in."""


@dataclass(frozen=True, slots=True)
class OakFound:
    """An OAK that was found.

    id: its serial number, which stays. name: its address, an USB port ("1.2") or an IP. platform:
    "RVC2", "RVC4". link: "USB", "network". state: whether it can be opened.
    """

    id: str
    name: str
    platform: str
    link: str
    state: OakState
    info: dai.DeviceInfo = field(repr=False, compare=False)

    def __str__(self) -> str:
        return (
            f"oak:{self.id or self.name} ({self.platform}, {self.link} {self.name}, {self.state})"
        )


def list_oaks() -> tuple[OakFound, ...]:
    """Every OAK that is plugged in or on the local network, in use or not, in the order of their
    ids. Takes half a second."""
    try:
        infos = dai.Device.getAllConnectedDevices()
    except RuntimeError:  # there is no USB, and nothing else was asked for
        infos = []
    return tuple(sorted(map(found_oak, infos), key=lambda oak: (oak.id, oak.name)))


def found_oak(info: dai.DeviceInfo) -> OakFound:
    """What depthai says of a device, in our words."""
    usb = info.protocol == dai.XLinkProtocol.X_LINK_USB_VSC
    return OakFound(
        info.deviceId,
        info.name,
        _PLATFORMS.get(info.platform, "unknown"),
        "USB" if usb else "network",
        _state_of(info),
        info,
    )


def choose_oak(wanted: str, found: Sequence[OakFound]) -> OakFound:
    """The OAK with that id or name; with an empty text the first that is free.

    Raises UnavailableError, which lists what is there, if it is missing, in use or not allowed.
    """
    where = f"oak:{wanted}"
    if not found:
        raise OakMissingError(
            "there is no OAK camera",
            where=where,
            found="none on USB, and none on the local network",
            hint=_where_to_look(),
        )
    fitting = [
        oak for oak in found if not wanted or wanted.lower() in (oak.id.lower(), oak.name.lower())
    ]
    for oak in fitting:
        if oak.state == "free":
            return oak
    listed = "; ".join(map(str, found))
    if not fitting:
        raise OakMissingError(
            "this OAK is not there",
            where=where,
            found=listed,
            hint="plug it in, or give the id of one that is there; `oak:` takes the first",
        )
    raise trouble_of(fitting[0], where=where, listed=listed)


def trouble_of(oak: OakFound, *, where: str, listed: str) -> UnavailableError:
    """Why an OAK that is there cannot be opened."""
    match oak.state:
        case "in use":
            return UnavailableError(
                "this OAK is used by another program",
                where=where,
                found=listed,
                hint="close the other program; if it crashed, the device is free in ten seconds",
            )
        case "no permission":
            return UnavailableError(
                "this user may not use this OAK",
                where=where,
                found=listed,
                hint=f"put the line {UDEV_RULE} into {UDEV_FILE}, run `sudo udevadm control "
                "--reload-rules` and `sudo udevadm trigger`, and plug it in anew",
            )
        case _:
            return UnavailableError(
                "this OAK does not answer as it should",
                where=where,
                found=listed,
                hint="unplug it, wait for five seconds, plug it in again; try another cable",
            )


def _state_of(info: dai.DeviceInfo) -> OakState:
    if info.status == dai.XLinkError_t.X_LINK_INSUFFICIENT_PERMISSIONS:
        return "no permission"
    if info.status == dai.XLinkError_t.X_LINK_DEVICE_ALREADY_IN_USE or info.state in _RUNNING:
        return "in use"
    return "free" if info.status in _OK else "broken"


def _where_to_look() -> str:
    if sys.platform == "linux" and not USB_BUS.exists():
        return (
            f"this machine shows no USB ({USB_BUS} is missing): a container must be given it; "
            "`rehearsal`, takes and webcams need no OAK"
        )
    return (
        "plug it in, at a USB 3 port, and see that its lamp is on; `puppet cameras` lists what is "
        "there; `rehearsal`, takes and webcams need no OAK"
    )
