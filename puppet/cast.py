"""The cast: the puppets of a show, loaded, mapped and placed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from puppet.errors import BadShowError
from puppet.formats.armature_toml import load_puppet
from puppet.mapping.drive import Placement
from puppet.mapping.forward import propose_forward
from puppet.mapping.proposal import Proposal
from puppet.mesh import Model
from puppet.show import PuppetConfig, Show


@dataclass(frozen=True, slots=True, eq=False)
class StagedPuppet:
    """A puppet on stage: its file, its model at `scale` times the file's size, what drives it
    and where it stands."""

    name: str
    path: Path
    scale: float
    model: Model
    proposal: Proposal
    placement: Placement


def load_cast(show: Show, show_path: Path) -> tuple[StagedPuppet, ...]:
    """Load every puppet of a show and propose its mapping.

    Raises BadFileError for a model that cannot be read, and BadShowError for one in which nothing
    could be mapped.
    """
    return tuple(_stage(puppet, show_path.parent) for puppet in show.puppets)


def _stage(config: PuppetConfig, folder: Path) -> StagedPuppet:
    path = (folder / config.armature).resolve()
    puppet = load_puppet(path)
    scale = 1.0 if config.height is None else config.height / max(puppet.model.height, 1e-6)
    model = puppet.model.scaled(scale)
    proposal = propose_forward(model.armature)
    if not proposal.pairs:
        raise BadShowError(
            "no bone of this armature could be mapped",
            where=path,
            found=f"bones {', '.join(puppet.model.armature.names)}",
        )
    follow = config.follow if isinstance(config.follow, tuple) else (config.follow,) * 3
    placement = Placement(
        position=np.array(config.position, float),
        yaw=float(np.radians(config.yaw)),
        follow=np.array(follow, float),
        turn=config.turn,
        grounded=puppet.traits.grounded,
    )
    return StagedPuppet(config.name, path, scale, model, proposal, placement)
