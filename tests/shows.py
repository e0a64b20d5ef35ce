"""Shows for tests that decide: written into a folder of their own, so that nothing else is kept."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from puppet.mapping.proposal import Mode

REPOSITORY = Path(__file__).resolve().parents[1]
ARMATURES = REPOSITORY / "configs/armatures"


def write_show(
    folder: Path, puppets: Mapping[str, tuple[str, Mode]], extra: str = "", name: str = "Decided"
) -> Path:
    """A show of these puppets (name -> file in configs/armatures, or a path; and the mode)."""
    text = f'name = "{name}"\n{extra}\n[source]\npath = "rehearsal"\n'
    for x, (puppet, (armature, mode)) in enumerate(puppets.items()):
        text += (
            f'\n[[puppets]]\nname = "{puppet}"\narmature = "{ARMATURES / armature}"\n'
            f'mode = "{mode}"\nposition = [{x}.0, 0.5, 0.0]\n'
        )
    path = folder / "show.toml"
    path.write_text(text)
    return path
