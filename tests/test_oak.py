"""A camera that is unplugged, hangs, and comes back; real depthai, no device."""

from __future__ import annotations

import threading
import time
from itertools import islice, pairwise

import numpy as np
import pytest

from puppet.errors import UnavailableError
from puppet.oak_config import OakConfig
from puppet.tracking.cameras.camera import Camera, Shot
from puppet.tracking.cameras.oak import OakCamera
from puppet.tracking.cameras.oak_listing import OakFound, OakMissingError, found_oak
from puppet.tracking.cameras.oak_stream import OakStream
from tests.oak_host import Bus, Script, device_info

FIRST, SECOND = "14442C10D13EABCE00", "18443010C1A1B40F00"
QUICK = OakConfig(rate=100.0)


def camera_on(bus: Bus, wanted: str = "", silence: float = 0.5) -> OakCamera:
    return OakCamera(
        wanted,
        QUICK,
        # Looked up at each call, as tests put others in their place.
        lister=lambda: bus.lister(),  # noqa: PLW0108
        opener=lambda oak, config: bus.opener(oak, config),  # noqa: PLW0108
        pauses=(0.01, 0.02, 0.03),
        silence=silence,
    )


def take(camera: Camera, count: int) -> list[Shot]:
    try:
        return list(islice(camera, count))
    finally:
        camera.close()


def assert_grows(shots: list[Shot]) -> None:
    for shot, later in pairwise(shots):
        assert shot.time < later.time
        assert shot.sequence < later.sequence


def noted_waits(camera: OakCamera) -> list[float]:
    """The pauses that the camera makes from here on."""
    waits: list[float] = []
    wait = camera._over.wait

    def noted(timeout: float | None = None) -> bool:
        waits.append(timeout or 0.0)
        return wait(timeout)

    camera._over.wait = noted  # type: ignore[method-assign]
    return waits


def test_shots_have_everything_that_the_device_knows() -> None:
    camera = camera_on(Bus(Script(shots=50)))
    assert camera.info.name == f"oak:{FIRST}"
    assert (camera.info.kind, camera.info.live, camera.info.device) == ("oak", True, FIRST)
    shots = take(camera, 3)
    for shot in shots:
        assert shot.depth is not None
        assert shot.intrinsics is not None
        assert shot.up is not None
        np.testing.assert_allclose(shot.up, (0.0, -1.0, 0.0), atol=1e-6)
    assert_grows(shots)
    assert (camera.trouble, camera.warnings, len(camera)) == ("", (), 0)


def test_without_an_imu_up_is_not_known() -> None:
    (shot,) = take(camera_on(Bus(Script(imu=None))), 1)
    assert shot.up is None


def test_after_it_was_unplugged_it_goes_on_with_the_same_device() -> None:
    bus = Bus(Script(shots=5, then="unplug", first=70), Script(shots=50))
    bus.present.insert(0, found_oak(device_info("00000000000000", "1.1")))
    camera = camera_on(bus, FIRST)
    seen = []
    for shot in camera:
        seen.append(shot)
        if len(bus.opened) >= 2 and shot.colour[0, 0, 0] >= 2:
            break
    camera.close()
    assert set(bus.opened) == {FIRST}
    assert seen[0].colour[0, 0, 0] >= 70
    assert seen[-1].colour[0, 0, 0] < 70
    assert_grows(seen)


def test_the_outage_shows_as_trouble_and_as_a_gap() -> None:
    bus = Bus(Script(shots=5, then="unplug"), Script(shots=50))
    plugged = bus.present
    camera = camera_on(bus)
    troubles: list[str] = []
    seen: list[Shot] = []

    def unplugged() -> list[OakFound]:
        troubles.append(camera.trouble)
        return plugged if len(troubles) > 3 else []

    bus.lister = unplugged  # type: ignore[method-assign]
    for shot in camera:
        seen.append(shot)
        if len(bus.opened) >= 2:
            break
    assert camera.trouble == ""
    camera.close()
    assert "was unplugged" in troubles[0]
    assert all("is not plugged in" in trouble for trouble in troubles[1:])
    assert FIRST in troubles[0]
    before, after = seen[-2:]
    assert after.sequence - before.sequence == pytest.approx(
        (after.time - before.time) * QUICK.rate, abs=1.0
    )
    assert after.sequence - before.sequence > 3


def test_a_device_that_hangs_is_opened_anew() -> None:
    bus = Bus(Script(shots=3, then="hang"), Script(shots=50))
    camera = camera_on(bus)
    seen = []
    for shot in camera:
        seen.append(shot)
        if len(bus.opened) >= 2:
            break
    camera.close()
    assert_grows(seen)


def test_one_that_opens_and_gives_nothing_is_tried_with_growing_pauses() -> None:
    bus = Bus(Script(shots=3), *[Script(shots=0)] * 3, Script(shots=50))
    camera = OakCamera(
        config=QUICK,
        lister=bus.lister,
        opener=bus.opener,
        pauses=(0.01, 0.02, 0.03, 0.04, 0.05),
        silence=0.02,
    )
    waits = noted_waits(camera)
    for _ in camera:
        if len(bus.opened) == 5:
            break
    camera.close()
    assert waits == [0.01, 0.02, 0.03, 0.04]


def test_errors_of_later_openings_are_states() -> None:
    used = UnavailableError("this OAK is used by another program")
    bus = Bus(Script(shots=3, then="unplug"), used, used, Script(shots=50))
    camera = camera_on(bus)
    troubles = []
    opener = bus.opener

    def watched(oak: OakFound, config: OakConfig) -> OakStream:
        troubles.append(camera.trouble)
        return opener(oak, config)

    bus.opener = watched  # type: ignore[method-assign]
    for _ in camera:
        if len(bus.opened) == 4:
            break
    camera.close()
    assert "used by another program" in troubles[1]
    assert camera.trouble == ""


def test_a_first_opening_that_fails_is_an_error() -> None:
    with pytest.raises(UnavailableError, match="broken"):
        camera_on(Bus(UnavailableError("it is broken")))


def test_a_wrong_id_is_an_error_before_anything_is_opened() -> None:
    bus = Bus(Script())
    with pytest.raises(OakMissingError) as caught:
        camera_on(bus, "nonsense")
    assert FIRST in str(caught.value)
    assert bus.opened == []


def test_a_device_in_use_is_an_error_of_its_own() -> None:
    bus = Bus(Script(), present=[found_oak(device_info(state="BOOTED"))])
    with pytest.raises(UnavailableError, match="another program"):
        camera_on(bus)


def test_a_missing_device_is_missed_by_depthai_itself() -> None:
    with pytest.raises(OakMissingError):
        OakCamera("0000")


def test_it_can_be_closed_while_a_shot_is_waited_for() -> None:
    bus = Bus(Script(shots=2))
    camera = camera_on(bus, silence=60.0)
    seen: list[Shot] = []
    thread = threading.Thread(target=lambda: seen.extend(camera))
    thread.start()
    time.sleep(0.2)
    camera.close()
    camera.close()
    thread.join(20.0)
    assert not thread.is_alive()
    assert camera.trouble == ""
    with pytest.raises(Exception, match="closed"):
        bus.streams[0].shot(0.01)


def test_it_can_be_closed_while_the_device_is_looked_for() -> None:
    bus = Bus(Script(shots=2, then="unplug"))
    camera = camera_on(bus)
    missing = threading.Event()

    def nothing() -> list[OakFound]:
        missing.set()
        return []

    bus.lister = nothing  # type: ignore[method-assign]
    thread = threading.Thread(target=lambda: list(camera))
    thread.start()
    assert missing.wait(20.0)
    camera.close()
    thread.join(20.0)
    assert not thread.is_alive()


def test_a_device_that_boots_while_the_camera_is_closed_is_let_go() -> None:
    bus = Bus(Script(shots=2, then="unplug"), Script(shots=50))
    camera = camera_on(bus)
    opener = bus.opener
    booting, go_on = threading.Event(), threading.Event()

    def slow(oak: OakFound, config: OakConfig) -> OakStream:
        booting.set()
        go_on.wait(20.0)
        return opener(oak, config)

    bus.opener = slow  # type: ignore[method-assign]
    thread = threading.Thread(target=lambda: list(camera))
    thread.start()
    assert booting.wait(20.0)
    camera.close()
    thread.join(20.0)
    assert not thread.is_alive()
    go_on.set()
    for _ in range(2000):
        if len(bus.streams) == 2 and bus.streams[1]._pipeline is None:
            break
        time.sleep(0.005)
    assert bus.streams[1]._pipeline is None


def test_what_is_done_with_a_shot_is_not_the_devices_silence() -> None:
    # Slower than one look for a shot, so that some looks find nothing.
    bus = Bus(Script(shots=300, pace=0.15))
    shots = iter(camera := camera_on(bus))
    next(shots)
    time.sleep(1.0)
    for _ in range(3):
        next(shots)
    camera.close()
    assert len(bus.opened) == 1


def test_pauses_begin_anew_once_shots_came() -> None:
    bus = Bus(Script(shots=5, then="unplug"))
    camera = camera_on(bus)
    waits = noted_waits(camera)
    for _ in camera:
        if len(bus.opened) >= 4:
            break
    camera.close()
    assert waits == [0.01] * (len(bus.opened) - 1)
