"""Surveys of many loops on a common grid agree with the oracle, loop by loop."""

from dataclasses import replace

import numpy as np
import pytest

import oracle
from cases import paper_case, random_case, real_case, xi
from sloshpy.case import Criteria
from sloshpy.dynamics import open_loop, partial_fractions
from sloshpy.dynamics.partial_fractions import _plant_modes
from sloshpy.dynamics.response import unfed
from sloshpy.stability.grid import grid_sweep
from sloshpy.stability.nearest import nearest
from sloshpy.vehicle import SloshMass

OMEGA = np.geomspace(0.2, 12.0, 500)
DAMPINGS = np.array([0.003, 0.01, 0.03, 0.1])


def by_oracle(case, damping):
    c = oracle.numbers(case, np.atleast_1d(damping))
    distance = oracle.disc_margin(oracle.loop(c, 1j * OMEGA))
    k = int(np.argmin(distance))
    return distance[k], OMEGA[k], np.max(np.abs(oracle.solved(c, 1j * OMEGA)[1])), oracle.stable(c)


def test_vehicles_by_dampings_equal_the_oracle_one_by_one():
    masses = np.array([[14000.0], [16000.0], [19000.0]])
    batch = paper_case(xi(0.01), vehicle={"mass": masses})
    found = grid_sweep(open_loop(batch, DAMPINGS[:, None]), OMEGA, Criteria())
    assert found.least.shape == (3, 4)
    for i, j in np.ndindex(3, 4):
        one = paper_case(xi(0.01), vehicle={"mass": float(masses[i, 0])})
        least, omega, slosh, stable = by_oracle(one, DAMPINGS[j])
        # 1e-9: the two routes differ by rounding of L, amplified by the slope of the logarithm
        assert found.least[i, j] == pytest.approx(least, rel=1e-9)
        assert found.omega[i, j] == pytest.approx(omega)
        assert found.slosh[i, j] == pytest.approx(slosh, rel=1e-9)
        assert found.stable[i, j] == stable
        assert np.sign(found.nichols_disc_margin[i, j]) == (1.0 if stable else -1.0)


def test_a_batch_of_vehicles_alone_and_one_loop_equal_the_oracle():
    masses = np.array([14000.0, 16000.0])
    loop = open_loop(paper_case(xi(0.02), vehicle={"mass": masses}), np.array([[0.02], [0.02]]))
    found = grid_sweep(loop, OMEGA, Criteria())
    for i, mass in enumerate(masses):
        assert found.least[i] == pytest.approx(
            by_oracle(paper_case(xi(0.02), vehicle={"mass": mass}), 0.02)[0], rel=1e-9
        )
    single = grid_sweep(open_loop(paper_case(xi(0.02))), OMEGA, Criteria())
    assert single.least.shape == ()
    assert single.least == pytest.approx(by_oracle(paper_case(xi(0.02)), 0.02)[0], rel=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_random_cases_with_several_tanks_delay_and_actuator_equal_the_oracle(seed):
    case, _ = random_case(np.random.default_rng(seed), tanks=1 + seed % 3, delay=True, actuator=True)
    n = len(case.vehicle.tanks)
    damping = np.array([[0.004] * n, [0.05] * n])
    found = grid_sweep(open_loop(case, damping), OMEGA, Criteria())
    for j in range(2):
        least, _, slosh, stable = by_oracle(case, damping[j])
        assert found.least[j] == pytest.approx(least, rel=1e-8)
        assert found.slosh[j] == pytest.approx(slosh, rel=1e-8)
        assert found.stable[j] == stable


def test_more_vehicles_than_one_group_keep_their_order():
    masses = np.linspace(14000.0, 20000.0, 70)[:, None]
    found = grid_sweep(open_loop(paper_case(vehicle={"mass": masses}), DAMPINGS[:, None]), OMEGA, Criteria())
    for i in (0, 31, 32, 69):
        one = grid_sweep(open_loop(paper_case(vehicle={"mass": masses[i]}), DAMPINGS[:, None]), OMEGA, Criteria())
        assert np.array_equal(found.least[i], one.least)


def test_a_grid_is_never_less_optimistic_than_the_refined_minimum():
    tank = SloshMass(name="aux", slosh_mass=60.0, station=3.0, frequency=3.1, damping=xi(0.0005))
    case = paper_case(xi(0.048), more=(tank,))
    from sloshpy.stability import margins

    on_grid = grid_sweep(open_loop(case), OMEGA, Criteria()).least
    assert on_grid > margins(case).minima.value[0] + 0.01


def test_the_grid_finds_the_nearest_point_of_every_curve_also_of_silent_and_infinite_ones():
    rng = np.random.default_rng(8)
    L = np.exp(rng.uniform(-6.0, 6.0, (40, 500)) + 1j * rng.uniform(-np.pi, np.pi, (40, 500)))
    L[3, 7], L[4, :] = 0.0, 1e-30  # no loop at all at a point, next to none on a whole curve
    L[5, 11] = -1.0
    weight = 0.5 * (np.pi / 6.0) / np.log(10.0**0.3)
    for rows in (slice(None), slice(0, 3), slice(4, 20)):
        with np.errstate(divide="ignore"):
            distance = oracle.disc_margin(L[rows]) * np.pi / 6.0
        where, squared = nearest(-L[rows].real, -L[rows].imag, weight)
        assert np.array_equal(where, np.argmin(distance, axis=-1))
        assert np.sqrt(squared) == pytest.approx(np.min(distance, axis=-1), rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("changed", [(0,), (2,), (0, 1), (0, 1, 2)])
def test_dampings_of_some_tanks_alone_move_the_slosh_of_all(changed):
    case, own = random_case(np.random.default_rng(11), tanks=3)
    damping = np.tile(own, (4, 1))
    damping[:, changed] = DAMPINGS[:, None]
    found = grid_sweep(open_loop(case, damping), OMEGA, Criteria())
    for j in range(4):
        least, _, slosh, stable = by_oracle(case, damping[j])
        assert found.least[j] == pytest.approx(least, rel=1e-8)
        assert found.slosh[j] == pytest.approx(slosh, rel=1e-8)
        assert found.stable[j] == stable


@pytest.mark.parametrize("seed", range(20))
def test_the_modes_of_a_plant_give_what_its_equations_give(seed):
    case, _ = real_case(np.random.default_rng(seed))
    loop = open_loop(case)
    n = len(loop.plant.tanks)
    batch = replace(loop, damping=np.tile(loop.damping, (2, 1)))
    ratio = np.full(n, 0.003)
    modes = _plant_modes(batch.take(np.arange(2)), ratio)
    for own, true in zip(modes[1].at(OMEGA), unfed(loop, 1j * OMEGA, ratio), strict=True):
        true = np.moveaxis(true, 0, -1)
        assert np.max(np.abs(own - true)) < 1e-9 * np.max(np.abs(true), initial=1e-30)


def test_plants_without_a_basis_of_modes_are_solved_frequency_by_frequency(monkeypatch):
    twin = SloshMass(name="twin", slosh_mass=1e3, station=9.0, frequency=2.0, damping=xi(0.01))
    loop = open_loop(paper_case(xi(0.01), more=(twin,)), DAMPINGS[:, None] * np.ones(2))
    found = grid_sweep(loop, OMEGA, Criteria())
    monkeypatch.setattr(partial_fractions, "AGREEMENT", 0.0)  # no mode is good enough
    solved = grid_sweep(loop, OMEGA, Criteria())
    assert np.any(found.least != solved.least)
    for j, damping in enumerate(DAMPINGS):
        case = paper_case(xi(0.01), more=(twin,))
        least, _, slosh, _ = by_oracle(case, np.full(2, damping))
        for way in (found, solved):
            assert way.least[j] == pytest.approx(least, rel=1e-8)
            assert way.slosh[j] == pytest.approx(slosh, rel=1e-8)
