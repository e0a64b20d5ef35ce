"""`puppet map` and `puppet decide`: mappings proposed, explained and corrected."""

from __future__ import annotations

import getpass
import json
import sys
from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, get_args

from rich.console import Console
from rich.table import Table

from puppet.armature import Armature
from puppet.cast import rig_of
from puppet.errors import BadDecisionError, BadShowError
from puppet.formats.armature_toml import load_puppet
from puppet.mapping.blocks import BLOCKS
from puppet.mapping.decisions import Act, Decision
from puppet.mapping.human import HUMAN
from puppet.mapping.proposal import Mode
from puppet.mapping.service import MOST_PROPOSALS, MappingService
from puppet.net.bus import Bus
from puppet.net.mapping_client import MappingClient
from puppet.show import load_show
from puppet.skeleton import HUMAN_BONE_NAMES

_err = Console(stderr=True, soft_wrap=True)
_STYLES = {"sure": "green", "likely": "", "doubtful": "yellow"}
_KINDS: dict[Mode, str] = {"fk": "forward kinematics", "ik": "inverse kinematics"}


def map_armature(
    path: Path,
    mode: str,
    *,
    as_json: bool,
    explain: bool,
    k: int,
    lock: Sequence[str],
    forbid: Sequence[str],
    matrix: str | None,
) -> None:
    """Propose mappings for one armature and print them."""
    puppet = load_puppet(path)
    for warning in puppet.model.warnings:
        _err.print(f"{path.name}: {warning}", style="yellow", markup=False, highlight=False)
    checked = mode_of(mode)
    name = puppet.model.armature.name
    service = MappingService({name: rig_of(puppet)}, {name: checked})
    decisions = _decisions(checked, [*_pairs("lock", lock), *_pairs("forbid", forbid)])
    if decisions:
        service.decide(name, decisions)
    if matrix is not None:
        if checked == "ik":
            raise BadShowError(
                "the score matrix is that of FK",
                where="--matrix",
                found="--mode ik",
                hint="--mode ik --explain says what each end effector scores",
            )
        _print_matrix(puppet.model.armature, matrix, as_json=as_json)
        return
    if not 1 <= k <= MOST_PROPOSALS:
        raise BadShowError(
            "so many mappings cannot be proposed",
            where="--k",
            expected=f"1 to {MOST_PROPOSALS}",
            found=str(k),
        )
    best, *others = service.propose(name, k=k)
    if as_json:
        document = best.as_json(explain=explain)
        if k > 1:
            document["alternatives"] = [other.as_json(explain=explain) for other in others]
        sys.stdout.write(json.dumps(document, indent=2) + "\n")
        return
    first = best.as_json(explain=True)
    _print_mapping(first, f"{name}: {_KINDS[checked]}", explain=explain)
    for rank, other in enumerate(others, start=2):
        title = f"{name}: choice {rank} (* is not as in the first)"
        _print_mapping(other.as_json(explain=True), title, explain=explain, against=first)


def mode_of(text: str) -> Mode:
    """Raises BadShowError for what is no mode."""
    if text not in get_args(Mode):
        raise BadShowError("there is no such mode", where="--mode", expected="fk or ik", found=text)
    mode: Mode = "fk" if text == "fk" else "ik"
    return mode


def _pairs(act: Act, texts: Iterable[str]) -> list[tuple[Act, str, str]]:
    """The act, bone and partner of each. Raises BadDecisionError for what is no pair."""
    pairs: list[tuple[Act, str, str]] = []
    for text in texts:
        bone, equals, human = text.rpartition("=")
        if not (bone and equals and human):
            raise BadDecisionError(
                "this is not a pair",
                where=f"--{act}",
                expected="BONE=HUMAN, as fin.R=hand.R, or a whole limb: fin.R=arm.R",
                found=text,
            )
        pairs.append((act, bone, human))
    return pairs


def _decisions(mode: Mode, pairs: Iterable[tuple[Act, str, str]]) -> list[Decision]:
    return [Decision(act, mode, bone, human) for act, bone, human in pairs]


def _print_mapping(
    mapping: dict[str, Any], title: str, *, explain: bool, against: dict[str, Any] | None = None
) -> None:
    """A mapping as `Proposal.as_json` says it with all that is known; * marks what `against` has
    otherwise."""
    fk = mapping["mode"] == "fk"
    name, partner = ("bone", "human") if fk else ("effector", "control_point")
    before = {pair[name]: pair[partner] for pair in against["pairs"]} if against else None
    console = Console()
    console.print(title, style="bold", markup=False)
    table = Table()
    table.add_column("bone" if fk else "end effector")
    table.add_column("turns with" if fk else "goes with")
    table.add_column("score", justify="right")
    table.add_column("")
    if explain:
        table.add_column("because")
        table.add_column("or")
    for pair in mapping["pairs"]:
        changed = before is not None and before.get(pair[name]) != pair[partner]
        row = [
            pair[name],
            pair[partner] + (" *" if changed else ""),
            f"{pair['score']:.2f}",
            pair.get("decided") or pair["certainty"],
        ]
        if explain:
            others = ((other[partner], other["score"]) for other in pair["runners_up"])
            row += [_because(pair["reasons"]), _or(others)]
        table.add_row(*row, style=_STYLES[pair["certainty"]])
    follow = mapping.get("follow", {})
    for bone in mapping["unmapped"]:
        share = f"{follow[bone]:.0%} of its parent's turn" if bone in follow else "its parent"
        table.add_row(bone, share if fk else "—", style="dim")
    console.print(table)
    for offer in mapping["offered_masters"]:
        console.print(
            f"a master {offer['master']!r} could join {', '.join(offer['effectors'])}: "
            f"{offer['why']}",
            markup=False,
            highlight=False,
        )


def _because(reasons: dict[str, float]) -> str:
    parts = sorted(reasons.items(), key=lambda item: -abs(item[1]))
    return ", ".join(f"{part} {value:+.2f}" for part, value in parts if abs(value) >= 0.005)


def _or(others: Iterable[tuple[str, float]]) -> str:
    return ", ".join(f"{name} {score:.2f}" for name, score in islice(others, 2))


def _print_matrix(armature: Armature, name: str, *, as_json: bool) -> None:
    if name not in BLOCKS:
        raise BadShowError(
            "there is no such block", where="--matrix", expected=", ".join(BLOCKS), found=name
        )
    block = BLOCKS[name](armature, HUMAN)
    if as_json:
        document = {
            "armature": armature.name,
            "block": name,
            "bones": list(armature.names),
            "human": list(HUMAN_BONE_NAMES),
            "matrix": [[round(float(value), 6) for value in row] for row in block],
        }
        sys.stdout.write(json.dumps(document) + "\n")
        return
    table = Table(title=f"{armature.name}: {name}")
    table.add_column("bone", no_wrap=True)
    for human in HUMAN_BONE_NAMES:
        table.add_column(human.replace("upper_", "u_").replace("shoulder", "shld"), justify="right")
    for bone, row in zip(armature.names, block, strict=True):
        table.add_row(bone, *(f"{value:.3g}" if value else "·" for value in row))
    # Numbers that are cut off are of no use: wider than the terminal if it must be.
    Console(width=max(240, Console().width)).print(table)


def decide_live(
    show_path: Path,
    puppet: str | None,
    port: int | None,
    *,
    pairs: Sequence[tuple[Act, Sequence[str]]],
    clear: Sequence[str],
    mode: str | None,
    group: Sequence[str],
    ungroup: Sequence[str],
    undo: bool,
    redo: bool,
    explain: bool,
    reload: bool,
) -> None:
    """Correct the mapping of a running show, and print what drives the puppet then."""
    changes = bool(mode or clear or group or ungroup or any(texts for _, texts in pairs))
    if changes + undo + redo + reload > 1:
        raise BadDecisionError(
            "only one of these can be done at a time",
            where="--undo, --redo, --reload",
            hint="give one of them alone, and what is to be decided in another call",
        )
    if puppet is None and (changes or undo or redo):
        raise BadDecisionError(
            "it is not said which puppet this is about",
            expected="puppet decide SHOW PUPPET …",
            found="no name of a puppet",
            hint="puppet decide SHOW lists the puppets on stage",
        )
    # What is malformed is told before anybody is asked.
    wanted = None if mode is None else mode_of(mode)
    given = [pair for act, texts in pairs for pair in _pairs(act, texts)]
    masters = [_master(text) for text in group]
    show = load_show(show_path)
    endpoint = show.bus.endpoint if port is None else f"tcp/127.0.0.1:{port}"
    with Bus.join(endpoint, show.key, wait=3.0) as bus:
        client = MappingClient(bus)
        if reload:
            for warning in client.load():
                _err.print(warning, style="yellow", markup=False, highlight=False)
        cards = client.puppets()
        if puppet is None:
            _print_cards(cards)
            return
        card = next((card for card in cards if card["name"] == puppet), None)
        if card is None:
            raise BadDecisionError(
                "there is no such puppet on stage",
                expected=f"one of {', '.join(card['name'] for card in cards)}",
                found=puppet,
            )
        current: Mode = wanted or card["mode"]
        step = [Decision("mode", wanted)] if wanted else []
        step += _decisions(current, given)
        step += [Decision("clear", current, bone) for bone in clear]
        step += masters
        step += [Decision("ungroup", "ik", name) for name in ungroup]
        answer = client.propose(puppet)[0]
        if undo:
            answer = client.undo(puppet)
        elif redo:
            answer = client.redo(puppet)
        elif step:
            answer = client.decide(puppet, step, _who())
        _print_mapping(answer, f"{puppet}: {_KINDS[answer['mode']]}", explain=explain)
        _print_history(client.history(puppet))


def _who() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # in a container a user may have no name
        return ""


def _master(text: str) -> Decision:
    name, equals, effectors = text.partition("=")
    if not (name and equals and effectors):
        raise BadDecisionError(
            "this is not a master",
            where="--group",
            expected="NAME=BONE,BONE, as wings=wing_tip.L,wing_tip.R",
            found=text,
        )
    bones = tuple(bone.strip() for bone in effectors.split(","))
    return Decision("group", "ik", name, effectors=bones)


def _print_cards(cards: Iterable[dict[str, Any]]) -> None:
    table = Table()
    for column in ("puppet", "driven by", "pairs", "doubtful", "unmapped"):
        table.add_column(column)
    for card in cards:
        unmapped = ", ".join(card["unmapped"])
        table.add_row(
            card["name"], card["mode"].upper(), str(card["pairs"]), str(card["doubtful"]), unmapped
        )
    Console().print(table)
    for card in cards:
        for warning in card["warnings"]:
            _err.print(warning, style="yellow", markup=False, highlight=False)


def _print_history(history: dict[str, Any]) -> None:
    for index, step in enumerate(history["steps"]):
        undone = index >= history["holds"]
        _err.print(
            f"{index + 1}. {step}" + ("  (undone)" if undone else ""),
            style="dim" if undone else "",
            markup=False,
            highlight=False,
        )
