"""The closed-form danger zone against an eigenvalue scan, its refusal, and the first-order departure."""

import numpy as np
import pytest
from scipy.optimize import brentq

import oracle
from cases import paper_case, xi
from sloshpy.dynamics import open_loop
from sloshpy.stability import danger_zone, required_damping_map
from sloshpy.stability.danger_zone import departure, phase_lead

TINY = 1e-4  # loop gain at which a root's real part is its first-order departure


def growth(case, l, gain=TINY):
    """Real part of the undamped slosh root at a tiny gain, with the slosh mass at lever l."""
    c = oracle.numbers(case, 0.0)
    c = oracle.replace(c, l=np.array([l]), gain=gain)
    _, den = oracle.one_tank_polynomials(c)
    w = np.sqrt(den[2] / den[0])
    roots = oracle.poles(c)
    return roots[np.argmin(np.abs(roots - 1j * w))].real


def test_bounds_are_where_the_departure_changes_sign_on_random_vehicles():
    """Single tank, PD, drag and partly vectored thrust included: eqs 22 and 23 hold for any k3 and k4."""
    rng = np.random.default_rng(50)
    done = 0
    while done < 25:
        M, I = 10 ** rng.uniform(3.5, 5.5), None
        I = M * rng.uniform(4, 9) ** 2
        F = M * rng.uniform(8, 40)
        w, m = rng.uniform(2, 5), M * rng.uniform(0.01, 0.06)
        case = paper_case(
            law=xi(0.0),
            vehicle={
                "mass": M,
                "inertia": I,
                "cg": rng.uniform(4, 12),
                "thrust": F,
                "vectored_thrust": rng.uniform(0.3, 1) * F,
                "drag": rng.uniform(0, 0.3) * F,
            },
            tank={"slosh_mass": m, "frequency": w, "station": 1.0},
            attitude_gain=0.3,
            rate_gain=0.5,
        )
        zone = danger_zone(case)
        reach = np.sqrt(0.8 * I / m)
        if zone.reason or max(zone.aft, -zone.forward) * 1.2 > reach:
            continue
        done += 1
        for bound in (zone.aft, zone.forward):
            found = brentq(lambda l, case=case: growth(case, l), bound * 0.8, bound * 1.2, xtol=1e-9)
            assert found == pytest.approx(bound, rel=1e-3)  # first order in the tiny gain
        assert growth(case, 0.5 * (zone.aft + zone.forward)) > 0
        assert growth(case, zone.aft * 1.15) < 0
        assert growth(case, zone.forward * 1.15) < 0


def test_the_example_lies_inside_and_greensite_stops_at_the_cg():
    zone = danger_zone(paper_case())
    assert zone.inside is True
    assert zone.aft == pytest.approx(13.18, abs=5e-3)
    assert zone.forward == pytest.approx(-9.37, abs=6e-3)  # printed 9.37; 9.375 exactly
    assert danger_zone(paper_case(tank={"station": 6 + 9.4})).inside is False
    assert danger_zone(paper_case(tank={"station": 6 + 9.35})).inside is True
    assert danger_zone(paper_case(tank={"station": 6 - 13.15})).inside is True


def test_lead_less_lag_is_the_phase_of_the_forward_path():
    case = paper_case(delay=0.1)
    expected = np.arctan2(0.14 * 2, 0.08) - 0.2
    assert phase_lead(case.autopilot, 2.0) == pytest.approx(expected, rel=1e-12)


def test_the_formula_is_refused_once_lag_eats_the_lead():
    """T16: at 800 ms the zone is inverted: l = -3 m is stable and l = +16 m, outside, is not."""
    zone = danger_zone(paper_case(delay=0.8))
    assert zone.inside is None
    assert "lag eats the PD lead" in zone.reason
    assert danger_zone(paper_case(delay=0.17)).inside is True
    for l, sign in ((-3.0, -1), (16.0, 1)):
        moved = paper_case(law=xi(0.0), tank={"station": 6.0 - l}, delay=0.8)
        c = oracle.replace(oracle.numbers(moved, 0.0), gain=TINY)
        _, den = oracle.one_tank_polynomials(c)
        root = oracle.newton_pole(c, 1j * np.sqrt(den[2] / den[0]))
        assert np.sign(root.real) == sign


def test_departure_is_the_derivative_of_the_eigenvalue():
    """Central difference in the loop gain at 1e-5; its own error is of second order."""
    for tau in (0.0, 0.17):
        for l in (-12.0, -3.0, 5.0, 14.0):
            case = paper_case(law=xi(0.0), tank={"station": 6.0 - l}, delay=tau)
            c = oracle.numbers(case, 0.0)
            _, den = oracle.one_tank_polynomials(c)
            start = 1j * np.sqrt(den[2] / den[0])
            h = 1e-4
            roots = [oracle.newton_pole(oracle.replace(c, gain=g), start) for g in (-h, h)]
            slope = (roots[1] - roots[0]).real / (2 * h)
            ours = float(departure(open_loop(case, damping=0.0), 0))
            assert ours == pytest.approx(slope, rel=1e-4, abs=1e-6)


def test_the_map_agrees_with_the_closed_form_and_marks_the_case():
    found = required_damping_map(paper_case(law=xi(0.0)))
    l = 6.0 - found.station
    inside = (l > found.zone.forward + 1e-6) & (l < found.zone.aft - 1e-6)
    np.testing.assert_array_equal(found.departure > 1e-9, inside)
    at = int(np.argmin(np.abs(found.station - 9.0)))
    assert found.required[at] == pytest.approx(0.047358, rel=1e-4)
    assert found.neutral[at] == pytest.approx(0.023929, rel=1e-4)


def test_a_station_that_makes_the_mass_matrix_indefinite_is_refused():
    with pytest.raises(ValueError, match="indefinite"):
        required_damping_map(paper_case(), station=np.array([6.0, 50.0]))


def test_a_batch_of_vehicles_equals_a_loop_and_refuses_by_nan():
    stations = np.array([9.0, 16.0, -8.0])
    delays = np.array([0.0, 0.0, 0.7])  # the last eats the lead
    batch = danger_zone(paper_case(tank={"station": stations}, delay=delays))
    for k, (station, delay) in enumerate(zip(stations, delays, strict=True)):
        one = danger_zone(paper_case(tank={"station": float(station)}, delay=float(delay)))
        assert batch.lead[k] == pytest.approx(one.lead)
        assert (batch.l[k], batch.aft[k], batch.forward[k]) == pytest.approx((one.l, one.aft, one.forward))
        assert {None: np.isnan(batch.within[k]), True: batch.within[k] == 1.0, False: batch.within[k] == 0.0}[
            one.inside
        ]
    assert "1 of 3 vehicles inside the danger zone, 1 refused" in str(batch)
