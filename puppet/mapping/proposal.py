"""What a mapping builder proposes: pairs with their reasons, runners-up, and what it left out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from puppet.armature import Armature
from puppet.mapping.confidence import Certainty, certainty
from puppet.skeleton import HUMAN_BONE_NAMES

#: How a puppet is driven: bone to bone, or end effectors to control points.
Mode = Literal["fk", "ik"]


@dataclass(frozen=True, slots=True)
class RunnerUp:
    """What else could drive a bone, and how well: score as in `Pair`."""

    human: int
    score: float


@dataclass(frozen=True, slots=True)
class Pair:
    """One thing of the armature and what of the performer drives it.

    name: the bone, or under IK the effector or the master. bones: the bones behind the name; more
        than one for a master.
    human: index of the human bone; under IK of the one whose end is the control point.
    score: 0..1, the sum of `reasons`; for comparing the pairs of one armature.
    confidence: 0..1, how often a pair like this one is right (docs/mapping-benchmark.md has
        the table).
    margin: how much worse the best mapping without this pair would be; below 0 where it was forced.
    reasons: what each part of the evidence contributed, by the names in `evidence.PARTS`.
    runners_up: best first. decided: the operator's word on it, "" if there is none.
    """

    name: str
    bones: tuple[int, ...]
    human: int
    score: float
    confidence: float = 0.5
    margin: float = 0.0
    reasons: dict[str, float] = field(default_factory=dict, hash=False)
    runners_up: tuple[RunnerUp, ...] = ()
    decided: str = ""

    @property
    def bone(self) -> int:
        """The bone, or the first of them."""
        return self.bones[0]

    @property
    def partner(self) -> str:
        """The name of the human bone or control point."""
        return HUMAN_BONE_NAMES[self.human]

    @property
    def certainty(self) -> Certainty:
        """The confidence as a word."""
        return certainty(self.confidence)


@dataclass(frozen=True, slots=True)
class OfferedMaster:
    """End effectors that could share one control point, so that none is left over.

    effectors: names. why: a sentence for people.
    """

    name: str
    effectors: tuple[str, ...]
    why: str


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A mapping for one armature.

    pairs: in the order of its bones. unmapped: what nothing drives: bones under FK, which follow
        their parents; effectors under IK, which are carried along.
    merit: how good the whole is, for comparing proposals of one armature: the sum of powers
        of the scores. offers: masters that the operator may accept.
    follows: for bones without a partner the share of their parent's turn that they repeat.
    """

    armature: Armature
    mode: Mode
    pairs: tuple[Pair, ...]
    unmapped: tuple[str, ...] = ()
    merit: float = 0.0
    offers: tuple[OfferedMaster, ...] = ()
    follows: tuple[tuple[int, float], ...] = ()

    def as_json(self, *, explain: bool = False) -> dict[str, Any]:
        """The form that `puppet map --json` prints; with `explain` with all that is known."""
        out: dict[str, Any] = {
            "armature": self.armature.name,
            "mode": self.mode,
            "pairs": [pair_json(pair, self, explain=explain) for pair in self.pairs],
            "unmapped": list(self.unmapped),
        }
        if self.follows:
            out["follow"] = {self.armature.names[bone]: share for bone, share in self.follows}
        if explain:
            out["merit"] = round(self.merit, 4)
            out["offered_masters"] = [
                {"master": offer.name, "effectors": list(offer.effectors), "why": offer.why}
                for offer in self.offers
            ]
        return out


def pair_json(pair: Pair, proposal: Proposal, *, explain: bool) -> dict[str, Any]:
    """One of the pairs of `Proposal.as_json`; with `explain` also its reasons and runners-up."""
    names = ("bone", "human") if proposal.mode == "fk" else ("effector", "control_point")
    armature = proposal.armature
    out: dict[str, Any] = {
        names[0]: pair.name,
        names[1]: pair.partner,
        "score": round(pair.score, 4),
    }
    if len(pair.bones) > 1:
        out["drives"] = [armature.names[bone] for bone in pair.bones]
    if explain:
        if pair.decided:
            out["decided"] = pair.decided
        out["confidence"] = round(pair.confidence, 3)
        out["certainty"] = pair.certainty
        out["margin"] = round(pair.margin, 4)
        out["reasons"] = {part: round(value, 4) for part, value in pair.reasons.items()}
        out["runners_up"] = [
            {names[1]: HUMAN_BONE_NAMES[other.human], "score": round(other.score, 4)}
            for other in pair.runners_up
        ]
    return out
