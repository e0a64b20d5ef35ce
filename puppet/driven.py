"""One puppet on the line: from a conditioned skeleton to the pose that is shown.

mapping → solver → finishers, in the order in which a frame meets them. FK asks for a pose; IK asks
for goals, which the solver reaches from the pose. Which of the two it is can change at any moment.
"""

from __future__ import annotations

from dataclasses import replace

from puppet.cast import StagedPuppet
from puppet.mapping.drive import ForwardDrive
from puppet.mapping.effector_drive import EffectorDrive
from puppet.mapping.effectors import propose_effectors
from puppet.mapping.forward import propose_forward
from puppet.mapping.proposal import Proposal
from puppet.mapping.stance import Stance
from puppet.pose import Pose
from puppet.skeleton import SkeletonFrame
from puppet.solvers.floor import Floor
from puppet.solvers.joint_limits import JointLimits
from puppet.solvers.oriented_tips import OrientedTips
from puppet.solvers.transition import Transition
from puppet.solvers.turn_limit import TurnLimit


class DrivenPuppet:
    """A mapping with its solver and finishers, and their memory."""

    def __init__(self, puppet: StagedPuppet, neutral: Stance) -> None:
        self.puppet = puppet
        self._neutral = neutral
        armature = puppet.model.armature
        self._limits = JointLimits(armature)
        self._turn_limit = TurnLimit()
        self._transition = Transition()
        self._floor = None if puppet.floor is None else Floor(armature, puppet.floor)
        self._drive: ForwardDrive | EffectorDrive
        self._solver: OrientedTips | None
        self._drive_by(puppet.proposal)

    def step(self, frame: SkeletonFrame, dt: float) -> Pose:
        """The pose to show, `dt` seconds after the one before."""
        pose = self._turn_limit(self.asked(frame), dt)
        pose = self._transition(pose, dt)
        return pose if self._floor is None else self._floor(pose)

    def asked(self, frame: SkeletonFrame) -> Pose:
        """What the mapping asks for and the joints allow, before anything that takes time."""
        intent = self._drive(frame)
        pose = intent.base if self._solver is None else self._solver(intent)
        return self._limits(pose)

    def set_mapping(self, proposal: Proposal) -> None:
        """Drive it by another mapping, easing over from what is shown."""
        self._drive_by(proposal)
        self.ease()

    def set_neutral(self, neutral: Stance) -> None:
        """Count from another neutral stance, easing over from what is shown."""
        self._neutral = neutral
        self._drive = self._drive.with_neutral(neutral)
        self.ease()

    def warm_up(self, frame: SkeletonFrame) -> None:
        """Compile what either way of driving needs, so that the first change is no pause."""
        armature = self.puppet.model.armature
        for build in (propose_forward, propose_effectors):
            self.set_mapping(build(armature)[0])
            self.step(frame, 1.0 / 30.0)

    def ease(self) -> None:
        """Get to whatever is asked for next without a jump."""
        self._turn_limit.reset()  # the transition sees to it that nothing jumps
        self._transition.start()

    def _drive_by(self, proposal: Proposal) -> None:
        # The service knows the armature in the size of its file, the stage in the show's.
        puppet = self.puppet
        self.proposal = replace(proposal, armature=puppet.model.armature)
        armature = puppet.model.armature
        if proposal.mode == "fk":
            self._drive = ForwardDrive(
                armature, proposal.pairs, self._neutral, puppet.placement, proposal.follows
            )
            self._solver = None
        else:
            drive = EffectorDrive(
                armature, proposal.pairs, self._neutral, puppet.placement, puppet.reach
            )
            self._drive = drive
            self._solver = OrientedTips(
                armature.holding(drive.held), drive.effectors, drive.oriented
            )
