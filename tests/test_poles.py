"""Closed-loop poles, exact with delay, against other eigenvalue routes and the argument principle."""

from importlib.resources import files

import control
import numpy as np
import pytest

import oracle
from cases import paper_case, random_case
from sloshpy.dynamics import closed_loop_poles, open_loop, open_loop_poles
from sloshpy.dynamics.growth import BRIEF_ORDER, SURE, greatest_growth, is_stable, surely_damped
from sloshpy.dynamics.poles import closed_loop_eigenvalues, unstable_count
from sloshpy.dynamics.states import system_matrix
from sloshpy.files import read_case


def near(values, wanted):
    """Largest distance of a wanted value from the nearest value, relative."""
    return max(np.abs(values - w).min() / max(abs(w), 1e-3) for w in wanted)


def test_poles_without_delay_agree_with_the_full_first_order_matrix_on_300_cases():
    rng = np.random.default_rng(20)
    for _ in range(300):
        case, damping = random_case(rng, delay=False)
        ours = closed_loop_eigenvalues(open_loop(case, damping=damping))
        theirs = oracle.poles(oracle.numbers(case, damping))
        assert len(ours) == len(theirs)
        # 1e-7: a well-separated pole has 1e-12, nearly double filter poles lose half the digits
        assert near(ours, theirs) < 1e-7
        assert near(theirs, ours) < 1e-7


def test_poles_with_delay_are_roots_of_the_exact_characteristic_function():
    rng = np.random.default_rng(21)
    worst = 0.0
    for _ in range(200):
        case, damping = random_case(rng, delay=True)
        values = closed_loop_eigenvalues(open_loop(case, damping=damping))
        values = values[np.isfinite(values)]
        f, size = oracle.characteristic(oracle.numbers(case, damping), values)
        worst = max(worst, np.max(np.abs(f) / size))
    assert worst < 1e-9


def test_every_pole_near_the_axis_is_found_with_delay():
    """The oracle's Newton from a grid of starts in the slosh band finds no pole that the list lacks."""
    rng = np.random.default_rng(22)
    for _ in range(40):
        case, damping = random_case(rng, delay=True)
        c = oracle.numbers(case, damping)
        ours = closed_loop_eigenvalues(open_loop(case, damping=damping))
        ours = ours[np.isfinite(ours)]
        for w in np.linspace(0.2, 2.0, 6) * c.w.mean():
            root = oracle.newton_pole(c, complex(-0.02 * w, w))
            f, size = oracle.characteristic(c, root)
            if (
                np.isfinite(root)
                and abs(f) < 1e-10 * size
                and root.real > -0.3 * c.w.mean()
                and abs(root) < 3 * c.w.max()
            ):
                assert np.abs(ours - root).min() < 1e-6 * abs(root), (root, ours)


def test_small_delays_agree_with_pade_of_order_20():
    """T14: five sections of order 4 in series; one polynomial of order 20 would spread over 40 decades."""
    for tau, ratio in ((0.05, 0.03), (0.17, 0.0), (0.3, 0.048)):
        c = oracle.numbers(paper_case(delay=tau), ratio)
        num, den = oracle.one_tank_polynomials(c)
        loop = control.tf2ss(control.tf(np.polymul(num, [0.14, 0.08]), den))
        for _ in range(5):
            loop = loop * control.tf2ss(*control.pade(tau / 5, 4))
        theirs = control.feedback(loop).poles()
        slow = theirs[np.abs(theirs) < 4]
        exact = closed_loop_eigenvalues(open_loop(paper_case(delay=tau), damping=ratio))
        exact = exact[np.isfinite(exact)]
        assert len(slow) == 4
        assert near(exact, slow) < 1e-8


def test_low_pade_orders_would_give_other_poles():
    """T14: at order 1 the phase is 68 deg wrong at 3 Hz; ours does not depend on any order."""
    w, tau = 2 * np.pi * 3, 0.17
    first = np.angle((2 - 1j * w * tau) / (2 + 1j * w * tau))
    error = np.degrees(np.abs(np.angle(np.exp(1j * (first + w * tau)))))
    assert error == pytest.approx(68, abs=1)
    case = paper_case(delay=tau, gain=2.0)
    c = oracle.numbers(case, 0.03)
    for pole in closed_loop_poles(open_loop(case, damping=0.03)).value:
        f, size = oracle.characteristic(c, pole)
        assert abs(f) < 1e-9 * size


def test_stability_agrees_with_the_oracle_on_2000_random_cases():
    """1000 without delay (full matrix) and 1000 with (argument principle).

    Cases whose greatest growth is within 1e-9 of zero relative to the slosh frequency lie inside the rounding of both
    routes and are left out; with these seeds none is.
    """
    rng = np.random.default_rng(23)
    unstable = 0
    for k in range(2000):
        case, damping = random_case(rng, delay=k % 2 == 1)
        c = oracle.numbers(case, damping)
        growth = float(greatest_growth(open_loop(case, damping=damping)))
        assert abs(growth) > 1e-9 * c.w.mean()
        assert (growth < 0) == oracle.stable(c), (k, growth)
        unstable += growth > 0
    assert 400 < unstable < 1600  # both verdicts are well represented


def test_no_matrix_with_a_lighter_eigenvalue_is_called_surely_damped():
    """Eigenvalues are chosen, about the bound to a millionth and growing ones among them, and mixed by random bases."""
    rng = np.random.default_rng(24)
    light = called = 0
    for _ in range(20):
        pairs, count = int(rng.integers(6, 14)), 200
        zeta = 10.0 ** rng.uniform(-2.5, 0.0, (count, pairs))
        edge = rng.random(count) < 0.5
        zeta[edge, 0] = SURE * (1.0 + rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-6.0, 1.0, count))[edge]
        omega = 3.0 * 10.0 ** rng.uniform(-1.5, 1.5, (count, pairs))
        own = np.zeros((count, 2 * pairs, 2 * pairs))
        even = np.arange(0, 2 * pairs, 2)
        own[:, even, even] = own[:, even + 1, even + 1] = -zeta * omega
        own[:, even, even + 1] = omega * np.sqrt(1.0 - zeta**2)
        own[:, even + 1, even] = -own[:, even, even + 1]
        first, last = np.linalg.qr(rng.normal(size=(2, count, 2 * pairs, 2 * pairs)))[0]
        skew = np.triu(rng.normal(size=own.shape), 1) * 10.0 ** rng.uniform(-1.0, 1.0, (count, 1, 1)) / pairs
        basis = first @ (np.eye(2 * pairs) + skew) @ last
        sure = surely_damped(basis @ own @ np.linalg.inv(basis), 3.0 * 10.0 ** rng.uniform(-0.5, 0.5, count))
        assert not np.any(sure & (zeta.min(axis=-1) <= SURE))
        light, called = light + np.sum(zeta.min(axis=-1) <= SURE), called + np.sum(sure)
    assert light > 500
    assert called > 1000


def test_stability_along_damping_is_the_sign_of_the_greatest_growth():
    """Ten vehicles like the launcher, closely about the damping at which each becomes unstable; few stay in doubt."""
    case = read_case(str(files("sloshpy") / "data" / "flexible_launcher.toml"))
    rng = np.random.default_rng(25)
    tanks = tuple(t.model_copy(update={"frequency": t.frequency * rng.uniform(0.9, 1.1)}) for t in case.vehicle.tanks)
    gain = case.autopilot.attitude_gain * rng.uniform(0.5, 1.5, (10, 1))
    vehicle = case.vehicle.model_copy(update={"tanks": tanks})
    case = case.model_copy(
        update={"vehicle": vehicle, "autopilot": case.autopilot.model_copy(update={"attitude_gain": gain})}
    )
    loop = open_loop(case, np.geomspace(1e-5, 0.1, 60)[:, None] * np.ones(len(tanks)))
    stable = is_stable(loop)
    assert np.array_equal(stable, greatest_growth(loop) < 0.0)
    assert 0.1 < np.mean(stable) < 0.9
    A, _ = system_matrix(loop, delay=(1, BRIEF_ORDER))
    assert np.mean(surely_damped(A, np.full(loop.batch, 3.0))) > 0.7 * np.mean(stable)


def test_encirclement_count_agrees_with_eigenvalues_on_300_cases():
    """T04: the witness uses no eigenvalue."""
    rng = np.random.default_rng(24)
    for k in range(300):
        case, damping = random_case(rng, delay=k % 2 == 1)
        loop = open_loop(case, damping=damping)
        values = closed_loop_eigenvalues(loop)
        assert unstable_count(loop) == np.sum(values[np.isfinite(values)].real > 0), k


def test_encirclement_count_sees_damping_of_one_part_in_a_million():
    """T04: a fixed grid misses a resonance this narrow."""
    for ratio, count in ((1e-6, 2), (0.0239, 2), (0.02394, 0)):
        assert unstable_count(open_loop(paper_case(), damping=ratio)) == count


def test_poles_are_those_of_eq_21_with_pd_control():
    for ratio in (0.0, 0.01, 0.048):
        case = paper_case(vehicle={"vectored_thrust": 6e5, "drag": 5e4})
        num, den = oracle.one_tank_polynomials(oracle.numbers(case, ratio))
        roots = np.roots(np.polyadd(den, np.polymul(num, [0.14, 0.08])))
        assert near(closed_loop_eigenvalues(open_loop(case, damping=ratio)), roots) < 1e-10


def test_open_loop_poles_of_one_tank_are_the_denominator_of_eq_21():
    found = open_loop_poles(open_loop(paper_case(), damping=0.01))
    _, den = oracle.one_tank_polynomials(oracle.numbers(paper_case(), 0.01))
    slosh = found.value[np.abs(found.value) > 1e-6]
    upper = [r for r in np.roots(den) if r.imag > 0]
    np.testing.assert_allclose(slosh, upper, rtol=1e-10)
    assert found.drift_poles == 2


def test_drift_poles_are_reported_and_never_counted_as_unstable():
    found = closed_loop_poles(open_loop(paper_case(), damping=0.048))
    assert found.stable
    assert found.drift_poles == 2
    assert np.all(np.abs(found.value) > 1e-3)


def test_the_lightly_damped_pole_is_named_after_its_tank_and_shares_add_up():
    rng = np.random.default_rng(25)
    for _ in range(30):
        case, damping = random_case(rng, tanks=2, delay=False, actuator=False, filters=False)
        found = closed_loop_poles(open_loop(case, damping=damping))
        np.testing.assert_allclose(found.participation.sum(axis=1), 1.0, rtol=1e-9)
        for name, tank in zip(found.name, found.tank, strict=True):
            assert tank is None or tank in name
    first = closed_loop_poles(open_loop(paper_case(), damping=0.01))
    assert (first.name[0], first.kind[0], first.tank[0]) == ("LOX slosh", "slosh", "LOX")


def test_poles_of_a_batch_equal_a_loop():
    levels = np.array([0.0, 0.01, 0.03, 0.048])
    for tau in (0.0, 0.17):
        batch = greatest_growth(open_loop(paper_case(delay=tau), damping=levels[:, None]))
        for k, level in enumerate(levels):
            assert batch[k] == pytest.approx(
                float(greatest_growth(open_loop(paper_case(delay=tau), damping=float(level)))), rel=1e-9
            )


def test_a_batch_with_some_zero_delays_equals_a_loop():
    delays = np.array([0.0, 0.05, 0.3])
    batch = greatest_growth(open_loop(paper_case(delay=delays), damping=0.02))
    for k, tau in enumerate(delays):
        alone = float(greatest_growth(open_loop(paper_case(delay=float(tau)), damping=0.02)))
        assert batch[k] == pytest.approx(alone, rel=1e-9)


def test_no_pole_is_listed_twice_and_every_growing_one_is_listed_with_delay():
    """A pole of the Pade start may be polished onto a pole of the loop; it is not a second mode."""
    rng = np.random.default_rng(26)
    for k in range(300):
        case, damping = random_case(rng, delay=True, tanks=1 + k % 2)
        found = closed_loop_poles(open_loop(case, damping=damping))
        value = found.value[np.isfinite(found.value)]
        apart = np.abs(value[:, None] - value[None, :]) + np.eye(len(value)) * 1e9
        assert np.all(apart.min(axis=1) > 1e-7 * np.abs(value)), k
        count = np.sum(np.where(value.imag > 0, 2, 1)[value.real > 0])
        assert count == oracle.unstable_poles(oracle.numbers(case, damping)), k
        assert found.stable == (count == 0), k
