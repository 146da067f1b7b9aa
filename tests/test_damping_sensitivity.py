"""Derivatives by the damping against a closed form, a sum rule, and differences of independent solutions."""

import numpy as np
import pytest

import oracle
from cases import paper_case, random_case, real_case, xi
from sloshpy.dynamics import open_loop
from sloshpy.dynamics.characteristic import polish
from sloshpy.dynamics.plant import plant
from sloshpy.dynamics.poles import closed_loop_eigenvalues
from sloshpy.files import read_case, write_example
from sloshpy.stability import damping_sensitivity, margins

H = 1e-6  # damping ratio: the error of the difference is 1e-12 of the curvature and 1e-16 / 1e-6 of rounding
TWIN = {"name": "twin", "slosh_mass": 500.0, "station": 9.0, "frequency": 2.0}


def test_one_tank_has_the_derivative_of_its_characteristic_polynomial():
    """Closed form: P(s, xi) = den + (a0 + a1 s) num of eq 21 is linear in xi, so ds/dxi = -P_xi / P_s."""
    for ratio in (0.0, 0.01, 0.048):
        case = paper_case(vehicle={"vectored_thrust": 6e5, "drag": 5e4})

        def characteristic(x, case=case):
            num, den = oracle.one_tank_polynomials(oracle.numbers(case, x))
            return np.polyadd(den, np.polymul(num, [0.14, 0.08]))

        by_xi = np.polysub(characteristic(ratio + 1.0), characteristic(ratio))
        by_s = np.polyder(characteristic(ratio))
        found = damping_sensitivity(case, ratio)
        expected = -np.polyval(by_xi, found.poles.value) / np.polyval(by_s, found.poles.value)
        np.testing.assert_allclose(found.pole_slope[:, 0], expected, rtol=1e-9)


def test_a_tank_that_nothing_couples_has_the_derivative_of_a_free_oscillator():
    """s = w (-xi + j sqrt(1 - xi^2)): ds/dxi = -w (1 + j xi / sqrt(1 - xi^2)); a gram of liquid moves no stage."""
    case = paper_case(xi(0.2), tank={"slosh_mass": 1e-3})
    found = damping_sensitivity(case)
    k = found.poles.name.index("LOX slosh")
    assert found.pole_slope[k, 0] == pytest.approx(-2.0 * (1.0 + 0.2j / np.sqrt(0.96)), rel=1e-5)


def test_the_sum_over_all_poles_is_the_change_of_the_trace():
    """Sum of the poles = trace of the state matrix; a tank's damping enters it as -2 xi w m (Mq^-1)_jj only."""
    rng = np.random.default_rng(70)
    for _ in range(60):
        case, damping = real_case(rng, delay=False)
        found = damping_sensitivity(case, damping)
        number = np.where(np.abs(found.poles.value.imag) > 0.0, 2.0, 1.0)
        p = plant(case.vehicle)
        own = np.arange(2, 2 + len(damping))
        expected = -2.0 * p.tank_frequency * p.tank_mass * np.linalg.inv(p.mass)[own, own]
        np.testing.assert_allclose(number @ found.growth_slope, expected, rtol=1e-6, atol=1e-7 * np.abs(expected).max())


def test_poles_move_as_newton_on_the_oracle_says():
    rng = np.random.default_rng(71)
    checked = 0
    for k in range(40):
        case, damping = random_case(rng, delay=k % 2 == 1)
        found = damping_sensitivity(case, damping)
        for p, name, slope in zip(found.poles.value, found.poles.name, found.pole_slope, strict=True):
            if not name.endswith("slosh"):
                continue
            for j in range(len(damping)):
                step = H * np.eye(len(damping))[j]
                ends = [oracle.newton_pole(oracle.numbers(case, damping + sign * step), p) for sign in (1, -1)]
                expected = (ends[0] - ends[1]) / (2 * H)
                scale = case.vehicle.tanks[j].frequency
                np.testing.assert_allclose(slope[j], expected, rtol=1e-5, atol=1e-6 * scale)
                checked += 1
    assert checked > 100


def test_poles_of_bending_flying_vehicles_with_delay_move_as_differences_say():
    rng = np.random.default_rng(72)
    for _ in range(30):
        case, damping = real_case(rng, delay=True)
        found = damping_sensitivity(case, damping)
        for j in range(len(damping)):
            step = H * np.eye(len(damping))[j]
            ends = [polish(open_loop(case, damping + sign * step).along(), found.poles.value) for sign in (1, -1)]
            expected = (ends[0] - ends[1]) / (2 * H)
            known = np.isfinite(expected)
            scale = np.abs(found.poles.value[known]) + case.vehicle.tanks[j].frequency
            error = np.abs(found.pole_slope[known, j] - expected[known])
            assert np.all(error < 1e-4 * np.abs(expected[known]) + 1e-6 * scale)


def test_every_minimum_moves_as_differences_of_refined_minima_say():
    """The frequency of the minimum moves too; the envelope theorem leaves it out and must be right."""
    rng = np.random.default_rng(73)
    checked = 0
    for k in range(40):
        case, damping = real_case(rng, air=False) if k % 2 else random_case(rng)
        found = damping_sensitivity(case, damping)
        minima = found.margins.minima
        sign = 1.0 if found.margins.stable else -1.0
        for j in range(len(damping)):
            step = H * np.eye(len(damping))[j]
            ends = [margins(case, damping + way * step).minima for way in (1, -1)]
            for m, omega in enumerate(minima.omega[: len(found.margin_slope)]):
                at = [np.nanargmin(np.abs(end.omega - omega)) for end in ends]
                if any(abs(e.omega[i] / omega - 1) > 1e-3 * damping[j] for e, i in zip(ends, at, strict=True)):
                    continue  # a shallow minimum that moves far or merges
                expected = sign * (ends[0].value[at[0]] - ends[1].value[at[1]]) / (2 * H)
                # 1e-15 of rounding of a value over the step
                assert found.margin_slope[m, j] == pytest.approx(expected, rel=2e-3, abs=1e-6 * max(1, minima.value[m]))
                checked += abs(expected) > 1e-3
    assert checked > 100


def test_the_disc_margin_of_the_paper_rises_by_a_fifth_for_each_percent():
    """theory.md: DM = 1 at 4.7358 %, 1.0183 at 4.8 %, a difference over so small a step that a line will do."""
    case = paper_case()
    slope = damping_sensitivity(case, 0.5 * (0.047358 + 0.048)).margin_slope[0, 0]
    assert slope == pytest.approx((1.0183 - 1.0) / (0.048 - 0.047358), rel=0.01)


def test_more_damping_of_an_unstable_loop_is_better_by_sign():
    found = damping_sensitivity(paper_case(), 0.02)
    assert not found.margins.stable
    assert found.margin_slope[0, 0] > 0.0
    assert found.growth_slope[0, 0] < 0.0


def test_a_split_tank_shares_the_derivative_of_the_whole():
    whole = damping_sensitivity(paper_case(xi(0.03)))
    half = paper_case(xi(0.03), tank={"slosh_mass": 500.0})
    twin = half.vehicle.tanks[0].model_copy(update=TWIN)
    split = damping_sensitivity(paper_case(xi(0.03), tank={"slosh_mass": 500.0}, more=(twin,)))
    k = int(np.argmin(np.abs(split.poles.value - whole.poles.value[0])))
    np.testing.assert_allclose(split.pole_slope[k], 0.5 * whole.pole_slope[0, 0], rtol=1e-8)
    np.testing.assert_allclose(split.margin_slope[0], 0.5 * whole.margin_slope[0, 0], rtol=1e-8)


def test_two_poles_that_coincide_have_no_derivative():
    """Three equal tanks at one station: two of their modes move against each other and are one double pole."""
    tank = paper_case(xi(0.03), tank={"slosh_mass": 300.0}).vehicle.tanks[0]
    more = tuple(tank.model_copy(update={"name": name}) for name in ("b", "c"))
    case = paper_case(xi(0.03), tank={"slosh_mass": 300.0}, more=more)
    found = damping_sensitivity(case)
    free = 2.0 * (-0.03 + 1j * np.sqrt(1 - 0.03**2))
    double = np.abs(found.poles.value - free) < 1e-6
    assert np.sum(double) == 2
    assert np.all(np.isnan(found.growth_slope[double]))
    assert np.all(np.isfinite(found.growth_slope[~double]))


def test_a_neutral_minimum_has_no_derivative_because_the_distance_has_a_corner_there():
    from scipy.optimize import brentq

    def most(x):
        return float(np.max(closed_loop_eigenvalues(open_loop(paper_case(), x)).real))

    found = damping_sensitivity(paper_case(), brentq(most, 0.02, 0.03, xtol=1e-16))
    assert found.margins.minima.value[0] < 1e-9
    assert np.isnan(found.margin_slope[0, 0])


def test_it_says_which_tank_drives_which_mode(tmp_path):
    case = read_case(write_example("two_tanks", tmp_path))
    found = damping_sensitivity(case)
    assert found.driver[:2] == ("LH2", "LOX")
    text = str(found)
    assert "driven by" in text
    assert max(len(line) for line in text.splitlines()) <= 120
    data = found.to_dataset()
    assert data["growth_slope"].sel(tank="LH2").values[0] == found.growth_slope[0, 1]
    assert data["growth_slope"].attrs["units"] == "1/s"
    k = found.poles.name.index("actuator")
    assert abs(found.growth_slope[k]).max() < 0.01 * abs(found.growth_slope[0]).max()


def test_tanks_in_another_order_give_the_columns_in_that_order():
    case, damping = random_case(np.random.default_rng(74), tanks=3)
    vehicle = case.vehicle.model_copy(update={"tanks": case.vehicle.tanks[::-1]})
    turned = damping_sensitivity(case.model_copy(update={"vehicle": vehicle}), damping[::-1])
    plain = damping_sensitivity(case, damping)
    order = [int(np.argmin(np.abs(turned.poles.value - p))) for p in plain.poles.value]
    np.testing.assert_allclose(turned.pole_slope[order][:, ::-1], plain.pole_slope, rtol=1e-6, atol=1e-9)
