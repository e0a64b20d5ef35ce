"""FK drive: rest stays at rest, turns are carried over, nothing jumps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from puppet.armature import Armature
from puppet.kernel import Floats
from puppet.mapping.drive import ForwardDrive
from puppet.mapping.evidence import gather
from puppet.mapping.forward import propose_forward
from puppet.mapping.placement import Placement
from puppet.mapping.proposal import Pair
from puppet.mapping.stance import stance_of, upright
from puppet.pose import forward_kinematics
from puppet.rotation import IDENTITY
from puppet.skeleton import HUMAN_BONE_NAMES, Joint, SkeletonFrame
from puppet.tracking.takes.rehearsal import Rehearsal
from tests.armatures import armature_of, armatures
from tests.moments import frames_of

FISH = {
    "back": "",
    "middle": "back",
    "head": "middle",
    "fin.R": "middle",
    "fin_tip.R": "fin.R",
    "fin.L": "middle",
    "fin_tip.L": "fin.L",
}


def standing() -> Floats:
    """(20, 3) the first frame of the rehearsal: somebody who just stands there."""
    return np.array(Rehearsal().frame(0.0).positions)


def frame(positions: Floats, influence: float = 1.0) -> SkeletonFrame:
    return SkeletonFrame(0.0, 0, 0, positions, np.full(20, 2, np.uint8), np.full(20, influence))


def turned(positions: Floats, turn: Rotation, about: Joint, joints: list[Joint]) -> Floats:
    """Some joints turned about another."""
    result = positions.copy()
    centre = positions[about]
    result[joints] = centre + turn.apply(positions[joints] - centre)
    return result


LEFT_ARM = [Joint.ELBOW_LEFT, Joint.WRIST_LEFT, Joint.HAND_LEFT]


@given(armature=armatures(), seed=st.integers(0, 1000))
def test_in_the_neutral_stance_everything_rests_whatever_its_axes(
    armature: Armature, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    positions = standing() + rng.normal(scale=0.1, size=(20, 3))
    drive = ForwardDrive(armature, propose_forward(armature)[0].pairs, stance_of(positions))
    np.testing.assert_allclose(
        np.abs((drive(frame(positions)).base.bones * armature.rotations).sum(axis=1)), 1, atol=1e-9
    )


@given(
    st.sampled_from(frames_of(Rehearsal())[::40]),
    st.floats(-math.pi, math.pi),
    st.tuples(*[st.floats(-5, 5)] * 3),
)
def test_where_the_performer_stands_and_faces_bends_nothing(
    seen: SkeletonFrame, heading: float, place: tuple[float, float, float]
) -> None:
    armature = armature_of(FISH)
    drive = ForwardDrive(armature, propose_forward(armature)[0].pairs, stance_of(standing()))
    if not seen.present:
        return
    elsewhere = Rotation.from_euler("y", heading).apply(seen.positions) + place
    np.testing.assert_allclose(
        drive(frame(np.array(elsewhere))).base.bones,
        drive(frame(seen.positions)).base.bones,
        atol=1e-6,
    )


@pytest.mark.parametrize("angle", [20, 60, 90])
def test_a_raised_arm_turns_its_bone_by_as_much(angle: float) -> None:
    armature = armature_of({"hub": "", "arm.L": "hub", "leg.L": "hub"})
    human = HUMAN_BONE_NAMES.index("upper_arm.L")
    drive = ForwardDrive(
        armature, [Pair("arm.L", (armature.index("arm.L"),), human, 1.0)], stance_of(standing())
    )
    turn = Rotation.from_euler("z", angle, degrees=True)
    raised = turned(standing(), turn, Joint.SHOULDER_LEFT, LEFT_ARM)
    _, rest = forward_kinematics(armature, drive(frame(standing())).base)
    _, now = forward_kinematics(armature, drive(frame(raised)).base)
    bone = armature.index("arm.L")
    seen = Rotation.from_quat(now[bone]) * Rotation.from_quat(rest[bone]).inv()
    # The arm hangs a little outwards, so a swing out of the T pose is not quite about one axis.
    assert (seen * turn.inv()).magnitude() < math.radians(4)
    for other in ("hub", "leg.L"):
        index = armature.index(other)
        np.testing.assert_allclose(np.abs(now[index] @ rest[index]), 1.0, atol=1e-9)


def test_a_straight_arm_makes_a_straight_fin() -> None:
    armature = armature_of(FISH)
    drive = ForwardDrive(armature, propose_forward(armature)[0].pairs, upright(np.zeros(3), 0.0))
    straight = standing()
    for joint, x in zip(LEFT_ARM, (0.48, 0.74, 0.82), strict=True):
        straight[joint] = straight[Joint.SHOULDER_LEFT] + (x - 0.18, 0.0, 0.0)
    bones = drive(frame(straight)).base.bones
    tip = armature.index("fin_tip.L")
    between = Rotation.from_quat(bones[tip]) * Rotation.from_quat(armature.rotations[tip]).inv()
    assert between.magnitude() < math.radians(8)


def test_a_limit_scales_the_human_range_into_it() -> None:
    free = armature_of({"hub": "", "arm.L": "hub"})
    limited = replace(free, limits=np.array([np.inf, math.radians(60)]))
    human = HUMAN_BONE_NAMES.index("upper_arm.L")
    up = turned(
        standing(),
        Rotation.from_euler("z", 170, degrees=True),
        Joint.SHOULDER_LEFT,
        LEFT_ARM,
    )

    def swing_of(armature: Armature) -> float:
        drive = ForwardDrive(armature, [Pair("b1", (1,), human, 1.0)], stance_of(standing()))
        local = Rotation.from_quat(drive(frame(up)).base.bones[1])
        return float((local * Rotation.from_quat(armature.rotations[1]).inv()).magnitude())

    assert swing_of(free) == pytest.approx(math.radians(170), abs=math.radians(6))
    assert swing_of(limited) == pytest.approx(math.radians(60), abs=math.radians(6))


@pytest.mark.parametrize("limit", [math.inf, math.radians(75)])
def test_arms_that_pass_straight_up_do_not_make_a_fin_jump(limit: float) -> None:
    armature = replace(armature_of(FISH), limits=np.full(len(FISH), limit))
    drive = ForwardDrive(armature, propose_forward(armature)[0].pairs, stance_of(standing()))
    before = None
    for step in range(400):
        # A circle around straight up, a few degrees wide: where counting from hanging would flip.
        round_angle = 2 * math.pi * step / 400
        turn = Rotation.from_euler("z", 180, degrees=True)
        lean = Rotation.from_rotvec(
            0.15 * np.array([math.cos(round_angle), 0.0, math.sin(round_angle)])
        )
        up = turned(standing(), lean * turn, Joint.SHOULDER_LEFT, LEFT_ARM)
        bones = drive(frame(up)).base.bones
        if before is not None:
            moved = [
                (Rotation.from_quat(a) * Rotation.from_quat(b).inv()).magnitude()
                for a, b in zip(bones, before, strict=True)
            ]
            assert max(moved) < math.radians(2)
        before = bones


def test_no_influence_is_rest_and_half_of_it_is_between() -> None:
    armature = armature_of(FISH)
    drive = ForwardDrive(armature, propose_forward(armature)[0].pairs, stance_of(standing()))
    raised = turned(
        standing(), Rotation.from_euler("z", 90, degrees=True), Joint.SHOULDER_LEFT, LEFT_ARM
    )
    fin = armature.index("fin.L")
    rest = Rotation.from_quat(armature.rotations[fin])

    def swing_at(influence: float) -> float:
        bones = drive(frame(raised, influence)).base.bones
        return float((Rotation.from_quat(bones[fin]) * rest.inv()).magnitude())

    assert swing_at(0.0) < 1e-9
    assert 0.3 * swing_at(1.0) < swing_at(0.5) < 0.7 * swing_at(1.0)


def test_the_root_follows_the_hip_by_its_share_and_a_grounded_one_never_sinks() -> None:
    armature = armature_of(FISH)
    neutral = stance_of(standing())
    pairs = propose_forward(armature)[0].pairs
    moved = frame(standing() + (1.0, -0.4, 0.5))
    floating = ForwardDrive(
        armature, pairs, neutral, Placement(np.array([2.0, 1.0, 0.0]), follow=np.full(3, 0.5))
    )
    np.testing.assert_allclose(floating(moved).base.translation, [2.5, 0.8, 0.25], atol=1e-9)
    grounded = ForwardDrive(
        armature, pairs, neutral, Placement(follow=np.full(3, 0.5), grounded=True)
    )
    np.testing.assert_allclose(grounded(moved).base.translation, [0.5, 0.0, 0.25], atol=1e-9)


def test_a_turn_on_the_spot_turns_the_puppet_and_nothing_else() -> None:
    armature = armature_of(FISH)
    drive = ForwardDrive(armature, propose_forward(armature)[0].pairs, stance_of(standing()))
    centre = standing()[Joint.HIP_CENTER]
    quarter = Rotation.from_euler("y", 90, degrees=True)
    around = frame(np.array(quarter.apply(standing() - centre) + centre))
    pose = drive(around).base
    assert (Rotation.from_quat(pose.rotation) * quarter.inv()).magnitude() < 1e-6
    np.testing.assert_allclose(
        np.abs((pose.bones * armature.rotations).sum(axis=1)), 1.0, atol=1e-9
    )


@given(armatures(most=15), st.integers(0, 2**32 - 1), st.sampled_from(frames_of(Rehearsal())[::40]))
def test_a_bone_that_follows_repeats_its_share_of_its_parents_turn(
    armature: Armature, seed: int, seen: SkeletonFrame
) -> None:
    """By SciPy: what a bone turns is its place in the pose against its place at rest."""
    if not seen.present:
        return
    shares = np.random.default_rng(seed).uniform(-0.5, 1.5, len(armature))
    proposal = propose_forward(gather(armature, follows=shares))[0]
    # Half of the pairs are taken away, so that much is left that follows.
    pairs = proposal.pairs[::2]
    driven = {pair.bone for pair in pairs}
    follows = [(b, s) for b, s in enumerate(shares.tolist()) if b not in driven]
    drive = ForwardDrive(armature, pairs, stance_of(standing()), follows=follows)
    pose = replace(drive(frame(seen.positions)).base, rotation=IDENTITY, translation=np.zeros(3))
    now = Rotation.from_quat(forward_kinematics(armature, pose)[1])
    turned = now * Rotation.from_quat(armature.rest[1]).inv()
    for bone, share in follows:
        parent = int(armature.parents[bone])
        if parent < 0:
            assert turned[bone].magnitude() < 1e-9
            continue
        above = int(armature.parents[parent])
        before = Rotation.identity() if above < 0 else turned[above]
        own = before.inv() * turned[parent]
        if own.magnitude() > 3.1:
            continue  # half a turn has two shares
        expected = turned[parent] * Rotation.from_rotvec(share * own.as_rotvec())
        assert (turned[bone] * expected.inv()).magnitude() < 1e-6


def test_a_tail_that_follows_bends_on_behind_what_bends_before_it() -> None:
    armature = armature_of({"hub": "", "arm.L": "hub", "next": "arm.L", "last": "next"})
    human = HUMAN_BONE_NAMES.index("upper_arm.L")
    pair = Pair("arm.L", (armature.index("arm.L"),), human, 1.0)
    raised = turned(
        standing(), Rotation.from_euler("z", 40, degrees=True), Joint.SHOULDER_LEFT, LEFT_ARM
    )

    def turns(*follows: tuple[int, float]) -> list[float]:
        drive = ForwardDrive(armature, [pair], stance_of(standing()), follows=follows)
        _, now = forward_kinematics(armature, drive(frame(raised)).base)
        _, rest = forward_kinematics(armature, drive(frame(standing())).base)
        gone = Rotation.from_quat(now) * Rotation.from_quat(rest).inv()
        return [math.degrees(angle) for angle in gone.magnitude()]

    arm, following, last = (armature.index(name) for name in ("arm.L", "next", "last"))
    stiff = turns()
    assert stiff[following] == pytest.approx(stiff[arm])
    bent = turns((following, 0.5), (last, 1.0))
    assert bent[arm] == pytest.approx(stiff[arm])
    assert bent[following] == pytest.approx(1.5 * stiff[arm])
    assert bent[last] == pytest.approx(2.0 * stiff[arm])
