"""What must hold of any proposal, FK or IK, whatever was decided; and decisions drawn by chance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from hypothesis import strategies as st

from puppet.armature import Armature
from puppet.errors import BadDecisionError
from puppet.mapping.anatomy import anatomy, limb_rows
from puppet.mapping.decisions import BANS, KEEPS, Decision, partners_of
from puppet.mapping.evidence import PARTS
from puppet.mapping.human import HUMAN_LIMBS, WHOLE_LIMBS
from puppet.mapping.proposal import Mode, Proposal
from puppet.mapping.verdicts import Verdicts
from puppet.skeleton import HUMAN_BONE_NAMES

Named = tuple[tuple[str, str], ...]


def pairs_of(proposal: Proposal) -> Named:
    """(name, partner) in the order of names."""
    return tuple(sorted((pair.name, pair.partner) for pair in proposal.pairs))


@st.composite
def decided(draw: st.DrawFn, armature: Armature, mode: Mode, most: int = 6) -> Verdicts:
    """What holds after some acts at random; those that are refused are left out."""
    verdicts = Verdicts(mode)
    for _ in range(draw(st.integers(0, most))):
        decision = Decision(
            draw(st.sampled_from(["accept", "lock", "set", "reject", "forbid"])),
            mode,
            draw(st.sampled_from(armature.names)),
            draw(st.sampled_from((*partners_of(mode), *WHOLE_LIMBS))),
        )
        try:
            verdicts = verdicts.with_act(decision, armature)
        except BadDecisionError:
            continue
    return verdicts


def check_sound(proposal: Proposal, verdicts: Verdicts) -> None:
    """No doubles, nothing lost, and every word of the operator kept."""
    mode = proposal.mode
    names = [pair.name for pair in proposal.pairs]
    assert len(set(names)) == len(names)
    assert not set(names) & set(proposal.unmapped)
    drivers = [pair.human for pair in proposal.pairs if pair.decided != "set"]
    assert len(set(drivers)) == len(drivers), "one human bone drives two, and nobody said so"
    found = {pair.name: pair for pair in proposal.pairs}
    for bone, (human, act) in verdicts.kept_in(mode).items():
        assert act in KEEPS
        assert bone in found, f"{bone} was decided and has nothing"
        assert found[bone].partner == human, f"{bone} = {human} was decided"
        assert found[bone].decided == act
        assert found[bone].confidence == 1.0
    for (bone, human), act in verdicts.banned_in(mode).items():
        assert act in BANS
        assert bone not in found or found[bone].partner != human, f"{bone} = {human} was ruled out"
    if mode == "fk":
        check_whole_limbs(proposal, verdicts)


def check_whole_limbs(proposal: Proposal, verdicts: Verdicts) -> None:
    """Limbs go where it was said, and not where it was ruled out; but bones come before limbs."""
    armature = proposal.armature
    limbs = anatomy(armature).pieces
    rows = limb_rows(armature, limbs)
    of_limb: dict[str, set[str]] = {
        limb.name: {HUMAN_BONE_NAMES[b] for b in limb.bones} for limb in HUMAN_LIMBS
    }
    kept = verdicts.kept_in("fk")
    taken = {human for human, _ in kept.values()}

    def partners(first: str) -> dict[str, str]:
        row = rows[armature.index(first)]
        return {
            pair.name: pair.partner
            for pair in proposal.pairs
            if rows.get(pair.bone) == row and pair.name not in kept
        }

    for first, (limb, act) in verdicts.limbs.items():
        found = partners(first)
        assert set(found.values()) <= of_limb[limb], f"{first} = {limb} was decided: {found}"
        assert all(p.decided == act for p in proposal.pairs if p.name in found)
        chain = limbs[rows[armature.index(first)]].bones
        if not taken & of_limb[limb] and not any(armature.names[bone] in kept for bone in chain):
            banned = verdicts.banned_in("fk")
            free = [
                bone
                for bone in chain
                if any((armature.names[bone], human) not in banned for human in of_limb[limb])
            ]
            assert found or not free, f"{first} = {limb} was decided and has nothing"
    for first, limb in verdicts.banned_in("fk"):
        if limb in of_limb and limb in WHOLE_LIMBS:
            assert not set(partners(first).values()) & of_limb[limb], f"{first} = {limb} is banned"


def check_reasons(proposal: Proposal) -> None:
    """Scores are the sum of their reasons, and runners-up are others, best first."""
    for pair in proposal.pairs:
        assert set(pair.reasons) == set(PARTS)
        assert np.isfinite([pair.score, pair.confidence, pair.margin]).all()
        assert 0.0 <= pair.score <= 1.0
        assert 0.0 <= pair.confidence <= 1.0
        total = min(max(sum(pair.reasons.values()), 0.0), 1.0)
        assert abs(total - pair.score) < 1e-8, f"{pair.name}: {pair.reasons} is not {pair.score}"
        others = [runner.human for runner in pair.runners_up]
        scores = [runner.score for runner in pair.runners_up]
        assert pair.human not in others
        assert len(set(others)) == len(others)
        assert scores == sorted(scores, reverse=True)
        assert all(0 <= human < len(HUMAN_BONE_NAMES) for human in others)


def check_possible(proposal: Proposal, verdicts: Verdicts, sides: Sequence[str]) -> None:
    """What is offered instead of a pair is not what can never be."""
    banned = verdicts.banned_in(proposal.mode)
    human_sides = {bone: limb.side for limb in HUMAN_LIMBS for bone in limb.bones}
    for pair in proposal.pairs:
        ours = {sides[bone] for bone in pair.bones}
        for runner in pair.runners_up:
            partner = HUMAN_BONE_NAMES[runner.human]
            assert (pair.name, partner) not in banned, f"{pair.name} = {partner} was ruled out"
            theirs = human_sides.get(runner.human, "")
            if len(ours) == 1 and theirs and ours != {""}:
                assert theirs in ours, f"{pair.name}: {partner} is on the other side"
