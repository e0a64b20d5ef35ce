"""Shows: what is accepted, and what is said of the rest."""

from __future__ import annotations

from pathlib import Path

import pytest

from puppet.errors import BadShowError
from puppet.show import load_show

SHOWS = sorted((Path(__file__).parents[1] / "configs/shows").glob("*.toml"))
GOOD = """
name = "A Show"
[source]
path = "rehearsal"
[[puppets]]
name = "fish"
armature = "fish.glb"
"""


@pytest.mark.parametrize("path", SHOWS, ids=lambda path: path.stem)
def test_the_shows_of_the_repository_load(path: Path) -> None:
    show = load_show(path)
    assert all((path.parent / puppet.armature).exists() for puppet in show.puppets)


def test_a_show_has_a_key_for_the_bus(tmp_path: Path) -> None:
    path = tmp_path / "show.toml"
    path.write_text(GOOD)
    assert load_show(path).key == "a-show"


@pytest.mark.parametrize(
    ("text", "place", "says"),
    [
        (GOOD.replace("path", "pth"), "source", "unknown field `pth`"),
        (GOOD + "yaw = 'left'\n", "puppets[0].yaw", "expected `float`, got `str`"),
        (GOOD + "colour = 'red'\n", "puppets[0]", "unknown field `colour`"),
        (GOOD.replace("fish.glb", "x").replace('armature = "x"', ""), "puppets[0]", "armature"),
        (GOOD + "height = 0\n", "puppets[0].height", "0.01 to 100"),
        (GOOD + "mode = 'xk'\n", "puppets[0].mode", "invalid enum value 'xk'"),
        (GOOD + "position = [1, 2]\n", "puppets[0].position", "length 3"),
        (GOOD + "position = [1, nan, 2]\n", "puppets[0].position", "finite"),
        (GOOD + "[[puppets]]\nname = 'fish'\narmature = 'b'\n", "puppets[1].name", "same name"),
        (GOOD.split("[[", maxsplit=1)[0] + "puppets = []\n", "source", "unknown field"),
        ("puppets = []\n" + GOOD.split("[[", maxsplit=1)[0], "puppets", "at least one"),
        (GOOD + "[view]\nwidth = 3\n", "view.width", "16 to 8192"),
        (GOOD + "[conditioning]\nhold = -1\n", "conditioning.hold", "0 or more"),
        (GOOD.replace('"rehearsal"', '"rehearsal"\nspeed = 0'), "source.speed", "above 0"),
        ("name = ", "", "not TOML"),
        ("\udcff", "", "not TOML"),
    ],
)
def test_a_wrong_show_is_told_with_file_and_place(
    tmp_path: Path, text: str, place: str, says: str
) -> None:
    path = tmp_path / "show.toml"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(BadShowError) as caught:
        load_show(path)
    message = str(caught.value)
    assert f"{path}: {place}" in message
    assert says in message


def test_a_missing_show_is_told(tmp_path: Path) -> None:
    with pytest.raises(BadShowError, match="cannot be opened"):
        load_show(tmp_path / "nothing.toml")
