"""Required and neutral damping are suprema over damping, never roots of DM = 1."""

from dataclasses import replace

import numpy as np
import pytest

import oracle
from cases import paper_case, random_case, xi
from sloshpy.dynamics import open_loop
from sloshpy.stability import loop_margins, margins, required_damping
from sloshpy.vehicle import SloshMass
from test_loop import _varied, pick


def test_example_needs_the_upper_root_and_not_the_unstable_one():
    """T01: DM = 1 also at 1.2208 % (unstable), which brentq, fsolve and an upward scan all return."""
    found = required_damping(paper_case())
    assert float(found.required) == pytest.approx(0.047358, rel=1e-4)
    assert float(found.neutral) == pytest.approx(0.023929, rel=1e-4)
    low = margins(paper_case(), damping=0.012208)
    assert float(low.nichols_disc_margin) == pytest.approx(-1.0, abs=2e-3)


def _good(loop, criteria, tank, x):
    damping = loop.damping.copy()
    damping[tank] = x
    found = loop_margins(replace(loop, damping=damping), criteria)
    return bool(found.stable), bool(found.stable) and float(found.slosh_disc_margin(tank)[0]) >= criteria.disc_margin


def test_just_below_fails_and_just_above_passes_on_random_vehicles():
    rng = np.random.default_rng(40)
    checked = 0
    for _ in range(25):
        case, _ = random_case(rng, tanks=int(rng.integers(1, 3)), least=1e-3)
        found, loop = required_damping(case), open_loop(case)
        for value, which in ((float(found.neutral), 0), (float(found.required), 1)):
            if 1e-4 < value < 0.9:
                assert not _good(loop, case.criteria, 0, value * (1 - 1e-3))[which]
                assert _good(loop, case.criteria, 0, value * (1 + 1e-3))[which]
                checked += 1
    assert checked >= 10


def test_neutral_damping_agrees_with_a_dense_scan_of_the_oracle_on_60_vehicles():
    """400 levels from 1e-5 to 0.3: the greatest unstable level lies below ours, the next one at or above it."""
    rng = np.random.default_rng(41)
    levels = np.concatenate([[1e-9], np.geomspace(1e-5, 0.3, 400)])
    seen = 0
    for k in range(60):
        case, damping = random_case(rng, tanks=1 + k % 2, delay=k % 4 == 3, least=1e-3)
        stable = oracle.neutral_damping_scan(oracle.numbers(case, damping), 0, levels)
        ours = float(required_damping(case).neutral)
        if stable.all():
            assert ours < 1e-8, k
        elif not stable[-1]:
            assert np.isnan(ours), k
        else:
            last = np.flatnonzero(~stable)[-1]
            assert levels[last] <= ours * (1 + 1e-9), k
            assert ours <= levels[last + 1] * (1 + 1e-9), k
            seen += 1
    assert seen >= 10


def test_required_damping_agrees_with_a_dense_scan_of_the_oracle_for_one_tank():
    """The oracle's least DM over the slosh band on 400 levels; single tanks, whose lobe is the only one in the band."""
    rng = np.random.default_rng(42)
    levels = np.geomspace(1e-3, 0.3, 400)
    for _ in range(5):
        l, w = rng.uniform(-8, 8), rng.uniform(1.6, 2.6)
        case = paper_case(law=xi(0.01), tank={"station": 6.0 - l, "frequency": w})
        found = required_damping(case)
        c = oracle.numbers(case, 0.01)
        omega = w * np.linspace(0.9, 1.25, 4001)
        good = [
            oracle.stable(c.damped(x)) and oracle.disc_margin(oracle.loop(c.damped(x), 1j * omega)).min() >= 1.0
            for x in levels
        ]
        last = np.flatnonzero(~np.array(good))
        if len(last) and levels[last[-1]] < 0.2:
            assert levels[last[-1]] * 0.999 <= float(found.required) <= levels[last[-1] + 1] * 1.001


def test_none_is_needed_outside_the_danger_zone():
    found = required_damping(paper_case(tank={"station": 6.0 + 10.5}))
    assert float(found.neutral) == pytest.approx(0.0, abs=1e-9)


def test_required_damping_of_a_batch_of_vehicles_equals_a_loop():
    case = _varied(np.random.default_rng(43), (4,))
    batch = required_damping(case)
    for k in range(4):
        one = required_damping(pick(case, (k,)))
        np.testing.assert_allclose(batch.neutral[k], one.neutral, rtol=1e-8)
        np.testing.assert_allclose(batch.required[k], one.required, rtol=1e-6)


def test_required_damping_over_another_tanks_damping_equals_a_loop():
    """The damping axis: the second tank's ratio varies, the first tank's requirement follows."""
    from sloshpy.stability import loop_required_damping

    case = _varied(np.random.default_rng(44), ())
    levels = np.array([[0.0, 0.001], [0.0, 0.01], [0.0, 0.05]])
    batch = loop_required_damping(open_loop(case, damping=levels), case.criteria, 0, 1.0)
    for k in range(3):
        one = loop_required_damping(open_loop(case, damping=levels[k]), case.criteria, 0, 1.0)
        np.testing.assert_allclose(batch.required[k], one.required, rtol=1e-6)
        np.testing.assert_allclose(batch.neutral[k], one.neutral, rtol=1e-8)


def test_required_damping_over_vehicles_and_damping_equals_a_double_loop():
    from sloshpy.stability import loop_required_damping

    case = _varied(np.random.default_rng(45), (2,))
    levels = np.array([[0.0, 0.002], [0.0, 0.05]])
    batch = loop_required_damping(open_loop(case, damping=levels[:, None, :]), case.criteria, 0, 1.0)
    assert batch.required.shape == (2, 2)
    for i, k in np.ndindex(2, 2):
        one = loop_required_damping(open_loop(pick(case, (k,)), damping=levels[i]), case.criteria, 0, 1.0)
        np.testing.assert_allclose(batch.required[i, k], one.required, rtol=1e-6)


def test_an_unknown_tank_is_refused():
    with pytest.raises(ValueError, match="no tank"):
        required_damping(paper_case(), "RP-1")


def test_dry_mass_properties_change_the_requirement_as_stated():
    """T19: with dry mass and inertia 5.45 %, with the slosh mass added twice 4.14 %."""
    l = -3.0

    def needed(sign):
        M, I = 1.6e4 + sign * 1e3, 9e5 + sign * 1e3 * l**2
        return float(required_damping(paper_case(vehicle={"mass": M, "inertia": I})).required)

    assert needed(-1) == pytest.approx(0.0545, abs=2e-3)
    assert needed(+1) == pytest.approx(0.0414, abs=2e-3)


def test_several_tanks_name_the_tank_meant():
    more = (SloshMass(name="RP-1", slosh_mass=300.0, station=3.0, frequency=2.8, damping=xi(0.01)),)
    case = paper_case(more=more)
    assert required_damping(case, "RP-1").tank == "RP-1"
    assert required_damping(case, 1).tank == "RP-1"


def test_the_digits_of_a_loop_do_not_depend_on_its_neighbours():
    stations = np.linspace(6.5, 12.0, 7)
    batch = required_damping(paper_case(tank={"station": stations}))
    for k, x in enumerate(stations):
        alone = required_damping(paper_case(tank={"station": x}))
        assert np.array_equal(batch.required[k], alone.required, equal_nan=True)
        assert np.array_equal(batch.omega[k], alone.omega, equal_nan=True)
