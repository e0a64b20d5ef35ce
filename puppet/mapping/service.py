"""The mapping service: proposes, takes decisions, undoes, explains, and keeps what was decided.

One object for all puppets of a show. It knows neither the bus nor the stage: whoever holds it hears
of every new mapping through `on_change`, called before the one who decided gets an answer.
`puppet map`, the stage and its clients all go through this.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path

import msgspec

from puppet.armature import Armature
from puppet.errors import BadDecisionError
from puppet.formats.mapping_file import (
    BoneRow,
    Entry,
    KeptMappings,
    KeptRecord,
    MappingFile,
    StepRow,
)
from puppet.mapping.decisions import Decision
from puppet.mapping.effectors import propose_effectors
from puppet.mapping.evidence import Evidence, gather
from puppet.mapping.fingerprint import BoneRecord, bone_records, differences, digest
from puppet.mapping.forward import propose_forward
from puppet.mapping.ledger import LONGEST_HISTORY, Ledger
from puppet.mapping.preferences import Preferences
from puppet.mapping.proposal import Mode, Pair, Proposal
from puppet.mapping.verdicts import Verdicts

#: Proposals that are made at most at once.
MOST_PROPOSALS = 50


@dataclass(frozen=True)
class Rig:
    """An armature as its file gives it, with what the mapping wants to know beside it.

    masters: by name, the effectors of each. follows: by bone, the share of its parent's turn that
    it repeats when nothing drives it.
    """

    armature: Armature
    preferences: Preferences = field(default_factory=Preferences)
    masters: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    follows: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def fingerprint(self) -> str:
        """The key of what is decided about it."""
        return digest(self.records)

    @cached_property
    def records(self) -> dict[str, BoneRecord]:
        """What is kept of its bones beside what is decided about it."""
        return bone_records(self.armature)

    def evidence(self, mode: Mode) -> Evidence:
        """Worked out once; a decision does not change it."""
        return self._forward if mode == "fk" else self._effectors

    @cached_property
    def _forward(self) -> Evidence:
        follows = [self.follows.get(name, 0.0) for name in self.armature.names]
        return gather(self.armature, self.preferences, follows)

    @cached_property
    def _effectors(self) -> Evidence:
        return gather(self.armature, self.preferences, pieces=False)

    def propose(self, verdicts: Verdicts, mode: Mode | None = None, k: int = 1) -> list[Proposal]:
        """The k best mappings, best first."""
        mode = mode or verdicts.mode
        build = propose_forward if mode == "fk" else propose_effectors
        return build(self.evidence(mode), verdicts, k)


@dataclass
class _Puppet:
    name: str
    rig: Rig
    mode: Mode  # as the show has it
    ledger: Ledger
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class History:
    """What was decided of a puppet.

    steps: sentences, oldest first. holds: how many of them hold; the others can be redone.
    """

    steps: tuple[str, ...]
    holds: int


class MappingService:
    """See the module. Safe to be called from several threads."""

    def __init__(
        self,
        rigs: Mapping[str, Rig],
        modes: Mapping[str, Mode] | None = None,
        path: Path | None = None,
        on_change: Callable[[str, Proposal], None] | None = None,
    ) -> None:
        """`path`: where decisions are kept; None keeps them in memory only.

        Raises BadFileError for a mapping file that makes no sense.
        """
        self._lock = threading.RLock()
        self._kept = None if path is None else KeptMappings(path)
        self.on_change = on_change
        file = MappingFile() if self._kept is None else self._kept.file
        self._puppets = {
            name: _met(name, rig, (modes or {}).get(name, "fk"), file, rigs)
            for name, rig in rigs.items()
        }

    @property
    def names(self) -> tuple[str, ...]:
        """The puppets."""
        return tuple(self._puppets)

    def current(self, puppet: str) -> Proposal:
        """The mapping that drives a puppet now."""
        return self._proposed(puppet)[0]

    def propose(self, puppet: str, mode: Mode | None = None, k: int = 1) -> list[Proposal]:
        """The k best mappings around what was decided. Raises BadDecisionError."""
        if not 1 <= k <= MOST_PROPOSALS:
            raise BadDecisionError(
                "so many proposals cannot be made",
                where="k",
                expected=f"1 to {MOST_PROPOSALS}",
                found=str(k),
            )
        return self._proposed(puppet, mode, k)

    def _proposed(self, puppet: str, mode: Mode | None = None, k: int = 1) -> list[Proposal]:
        # Neither a rig nor what held at an instant ever changes, so whoever decides meanwhile need
        # not wait for many proposals.
        with self._lock:
            its = self._find(puppet)
            rig, verdicts = its.rig, its.ledger.verdicts
        return rig.propose(verdicts, mode, k)

    def decide(self, puppet: str, decisions: Iterable[Decision], who: str = "") -> Proposal:
        """Take decisions, as one step that can be undone. -> the mapping that follows

        They are on the disk, and `on_change` has been told, when this returns. Raises
        BadDecisionError for what is not possible, UnavailableError if it cannot be saved, and
        BadFileError if somebody has spoilt the file meanwhile; then nothing has changed.
        """
        now = datetime.now(UTC).isoformat(timespec="seconds")
        step = [
            msgspec.structs.replace(decision, who=decision.who or who, when=decision.when or now)
            for decision in decisions
        ]
        return self._change(puppet, lambda its: its.ledger.with_step(step, its.rig.armature))

    def undo(self, puppet: str) -> Proposal:
        """Take back the last step. Raises BadDecisionError if there is none."""
        return self._change(puppet, lambda its: its.ledger.undone())

    def redo(self, puppet: str) -> Proposal:
        """Bring back the last step that was undone. Raises BadDecisionError if there is none."""
        return self._change(puppet, lambda its: its.ledger.redone())

    def verdicts(self, puppet: str) -> Verdicts:
        """What holds now."""
        with self._lock:
            return self._find(puppet).ledger.verdicts

    def history(self, puppet: str) -> History:
        """What was decided, for people."""
        with self._lock:
            ledger = self._find(puppet).ledger
            steps = tuple(
                "; ".join(decision.sentence() for decision in step)
                + (f" ({step[0].who})" if step[0].who else "")
                for step in ledger.steps
            )
            return History(steps, ledger.cursor)

    def warnings(self, puppet: str) -> tuple[str, ...]:
        """What did not fit when the decisions were read, a sentence each."""
        return self._find(puppet).warnings

    def explain(self, puppet: str, bone: str, mode: Mode | None = None) -> Pair | None:
        """The pair of a bone, effector or master with its reasons; None if nothing drives it.

        Raises BadDecisionError for a bone that is not there.
        """
        return self.explained(puppet, bone, mode)[0]

    def explained(
        self, puppet: str, bone: str, mode: Mode | None = None
    ) -> tuple[Pair | None, Proposal]:
        """As `explain`, with the proposal that the pair belongs to."""
        proposal = self.propose(puppet, mode)[0]
        pair = next((pair for pair in proposal.pairs if pair.name == bone), None)
        if pair is None and bone not in (*proposal.armature.names, *proposal.unmapped):
            raise BadDecisionError(
                "there is no such bone",
                where=puppet,
                expected=f"one of {', '.join(proposal.armature.names)}",
                found=bone,
            )
        return pair, proposal

    def save(self) -> Path:
        """Write the file again, though every decision has done so. Raises UnavailableError."""
        with self._lock:
            kept = self._in_a_file()
            kept.put()
            return kept.path

    def load(self) -> tuple[str, ...]:
        """Read the file anew, as somebody edited it. -> warnings

        Raises BadFileError for a file that makes no sense, and BadDecisionError for one after which
        nothing would drive a puppet any more; then nothing has changed.
        """
        with self._lock:
            kept = self._in_a_file()
            file = kept.read()
            puppets = {
                name: _met(name, its.rig, its.mode, file, self._puppets)
                for name, its in self._puppets.items()
            }
            proposals = {
                name: its.rig.propose(its.ledger.verdicts)[0] for name, its in puppets.items()
            }
            for name, proposal in proposals.items():
                self._check_driven(self._puppets[name], proposal, f"{kept.path}: {name}")
            self._puppets = puppets
            for name, proposal in proposals.items():
                self._tell(name, proposal)
            return tuple(text for its in self._puppets.values() for text in its.warnings)

    def _in_a_file(self) -> KeptMappings:
        if self._kept is None:
            raise BadDecisionError("these decisions are kept in memory only")
        return self._kept

    def _find(self, puppet: str) -> _Puppet:
        try:
            return self._puppets[puppet]
        except KeyError:
            raise BadDecisionError(
                "there is no such puppet on stage",
                expected=f"one of {', '.join(self._puppets)}",
                found=puppet,
            ) from None

    def _change(self, puppet: str, change: Callable[[_Puppet], Ledger]) -> Proposal:
        with self._lock:
            its = self._find(puppet)
            try:
                ledger = change(its)
            except BadDecisionError as error:
                error.where = error.where or puppet
                raise
            proposal = its.rig.propose(ledger.verdicts)[0]
            self._check_driven(its, proposal, puppet)
            if self._kept is not None:
                self._kept.put(_entry(its, ledger))
            its.ledger = ledger
            self._tell(puppet, proposal)
            return proposal

    @staticmethod
    def _check_driven(was: _Puppet, proposal: Proposal, where: str) -> None:
        """Raises BadDecisionError if nothing would drive any more what something drives now."""
        if proposal.pairs or not was.rig.propose(was.ledger.verdicts)[0].pairs:
            return
        # A show in which nothing drives a puppet does not start: this would be the end of it.
        raise BadDecisionError(
            "then nothing would drive this puppet any more",
            where=where,
            hint='IK needs a chain of two bones or more: drive it by "fk"'
            if proposal.mode == "ik"
            else "leave it at least one pair",
        )

    def _tell(self, puppet: str, proposal: Proposal) -> None:
        if self.on_change is not None:
            self.on_change(puppet, proposal)


def _met(name: str, rig: Rig, mode: Mode, file: MappingFile, others: Collection[str]) -> _Puppet:
    """A puppet with what was decided of its rig, or of the rig that had its name."""
    fresh = Verdicts(mode, masters=dict(rig.masters))
    entry = file.entry(name, rig.fingerprint, others)
    changes: list[str] = []
    if entry is None:
        # A namesake that is the same but for rounding is the same.
        namesakes = [
            (list(differences(_records(entry), rig.records)), entry)
            for entry in file.puppets[::-1]
            if entry.puppet == name
        ]
        changes, entry = min(namesakes, key=lambda item: bool(item[0]), default=([], None))
    if entry is None:
        return _Puppet(name, rig, mode, Ledger(fresh))
    ledger, warnings = _replayed(entry, rig, fresh)
    if changes:
        warnings.insert(0, f"its rig has changed since it was decided about: {'; '.join(changes)}")
    return _Puppet(name, rig, mode, ledger, tuple(f"{name}: {text}" for text in warnings))


def _records(entry: Entry) -> dict[str, BoneRecord]:
    return {row.name: BoneRecord(row.parent, row.rest) for row in entry.bones}


def _entry(its: _Puppet, ledger: Ledger) -> Entry:
    start = ledger.start
    # Once the oldest steps have been dropped, what they came to is not in the show any more.
    folded = len(ledger.steps) == LONGEST_HISTORY
    return Entry(
        puppet=its.name,
        fingerprint=its.rig.fingerprint,
        mode=start.mode if folded else None,
        holds=ledger.cursor,
        steps=tuple(StepRow(step) for step in ledger.steps),
        kept=(
            *(KeptRecord(m, b, human, act) for (m, b), (human, act) in start.kept.items()),
            *(KeptRecord("fk", b, limb, act) for b, (limb, act) in start.limbs.items()),
        ),
        banned=tuple(KeptRecord(m, b, human, act) for (m, b, human), act in start.banned.items()),
        masters=dict(start.masters) if folded else {},
        bones=tuple(
            BoneRow(bone, record.parent, record.rest) for bone, record in its.rig.records.items()
        ),
    )


def _replayed(entry: Entry, rig: Rig, fresh: Verdicts) -> tuple[Ledger, list[str]]:
    """The steps of a file on an armature; what does not fit it is left out, with a warning."""
    warnings: list[str] = []
    state = fresh if entry.mode is None else replace(fresh, mode=entry.mode, masters={})
    # What is set by hand may share its partner, so it comes after what may not.
    kept = sorted(entry.kept, key=lambda record: record.act == "set")
    before = [
        *(Decision("group", "ik", m, effectors=e) for m, e in entry.masters.items()),
        *(Decision(record.act, record.mode, record.bone, record.human) for record in kept),
        *(Decision(record.act, record.mode, record.bone, record.human) for record in entry.banned),
    ]
    for decision in before:
        try:
            state = state.with_act(decision, rig.armature)
        except BadDecisionError as error:
            warnings.append(_left_out(decision, error))
    ledger = Ledger(state)
    held = 0
    for index, row in enumerate(entry.steps):
        fitting: list[Decision] = []
        for decision in row.decisions:
            try:
                ledger.with_step((*fitting, decision), rig.armature)
                fitting.append(decision)
            except BadDecisionError as error:
                warnings.append(_left_out(decision, error))
        if fitting:
            ledger = ledger.with_step(fitting, rig.armature)
            held += index < entry.holds
    return ledger.moved_to(held), warnings


def _left_out(decision: Decision, error: BadDecisionError) -> str:
    found = f" ({error.found})" if error.found else ""
    return f"left out “{decision.sentence()}”: {error.what}{found}"
