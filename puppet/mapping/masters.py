"""What may be a master bone: one handle that moves several end effectors."""

from __future__ import annotations

from collections.abc import Sequence

from puppet.armature import Armature


def master_problem(
    name: str, effectors: Sequence[str], armature: Armature
) -> tuple[str, str] | None:
    """What is wrong with a master, and what was found; None if it can be.

    The bones must be there (whoever reads them checks that, and knows where they were written).
    """
    if not name.strip() or not name.isprintable():
        return "a master needs a name", repr(name)
    if name in armature.names:
        return "a master cannot have the name of a bone", name
    if len(set(effectors)) < 2:
        return "a master drives two or more different bones", ", ".join(effectors) or "none"
    bones = {armature.index(effector) for effector in effectors}
    roots = [armature.names[bone] for bone in sorted(bones) if armature.parents[bone] < 0]
    if roots:
        return "a root goes where the performer goes, and no master moves it", ", ".join(roots)
    for bone in sorted(bones):
        for other in armature.below(bone)[1:]:
            if other in bones:
                names = f"{armature.names[bone]} and {armature.names[other]}"
                return "a master cannot drive a bone and another that hangs on it", names
    return None
