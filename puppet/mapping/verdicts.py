"""What holds now, after all that was decided: the only thing that a mapping builder looks at."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from puppet.armature import Armature
from puppet.errors import BadDecisionError
from puppet.mapping.decisions import KEEPS, Act, Decision, partners_of
from puppet.mapping.human import LIMB_NAMES, WHOLE_LIMBS
from puppet.mapping.masters import master_problem
from puppet.mapping.proposal import Mode
from puppet.mapping.whole_limbs import first_of_limb, inside, said_of


@dataclass(frozen=True, slots=True)
class Verdicts:
    """What holds now.

    mode: how the puppet is driven. kept: by (mode, bone), the partner and the act that said so.
    limbs: under FK, by the first bone of a limb, the limb of the performer that drives it whole.
    banned: (mode, bone, partner) and the act; a whole limb by its first bone, or under IK by the
    effector and the control point at its end. masters: by name, their effectors.
    """

    mode: Mode = "fk"
    kept: Mapping[tuple[Mode, str], tuple[str, Act]] = field(default_factory=dict)
    limbs: Mapping[str, tuple[str, Act]] = field(default_factory=dict)
    banned: Mapping[tuple[Mode, str, str], Act] = field(default_factory=dict)
    masters: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def kept_in(self, mode: Mode) -> dict[str, tuple[str, Act]]:
        """By bone, for one mode."""
        return {bone: verdict for (its, bone), verdict in self.kept.items() if its == mode}

    def banned_in(self, mode: Mode) -> dict[tuple[str, str], Act]:
        """By bone and partner, for one mode."""
        return {(b, human): act for (its, b, human), act in self.banned.items() if its == mode}

    def with_act(self, decision: Decision, armature: Armature) -> Verdicts:
        """What holds after one more act.

        Raises BadDecisionError for a bone, partner or master that is not there, a partner that
        another bone is locked to, and an act that makes no sense.
        """
        if decision.act == "mode":
            return replace(self, mode=decision.mode)
        if decision.act in ("group", "ungroup"):
            return self._grouped(decision, armature)
        self._check_pair(decision, armature)
        if decision.act == "clear":
            return self._cleared(decision, armature)
        decision = said_of(decision, armature, self.masters)
        mode, bone, human = decision.mode, decision.bone, decision.human
        kept, limbs, banned = dict(self.kept), dict(self.limbs), dict(self.banned)
        whole = mode == "fk" and human in WHOLE_LIMBS
        bones, partners = inside(decision, armature)
        if decision.act in KEEPS:
            if mode == "ik":
                self._check_movable(decision, armature)
            if decision.act != "set":
                self._check_free(decision)
            if whole:
                limbs[bone] = (human, decision.act)
            else:
                kept[mode, bone] = (human, decision.act)
            # What was ruled out before and would leave nothing of this does not hold any more.
            for key in [k for k in banned if k[0] == mode and k[1] in bones and k[2] in partners]:
                del banned[key]
        else:
            banned[mode, bone, human] = decision.act
            if whole and limbs.get(bone, ("",))[0] == human:
                del limbs[bone]
            for its, name in [key for key in kept if key[0] == mode]:
                partner = kept[its, name][0]
                exact = (name, partner) == (bone, human)
                if exact or (whole and name in bones and partner in partners):
                    del kept[its, name]
        return replace(self, kept=kept, limbs=limbs, banned=banned)

    def _cleared(self, decision: Decision, armature: Armature) -> Verdicts:
        """Without what was said of a bone, and of its limb; or only of that and one partner."""
        mode, human = decision.mode, decision.human
        said = said_of(decision, armature, self.masters) if human else decision
        first = first_of_limb(armature, decision.bone) if mode == "fk" else None

        def gone(bone: str, partner: str) -> bool:
            if human:
                return bone in (decision.bone, said.bone) and partner in (human, said.human)
            return bone == decision.bone or (bone == first and partner in WHOLE_LIMBS)

        return replace(
            self,
            kept={k: v for k, v in self.kept.items() if k[0] != mode or not gone(k[1], v[0])},
            limbs={k: v for k, v in self.limbs.items() if mode != "fk" or not gone(k, v[0])},
            banned={k: v for k, v in self.banned.items() if k[0] != mode or not gone(k[1], k[2])},
        )

    def _grouped(self, decision: Decision, armature: Armature) -> Verdicts:
        masters = dict(self.masters)
        if decision.act == "ungroup":
            if masters.pop(decision.bone, None) is None:
                raise _wrong("there is no such master", decision.bone, sorted(masters))
            gone = ("ik", decision.bone)
            return replace(
                self,
                masters=masters,
                kept={key: value for key, value in self.kept.items() if key != gone},
                banned={key: value for key, value in self.banned.items() if key[:2] != gone},
            )
        for name in decision.effectors:
            if name not in armature.names:
                raise _wrong("there is no such bone", name, armature.names)
        problem = master_problem(decision.bone, decision.effectors, armature)
        if problem is not None:
            raise BadDecisionError(problem[0], where=decision.bone, found=problem[1])
        for name, effectors in masters.items():
            shared = set(effectors) & set(decision.effectors)
            if name != decision.bone and shared:
                raise BadDecisionError(
                    "an effector belongs to another master already",
                    where=decision.bone,
                    found=f"{', '.join(sorted(shared))} of {name}",
                    hint=f"ungroup {name} first",
                )
        masters[decision.bone] = tuple(dict.fromkeys(decision.effectors))
        # From now on the master is what is decided about.
        held = {("ik", effector) for effector in decision.effectors}
        kept = {key: value for key, value in self.kept.items() if key not in held}
        return replace(self, masters=masters, kept=kept)

    def _check_pair(self, decision: Decision, armature: Armature) -> None:
        bones = [*armature.names, *(self.masters if decision.mode == "ik" else ())]
        if decision.bone not in bones:
            raise _wrong("there is no such bone", decision.bone, bones)
        partners = (*partners_of(decision.mode), *LIMB_NAMES)
        if decision.human not in partners and not (decision.act == "clear" and not decision.human):
            what = "human bone" if decision.mode == "fk" else "control point"
            raise _wrong(
                f"there is no such {what} or limb", decision.human, dict.fromkeys(partners)
            )
        movement = (
            armature.movements[armature.index(decision.bone)]
            if decision.bone in armature.names
            else "turn"
        )
        if decision.act in KEEPS and decision.mode == "fk" and movement != "turn":
            raise BadDecisionError(
                "this bone cannot turn, so nothing can drive it",
                where=decision.bone,
                found=f"a bone that {'slides' if movement == 'slide' else 'is fixed'}",
            )

    def _check_movable(self, decision: Decision, armature: Armature) -> None:
        """That a goal can move the bone."""
        if decision.bone not in armature.names:
            return
        if armature.parents[armature.index(decision.bone)] < 0:
            raise BadDecisionError(
                "this bone is a root: it goes where the performer goes, and no goal moves it",
                where=decision.bone,
                found=decision.sentence(),
            )
        for master, effectors in self.masters.items():
            if decision.bone in effectors:
                raise BadDecisionError(
                    "a master moves this bone already",
                    where=decision.bone,
                    found=f"{decision.bone} of {master}",
                    hint=f"decide about {master}, or ungroup it first",
                )

    def _check_free(self, decision: Decision) -> None:
        """That nothing else was given to the same partner. `decision`: as `said_of` has it."""
        whole = decision.mode == "fk" and decision.human in WHOLE_LIMBS
        taken = (
            [(bone, *verdict) for bone, verdict in self.limbs.items()]
            if whole
            else [(bone, *v) for (mode, bone), v in self.kept.items() if mode == decision.mode]
        )
        for bone, human, act in taken:
            if human == decision.human and bone != decision.bone:
                raise BadDecisionError(
                    f"{human} drives another {'limb' if whole else 'bone'} already",
                    where=f"{decision.act} {decision.bone} = {human}",
                    found=f"{act} {bone} = {human}",
                    hint=f"clear {bone} first, or set {decision.bone} by hand: then both follow it",
                )


def _wrong(what: str, found: str, there: Iterable[str]) -> BadDecisionError:
    return BadDecisionError(what, expected=f"one of {', '.join(there)}", found=found)
