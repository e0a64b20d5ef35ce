"""What a mapping builder proposes: pairs with scores, and what it left out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from puppet.armature import Armature
from puppet.skeleton import HUMAN_BONE_NAMES

Mode = Literal["fk"]


@dataclass(frozen=True, slots=True)
class Pair:
    """One bone of the armature and the human bone that turns it.

    score: 0..1, from the shape of the hierarchies and the preferences; for comparing the pairs of
    one armature, not a probability.
    """

    bone: int
    human: int
    score: float


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A mapping for one armature: pairs in the order of its bones, and the bones without one."""

    armature: Armature
    mode: Mode
    pairs: tuple[Pair, ...]

    @property
    def unmapped(self) -> tuple[str, ...]:
        """Names of the bones that no human bone turns; they follow their parents."""
        mapped = {pair.bone for pair in self.pairs}
        return tuple(name for bone, name in enumerate(self.armature.names) if bone not in mapped)

    def as_json(self) -> dict[str, Any]:
        """The form that `puppet map --json` prints."""
        return {
            "armature": self.armature.name,
            "mode": self.mode,
            "pairs": [
                {
                    "bone": self.armature.names[pair.bone],
                    "human": HUMAN_BONE_NAMES[pair.human],
                    "score": round(pair.score, 4),
                }
                for pair in self.pairs
            ],
            "unmapped": list(self.unmapped),
        }
