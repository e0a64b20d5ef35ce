"""IK mapping: which control point moves which end effector (Sanna 2015, section 5).

End effectors are the tips of an armature's chains; control points are the performer's head, hands
and feet. The best pair of all is taken first, then the best of what is left, and so on (figure 6).
A master bone stands for several effectors and scores what they score on average. What is left over
when the control points are used up stays where the rest carries it, and masters are offered that
would leave nothing over.
"""

from __future__ import annotations

from collections.abc import Mapping

from puppet.armature import Armature
from puppet.mapping.effector_rows import EffectorTable, effector_table
from puppet.mapping.evidence import Evidence, gather
from puppet.mapping.human import HUMAN_LIMBS
from puppet.mapping.limb_choice import LimbChoice
from puppet.mapping.offers import offered
from puppet.mapping.proposal import Pair, Proposal
from puppet.mapping.ranking import best_first, sum_of_powers, whole_first
from puppet.mapping.verdicts import Verdicts


def propose_effectors(
    source: Armature | Evidence, verdicts: Verdicts | None = None, k: int = 1
) -> list[Proposal]:
    """The k best IK mappings of an armature, best first; fewer if there are no more.

    What merely leaves an effector out that could be moved comes after all that does not. An
    armature without a chain (a single bone) has nothing that IK could move: its proposal has no
    pairs.
    """
    evidence = source if isinstance(source, Evidence) else gather(source, pieces=False)
    verdicts = verdicts or Verdicts()
    table = effector_table(evidence, verdicts)
    choice = table.choice(evidence, verdicts)
    found: dict[frozenset[tuple[int, int]], Proposal] = {}
    # What was decided is in every proposal, so two assignments may come to the same pairs.
    kept = {row: column for row, (column, _) in table.kept(verdicts).items()}
    for _, assignment in whole_first(choice.scores, choice.allowed, best_first):
        chosen = dict(assignment) | kept
        key = frozenset(chosen.items())
        if key not in found:
            found[key] = _proposal(evidence, verdicts, table, choice, chosen)
        if len(found) == k:
            break
    return list(found.values()) or [_proposal(evidence, verdicts, table, choice, kept)]


def _proposal(
    evidence: Evidence,
    verdicts: Verdicts,
    table: EffectorTable,
    choice: LimbChoice,
    chosen: Mapping[int, int],
) -> Proposal:
    """chosen: the column of each row, with what was kept; by hand two rows may share one."""
    acts = {row: act for row, (_, act) in table.kept(verdicts).items()}
    rows = table.rows
    pairs: list[Pair] = []
    for row, column in sorted(chosen.items(), key=lambda item: rows[item[0]].bones):
        pairs.append(
            choice.reasoning(row, column).pair(
                rows[row].name, rows[row].bones, HUMAN_LIMBS[column].tip, acts.get(row, "")
            )
        )
    left = [effector for row, effector in enumerate(rows) if row not in chosen]
    return Proposal(
        evidence.armature,
        "ik",
        tuple(pairs),
        tuple(effector.name for effector in sorted(left, key=lambda e: e.bones)),
        sum_of_powers(choice.scores, tuple(chosen.items()))[0],
        offered(evidence, verdicts, table, chosen, choice.possible),
    )
