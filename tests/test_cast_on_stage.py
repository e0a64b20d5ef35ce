"""The seven published puppets and every real rig on stage: how they move, before any limiter.

What is looked at is what the mapping and the solver ask for (`DrivenPuppet.asked`): behind the
limit on turning nothing could be seen to jump. What is shown is looked at for where it stands.
"""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.cast import Cast, StagedPuppet, load_cast, rig_of
from puppet.driven import DrivenPuppet
from puppet.formats.armature_toml import load_puppet
from puppet.kernel import Floats
from puppet.line import Line
from puppet.mapping.proposal import Mode
from puppet.mapping.stance import Stance, heading_of, in_heading, upright
from puppet.pose import Pose, forward_kinematics
from puppet.show import load_show
from puppet.skeleton import Joint, Moment, SkeletonFrame, nobody
from puppet.solvers.joint_limits import Bounds
from puppet.tracking.takes.choreography import DURATION, SECTIONS
from puppet.tracking.takes.rehearsal import Rehearsal
from puppet.tracking.takes.take import read_take
from tests.moments import frames_of
from tests.rig_changes import MODES, propose
from tests.shows import write_show
from tests.test_any_rig import SHARED

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
STANDING_ON_IK = ("ostrich", "seagull", "seagull_with_master")
STREAMS = sorted((Path(__file__).parent / "recorded_streams").glob("balance*.mcap"))
RATE = 30

#: Degrees that a bone may turn for each metre that the performer's quickest joint goes in a frame.
#:
#: A part as long as L turns by 57/L degrees when one of its ends goes a metre, and by twice as many
#: when both go, opposite ways. FK passes that on: 225 to 450 for an arm's two bones, with which
#: fins and legs turn; and 1350 for a hand of 8.5 cm, with which the lamp's shade turns. Under IK
#: chains bend the more the straighter they are and the further they are asked to go. What is
#: allowed is a fifth more than what was measured: 177 (fish, dog), 802 (lamp), 1130 (the gulls,
#: whose necks of two short bones fold from one side to the other within a frame or two); and little
#: more than the one steepest frame of the ostrich (623) and of the snake (900), whose other frames
#: stay below two thirds of that.
STEEPEST = {
    "fish": 220.0,
    "dog": 220.0,
    "lamp": 950.0,
    "ostrich": 640.0,
    "snake": 920.0,
    "seagull": 1350.0,
    "seagull_with_master": 1350.0,
}
#: Metres: what trembling adds to a step.
TREMBLING = 0.003
#: Degrees that no bone turns in a frame, however quick the performer is; measured: 50.
WIDEST = 60.0
#: Degrees in a frame while a performer is lost and found: just what a shown bone may turn at most.
GENTLE = 720.0 / RATE


@dataclass(frozen=True, eq=False)
class Shown:
    """One frame: the performer, what is asked of each puppet, and what is shown.

    anew: whether another neutral stance is counted from since the frame before.
    """

    frame: SkeletonFrame
    neutral: Stance
    asked: dict[str, Pose]
    shown: dict[str, Pose]
    anew: bool

    def moved_since(self, before: Shown) -> float:
        """Metres that the performer's quickest joint went, as far as it is trusted.

        A joint is where it is on the body, counted from the neutral stance; one that is lost goes
        home with its influence, and that is a step as well.
        """
        ways = [
            moment.frame.influence[:, None] * (on_body(moment.frame) - self.neutral.joints)
            for moment in (before, self)
        ]
        return float(np.linalg.norm(ways[1] - ways[0], axis=1).max())


def on_body(frame: SkeletonFrame) -> Floats:
    """(20, 3) metres from the hip, in the performer's heading."""
    positions = frame.positions
    return in_heading(positions, positions[Joint.HIP_CENTER], heading_of(positions))


def play(cast: Cast, frames: Iterable[SkeletonFrame]) -> list[Shown]:
    """The frames through a line; beside it, what is asked for within."""
    line = Line(cast)
    beside = {puppet.name: DrivenPuppet(puppet, UNSEEN) for puppet in cast}
    moments: list[Shown] = []
    for frame in frames:
        tick = line.step(Moment.of(frame))
        neutral = tick.neutral or UNSEEN
        anew = not moments or neutral is not moments[-1].neutral
        if anew:
            for driven in beside.values():
                driven.set_neutral(neutral)
        asked = {name: driven.asked(tick.frame) for name, driven in beside.items()}
        moments.append(Shown(tick.frame, neutral, asked, tick.poses, anew))
    return moments


UNSEEN = upright(np.zeros(3), 0.0)


@pytest.fixture(scope="module")
def cast(tmp_path_factory: pytest.TempPathFactory) -> Cast:
    return on_stage(tmp_path_factory.mktemp("cast"), PUBLISHED)


def on_stage(folder: Path, puppets: dict[str, Mode], follow: str = "") -> Cast:
    path = write_show(folder, {name: (f"{name}.toml", mode) for name, mode in puppets.items()})
    text = path.read_text().replace("0.5, 0.0]", f"0.0, 0.0]\n{follow}")  # on the floor
    path.write_text(text)
    return load_cast(load_show(path), path)


@pytest.fixture(scope="module")
def rehearsed(cast: Cast) -> list[Shown]:
    return play(cast, frames_of(Rehearsal(RATE)))


@pytest.fixture(scope="module")
def recorded(cast: Cast) -> dict[str, list[Shown]]:
    return {path.stem: play(cast, frames_of(read_take(path))) for path in STREAMS}


def section(name: str) -> slice:
    found = next(part for part in SECTIONS if part.name == name)
    return between(found.start, found.end)


def between(start: float, end: float) -> slice:
    return slice(int(start * RATE) + 1, int(end * RATE))


def of(cast: Cast, name: str) -> StagedPuppet:
    return next(puppet for puppet in cast if puppet.name == name)


def degrees(a: Floats, b: Floats) -> Floats:
    """How far each bone is from being turned alike, the short way round."""
    return np.asarray(np.degrees((Rotation.from_quat(a) * Rotation.from_quat(b).inv()).magnitude()))


def tips(armature: Armature, pose: Pose) -> Floats:
    """(B, 3) where the bones end, in the world."""
    positions, rotations = forward_kinematics(armature, pose)
    return np.asarray(positions + Rotation.from_quat(rotations).apply(armature.tips.copy()))


def tip(cast: Cast, pose: Pose, puppet: str, bone: str) -> Floats:
    """Where a bone ends, in the world."""
    armature = of(cast, puppet).model.armature
    return np.asarray(tips(armature, pose)[armature.index(bone)])


def lowest(puppet: StagedPuppet, pose: Pose) -> float:
    """The height of a puppet's lowest point of skin."""
    assert puppet.floor is not None
    origins, frames = forward_kinematics(puppet.model.armature, pose)
    bones = puppet.floor.bones
    points = Rotation.from_quat(frames[bones]).apply(puppet.floor.positions.copy())
    return float((origins[bones] + points)[:, 1].min())


# -- rest -------------------------------------------------------------------------------------


@EVERY
def test_it_rests_while_the_performer_stands_before_and_after(
    cast: Cast, rehearsed: list[Shown], name: str
) -> None:
    """Every bone, every tip, and its place; and nothing moves."""
    puppet = of(cast, name)
    armature = puppet.model.armature
    rest = Pose(puppet.placement.position, np.array([0.0, 0.0, 0.0, 1.0]), armature.rotations)
    for moment in rehearsed[between(1.2, 2.9)] + rehearsed[between(57.2, DURATION)]:
        for pose in (moment.asked[name], moment.shown[name]):
            assert degrees(pose.bones, armature.rotations).max() < 4.0
            assert np.abs(pose.translation - rest.translation).max() < 0.01
            away = np.linalg.norm(tips(armature, pose) - tips(armature, rest), axis=1)
            assert away.max() < 0.02 * armature.size


def test_a_second_rehearsal_ends_where_the_first_did(cast: Cast, rehearsed: list[Shown]) -> None:
    """Nothing drifts. In one line, one after the other; the loop's seam is no seam."""
    line, rehearsal = Line(cast), Rehearsal(RATE)
    for sequence in range(2 * len(rehearsal)):
        tick = line.step(Moment.of(rehearsal.frame(sequence / RATE, sequence)))
    for puppet in cast:
        once, twice = rehearsed[-1].shown[puppet.name], tick.poses[puppet.name]
        assert degrees(twice.bones, once.bones).max() < 1e-3, puppet.name
        np.testing.assert_allclose(twice.translation, once.translation, atol=1e-5)
        turned = Rotation.from_quat(twice.rotation) * Rotation.from_quat(once.rotation).inv()
        assert turned.magnitude() < 1e-5


@EVERY
def test_nothing_is_remembered_the_same_frame_asks_for_the_same_pose(
    cast: Cast, rehearsed: list[Shown], name: str
) -> None:
    driven = DrivenPuppet(of(cast, name), rehearsed[-1].neutral)
    some = [moment for moment in rehearsed if moment.neutral is rehearsed[-1].neutral][::15]
    random.Random(1).shuffle(some)
    for moment in some:
        pose = driven.asked(moment.frame)
        assert pose.bones.tobytes() == moment.asked[name].bones.tobytes()
        assert pose.translation.tobytes() == moment.asked[name].translation.tobytes()


# -- no flips, no pops ------------------------------------------------------------------------


def assert_it_goes_with_the_performer(moments: list[Shown], name: str) -> None:
    for before, after in pairwise(moments):
        if after.anew:
            continue  # that is eased over in what is shown
        moved = after.moved_since(before)
        turned = degrees(after.asked[name].bones, before.asked[name].bones).max()
        most = min(STEEPEST[name] * (moved + TREMBLING), WIDEST)
        assert turned < most, (
            f"{turned:.1f}° at {after.frame.time:.2f} s while the performer moved {moved:.3f} m"
        )


@EVERY
def test_no_bone_flips_the_steps_of_the_puppet_are_those_of_the_performer(
    rehearsed: list[Shown], name: str
) -> None:
    assert_it_goes_with_the_performer(rehearsed, name)


@EVERY
@pytest.mark.parametrize("take", [path.stem for path in STREAMS])
def test_no_bone_flips_when_a_real_person_is_tracked(
    recorded: dict[str, list[Shown]], name: str, take: str
) -> None:
    assert_it_goes_with_the_performer(recorded[take], name)


@EVERY
def test_who_is_lost_and_comes_back_is_let_go_and_taken_up_again_gently(
    cast: Cast, rehearsed: list[Shown], name: str
) -> None:
    rest = of(cast, name).model.armature.rotations
    there = np.array([moment.frame.states.any() for moment in rehearsed])
    gone, back = int(np.flatnonzero(~there)[0]), int(np.flatnonzero(~there)[-1]) + 1
    away = [degrees(moment.asked[name].bones, rest).max() for moment in rehearsed[gone:back]]
    assert away[-1] < 2.0, "it is at rest before they come back"
    assert max(away) - away[0] < 4.0, "and goes nowhere else before"
    assert widest_step(rehearsed[gone - 1 : back + 15], name) < GENTLE


@EVERY
def test_who_vanishes_with_raised_arms_and_appears_in_a_squat_makes_nothing_jump(
    cast: Cast, name: str
) -> None:
    """What is asked for goes home so gently that nothing has to be limited; who appears out of
    nothing in the middle of a movement is followed there from rest, in more than one frame."""
    rehearsal = Rehearsal(RATE)

    def seen(index: int) -> SkeletonFrame:
        time = index / RATE
        if time < 2.0:
            return rehearsal.frame(time, index)
        if time < 4.0:
            return at(rehearsal.frame(30.0), time, index)
        return nobody(time, index) if time < 7.0 else at(rehearsal.frame(16.8), time, index)

    moments = play(cast, map(seen, range(9 * RATE)))
    rest = of(cast, name).model.armature.rotations
    assert degrees(moments[4 * RATE - 1].asked[name].bones, rest).max() > 24.0
    assert widest_step(moments[4 * RATE - 1 : 7 * RATE], name) < GENTLE
    assert widest_step(moments[7 * RATE - 1 :], name) < GENTLE


def widest_step(moments: list[Shown], name: str) -> float:
    """Degrees that the bone that turns most turns between two frames."""
    return max(
        float(degrees(after.asked[name].bones, before.asked[name].bones).max())
        for before, after in pairwise(moments)
    )


def at(frame: SkeletonFrame, time: float, sequence: int) -> SkeletonFrame:
    return SkeletonFrame(time, sequence, 0, frame.positions, frame.states)


# -- on the floor -----------------------------------------------------------------------------


@EVERY
def test_nothing_goes_through_the_floor(
    cast: Cast, rehearsed: list[Shown], recorded: dict[str, list[Shown]], name: str
) -> None:
    puppet = of(cast, name)
    if puppet.floor is None:
        assert name == "fish"
        return
    for moments in (rehearsed[::4], *recorded.values()):
        for moment in moments:
            assert lowest(puppet, moment.shown[name]) > -1e-6, f"at {moment.frame.time:.2f} s"


@pytest.mark.parametrize("name", STANDING_ON_IK)
@pytest.mark.parametrize("side", ["L", "R"])
def test_a_foot_that_stands_does_not_slide(
    cast: Cast, rehearsed: list[Shown], name: str, side: str
) -> None:
    """While the performer's foot is where it stood, the puppet's is, whatever the body does:
    stand, wave, bow, squat, reach and lean."""
    joints = [Joint.ANKLE_LEFT, Joint.FOOT_LEFT]
    if side == "R":
        joints = [Joint.ANKLE_RIGHT, Joint.FOOT_RIGHT]
    home = rehearsed[75]
    rests = tip(cast, home.shown[name], name, f"paw.{side}")
    stood = 0
    parts = ("stand", "wave", "bow", "squat", "arms out and up", "stand again")
    spans = [section(part) for part in parts] + [between(32.0, 35.7)]
    for moment in (moment for span in spans for moment in rehearsed[span]):
        if moment.frame.time < 1.2:
            continue
        moved = moment.frame.positions[joints] - home.frame.positions[joints]
        if np.linalg.norm(moved, axis=1).max() > 0.02:
            continue
        stood += 1
        slid = np.linalg.norm(tip(cast, moment.shown[name], name, f"paw.{side}") - rests)
        assert slid < 0.02, f"{1000 * slid:.0f} mm at {moment.frame.time:.2f} s"
    assert stood > 20 * RATE


@pytest.mark.parametrize("name", ["seagull", "seagull_with_master"])
def test_a_gull_which_has_no_knees_keeps_its_feet_flat_when_the_performer_squats(
    cast: Cast, rehearsed: list[Shown], name: str
) -> None:
    for moment in rehearsed[section("squat")]:
        pose = moment.shown[name]
        assert abs(pose.translation[1]) < 0.01, "it neither sinks nor is pushed up by its heels"
        assert lowest(of(cast, name), pose) < 0.01


def test_a_squat_bends_the_ostrichs_legs_and_a_jump_lifts_it(
    cast: Cast, rehearsed: list[Shown]
) -> None:
    name = "ostrich"
    armature = of(cast, name).model.armature

    def paws(moment: Shown) -> list[float]:
        return [tip(cast, moment.shown[name], name, f"paw.{side}")[1] for side in "LR"]

    low = min(rehearsed[section("squat")], key=lambda m: float(m.shown[name].translation[1]))
    assert low.shown[name].translation[1] < -0.15, "the body sinks"
    assert np.abs(paws(low)).max() < 0.02, "its paws stay"
    for shin in ("shin.L", "shin.R"):
        bone = [armature.index(shin)]
        assert degrees(low.shown[name].bones[bone], armature.rotations[bone])[0] > 30.0
    high = max(rehearsed[section("jump")], key=lambda m: float(m.shown[name].translation[1]))
    body = float(high.shown[name].translation[1])
    assert body > 0.1
    # Paws leave the floor as the performer's ankles do, in the measure in which the body rises.
    joints = [Joint.HIP_CENTER, Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT]
    hip, *ankles = (high.frame.positions - rehearsed[75].frame.positions)[joints, 1]
    np.testing.assert_allclose(paws(high), body / hip * np.array(ankles), atol=0.02)
    assert min(paws(high)) > 0.1


# -- who leads what ---------------------------------------------------------------------------


@pytest.mark.parametrize(("puppet", "rise"), [("snake", 0.3), ("ostrich", 0.05)])
def test_the_right_hand_leads_the_head(
    cast: Cast, rehearsed: list[Shown], puppet: str, rise: float
) -> None:
    part = rehearsed[section("arms out and up")]
    rest = tip(cast, rehearsed[75].shown[puppet], puppet, "head")
    heads = np.array([tip(cast, moment.shown[puppet], puppet, "head") for moment in part])
    hands = np.array([on_body(moment.frame)[Joint.HAND_RIGHT] for moment in part])
    out, up = int(np.argmin(hands[:, 0])), int(np.argmax(hands[:, 1]))
    assert heads[out, 0] < rest[0] - 0.2, "the hand goes out to the right, and so does the head"
    assert heads[up, 1] > rest[1] + rise, "the hand goes up, and so does the head"


@pytest.mark.parametrize("puppet", ["snake", "ostrich"])
def test_the_left_hand_does_not_move_the_head(
    cast: Cast, rehearsed: list[Shown], puppet: str
) -> None:
    """It goes behind the back, while the right one hangs."""
    rest = tip(cast, rehearsed[75].shown[puppet], puppet, "head")
    size = of(cast, puppet).model.armature.size
    for moment in rehearsed[between(38.6, 41.6)]:
        away = tip(cast, moment.asked[puppet], puppet, "head") - rest
        assert np.linalg.norm(away) < 0.06 * size


def test_one_hand_flaps_both_wings_like_a_mirror(cast: Cast, rehearsed: list[Shown]) -> None:
    name = "seagull_with_master"
    x = of(cast, name).placement.position[0]

    def wings(moment: Shown) -> tuple[Floats, Floats]:
        left, right = (tip(cast, moment.asked[name], name, f"wing_tip.{side}") for side in "LR")
        return left - (x, 0.0, 0.0), right - (x, 0.0, 0.0)

    rest = wings(rehearsed[75])[0]
    for part in ("wave", "arms out and up"):
        lifted = 0.0
        for moment in rehearsed[section(part)]:
            left, right = wings(moment)
            assert np.abs(left * (-1.0, 1.0, 1.0) - right).max() < 0.02
            lifted = max(lifted, float(left[1] - rest[1]))
        assert lifted > 0.15


# -- how far it goes along --------------------------------------------------------------------

#: Squat, bow, jump, and far out to the left.
ABOUT = (16.8, 9.0, 19.8, 45.0)


def gone_with(cast: Cast, rehearsed: list[Shown]) -> list[tuple[Shown, Floats, Pose, Floats]]:
    """(moment, metres of the hip, what is asked, metres of the puppet), both along the stage."""
    puppet = next(iter(cast))
    neutral = rehearsed[-1].neutral
    back = Rotation.from_euler("y", -neutral.heading)
    driven = DrivenPuppet(puppet, neutral)
    found = []
    for time in ABOUT:
        moment = rehearsed[round(time * RATE)]
        hip = moment.frame.positions[Joint.HIP_CENTER] - neutral.hip
        pose = driven.asked(moment.frame)
        way = moment.frame.influence[Joint.HIP_CENTER] * back.apply(hip)
        found.append((moment, way, pose, pose.translation - puppet.placement.position))
    return found


@pytest.mark.parametrize(("name", "mode"), [("ostrich", "ik"), ("dog", "ik"), ("fish", "fk")])
@pytest.mark.parametrize("follow", [(0.3, 0.0, 0.3), (0.1, 0.5, 0.4), (0.0, 0.0, 0.0)])
def test_a_follow_in_three_numbers_holds_in_all_three_directions(
    rehearsed: list[Shown],
    tmp_path: Path,
    name: str,
    mode: Mode,
    follow: tuple[float, float, float],
) -> None:
    cast = on_stage(tmp_path, {name: mode}, f"follow = {list(follow)}")
    for _, hip, _, gone in gone_with(cast, rehearsed):
        np.testing.assert_allclose(gone, hip * follow, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "mode"), [("dog", "fk"), ("lamp", "fk"), ("snake", "ik"), ("seagull", "ik")]
)
def test_what_stands_without_legs_that_bend_goes_up_with_a_jump_and_never_down(
    rehearsed: list[Shown], tmp_path: Path, name: str, mode: Mode
) -> None:
    cast = on_stage(tmp_path, {name: mode}, "follow = [0.1, 0.5, 0.4]")
    for _, hip, _, gone in gone_with(cast, rehearsed):
        wanted = hip * (0.1, 0.5, 0.4)
        wanted[1] = max(wanted[1], 0.0)
        np.testing.assert_allclose(gone, wanted, atol=1e-9)


@pytest.mark.parametrize("name", STANDING_ON_IK)
def test_a_follow_in_one_number_leaves_it_to_the_legs_how_far_they_bend(
    rehearsed: list[Shown], tmp_path: Path, name: str
) -> None:
    by_steps = gone_with(on_stage(tmp_path, {name: "ik"}), rehearsed)
    by_number = gone_with(on_stage(tmp_path, {name: "ik"}, "follow = 0.2"), rehearsed)
    for (_, hip, _, gone), (_, _, _, less) in zip(by_steps, by_number, strict=True):
        np.testing.assert_allclose(less[[0, 2]], 0.2 * hip[[0, 2]], atol=1e-9)
        assert less[1] == pytest.approx(gone[1], abs=1e-9)
        share = gone[0] / hip[0]
        assert 0.2 < share < 1.2
        sinks = name == "ostrich"  # a gull's legs have one bone each, and cannot bend
        np.testing.assert_allclose(
            gone, share * (hip if sinks else hip.clip([-9.0, 0.0, -9.0])), atol=1e-9
        )


@pytest.mark.parametrize("follow", ["0.3", "[0.3, 0.0, 0.3]", "[0.5, 0.4, 0.2]"])
def test_planted_paws_stay_whatever_the_follow(
    rehearsed: list[Shown], tmp_path: Path, follow: str
) -> None:
    name = "ostrich"
    cast = on_stage(tmp_path, {name: "ik"}, f"follow = {follow}")
    rests = of(cast, name).model.armature
    for moment, _, pose, _ in gone_with(cast, rehearsed)[:2]:
        for side in "LR":
            rest = rests.rest_tips[rests.index(f"paw.{side}")]
            slid = np.linalg.norm(tip(cast, pose, name, f"paw.{side}") - rest)
            assert slid < 0.025, f"{1000 * slid:.0f} mm at {moment.frame.time:.1f} s"


# -- every real rig ---------------------------------------------------------------------------

RIGS = [
    path
    for path in sorted(SHARED.glob("armatures/**/*"))
    if path.suffix in (".glb", ".gltf", ".xml")
    # A file that another one includes has no armature of its own.
    and path.name != "shared.xml"
    and path.parent.name != "bones"
]


@pytest.mark.skipif(not RIGS, reason="the shared rigs are not here")
@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_every_file_maps_and_moves(path: Path, tmp_path: Path) -> None:
    """Both ways, over the rehearsal: whole poses, within their limits and above the floor."""
    rig = rig_of(load_puppet(path))
    modes = [mode for mode in MODES if propose(rig, mode)[0].pairs]
    assert modes, "nothing of it can be driven"
    show = tmp_path / "show.toml"
    text = 'name = "all"\n[source]\npath = "rehearsal"\n'
    for mode in modes:
        text += f'[[puppets]]\nname = "{mode}"\nmode = "{mode}"\nheight = 1.2\n'
        text += f'armature = "{path}"\n'
    show.write_text(text)
    cast = load_cast(load_show(show), show)
    line = Line(cast)
    turned = dict.fromkeys(modes, 0.0)
    for index, moment in enumerate(Rehearsal(RATE)):
        if index > RATE and index % 10:  # a second of each frame, so that the stance is seen
            continue
        tick = line.step(moment)
        for puppet in cast:
            pose, armature = tick.poses[puppet.name], puppet.model.armature
            values = np.concatenate([pose.translation, pose.rotation, pose.bones.ravel()])
            assert np.isfinite(values).all(), f"{puppet.name} at {moment.time:.1f} s"
            lengths = np.linalg.norm(np.vstack([pose.rotation, pose.bones]), axis=1)
            np.testing.assert_allclose(lengths, 1.0, atol=1e-6)
            assert beyond_limits(armature, pose) < 1e-6, f"{puppet.name} at {moment.time:.1f} s"
            if puppet.floor is not None:
                assert lowest(puppet, pose) > -1e-6, f"{puppet.name} at {moment.time:.1f} s"
            away = degrees(pose.bones, armature.rotations).max()
            turned[tick_mode(puppet)] = max(turned[tick_mode(puppet)], float(away))
    assert min(turned.values()) > 10.0, "and it does move"


def tick_mode(puppet: StagedPuppet) -> Mode:
    return puppet.proposal.mode


def beyond_limits(armature: Armature, pose: Pose) -> float:
    """Radians by which the worst bone is outside its ranges."""
    bounds = Bounds.of(armature)
    turns = (
        Rotation.from_quat(armature.rotations).inv() * Rotation.from_quat(pose.bones)
    ).as_rotvec()
    if not len(turns):
        return 0.0
    outside = np.maximum(turns - bounds.upper, bounds.lower - turns).max()
    return float(max(outside, (np.linalg.norm(turns, axis=1) - bounds.limits).max()))
