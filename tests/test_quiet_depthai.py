"""depthai behind its door: nothing calls home, nothing is written, nobody else opens it."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from puppet.tracking.cameras.quiet_depthai import SWITCHES

REPOSITORY = Path(__file__).resolve().parents[1]
DOOR = "puppet/tracking/cameras/quiet_depthai.py"

#: What a session with an OAK does, as far as it goes without one.
OURS = """
from puppet.tracking.cameras.oak_listing import list_oaks
from tests.oak_host import Script, host_stream
list_oaks()
stream = host_stream(Script(shots=20))
while stream.shot(0.2) is not None:
    stream.readings()
stream.close()
print("done")
"""
#: The same with nothing set.
BARE = """
import depthai as dai, time
dai.Device.getAllConnectedDevices()
time.sleep(1.0)
print("done")
"""
#: Only what was said to someone counts, not that somebody was listened to.
SAID = re.compile(r"(connect|sendto|sendmsg|sendmmsg)\(.*(AF_INET6?)\b.*")
#: How depthai looks for cameras on the local network: a shout to everybody on it.
DISCOVERY = re.compile(r"sendto\(.*sin_port=htons\(11491\), sin_addr=inet_addr\(\"[\d.]*255\"\)")


def traced(code: str, folder: Path, environment: dict[str, str]) -> tuple[list[str], list[Path]]:
    """What a program says to the network, and the files that it leaves in its home and folder.

    Its connections fail, so that a program that would call home does not reach it.
    """
    home, here, log = folder / "home", folder / "here", folder / "trace"
    home.mkdir()
    here.mkdir()
    kept = {key: value for key, value in os.environ.items() if not key.startswith("DEPTHAI_")}
    done = subprocess.run(
        ["strace", "-f", "-qq", "-e", "trace=connect,sendto,sendmsg,sendmmsg"]
        + ["-e", "inject=connect:error=ENETUNREACH", "-o", str(log), sys.executable, "-c", code],
        cwd=here,
        env=kept
        | {"HOME": str(home), "XDG_CACHE_HOME": str(home / ".cache"), "TMPDIR": str(here)}
        | {"PYTHONPATH": str(REPOSITORY), "PYTHONDONTWRITEBYTECODE": "1"}
        | environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.stdout.endswith("done\n"), done.stderr
    said = [line for line in log.read_text().splitlines() if SAID.search(line)]
    files = [path for top in (home, here) for path in top.rglob("*") if path.is_file()]
    return said, files


@pytest.fixture
def strace() -> None:
    """Skips where programs cannot be traced."""
    if shutil.which("strace") is None:
        pytest.skip("strace is not installed")
    tried = subprocess.run(["strace", "-qq", "-o", "/dev/null", "true"], check=False)
    if tried.returncode != 0:
        pytest.skip("programs may not be traced here")


@pytest.mark.usefixtures("strace")
def test_nothing_is_told_to_anybody_and_no_file_is_left(tmp_path: Path) -> None:
    # Even where somebody switched it on.
    said, files = traced(OURS, tmp_path, {"DEPTHAI_TELEMETRY": "1", "DEPTHAI_CRASHDUMP": "x"})
    assert [line for line in said if not DISCOVERY.search(line)] == []
    assert [path for path in files if "depthai" in str(path) or "here" in path.parts] == []


@pytest.mark.usefixtures("strace")
def test_without_the_switches_it_would_call_home_and_that_is_noticed(tmp_path: Path) -> None:
    said, files = traced(BARE, tmp_path, {})
    assert [line for line in said if not DISCOVERY.search(line)]
    assert [path for path in files if "depthai" in str(path)]


def test_each_switch_is_set_whatever_it_was() -> None:
    code = (
        "import os, json, puppet.tracking.cameras.quiet_depthai\n"
        "print(json.dumps(dict(os.environ)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=REPOSITORY,
        env=os.environ | dict.fromkeys(SWITCHES, "nonsense"),
        capture_output=True,
        text=True,
        check=True,
    )
    environment = json.loads(done.stdout)
    assert {key: environment[key] for key in SWITCHES} == SWITCHES


def test_looking_for_cameras_prints_nothing() -> None:
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "from puppet.tracking.cameras.oak_listing import list_oaks; list_oaks()",
        ],
        cwd=REPOSITORY,
        env={key: value for key, value in os.environ.items() if key != "DEPTHAI_LEVEL"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout, done.stderr) == ("", "")


def test_nobody_else_imports_depthai() -> None:
    importers = []
    for folder in ("puppet", "tests", "benchmarks", "script"):
        for path in (REPOSITORY / folder).rglob("*.py"):
            text = path.read_text()
            if "depthai" not in text:
                continue
            for node in ast.walk(ast.parse(text)):
                names = []
                if isinstance(node, ast.Import):
                    names = [alias.name for alias in node.names]
                elif isinstance(node, ast.ImportFrom) and node.level == 0:
                    names = [node.module or ""]
                if any(name.split(".")[0] == "depthai" for name in names):
                    importers.append(path.relative_to(REPOSITORY).as_posix())
    assert importers == [DOOR]
