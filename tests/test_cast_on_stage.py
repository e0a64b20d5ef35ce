"""The seven published puppets on the rehearsal: how they move, before anything is limited.

What is looked at is what the mapping and the solver ask for (`DrivenPuppet.asked`): behind the
limit on turning nothing could be seen to jump.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from puppet.cast import Cast, load_cast
from puppet.kernel import Floats
from puppet.line import Line
from puppet.mapping.proposal import Mode
from puppet.mapping.stance import heading_of, in_heading
from puppet.pose import Pose, forward_kinematics
from puppet.rotation import rotate
from puppet.show import load_show
from puppet.skeleton import Joint, SkeletonFrame
from puppet.tracking.choreography import SECTIONS
from puppet.tracking.rehearsal import Rehearsal
from tests.shows import write_show

PUBLISHED: dict[str, Mode] = {
    "lamp": "fk",
    "fish": "fk",
    "dog": "fk",
    "seagull": "ik",
    "seagull_with_master": "ik",
    "snake": "ik",
    "ostrich": "ik",
}
EVERY = pytest.mark.parametrize("name", PUBLISHED)
#: Degrees that a bone may turn for each metre that the performer's quickest joint moves on the body
#: between two frames. The limbs of the small gull turn by 1100 for one of ours when arms swing far
#: behind the back; a flip would be 180 for a few millimetres.
STEEPEST = 1300.0
#: Metres: what trembling, and the influence of a joint that is lost, add to a step.
TREMBLING, LOSS = 0.004, 0.4


@dataclass(frozen=True)
class Moment:
    """One frame: the performer, what is asked of each puppet, and what is shown."""

    frame: SkeletonFrame
    asked: dict[str, Pose]
    shown: dict[str, Pose]
    counts_anew: bool

    @property
    def joints(self) -> Floats:
        """(20, 3) metres from the hip, in the performer's heading."""
        positions = self.frame.positions
        return in_heading(positions, positions[Joint.HIP_CENTER], heading_of(positions))


@pytest.fixture(scope="module")
def cast(tmp_path_factory: pytest.TempPathFactory) -> Cast:
    puppets = {name: (f"{name}.toml", mode) for name, mode in PUBLISHED.items()}
    path = write_show(tmp_path_factory.mktemp("cast"), puppets)
    path.write_text(path.read_text().replace("0.5, 0.0]", "0.0, 0.0]"))  # on the floor
    return load_cast(load_show(path), path)


@pytest.fixture(scope="module")
def rehearsed(cast: Cast) -> list[Moment]:
    line = Line(cast)
    moments, measured = [], False
    for frame in Rehearsal():
        tick = line.step(frame)
        asked = {name: driven.asked(tick.frame) for name, driven in line._driven.items()}
        anew = tick.measured != measured
        measured = tick.measured
        moments.append(Moment(tick.frame, asked, tick.poses, anew))
    return moments


def section(name: str) -> slice:
    found = next(part for part in SECTIONS if part.name == name)
    return slice(int(found.start * 30) + 1, int(found.end * 30))


def degrees(a: Floats, b: Floats) -> Floats:
    """How far each bone is from being turned alike."""
    cosine = np.clip(np.abs((a * b).sum(axis=1)), 0.0, 1.0)
    return np.asarray(np.degrees(2.0 * np.arccos(cosine)))


def tip(cast: Cast, pose: Pose, puppet: str, bone: str) -> Floats:
    """Where a bone ends, in the world."""
    armature = next(p for p in cast if p.name == puppet).model.armature
    positions, rotations = forward_kinematics(armature, pose)
    index = armature.index(bone)
    return np.asarray(positions[index] + rotate(rotations[index], armature.tips[index]))


@EVERY
def test_it_rests_while_the_performer_does_before_and_after(
    cast: Cast, rehearsed: list[Moment], name: str
) -> None:
    puppet = next(p for p in cast if p.name == name)
    for moment in (rehearsed[75], rehearsed[-1]):
        for pose in (moment.asked[name], moment.shown[name]):
            assert degrees(pose.bones, puppet.model.armature.rotations).max() < 4.0
            assert np.abs(pose.translation - puppet.placement.position).max() < 0.02


@EVERY
def test_no_bone_flips_the_steps_of_the_puppet_are_those_of_the_performer(
    rehearsed: list[Moment], name: str
) -> None:
    for before, after in pairwise(rehearsed):
        if after.counts_anew:
            continue
        step = np.linalg.norm(after.joints - before.joints, axis=1).max()
        lost = np.abs(after.frame.influence - before.frame.influence).max()
        turned = degrees(after.asked[name].bones, before.asked[name].bones).max()
        most = STEEPEST * (step + LOSS * lost + TREMBLING)
        assert turned < most, f"{turned:.0f}° at {after.frame.time:.2f} s, {1000 * step:.0f} mm"


@EVERY
def test_nothing_is_remembered_the_same_frame_asks_for_the_same_pose(
    cast: Cast, rehearsed: list[Moment], name: str
) -> None:
    line = Line(cast)
    for frame in list(Rehearsal())[:100]:
        line.step(frame)
    driven = line._driven[name]
    for moment in (rehearsed[520], rehearsed[100], rehearsed[880], rehearsed[520]):
        pose = driven.asked(moment.frame)
        assert pose.bones.tobytes() == moment.asked[name].bones.tobytes()


@EVERY
def test_nothing_goes_through_the_floor(cast: Cast, rehearsed: list[Moment], name: str) -> None:
    puppet = next(p for p in cast if p.name == name)
    if puppet.floor is None:
        assert name == "fish"
        return
    for moment in rehearsed[::5]:
        origins, frames = forward_kinematics(puppet.model.armature, moment.shown[name])
        heights = [
            origins[bone][1] + rotate(frames[bone], point)[1]
            for bone, point in zip(puppet.floor.bones, puppet.floor.positions, strict=True)
        ]
        assert min(heights) > -1e-6, f"at {moment.frame.time:.2f} s"


@pytest.mark.parametrize("part", ["wave", "bow", "squat"])
@pytest.mark.parametrize("foot", ["paw.L", "paw.R"])
def test_a_foot_that_stands_does_not_slide(
    cast: Cast, rehearsed: list[Moment], part: str, foot: str
) -> None:
    """The performer's feet stand in these parts, and the ostrich's with them."""
    places = [
        tip(cast, moment.shown["ostrich"], "ostrich", foot) for moment in rehearsed[section(part)]
    ]
    assert np.ptp(np.array(places), axis=0).max() < 0.025


def test_a_squat_bends_the_legs_and_a_jump_lifts_the_whole_bird(
    cast: Cast, rehearsed: list[Moment]
) -> None:
    heights = np.array([moment.shown["ostrich"].translation[1] for moment in rehearsed])
    assert heights[section("squat")].min() < -0.15
    assert heights[section("jump")].max() > 0.1
    paws = [
        min(tip(cast, m.shown["ostrich"], "ostrich", f"paw.{side}")[1] for side in "LR")
        for m in rehearsed[section("jump")]
    ]
    assert max(paws) > 0.1


@pytest.mark.parametrize(("puppet", "rise"), [("snake", 0.3), ("ostrich", 0.05)])
def test_the_right_hand_leads_the_head(
    cast: Cast, rehearsed: list[Moment], puppet: str, rise: float
) -> None:
    part = rehearsed[section("arms out and up")]
    rest = tip(cast, rehearsed[75].shown[puppet], puppet, "head")
    heads = np.array([tip(cast, moment.shown[puppet], puppet, "head") for moment in part])
    hands = np.array([moment.joints[Joint.HAND_RIGHT] for moment in part])
    out, up = int(np.argmin(hands[:, 0])), int(np.argmax(hands[:, 1]))
    assert heads[out, 0] < rest[0] - 0.2, "the hand goes out to the right, and so does the head"
    assert heads[up, 1] > rest[1] + rise, "the hand goes up, and so does the head"


def test_one_hand_flaps_both_wings_like_a_mirror(cast: Cast, rehearsed: list[Moment]) -> None:
    name = "seagull_with_master"
    x = next(p for p in cast if p.name == name).placement.position[0]
    lifted = 0.0
    for moment in rehearsed[section("wave")][::6]:
        left, right = (
            tip(cast, moment.asked[name], name, f"wing_tip.{side}") - (x, 0.0, 0.0) for side in "LR"
        )
        assert np.abs(left * (-1.0, 1.0, 1.0) - right).max() < 0.05
        lifted = max(lifted, float(left[1]))
    assert lifted > tip(cast, rehearsed[75].asked[name], name, "wing_tip.L")[1] + 0.15
