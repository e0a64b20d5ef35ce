"""A name of its own for every bone, whatever the file calls them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

#: Names that a warning gives before it only counts.
NAMED: Final = 8


def listed(names: Sequence[str]) -> str:
    """The first few names, and how many more there are.

    >>> listed(["hip", "knee"]), listed(["toe"] * 10)[-10:]
    ("'hip', 'knee'", 'and 2 more')
    """
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(map(repr, names[:NAMED])) + more


def unique_names(
    given: Sequence[object], instead: Sequence[str], warn: Callable[[str], None]
) -> list[str]:
    """A name for each bone: as `given`, numbered if it is there before; `instead` if it is none.

    >>> unique_names(["arm", "arm", None], ["bone_0", "bone_1", "bone_2"], print)
    bones without a name are now called 'bone_2'
    bone 'arm' is there more than once: one is now 'arm_2'
    ['arm', 'arm_2', 'bone_2']
    """
    said = [name if isinstance(name, str) and name.strip() else None for name in given]
    nameless = [other for name, other in zip(said, instead, strict=True) if name is None]
    if nameless:
        warn(f"bones without a name are now called {listed(nameless)}")
    taken = {name for name in said if name is not None}
    names: dict[str, None] = {}
    numbers: dict[str, int] = {}
    renamed: list[tuple[str, str]] = []
    for name, other in zip(said, instead, strict=True):
        wish = unique = other if name is None else name
        while unique in names or ((name is None or unique != wish) and unique in taken):
            numbers[wish] = numbers.get(wish, 1) + 1
            unique = f"{wish}_{numbers[wish]}"
        if unique != wish:
            renamed.append((wish, unique))
        names[unique] = None
    for wish, unique in renamed[:NAMED]:
        warn(f"bone {wish!r} is there more than once: one is now {unique!r}")
    if len(renamed) > NAMED:
        warn(f"{len(renamed) - NAMED} more bones have names that are there before: numbered")
    return list(names)
