"""The structure: who may import whom, and what a command must not drag in."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import puppet

PACKAGE = Path(puppet.__file__).parent
#: Each part of the package and the layer it lies in; imports go down or sideways, never up.
LAYERS = {
    "__main__": 6,
    "cli": 6,
    "commands": 5,
    "net": 4,
    "line": 3,
    "driven": 3,
    "parts": 2,
    "performer": 2,
    "render": 3,
    "cast": 2,
    "tracking": 2,
    "mapping": 1,
    "solvers": 1,
    "formats": 1,
    "show": 0,
    "oak_config": 0,
    "mesh": 0,
    "pose": 0,
    "armature": 0,
    "skeleton": 0,
    "rotation": 0,
    "kernel": 0,
    "errors": 0,
    "__init__": 0,
}
FORBIDDEN = {
    "render": {"mapping", "solvers", "tracking", "net"},
    "mapping": {"net", "render", "tracking"},
    "solvers": {"net", "render", "tracking", "mapping"},
    "tracking": {"net", "render"},
}


def imports() -> list[tuple[str, str, str]]:
    """(part, imported part, file) for every import inside the package."""
    found = []
    for path in PACKAGE.rglob("*.py"):
        part = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        for node in ast.walk(ast.parse(path.read_text())):
            names = []
            if isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module]
                if node.module == "puppet":
                    names = [f"puppet.{alias.name}" for alias in node.names]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            for name in names:
                pieces = name.split(".")
                if pieces[0] == "puppet" and len(pieces) > 1 and not pieces[1].startswith("__"):
                    found.append((part, pieces[1], str(path.relative_to(PACKAGE))))
    return found


def test_imports_point_one_way() -> None:
    for part, imported, file in imports():
        assert LAYERS[imported] <= LAYERS[part], f"{file} imports puppet.{imported} from above"
        assert imported not in FORBIDDEN.get(part, ()), f"{file} must not import puppet.{imported}"


def test_every_part_has_its_layer() -> None:
    parts = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or path.is_dir()}
    assert parts - {"__pycache__"} == set(LAYERS)


def test_no_module_is_a_drawer_for_odds_and_ends() -> None:
    drawers = {"utils", "util", "common", "helpers", "manager", "misc"}
    assert not [path for path in PACKAGE.rglob("*.py") if path.stem in drawers]


def test_files_can_be_read_in_one_sitting() -> None:
    long = {
        str(path.relative_to(PACKAGE)): count
        for path in PACKAGE.rglob("*.py")
        if (count := len(path.read_text().splitlines())) > 400
    }
    assert not long


def test_help_imports_nothing_heavy() -> None:
    script = (
        "import sys\nsys.argv = ['puppet', '--help']\nfrom puppet.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'numba', 'scipy', 'moderngl', 'zenoh', 'onnxruntime', 'cv2', 'av'}\n"
        "sys.exit(str(heavy & set(sys.modules)) if heavy & set(sys.modules) else 0)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "run" in done.stdout
