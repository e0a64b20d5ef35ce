"""What a show may ask of an OAK."""

from __future__ import annotations

import msgspec
import pytest

from puppet.oak_config import OakConfig


def test_an_empty_table_is_720p_at_30_with_depth() -> None:
    config = msgspec.toml.decode("", type=OakConfig)
    assert (config.width, config.height, config.rate, config.depth) == (1280, 720, 30.0, True)


@pytest.mark.parametrize(
    "text",
    [
        "width = 1290",
        "rate = 0.0",
        "laser = 1.5",
        "confidence = 256",
        "mono_width = 641",
        "hight = 1",
    ],
)
def test_what_no_device_can_do_is_refused(text: str) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.toml.decode(text, type=OakConfig)
