"""Several performers on the line: each puppet follows one, and changes hands without a jump."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from puppet.cast import Cast, load_cast
from puppet.errors import BadShowError
from puppet.line import REMEMBERED, Line, Tick
from puppet.pose import Pose
from puppet.show import PartConfig, load_show
from puppet.skeleton import Moment, SkeletonFrame, mirrored
from puppet.tracking.takes.rehearsal import Rehearsal

SHOW = Path(__file__).resolve().parents[1] / "configs/shows/rehearsal.toml"
TWO_PARTS = (PartConfig("one"), PartConfig("two"))
REHEARSAL = [moment.frame_of(0) for moment in Rehearsal()]
#: Frames of the wave of the right hand: from 3 s on.
WAVE = slice(60, 240)


@pytest.fixture(scope="module")
def cast() -> Cast:
    return load_cast(load_show(SHOW), SHOW)


def in_parts(cast: Cast, **part: str) -> list:  # type: ignore[type-arg]
    return [replace(puppet, part=part.get(puppet.name, "")) for puppet in cast]


def as_performer(frame: SkeletonFrame, number: int, x: float = 0.0) -> SkeletonFrame:
    """The same movement by somebody else, so far to the left."""
    return replace(frame, performer=number, positions=frame.positions + (x, 0.0, 0.0))


def together(*frames: SkeletonFrame) -> Moment:
    there = tuple(frame for frame in frames if frame.present)
    return Moment(frames[0].time, frames[0].sequence, there)


def still(frame: SkeletonFrame, number: int, x: float) -> SkeletonFrame:
    """Somebody who stands there as at the beginning of the rehearsal."""
    first = as_performer(REHEARSAL[30], number, x)
    return replace(first, time=frame.time, sequence=frame.sequence)


def degrees(before: Pose, after: Pose) -> float:
    turned = Rotation.from_quat(after.bones) * Rotation.from_quat(before.bones).inv()
    return float(np.degrees(turned.magnitude()).max())


def test_each_puppet_follows_whoever_plays_its_part(cast: Cast) -> None:
    """Two people who do not know of each other: as if each had a line alone."""
    both = Line(in_parts(cast, fish="one", lamp="two"), parts=TWO_PARTS)
    alone = Line(cast)
    for frame in REHEARSAL[:300]:
        beside = still(frame, 1, 5.0)  # further away, so the second part is theirs
        tick = both.step(together(as_performer(frame, 0), beside))
        expected = alone.step(Moment.of(frame))
        assert tick.parts == {"one": 0, "two": 1}
        np.testing.assert_array_equal(tick.poses["fish"].bones, expected.poses["fish"].bones)
    rest = next(p for p in cast if p.name == "lamp").model.armature.rotations
    assert degrees(replace(tick.poses["lamp"], bones=rest), tick.poses["lamp"]) < 4.0


def test_a_puppet_changes_hands_without_a_jump(cast: Cast) -> None:
    line = Line(cast)
    ticks: list[Tick] = []
    for index, frame in enumerate(REHEARSAL[:600]):
        # The second performer is in the midst of other movements, and faces another way.
        other = as_performer(REHEARSAL[(index + 500) % 1500], 1, 1.5)
        other = replace(other, time=frame.time, sequence=frame.sequence)
        ticks.append(line.step(together(frame, other)))
        if index == 200:
            line.parts.assign("lead", 1)
        if index == 400:
            line.parts.release("lead")
    assert [ticks[i].parts["lead"] for i in (199, 250, 450)] == [0, 1, 0]
    for before, after in pairwise(ticks[60:]):
        for name in before.poses:
            assert degrees(before.poses[name], after.poses[name]) < 24.5, (name, after.time)


def test_a_released_part_lets_its_puppets_rest(cast: Cast) -> None:
    line = Line(cast)
    for frame in REHEARSAL[:110]:
        line.step(Moment.of(frame))
    line.parts.release("lead")
    for frame in REHEARSAL[110:170]:
        tick = line.step(Moment.of(frame))
    for puppet in cast:
        rest = replace(tick.poses[puppet.name], bones=puppet.model.armature.rotations)
        assert degrees(rest, tick.poses[puppet.name]) < 0.5


def test_in_mirror_mode_the_other_side_moves(cast: Cast) -> None:
    """A line that mirrors, given the mirror image, does what a plain line does."""
    plain, mirror = Line(cast), Line(cast, mirror=True)
    for frame in REHEARSAL[:300]:
        expected = plain.step(Moment.of(frame)).poses
        got = mirror.step(Moment.of(mirrored(frame))).poses
        for name, pose in expected.items():
            np.testing.assert_array_equal(got[name].bones, pose.bones)


def test_mirror_mode_is_switched_in_mid_show_without_a_jump(cast: Cast) -> None:
    line = Line(cast)
    ticks = []
    for index, frame in enumerate(REHEARSAL[:200]):
        line.mirror = index >= 120
        ticks.append(line.step(Moment.of(frame)))
    for before, after in pairwise(ticks[60:]):
        for name in before.poses:
            assert degrees(before.poses[name], after.poses[name]) < 24.5, (name, after.time)


def test_who_left_long_ago_is_forgotten(cast: Cast) -> None:
    line = Line(cast)
    line.step(together(REHEARSAL[0], still(REHEARSAL[0], 1, 2.0)))
    frame = REHEARSAL[30]
    for second in range(1, int(REMEMBERED) + 3):
        tick = line.step(Moment.of(replace(frame, time=float(second), sequence=second)))
    assert [now.frame.performer for now in tick.performers] == [0]


def test_a_puppet_of_a_part_that_is_not_there_is_refused(cast: Cast) -> None:
    with pytest.raises(BadShowError, match="chorus") as caught:
        Line(in_parts(cast, fish="chorus"), parts=TWO_PARTS)
    assert "one, two" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[[parts]]\nname = "a"\n[[parts]]\nname = "a"', "a name of its own"),
        ('[[parts]]\nname = "a"\nrule = "zone"', "needs a zone"),
        ('[[parts]]\nname = "a"\nzone = {x = [1, 0], z = [0, 1]}', "from less to more"),
        ('[[parts]]\nname = "b"', "no such part"),
        ("[tracking]\nperformers = 5", "from 1 to 4"),
        ('[[sources]]\npath = "rehearsal"\nname = "a"', r"found: +both"),
    ],
)
def test_impossible_parts_and_sources_are_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "show.toml"
    path.write_text(
        f'name = "s"\n[source]\npath = "rehearsal"\n[[puppets]]\nname = "fish"\n'
        f'armature = "fish.glb"\npart = "{"a" if "parts" in text else ""}"\n{text}\n'
    )
    with pytest.raises(BadShowError, match=says):
        load_show(path)


def test_a_show_of_several_cameras_names_each(tmp_path: Path) -> None:
    path = tmp_path / "show.toml"
    sources = "".join(f'[[sources]]\npath = "rehearsal"\nname = "{name}"\n' for name in "ab")
    path.write_text(f'name = "s"\n{sources}[[puppets]]\nname = "fish"\narmature = "fish.glb"\n')
    show = load_show(path)
    assert [source.name for source in show.all_sources] == ["a", "b"]
    assert show.source_named("b").name == "b"
    with pytest.raises(BadShowError, match="no such source"):
        show.source_named("c")
    path.write_text(path.read_text().replace('name = "b"', 'name = "a"'))
    with pytest.raises(BadShowError, match="the same name"):
        load_show(path)
    assert msgspec.structs.replace(show, sources=()).all_sources == ()
