#!/usr/bin/env python3
"""Draw the contact sheets of docs/contact-sheets.md: every puppet of the cast beside a performer,
on the rehearsal and on a real take. Or those of any rigs, each driven both ways, to look at.

    python script/make_contact_sheets.py [NAME ...] [--out FOLDER]
    python script/make_contact_sheets.py --rigs FOLDER --out FOLDER
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

from PIL import Image

from puppet.formats.model import MODEL_SUFFIXES

REPOSITORY: Final = Path(__file__).resolve().parents[1]
TAKE: Final = REPOSITORY / "tests" / "recorded_streams" / "balance_cam01.mcap"
#: How each is driven where it was published (Sanna 2015), and how high it hangs.
CAST: Final = {
    "lamp": ("fk", 0.0),
    "fish": ("fk", 0.8),
    "dog": ("fk", 0.0),
    "seagull": ("ik", 0.0),
    "seagull_with_master": ("ik", 0.0),
    "snake": ("ik", 0.0),
    "ostrich": ("ik", 0.0),
}
#: Wave, bow, squat, jump, turned away, arms out, arms up, lean.
MOMENTS: Final = "4.6,8.8,16.7,19.6,24,28.2,30,34"
SIZE: Final = ("--width", "330", "--height", "250")

SHOW: Final = """\
name = "{name}"
[source]
path = "rehearsal"
[[puppets]]
name = "{name}"
armature = "{armature}"
mode = "{mode}"
position = [0.9, {height}, 0.0]
yaw = -20
{more}
[view]
performer = [-0.6, 0.0, 0.0]
show_pairs = false
"""


def draw(name: str, out: Path) -> None:
    """Both sheets of one puppet."""
    mode, height = CAST[name]
    armature = REPOSITORY / "configs" / "armatures" / f"{name}.toml"
    with tempfile.TemporaryDirectory() as folder:
        show = Path(folder) / f"{name}.toml"
        text = SHOW.format(name=name, armature=armature, mode=mode, height=height, more="")
        show.write_text(text)
        render(show, out / f"{name}-rehearsal.jpg", "--at", MOMENTS)
        render(show, out / f"{name}-balance.jpg", "--source", str(TAKE), "--sheet", "8")


def draw_rig(path: Path, out: Path) -> None:
    """Both ways of driving a rig, made as tall as a child; one that cannot be driven is named."""
    for mode in ("fk", "ik"):
        name = f"{path.stem}-{mode}"
        with tempfile.TemporaryDirectory() as folder:
            show = Path(folder) / "rig.toml"
            text = SHOW.format(
                name=name, armature=path.resolve(), mode=mode, height=0.0, more="height = 1.2"
            )
            show.write_text(text)
            try:
                render(show, out / f"{name}.jpg", "--at", MOMENTS)
            except subprocess.CalledProcessError:
                print(f"{name}: not drawn, for the reason above")


def render(show: Path, target: Path, *options: str) -> None:
    """One sheet, as a JPEG: pictures of a dim stage are small files then."""
    sheet = show.with_suffix(".png")
    command = [sys.executable, "-m", "puppet", "render", str(show), str(sheet), *options, *SIZE]
    subprocess.run(command, check=True, cwd=REPOSITORY)
    Image.open(sheet).convert("RGB").save(target, quality=88, optimize=True)
    print(f"{target}  {target.stat().st_size / 1024:.0f} kB")


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw the contact sheets of the docs.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(CAST))
    parser.add_argument("--out", type=Path, default=REPOSITORY / "docs" / "pictures" / "cast")
    parser.add_argument("--rigs", type=Path, help="draw the rigs in this folder instead")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.names) - set(CAST))
    if unknown:
        parser.error(f"there is no {', '.join(unknown)}; the cast is {', '.join(CAST)}")
    arguments.out.mkdir(parents=True, exist_ok=True)
    if arguments.rigs is not None:
        for path in sorted(arguments.rigs.rglob("*")):
            if path.suffix.lower() in MODEL_SUFFIXES:
                draw_rig(path, arguments.out)
        return
    for name in arguments.names or CAST:
        draw(name, arguments.out)


if __name__ == "__main__":
    main()
