"""Calls that may take for ever."""

from __future__ import annotations

import threading

import pytest

from puppet.tracking.cameras.patience import OverdueError, Patient


def test_it_gives_what_the_call_gives() -> None:
    assert Patient(lambda: 7).result(10.0) == 7


def test_it_raises_what_the_call_raises() -> None:
    def fail() -> None:
        raise KeyError("x")

    with pytest.raises(KeyError):
        Patient(fail).result(10.0)


def test_a_call_that_is_overdue_can_be_waited_for_again() -> None:
    go_on = threading.Event()
    patient = Patient(lambda: go_on.wait(10.0))
    with pytest.raises(OverdueError):
        patient.result(0.01)
    go_on.set()
    assert patient.result(10.0) is True


def test_a_result_that_comes_too_late_is_handed_back() -> None:
    go_on, back, never_mind = threading.Event(), threading.Event(), threading.Event()

    def call() -> str:
        go_on.wait(10.0)
        return "device"

    handed: list[str] = []

    def unwanted(result: str) -> None:
        handed.append(result)
        back.set()

    patient = Patient(call, unwanted)
    never_mind.set()
    assert patient.result(10.0, never_mind, 0.01) is None
    go_on.set()
    assert back.wait(10.0)
    assert handed == ["device"]


def test_a_result_that_is_there_already_is_handed_back_too() -> None:
    done = threading.Event()
    handed: list[int] = []

    def call() -> int:
        done.set()
        return 7

    patient = Patient(call, handed.append)
    assert done.wait(10.0)
    while not patient.done:
        pass
    patient.give_up()
    assert handed == [7]
    assert patient.result(10.0) is None
