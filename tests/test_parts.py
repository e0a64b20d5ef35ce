"""Who drives whom: parts are taken by a rule, kept, and given back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from puppet.errors import BadDecisionError
from puppet.mapping.stance import UPRIGHT
from puppet.parts import RAISED_SECONDS, Parts
from puppet.show import PartConfig, ZoneConfig
from puppet.skeleton import JOINT_COUNT, Joint, SkeletonFrame

LEFT = ZoneConfig(x=(0.0, 3.0), z=(-5.0, 0.0))
RIGHT = ZoneConfig(x=(-3.0, 0.0), z=(-5.0, 0.0))


def standing(
    performer: int, x: float, z: float, time: float, *, hand_up: bool = False
) -> SkeletonFrame:
    """Somebody who stands at that place on the floor."""
    positions = np.zeros((JOINT_COUNT, 3))
    for joint, place in UPRIGHT.items():
        positions[joint] = place
    if hand_up:
        positions[Joint.HAND_RIGHT] = (-0.3, 1.95, 0.1)
    positions += (x, 0.0, z)
    return SkeletonFrame(time, round(30 * time), performer, positions, np.full(20, 2, np.uint8))


class Show:
    """Plays seconds of people standing about, and tells who has which part."""

    def __init__(self, *configs: PartConfig) -> None:
        self.parts = Parts(configs)
        self.time = 0.0

    def play(self, seconds: float, **people: tuple[int, float, float] | tuple[int, float]) -> None:
        """people: name=(number, x, z); raised hands are told by a name that begins with "up"."""
        for _ in range(round(seconds * 30)):
            self.time += 1.0 / 30.0
            frames = [
                standing(
                    int(who[0]),
                    who[1],
                    who[2] if len(who) > 2 else -2.0,
                    self.time,
                    hand_up=name.startswith("up"),
                )
                for name, who in people.items()
            ]
            self.parts.step(frames, self.time)

    def player(self, part: str = "lead") -> int | None:
        return self.parts.holders[part]


def test_the_nearest_takes_the_part_at_once() -> None:
    show = Show()
    show.play(0.1, far=(1, 0.5, -4.0), near=(2, 0.5, -2.0))
    assert show.player() == 2


def test_someone_walking_through_the_picture_changes_nothing() -> None:
    show = Show()
    show.play(1.0, player=(1, 0.0, -3.0))
    for step in range(60):
        show.play(1 / 30, player=(1, 0.0, -3.0), passer=(2, 3.0 - 0.1 * step, -1.0))
        assert show.player() == 1
    show.play(5.0, player=(1, 0.0, -3.0))
    assert show.player() == 1


def test_whoever_is_hidden_for_a_moment_keeps_the_part_and_whoever_left_loses_it() -> None:
    show = Show(PartConfig(release_after=2.0))
    show.play(1.0, player=(1, 0.0))
    show.play(1.5, other=(2, 0.5))
    assert show.player() == 1
    show.play(0.6, other=(2, 0.5))
    assert show.player() == 2
    show.play(2.0, player=(1, 0.0), other=(2, 0.5))
    assert show.player() == 2


def test_each_zone_has_its_own_player_and_who_crosses_over_loses_the_part() -> None:
    show = Show(
        PartConfig("left", "zone", LEFT, release_after=1.0),
        PartConfig("right", "zone", RIGHT, release_after=1.0),
    )
    show.play(0.5, a=(1, 1.0), b=(2, -1.0))
    assert (show.player("left"), show.player("right")) == (1, 2)
    show.play(0.9, a=(1, -0.5), b=(2, -1.0))
    assert (show.player("left"), show.player("right")) == (1, 2), "a step over the line is forgiven"
    show.play(0.5, a=(1, -0.5), b=(2, -1.0))
    assert show.parts.holders == {"left": None, "right": 2}


def test_the_first_raised_hand_takes_the_part_and_a_scratched_head_does_not() -> None:
    show = Show(PartConfig("lead", "raised-hand"))
    show.play(2.0, a=(1, 0.0), b=(2, 0.5))
    assert show.player() is None
    show.play(0.5 * RAISED_SECONDS, up_a=(1, 0.0), b=(2, 0.5))
    show.play(0.2, a=(1, 0.0), b=(2, 0.5))
    assert show.player() is None
    show.play(RAISED_SECONDS - 0.1, a=(1, 0.0), up_b=(2, 0.5))
    show.play(0.2, up_a=(1, 0.0), up_b=(2, 0.5))
    assert show.player() == 2


def test_nobody_takes_a_part_that_the_operator_gives() -> None:
    show = Show(PartConfig("lead", "operator"))
    show.play(1.0, up_a=(1, 0.0), b=(2, 0.5))
    assert show.player() is None
    show.parts.assign("lead", 2)
    show.play(1.0, a=(1, 0.0), b=(2, 0.5))
    assert show.player() == 2


def test_a_released_part_does_not_go_back_to_the_same_player() -> None:
    show = Show()
    show.play(1.0, a=(1, 0.0))
    show.parts.release("lead")
    show.play(1.0, a=(1, 0.0))
    assert show.player() is None
    show.play(1.0, a=(1, 0.0), b=(2, 2.0))
    assert show.player() == 2
    show.parts.reopen("lead")
    show.play(1.0, a=(1, 0.0), b=(2, 2.0))
    assert show.player() == 1


def test_whoever_was_released_may_come_back_as_anybody_after_leaving() -> None:
    show = Show()
    show.play(1.0, a=(1, 0.0))
    show.parts.release("lead")
    for seconds, player in ((0.1, None), (2.0, None), (3.1, 1)):  # overlooked, hidden, gone
        show.play(seconds)
        show.play(0.1, a=(1, 0.0))
        assert show.player() == player


def test_what_is_not_there_cannot_be_given() -> None:
    show = Show()
    show.play(0.1, a=(1, 0.0))
    with pytest.raises(BadDecisionError, match="no such performer") as caught:
        show.parts.assign("lead", 7)
    assert "1" in str(caught.value)
    with pytest.raises(BadDecisionError, match="no such part"):
        show.parts.release("chorus")


@given(st.lists(st.sets(st.integers(0, 3), max_size=4), min_size=1, max_size=60), st.data())
def test_nobody_plays_two_parts_by_a_rule_and_a_player_is_never_pushed_out(
    comings: list[set[int]], data: st.DataObject
) -> None:
    parts = Parts([PartConfig("a"), PartConfig("b", release_after=0.5), PartConfig("c")])
    seen = dict.fromkeys(range(4), -1e9)
    before: dict[str, int | None] = dict.fromkeys(parts.names)
    for step, there in enumerate(comings):
        time = 0.1 * step
        frames = [standing(i, data.draw(st.floats(-2, 2)), -2.0, time) for i in sorted(there)]
        parts.step(frames, time)
        seen |= dict.fromkeys(there, time)
        players = [player for player in parts.holders.values() if player is not None]
        assert len(set(players)) == len(players)
        for name, player in before.items():
            if player is not None and time - seen[player] < 0.5:
                assert parts.holders[name] == player
        before = dict(parts.holders)
