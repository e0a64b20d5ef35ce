"""The whole line over the recorded streams: what moves, what rests, what never jumps."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from puppet.cast import Cast, load_cast
from puppet.line import Line, Tick
from puppet.pose import forward_kinematics, rest_pose
from puppet.show import load_show
from puppet.skeleton import Moment
from puppet.tracking.takes.rehearsal import SECTIONS, Rehearsal
from puppet.tracking.takes.replay import Replay, paced
from puppet.tracking.takes.take import read_take

REPOSITORY = Path(__file__).resolve().parents[1]
SHOW = REPOSITORY / "configs/shows/rehearsal.toml"
STREAMS = sorted((REPOSITORY / "tests/recorded_streams").glob("*.mcap"))


@pytest.fixture(scope="module")
def cast() -> Cast:
    return load_cast(load_show(SHOW), SHOW)


@pytest.fixture(scope="module")
def rehearsed(cast: Cast) -> list[Tick]:
    line = Line(cast)
    return [line.step(moment) for moment in Rehearsal()]


def section(word: str) -> slice:
    """The frames of the first section of the rehearsal whose name has `word` in it."""
    found = next(part for part in SECTIONS if word in part.name)
    return slice(int(found.start * 30) + 1, int(found.end * 30))


def tips(cast: Cast, tick: Tick, puppet: str, bone: str) -> np.ndarray:
    """Where a bone of a puppet ends, in the world."""
    armature = next(p for p in cast if p.name == puppet).model.armature
    positions, rotations = forward_kinematics(armature, tick.poses[puppet])
    index = armature.index(bone)
    turn = Rotation.from_quat(rotations[index])
    return np.asarray(positions[index] + turn.apply(armature.tips[index].copy()))


def test_somebody_who_just_stands_there_leaves_the_puppets_at_rest(
    cast: Cast, rehearsed: list[Tick]
) -> None:
    standing = rehearsed[45]
    for puppet in cast:
        armature = puppet.model.armature
        turned = Rotation.from_quat(standing.poses[puppet.name].bones)
        away = (turned * Rotation.from_quat(armature.rotations).inv()).magnitude()
        assert np.degrees(away).max() < 4.0


def test_raised_hands_lift_the_shade_of_the_lamp(cast: Cast, rehearsed: list[Tick]) -> None:
    at_rest = tips(cast, rehearsed[45], "lamp", "shade")[1]
    arms_up = max(tips(cast, tick, "lamp", "shade")[1] for tick in rehearsed[section("up")])
    assert arms_up > at_rest + 0.3


def test_raised_arms_open_the_fins_on_both_sides(cast: Cast, rehearsed: list[Tick]) -> None:
    for fin in ("fin_tip.L", "fin_tip.R"):
        rest = tips(cast, rehearsed[45], "fish", fin)
        opened = max(rehearsed[section("up")], key=lambda t: tips(cast, t, "fish", fin)[1])
        up = tips(cast, opened, "fish", fin)
        assert up[1] > rest[1] + 0.15, fin
    left = tips(cast, rehearsed[45], "fish", "fin_tip.L")[0]
    assert left > tips(cast, rehearsed[45], "fish", "fin_tip.R")[0]


def test_a_bow_makes_the_fish_look_down(cast: Cast, rehearsed: list[Tick]) -> None:
    rest = tips(cast, rehearsed[45], "fish", "head")[1]
    lowest = min(tips(cast, tick, "fish", "head")[1] for tick in rehearsed[section("bow")])
    assert lowest < rest - 0.08


def test_a_wave_of_the_right_hand_leaves_the_left_fin_alone(
    cast: Cast, rehearsed: list[Tick]
) -> None:
    def reach(fin: str) -> float:
        places = np.array([tips(cast, t, "fish", fin) for t in rehearsed[section("wave")]])
        return float(np.ptp(places, axis=0).max())

    assert reach("fin_tip.R") > 4 * reach("fin_tip.L")


def test_the_puppets_turn_once_round_with_the_performer(rehearsed: list[Tick]) -> None:
    yaw = np.unwrap(
        [
            2 * np.arctan2(tick.poses["fish"].rotation[1], tick.poses["fish"].rotation[3])
            for tick in rehearsed[section("turn")]
        ],
        period=2 * np.pi,
    )
    assert abs(abs(yaw[-1] - yaw[0]) - 2 * np.pi) < 0.5


def test_a_squat_does_not_push_the_lamp_into_the_floor(rehearsed: list[Tick]) -> None:
    for tick in rehearsed:
        assert tick.poses["lamp"].translation[1] >= -1e-9
    fish = [tick.poses["fish"].translation[1] for tick in rehearsed[section("squat")]]
    assert min(fish) < 0.95 - 0.08


def test_when_the_performer_leaves_the_puppets_go_to_rest_and_wake_up_again(
    cast: Cast, rehearsed: list[Tick]
) -> None:
    away = [i for i, tick in enumerate(rehearsed) if not tick.frame.present]
    empty = rehearsed[away[len(away) * 3 // 4]]
    for puppet in cast:
        rest = rest_pose(puppet.model.armature)
        turned = Rotation.from_quat(empty.poses[puppet.name].bones)
        apart = (turned * Rotation.from_quat(rest.bones).inv()).magnitude()
        assert np.degrees(apart).max() < 6.0
    assert rehearsed[-1].frame.influence.min() > 0.95


@pytest.mark.parametrize("path", STREAMS, ids=lambda path: path.stem)
def test_no_bone_ever_pops(cast: Cast, path: Path) -> None:
    """No bone turns faster than 720 degrees a second."""
    line = Line(cast)
    ticks = [line.step(moment) for moment in read_take(path)]
    for before, after in pairwise(ticks):
        dt = after.time - before.time
        for name, pose in after.poses.items():
            turned = (
                Rotation.from_quat(pose.bones) * Rotation.from_quat(before.poses[name].bones).inv()
            )
            assert np.degrees(turned.magnitude()).max() / dt < 725, f"{name} at {after.time}"
            moved = np.abs(pose.translation - before.poses[name].translation).max()
            assert moved / dt < 6.0


@pytest.mark.parametrize("speed", [0.25, 1.0, 8.0])
def test_a_take_gives_the_same_poses_bit_for_bit_at_any_speed(cast: Cast, speed: float) -> None:
    take = read_take(STREAMS[0])

    def poses(moments: list[Moment]) -> list[bytes]:
        line = Line(cast)
        return [
            b"".join(pose.bones.tobytes() for pose in line.step(moment).poses.values())
            for moment in moments
        ]

    dues, played = zip(*paced(Replay.of(take, speed=speed)), strict=True)
    assert poses(list(played)) == poses(list(take))
    assert dues[-1] == pytest.approx(take.duration / speed)


def test_before_anybody_was_seen_all_is_at_rest(cast: Cast) -> None:
    line = Line(cast)
    for tick in (line.at_rest(5.0), line.idle(5.0)):
        for puppet in cast:
            np.testing.assert_allclose(
                tick.poses[puppet.name].bones, puppet.model.armature.rotations, atol=1e-9
            )
            np.testing.assert_allclose(
                tick.poses[puppet.name].translation, puppet.placement.position, atol=1e-9
            )


def test_the_line_goes_on_by_itself_when_frames_stop(cast: Cast) -> None:
    line = Line(cast)
    moments = list(Rehearsal())[: int(SECTIONS[1].end * 30) - 30]
    for moment in moments:
        last = line.step(moment)
    fin = next(p for p in cast if p.name == "fish").model.armature.index("fin.R")
    for step in range(1, 150):
        tick = line.idle(moments[-1].time + step / 30)
    armature = next(p for p in cast if p.name == "fish").model.armature
    assert np.abs(last.poses["fish"].bones[fin] - armature.rotations[fin]).max() > 0.05
    assert np.abs(tick.poses["fish"].bones[fin] - armature.rotations[fin]).max() < 0.01
