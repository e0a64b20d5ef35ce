#!/usr/bin/env python3
"""Build the cast: configs/armatures/*.glb, from nothing but the code in script/cast/.

    script/make_cast.py [NAME ...] [--out FOLDER]

The same code gives the same files, byte for byte.
"""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path

NAMES = ("fish", "lamp", "dog", "seagull", "ostrich", "snake")


def build(name: str) -> bytes:
    """One member of the cast as the bytes of its .glb."""
    glb: bytes = importlib.import_module(f"cast.{name}").build().glb()
    return glb


def main() -> None:
    """Build the named puppets, or all of them."""
    parser = argparse.ArgumentParser(description="Build the cast into configs/armatures.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(NAMES))
    here = Path(__file__).resolve().parents[1]
    parser.add_argument("--out", type=Path, default=here / "configs" / "armatures")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.names) - set(NAMES))
    if unknown:
        parser.error(f"there is no {', '.join(unknown)}; the cast is {', '.join(NAMES)}")
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name in arguments.names or NAMES:
        path = arguments.out / f"{name}.glb"
        path.write_bytes(build(name))
        print(f"{path}  {path.stat().st_size / 1024:.0f} kB")


if __name__ == "__main__":
    main()
