"""IK drive: goals start at rest, hands reach, feet stand, and what is lost goes home."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.mapping.effector_drive import ANCHORS, EffectorDrive
from puppet.mapping.effectors import propose_effectors
from puppet.mapping.human import HUMAN, HUMAN_LIMBS, HumanLimb
from puppet.mapping.placement import Placement
from puppet.mapping.proposal import Proposal
from puppet.mapping.stance import Stance, stance_of
from puppet.pose import Intent, Pose, forward_kinematics
from puppet.skeleton import HUMAN_BONES, Joint, SkeletonFrame
from puppet.solvers.oriented_tips import OrientedTips
from puppet.tracking.takes.rehearsal import Rehearsal
from tests.armatures import armatures
from tests.moments import frames_of
from tests.rig_changes import CAST, creatures, propose, shipped

STANDING: Floats = np.array(Rehearsal().frame(0.0).positions)
SEEN = [frame for frame in frames_of(Rehearsal()) if frame.states.all()][::25]
UPPER = [joint for joint in Joint if "FOOT" not in joint.name and "ANKLE" not in joint.name]
any_armature = st.one_of(armatures(), creatures())
ways = st.tuples(*[st.floats(-0.4, 0.4)] * 3)
placements = st.builds(
    lambda x, z, yaw, grounded: Placement(np.array([x, 0.0, z]), yaw, grounded=grounded),
    st.floats(-3.0, 3.0),
    st.floats(-3.0, 3.0),
    st.floats(-math.pi, math.pi),
    st.booleans(),
)


def frame(positions: Floats, influence: Floats | None = None) -> SkeletonFrame:
    weights = np.ones(20) if influence is None else influence
    return SkeletonFrame(0.0, 0, 0, positions, np.full(20, 2, np.uint8), weights)


def noisy(seed: int, spread: float = 0.1) -> Floats:
    return STANDING + np.random.default_rng(seed).normal(scale=spread, size=(20, 3))


def driven(
    name: str, placement: Placement | None = None, neutral: Floats = STANDING, reach: float = 1.0
) -> EffectorDrive:
    proposal = propose(shipped(name), "ik")[0]
    return of(proposal, placement, stance_of(neutral), reach)


def of(
    proposal: Proposal, placement: Placement | None, neutral: Stance, reach: float = 1.0
) -> EffectorDrive:
    return EffectorDrive(proposal.armature, proposal.pairs, neutral, placement, reach)


def goals(intent: Intent) -> dict[int, Floats]:
    return {goal.bone: goal.position for goal in intent.goals}


def in_world(intent: Intent, bone: int) -> Floats:
    """Where a goal lies on the stage."""
    turn = Rotation.from_quat(intent.base.rotation)
    return np.asarray(turn.apply(goals(intent)[bone]) + intent.base.translation)


def moved(positions: Floats, joints: list[Joint], way: Floats) -> Floats:
    result = positions.copy()
    result[joints] += way
    return result


def tips_on(drive: EffectorDrive, kind: str) -> list[tuple[int, HumanLimb]]:
    """Effectors on hands ("arm"), feet ("leg") or the head, with the limb that moves them."""
    limbs = {limb.tip: limb for limb in HUMAN_LIMBS}
    return [
        (bone, limbs[pair.human])
        for pair in drive.pairs
        if limbs[pair.human].name.startswith(kind)
        for bone in pair.bones
    ]


# -- rest -------------------------------------------------------------------------------------


@given(any_armature, st.integers(0, 1000), placements)
def test_in_the_neutral_stance_every_goal_is_where_its_tip_rests(
    armature: Armature, seed: int, placement: Placement
) -> None:
    positions = noisy(seed)
    drive = of(propose_effectors(armature)[0], placement, stance_of(positions))
    intent = drive(frame(positions))
    assert set(goals(intent)) == {bone for pair in drive.pairs for bone in pair.bones}
    for bone, position in goals(intent).items():
        np.testing.assert_allclose(position, armature.rest_tips[bone], atol=1e-9)
    np.testing.assert_array_equal(intent.base.bones, armature.rotations)
    np.testing.assert_allclose(intent.base.translation, placement.position, atol=1e-12)


@given(any_armature, st.sampled_from(SEEN))
def test_the_base_pose_is_rest_whatever_the_performer_does(
    armature: Armature, seen: SkeletonFrame
) -> None:
    drive = of(propose_effectors(armature)[0], None, stance_of(STANDING))
    np.testing.assert_array_equal(drive(seen).base.bones, armature.rotations)


@pytest.mark.parametrize("name", CAST)
def test_the_same_frame_gives_the_same_goals(name: str) -> None:
    drive = driven(name, Placement(grounded=True))
    for seen in SEEN[:10]:
        once, again = drive(seen), drive(seen)
        for one, other in zip(once.goals, again.goals, strict=True):
            np.testing.assert_array_equal(one.position, other.position)


# -- feet -------------------------------------------------------------------------------------

WITH_LEGS = ("dog", "seagull", "seagull_with_master", "ostrich")
#: The gull's legs are stilts: one bone, and a foot.
WITH_KNEES = ("dog", "ostrich")
sways = st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.1), st.floats(-0.3, 0.3))


@pytest.mark.parametrize("name", WITH_LEGS)
@given(way=sways, heading=st.floats(-math.pi, math.pi), yaw=st.floats(-math.pi, math.pi))
def test_a_planted_foot_stays_where_it_is_while_the_hips_sway_and_sink(
    name: str, way: tuple[float, float, float], heading: float, yaw: float
) -> None:
    turn = Rotation.from_euler("y", heading)
    neutral = np.asarray(turn.apply(STANDING))
    drive = driven(name, Placement(np.array([1.0, 0.0, -2.0]), yaw, grounded=True), neutral)
    swayed = moved(neutral, UPPER, np.asarray(way))
    before, after = drive(frame(neutral)), drive(frame(swayed))
    feet = tips_on(drive, "leg")
    assert len(feet) == 2
    for bone, _ in feet:
        np.testing.assert_allclose(in_world(after, bone), in_world(before, bone), atol=1e-9)
    gone = after.base.translation - before.base.translation
    # It went along with the hips, by one share forwards and sideways, turned to where it looks.
    way_of_hips = np.asarray(way)
    assert math.hypot(gone[0], gone[2]) == pytest.approx(
        float(drive.placement.along[0]) * math.hypot(way_of_hips[0], way_of_hips[2]), abs=1e-9
    )
    sunk = way[1] if name in WITH_KNEES else max(way[1], 0.0)
    assert gone[1] == pytest.approx(drive.placement.along[1] * sunk, abs=1e-9)


@pytest.mark.parametrize("name", WITH_LEGS)
@given(lift=st.floats(0.0, 0.5), sink=st.floats(-0.3, 0.0))
def test_a_lifted_foot_rises_by_what_the_legs_are_to_ours_and_the_other_stays(
    name: str, lift: float, sink: float
) -> None:
    drive = driven(name, Placement(grounded=True))
    up = moved(STANDING, UPPER, np.array([0.0, sink, 0.0]))
    up = moved(up, [Joint.ANKLE_LEFT, Joint.FOOT_LEFT], np.array([0.0, lift, 0.0]))
    before, after = drive(frame(STANDING)), drive(frame(up))
    for bone, limb in tips_on(drive, "leg"):
        gone = in_world(after, bone) - in_world(before, bone)
        ratio = length_to(drive.armature, bone) / human_length(limb)
        expected = lift * ratio if limb.side == "L" else 0.0
        np.testing.assert_allclose(gone, [0.0, expected, 0.0], atol=1e-9)


@pytest.mark.parametrize("name", WITH_LEGS)
@given(seen=st.sampled_from(SEEN), yaw=st.floats(-math.pi, math.pi))
def test_no_foot_is_asked_to_go_below_the_floor(name: str, seen: SkeletonFrame, yaw: float) -> None:
    drive = driven(name, Placement(yaw=yaw, grounded=True))
    low = replace(seen, positions=seen.positions - [0.0, 0.3, 0.0])
    for bone, _ in tips_on(drive, "leg"):
        rest = float(drive.armature.rest_tips[bone, 1])
        assert in_world(drive(low), bone)[1] >= min(rest, 0.05 * drive.armature.size) - 1e-9


# -- hands ------------------------------------------------------------------------------------


def length_to(armature: Armature, bone: int) -> float:
    """Metres of the chain that ends in a bone, from where it leaves a bone with several children,
    or the root."""
    length = float(np.linalg.norm(armature.tips[bone]))
    while True:
        parent = int(armature.parents[bone])
        if parent < 0 or armature.parents[parent] < 0 or len(armature.children[parent]) > 1:
            return length
        length += float(np.linalg.norm(armature.offsets[bone]))
        bone = parent


def human_length(limb: HumanLimb) -> float:
    return float(np.linalg.norm(HUMAN.tips[list(limb.playable)], axis=1).sum())


@pytest.mark.parametrize("name", ["fish", "seagull", "snake", "ostrich"])
@pytest.mark.parametrize("reach", [1.0, 0.5, 2.0])
@given(way=ways)
def test_a_hand_moves_its_effector_by_length_to_length(
    name: str, reach: float, way: tuple[float, float, float]
) -> None:
    drive = driven(name, reach=reach)
    for bone, limb in tips_on(drive, "arm"):
        joint = HUMAN_BONES[limb.tip].end
        after = drive(frame(moved(STANDING, [joint], np.asarray(way))))
        ratio = min(length_to(drive.armature, bone) / human_length(limb), 6.0) * reach
        gone = goals(after)[bone] - drive.armature.rest_tips[bone]
        # The performer stands nearly, but not quite, square to the stage.
        np.testing.assert_allclose(gone, ratio * in_own_axes(way), atol=1e-9)


def in_own_axes(way: tuple[float, float, float]) -> Floats:
    """Along the performer's own left, up and forward."""
    back = Rotation.from_euler("y", -stance_of(STANDING).heading)
    return np.asarray(back.apply(way))


def test_who_raises_a_hand_raises_the_fin() -> None:
    drive = driven("fish")
    up = moved(STANDING, [Joint.WRIST_LEFT, Joint.HAND_LEFT], np.array([0.0, 0.5, 0.0]))
    armature, after = drive.armature, goals(drive(frame(up)))
    left, right = armature.index("fin_tip.L"), armature.index("fin_tip.R")
    assert after[left][1] > armature.rest_tips[left, 1] + 0.05
    np.testing.assert_allclose(after[right], armature.rest_tips[right], atol=1e-9)


@pytest.mark.parametrize("name", CAST)
@given(way=ways, heading=st.floats(-math.pi, math.pi))
def test_where_the_performer_stands_and_faces_changes_no_goal(
    name: str, way: tuple[float, float, float], heading: float
) -> None:
    """Without a floor; on one, feet and root go together."""
    drive = driven(name)
    turn = Rotation.from_euler("y", heading)
    elsewhere = np.asarray(turn.apply(SEEN[3].positions) + way)
    here, there = goals(drive(SEEN[3])), goals(drive(frame(elsewhere)))
    for bone in here:
        np.testing.assert_allclose(there[bone], here[bone], atol=1e-7)


@pytest.mark.parametrize("name", CAST)
@given(angle=st.floats(-3.0, 3.0), grounded=st.booleans())
def test_a_turn_on_the_spot_turns_the_root_and_nothing_else(
    name: str, angle: float, grounded: bool
) -> None:
    drive = driven(name, Placement(grounded=grounded))
    centre = STANDING[Joint.HIP_CENTER]
    turn = Rotation.from_euler("y", angle)
    intent = drive(frame(np.asarray(turn.apply(STANDING - centre) + centre)))
    for bone, position in goals(intent).items():
        np.testing.assert_allclose(position, drive.armature.rest_tips[bone], atol=1e-9)
    assert (Rotation.from_quat(intent.base.rotation) * turn.inv()).magnitude() < 1e-6
    np.testing.assert_allclose(intent.base.translation, 0.0, atol=1e-9)


# -- losing sight -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", CAST)
@given(seen=st.sampled_from(SEEN))
def test_the_goal_of_a_lost_control_point_comes_home(name: str, seen: SkeletonFrame) -> None:
    drive = driven(name)
    limbs = {limb.tip: limb for limb in HUMAN_LIMBS}
    for pair in drive.pairs:
        limb = limbs[pair.human]
        for lost in (ANCHORS[limb.name], HUMAN_BONES[limb.tip].end):
            influence = np.ones(20)
            influence[lost] = 0.0
            found = goals(drive(replace(seen, influence=influence)))
            for bone in pair.bones:
                np.testing.assert_array_equal(found[bone], drive.armature.rest_tips[bone])


@pytest.mark.parametrize("name", CAST)
@given(seen=st.sampled_from(SEEN), share=st.floats(0.0, 1.0))
def test_half_lost_is_half_way_home(name: str, seen: SkeletonFrame, share: float) -> None:
    drive = driven(name)
    whole, part = goals(drive(seen)), goals(drive(replace(seen, influence=np.full(20, share))))
    for bone, position in whole.items():
        rest = drive.armature.rest_tips[bone]
        np.testing.assert_allclose(part[bone] - rest, share * (position - rest), atol=1e-12)


@pytest.mark.parametrize("name", CAST)
def test_who_is_not_seen_at_all_moves_nothing(name: str) -> None:
    for grounded in (False, True):
        drive = driven(name, Placement(grounded=grounded))
        intent = drive(replace(SEEN[5], influence=np.zeros(20)))
        for bone, position in goals(intent).items():
            np.testing.assert_allclose(position, drive.armature.rest_tips[bone], atol=1e-12)
        np.testing.assert_allclose(intent.base.translation, 0.0, atol=1e-12)
        np.testing.assert_allclose(np.abs(intent.base.rotation), [0, 0, 0, 1], atol=1e-12)


# -- masters ----------------------------------------------------------------------------------


@given(way=ways)
def test_a_master_on_both_sides_moves_them_outwards_together(
    way: tuple[float, float, float],
) -> None:
    drive = driven("seagull_with_master")
    armature = drive.armature
    wings = next(pair for pair in drive.pairs if pair.name == "wings")
    limb = next(limb for limb in HUMAN_LIMBS if limb.tip == wings.human)
    hand = HUMAN_BONES[limb.tip].end
    after = goals(drive(frame(moved(STANDING, [hand], np.asarray(way)))))
    left, right = armature.index("wing_tip.L"), armature.index("wing_tip.R")
    gone_left = after[left] - armature.rest_tips[left]
    gone_right = after[right] - armature.rest_tips[right]
    np.testing.assert_allclose(gone_left, gone_right * [-1.0, 1.0, 1.0], atol=1e-9)
    # The wing on the hand's own side goes where the hand goes.
    own = gone_left if limb.side == "L" else gone_right
    assume(float(np.linalg.norm(way)) > 0.05)
    assert float(own @ in_own_axes(way)) > 0.0


# -- nothing jumps ----------------------------------------------------------------------------


@given(
    st.sampled_from(CAST),
    st.booleans(),
    st.sampled_from(SEEN),
    st.integers(0, 2**32 - 1),
)
def test_a_step_of_the_performer_is_a_step_of_the_goals(
    name: str, grounded: bool, seen: SkeletonFrame, seed: int
) -> None:
    """However small the step: no place where a goal could jump."""
    drive = driven(name, Placement(grounded=grounded))
    step = np.random.default_rng(seed).normal(size=(20, 3))
    step *= 1e-5 / np.linalg.norm(step, axis=1).max()
    one, other = goals(drive(seen)), goals(drive(frame(seen.positions + step)))
    for bone, position in one.items():
        assert np.linalg.norm(other[bone] - position) < 100 * 1e-5


def test_another_neutral_stance_is_another_origin() -> None:
    drive = driven("fish")
    other = drive.with_neutral(stance_of(SEEN[7].positions))
    for bone, position in goals(other(SEEN[7])).items():
        np.testing.assert_allclose(position, drive.armature.rest_tips[bone], atol=1e-9)
    assert drive.with_neutral(drive.neutral).placement.along.tolist() == (
        drive.placement.along.tolist()
    )


def test_a_placement_that_was_asked_for_is_kept() -> None:
    follow = np.array([0.1, 0.2, 0.4])
    free = driven("seagull", Placement(follow=follow))
    np.testing.assert_array_equal(free.placement.along, follow)
    on_floor = driven("seagull", Placement(follow=follow, grounded=True))
    np.testing.assert_array_equal(on_floor.placement.along, follow)
    # One number does not say how far legs bend.
    legs = driven("seagull", Placement(grounded=True)).placement.along
    by_one = driven("seagull", Placement(follow=0.1, grounded=True))
    np.testing.assert_array_equal(by_one.placement.along, [0.1, legs[1], 0.1])


# -- with the solver behind it ----------------------------------------------------------------


def solved(drive: EffectorDrive) -> Callable[[SkeletonFrame], Pose]:
    """As a puppet on the line is posed, before anything that takes time."""
    solver = OrientedTips(drive.armature.holding(drive.held), drive.effectors, drive.oriented)
    return lambda seen: solver(drive(seen))


def widest_turn(one: Pose, other: Pose) -> float:
    """Radians that the bone turns that turns most."""
    return float(
        (Rotation.from_quat(one.bones) * Rotation.from_quat(other.bones).inv()).magnitude().max()
    )


@pytest.mark.parametrize("name", CAST)
def test_poses_are_continuous(name: str) -> None:
    """Where a pose turns most between two frames, it turns little between two that are close:
    halving the time in which it does so, again and again, leaves no jump."""
    pose, rehearsal = solved(driven(name, Placement(grounded=name != "fish"))), Rehearsal()
    seen = [frame for frame in frames_of(Rehearsal(30.0)) if frame.states.all()]
    poses = [pose(frame) for frame in seen]
    turns = [
        (widest_turn(poses[i], poses[i + 1]), seen[i].time, seen[i + 1].time)
        for i in range(len(seen) - 1)
        if seen[i + 1].sequence == seen[i].sequence + 1
    ]
    for _, *moments in sorted(turns, reverse=True)[:5]:
        start, end = moments
        for _ in range(12):
            middle = (start + end) / 2.0
            before, between, after = (pose(rehearsal.frame(t)) for t in (start, middle, end))
            first = widest_turn(before, between) > widest_turn(between, after)
            start, end = (start, middle) if first else (middle, end)
        left = widest_turn(pose(rehearsal.frame(start)), pose(rehearsal.frame(end)))
        assert math.degrees(left) < 1.5, f"at {start:.5f} s"


@pytest.mark.parametrize("name", WITH_LEGS)
@given(way=st.tuples(st.floats(-0.06, 0.06), st.floats(-0.12, -0.01), st.floats(-0.06, 0.06)))
def test_a_planted_paw_stays_on_its_spot_of_the_stage(
    name: str, way: tuple[float, float, float]
) -> None:
    """In the pose itself, where straight legs need not stretch: within 1 % of the size."""
    drive = driven(name, Placement(grounded=True))
    pose = solved(drive)
    before = pose(frame(STANDING))
    after = pose(frame(moved(STANDING, UPPER, np.asarray(way))))
    for bone, _ in tips_on(drive, "leg"):
        slipped = tip_of(drive.armature, after, bone) - tip_of(drive.armature, before, bone)
        assert np.linalg.norm(slipped) < 0.01 * drive.armature.size


def tip_of(armature: Armature, pose: Pose, bone: int) -> Floats:
    origins, turns = forward_kinematics(armature, pose)
    return np.asarray(
        origins[bone] + Rotation.from_quat(turns[bone]).apply(armature.tips[bone].copy())
    )


@pytest.mark.parametrize("name", CAST)
def test_in_the_neutral_stance_the_pose_is_rest(name: str) -> None:
    drive = driven(name, Placement(grounded=True))
    rest = drive(frame(STANDING)).base
    assert widest_turn(solved(drive)(frame(STANDING)), rest) < 1e-6
