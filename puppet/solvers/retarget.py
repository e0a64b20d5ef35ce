"""FK drive as a kernel: human swings in, local bone rotations out.

For a human bone h carried by c, with swing s now and n in the neutral stance, the turn that h adds
is ``turn = N_c · exp(g·log s) · exp(g·log n)⁻¹ · N_c⁻¹``: measured in its carrier, expressed in the
axes that the carrier had in the neutral stance, N_c. In the neutral stance it is the identity, so
a bone at rest stays at rest whatever its axes; at gain g = 1 it is the whole human turn. Gains
scale swings about their reference and not the finished turn, so that a puppet with half the range
moves in a cone of half the size, without a jump anywhere in it.

A bone of the armature turns by what its human bone and the bones between that and its anchor add;
the anchor is the nearest mapped ancestor whose human bone carries its own, else the body. So a
straight arm makes a straight fin, and a lamp whose base is one arm and whose shade is the other
hangs each on the body.
"""

from __future__ import annotations

import numpy as np

from puppet.kernel import Floats, Ints, kernel
from puppet.rotation import conjugate, exp, log, multiply, shortest


@kernel
def turn(neutral_carrier: Floats, now: Floats, neutral: Floats, gain: float) -> Floats:
    """What one human bone adds. All (4,); gain 0..1. -> (4,)"""
    moved = multiply(exp(log(now) * gain), conjugate(exp(log(neutral) * gain)))
    return multiply(multiply(neutral_carrier, moved), conjugate(neutral_carrier))


@kernel
def retarget(
    swings: Floats,
    neutral_swings: Floats,
    neutral_frames: Floats,
    influence: Floats,
    carriers: Ints,
    parents: Ints,
    rest_world: Floats,
    rest_local: Floats,
    humans: Ints,
    anchors: Ints,
    path_starts: Ints,
    path: Ints,
    gains: Floats,
    follows: Floats,
    turned: Floats,
    bones: Floats,
) -> None:
    """Fill `bones`, (B, 4) parent_from_bone.

    swings, neutral_swings, neutral_frames: (17, 4). influence: (17,) 0..1, per human bone.
    parents: (B,). rest_world: (B, 4) armature_from_bone; rest_local: (B, 4) parent_from_bone.
    humans: (B,) human bone of each bone or -1. anchors: (B,) bone or -1 for the body.
    path_starts: (B + 1,) into `path`, the human bones from after the anchor's to the bone's own.
    gains: (B,). follows: (B,) for bones without a human bone, the share of their parent's turn
    that they repeat. turned: (B, 4) scratch, armature_from_bone turns.
    """
    world = np.empty((len(parents), 4))
    identity = np.zeros(4)
    identity[3] = 1.0
    for bone in range(len(parents)):
        parent = parents[bone]
        if humans[bone] < 0:
            if parent < 0:
                bones[bone] = rest_local[bone]
                turned[bone] = identity
                world[bone] = rest_local[bone]
            elif follows[bone] == 0.0:
                bones[bone] = rest_local[bone]
                turned[bone] = turned[parent]
                world[bone] = multiply(world[parent], rest_local[bone])
            else:
                above = parents[parent]
                before = identity if above < 0 else turned[above]
                own = shortest(multiply(conjugate(before), turned[parent]))
                turned[bone] = multiply(turned[parent], exp(log(own) * follows[bone]))
                world[bone] = multiply(turned[bone], rest_world[bone])
                bones[bone] = multiply(conjugate(world[parent]), world[bone])
            continue
        anchor = anchors[bone]
        total = identity.copy() if anchor < 0 else turned[anchor].copy()
        for step in range(path_starts[bone], path_starts[bone + 1]):
            human = path[step]
            carrier = carriers[human]
            frame = identity if carrier < 0 else neutral_frames[carrier]
            gain = gains[bone] * influence[human]
            total = multiply(total, turn(frame, swings[human], neutral_swings[human], gain))
        turned[bone] = total
        world[bone] = multiply(total, rest_world[bone])
        if parent < 0:
            bones[bone] = world[bone]
        else:
            bones[bone] = multiply(conjugate(world[parent]), world[bone])
