"""The steps of a flight shared among processes: the bits of one process, whatever becomes of a worker."""

import functools
import multiprocessing
import os
import signal

import numpy as np
import pytest

from sloshpy.files import read_case, write_example
from sloshpy.flight import Phase, Trajectory, assess_flight
from sloshpy.flight.workers import Step, answered


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    case = read_case(write_example("two_tanks", tmp_path_factory.mktemp("stage")))
    share = np.linspace(1.0, 0.9, 3)
    lighter = case.vehicle.model_copy(update={"mass": case.vehicle.mass * share})
    phase = Phase(name="burn", time=np.arange(3.0), case=case.model_copy(update={"vehicle": lighter}))
    return Trajectory(name="burn", phases=(phase,))


def test_workers_give_the_bits_of_one_process(flight):
    heard = []
    alone = assess_flight(flight, 2, lambda *step: heard.append(step))
    shared = assess_flight(flight, 2, workers=2)
    assert str(alone) == str(shared)
    for one, other in zip(alone.reviews, shared.reviews, strict=True):
        for name in ("held", "required_damping", "disc_margin", "witness", "cycle_slosh", "cycle_tvc"):
            assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name
        assert np.array_equal(one.tracks.pole, other.tracks.pole, equal_nan=True)
        assert [str(x) for x in one.assessments] == [str(x) for x in other.assessments]
    assert [step[0] for step in heard] == list(range(6))
    assert {step[1] for step in heard} == {5}


def squared(k: int) -> int:
    return k * k


def dies_elsewhere(k: int, driver: int) -> int:
    """Return the square, but kill every process that is not the driver."""
    if os.getpid() != driver:
        os.kill(os.getpid(), signal.SIGKILL)
    return k * k


def test_answers_come_in_the_order_of_the_steps():
    heard: list[str] = []
    steps = [Step(what=str(k), ask=functools.partial(squared, k)) for k in range(20)]
    assert answered(steps, 2, heard.append) == [k * k for k in range(20)]
    assert sorted(map(int, heard)) == list(range(20))


def test_what_a_dead_worker_leaves_is_done_here():
    steps = [Step(what="x", ask=functools.partial(dies_elsewhere, k, os.getpid())) for k in range(4)]
    assert answered(steps, 2, lambda _: None) == [0, 1, 4, 9]


def test_an_interrupt_leaves_no_worker_behind():
    def interrupted(_: str) -> None:
        raise KeyboardInterrupt

    before = set(multiprocessing.active_children())
    steps = [Step(what="x", ask=functools.partial(squared, k)) for k in range(50)]
    with pytest.raises(KeyboardInterrupt):
        answered(steps, 2, interrupted)
    assert set(multiprocessing.active_children()) <= before
