"""The cast: the puppets of a show, loaded, mapped and placed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from puppet.errors import BadShowError
from puppet.formats.armature_toml import Puppet, load_puppet
from puppet.formats.mapping_file import mappings_path
from puppet.mapping.placement import Placement
from puppet.mapping.proposal import Proposal
from puppet.mapping.service import MappingService, Rig
from puppet.mesh import Model
from puppet.show import PuppetConfig, Show
from puppet.solvers.floor import FloorPoints, floor_points


@dataclass(frozen=True, slots=True, eq=False)
class StagedPuppet:
    """A puppet on stage: its file, its model at `scale` times the file's size, and where it stands.

    proposal: the mapping that it starts with. reach: multiplies how far IK lets it go.
    floor: the points of its skin that may touch the floor; None if it is not on the floor.
    part: whoever plays it drives the puppet; empty for the show's first part.
    """

    name: str
    path: Path
    scale: float
    model: Model
    proposal: Proposal
    placement: Placement
    reach: float
    floor: FloorPoints | None
    part: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Cast:
    """All puppets of a show, and the service that maps them."""

    puppets: tuple[StagedPuppet, ...]
    mappings: MappingService

    def __iter__(self) -> Iterator[StagedPuppet]:
        return iter(self.puppets)

    def __len__(self) -> int:
        return len(self.puppets)


def load_cast(show: Show, show_path: Path) -> Cast:
    """Load every puppet of a show, and map it as was decided the last time.

    Raises BadFileError for a model or a mapping file that cannot be read, and BadShowError for a
    puppet in which nothing could be mapped.
    """
    loaded = {}
    for config in show.puppets:
        path = (show_path.parent / config.armature).resolve()
        loaded[config.name] = (config, path, load_puppet(path))
    kept = mappings_path(show_path)
    service = MappingService(
        {name: rig_of(puppet) for name, (_, _, puppet) in loaded.items()},
        {config.name: config.mode for config in show.puppets},
        kept if show.mappings is None else show_path.parent / show.mappings,
    )
    puppets = []
    for name, (config, path, puppet) in loaded.items():
        proposal = service.current(name)
        if not proposal.pairs:
            raise BadShowError(
                "nothing of this armature could be mapped",
                where=path,
                found=f"bones {', '.join(puppet.model.armature.names[:20])}",
                hint=_what_to_do(proposal, service.history(name).holds),
            )
        puppets.append(_staged(config, path, puppet, proposal))
    return Cast(tuple(puppets), service)


def rig_of(puppet: Puppet) -> Rig:
    """What the mapping wants to know of a puppet."""
    follows = {name: bone.follow for name, bone in puppet.traits.bones.items() if bone.follow}
    return Rig(
        puppet.model.armature, puppet.traits.preferences, dict(puppet.traits.masters), follows
    )


def _what_to_do(proposal: Proposal, decided: int) -> str:
    if decided:
        return "decisions stand in the way: look into the mapping file, or move it away"
    if proposal.mode == "ik":
        return 'IK needs a chain of two bones or more: try mode = "fk"'
    return "bones that slide or are fixed cannot be driven; see the .toml beside the model"


def _staged(config: PuppetConfig, path: Path, puppet: Puppet, proposal: Proposal) -> StagedPuppet:
    scale = 1.0 if config.height is None else config.height / max(puppet.model.height, 1e-6)
    model = puppet.model.scaled(scale)
    follow = config.follow
    placement = Placement(
        position=np.array(config.position, float),
        yaw=float(np.radians(config.yaw)),
        follow=np.array(follow) if isinstance(follow, tuple) else follow,
        turn=config.turn,
        grounded=bool(puppet.traits.grounded),
    )
    floor = floor_points(model) if puppet.traits.grounded else None
    return StagedPuppet(
        config.name, path, scale, model, proposal, placement, config.reach, floor, config.part
    )
