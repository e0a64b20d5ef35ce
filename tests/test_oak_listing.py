"""Which OAK is meant, and what is said if it cannot be had."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from puppet.errors import UnavailableError
from puppet.tracking.cameras.oak_listing import OakFound, OakMissingError, choose_oak, found_oak
from tests.oak_host import device_info

FIRST, SECOND = "14442C10D13EABCE00", "18443010C1A1B40F00"


def two() -> list[OakFound]:
    return [
        found_oak(device_info(FIRST, "1.2")),
        found_oak(device_info(SECOND, "192.168.1.7", "GATE", protocol="TCP_IP", platform="RVC4")),
    ]


def test_a_device_is_told_by_its_id_its_address_and_its_kind() -> None:
    usb, network = two()
    assert (usb.id, usb.name, usb.platform, usb.link, usb.state) == (
        FIRST,
        "1.2",
        "RVC2",
        "USB",
        "free",
    )
    assert (network.platform, network.link, network.state) == ("RVC4", "network", "free")


@pytest.mark.parametrize(
    ("state", "status", "expected"),
    [
        ("UNBOOTED", "SUCCESS", "free"),
        ("BOOTLOADER", "SUCCESS", "free"),
        ("GATE", "SUCCESS", "free"),
        ("BOOTED", "SUCCESS", "in use"),
        ("GATE_BOOTED", "SUCCESS", "in use"),
        ("UNBOOTED", "DEVICE_ALREADY_IN_USE", "in use"),
        ("UNBOOTED", "INSUFFICIENT_PERMISSIONS", "no permission"),
        ("UNBOOTED", "ERROR", "broken"),
    ],
)
def test_its_state_says_whether_it_can_be_opened(state: str, status: str, expected: str) -> None:
    assert found_oak(device_info(state=state, status=status)).state == expected


@pytest.mark.parametrize("wanted", [SECOND, SECOND.lower(), "192.168.1.7"])
def test_it_is_chosen_by_id_or_by_address(wanted: str) -> None:
    assert choose_oak(wanted, two()).id == SECOND


def test_without_a_wish_the_first_free_one_is_taken() -> None:
    assert choose_oak("", two()).id == FIRST
    used = found_oak(device_info(FIRST, state="BOOTED"))
    assert choose_oak("", [used, two()[1]]).id == SECOND


def test_a_wrong_id_lists_what_is_there() -> None:
    with pytest.raises(OakMissingError) as caught:
        choose_oak("1944", two())
    text = str(caught.value)
    assert "oak:1944: this OAK is not there" in text
    assert FIRST in text
    assert SECOND in text


@pytest.mark.parametrize(
    ("state", "status", "said"),
    [
        ("BOOTED", "SUCCESS", "used by another program"),
        ("UNBOOTED", "INSUFFICIENT_PERMISSIONS", 'ATTRS{idVendor}=="03e7"'),
        ("UNBOOTED", "ERROR", "does not answer as it should"),
    ],
)
@pytest.mark.parametrize("wanted", ["", FIRST])
def test_one_that_cannot_be_opened_says_why(
    wanted: str, state: str, status: str, said: str
) -> None:
    with pytest.raises(UnavailableError) as caught:
        choose_oak(wanted, [found_oak(device_info(FIRST, state=state, status=status))])
    assert said in str(caught.value)
    assert FIRST in str(caught.value)
    assert not isinstance(caught.value, OakMissingError)


def test_no_device_at_all_says_where_to_look() -> None:
    with pytest.raises(OakMissingError) as caught:
        choose_oak("", [])
    assert "there is no OAK camera" in str(caught.value)
    assert caught.value.hint


def test_a_machine_without_usb_has_no_devices() -> None:
    # depthai raises there if nothing but USB is asked for.
    code = "from puppet.tracking.cameras.oak_listing import list_oaks\nprint(list_oaks())"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).resolve().parents[1],
        env={"DEPTHAI_PROTOCOL": "usb", "PATH": ""},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.startswith("(")
