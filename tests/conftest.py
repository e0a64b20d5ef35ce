"""What the tests share: real parts, and where the given recordings lie."""

from __future__ import annotations

import json
import socket
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# The first call of a kernel compiles it; that says nothing about a test.
settings.register_profile(
    "puppet", deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("puppet")

REPOSITORY = Path(__file__).resolve().parents[1]
SHARED = REPOSITORY.parent / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder with real recordings and facts; skips where it is absent."""
    if not SHARED.is_dir():
        pytest.skip("the shared recordings and facts are not here")
    return SHARED


@pytest.fixture(scope="session")
def fish_facts(shared: Path) -> dict[str, Any]:
    """The matrices of Sanna 2015, appendix A."""
    facts: dict[str, Any] = json.loads((shared / "facts/fish_similarity.json").read_text())
    return facts


@pytest.fixture(scope="session")
def published(shared: Path) -> dict[str, Any]:
    """The seven mappings of Sanna 2015."""
    return tomllib.loads((shared / "facts/published_mappings.toml").read_text())


@pytest.fixture
def free_port() -> int:
    """A port on the loopback address that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
