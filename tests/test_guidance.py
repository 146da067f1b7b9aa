"""An outer loop that holds the drift, against the second implementation; and what drift poles are then called."""

import json

import numpy as np
import pytest
from pydantic import ValidationError

import oracle
import oracle_flexible as second
from cases import guided_case, paper_case, xi
from held import hold_history, hold_poles
from sloshpy.assess import assess
from sloshpy.autopilot import Actuator
from sloshpy.case import Criteria
from sloshpy.damping import PowerDamping
from sloshpy.dynamics import closed_loop_poles, frequency_response, open_loop, open_loop_poles
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.response import frequency_sensitivity
from sloshpy.errors import InputError, OutsideValidity
from sloshpy.files import read_case, to_control, write_case
from sloshpy.report.inputs import input_rows
from sloshpy.simulation import simulate
from sloshpy.stability import danger_zone, margins, root_locus
from sloshpy.stability.grid import grid_sweep
from sloshpy.stability.nichols import loop_zeros
from sloshpy.vehicle import SloshMass

HELD = {"drift_gain": 1.5e-5, "drift_rate_gain": 3e-4}  # about 0.1 rad/s, well damped, on the paper's stage


def fleet(seed, count, **parts):
    rng = np.random.default_rng(seed)
    return [guided_case(rng, **parts) for _ in range(count)]


@pytest.fixture(scope="module")
def many():
    cases = fleet(611, 500)
    pilots = [case.autopilot for case, _ in cases]
    assert 150 < sum(p.drift_gain != 0 and p.drift_rate_gain != 0 for p in pilots) < 350
    assert 60 < sum(p.drift_gain == 0 for p in pilots) < 200
    assert 60 < sum(p.drift_rate_gain == 0 for p in pilots) < 200
    assert 100 < sum(p.accelerometer_gain != 0 for p in pilots) < 300
    assert 150 < sum(case.vehicle.aerodynamics is not None for case, _ in cases) < 350
    return [(c, x, second.second_order(c.vehicle, x), open_loop(c, x)) for c, x in cases]


def test_loop_and_slosh_response_of_500_vehicles_are_the_oracles(many):
    for case, _, p, loop in many:
        v = case.vehicle
        own = np.array([t.frequency for t in v.tanks] + [f.frequency for f in v.flexible_modes])
        w = np.concatenate([np.geomspace(0.005, 10, 14) * own[0], own])
        L, z, cancelled = second.solved(p, case.autopilot, 1j * w)
        r = frequency_response(loop, w)
        # beyond 1e3 the oracle's own sum of terms has cancelled its digits
        allowed = 1e-10 * np.maximum(1.0, cancelled / 1e3)
        assert np.all(np.abs(r.loop - L) < allowed * np.abs(L)), (np.abs(r.loop / L - 1).max(), cancelled.max())
        # at frequencies of slow guidance the solve has lost (w/0.05 w_s)^2 of its digits, whichever route it takes
        slow = np.maximum(1.0, (0.05 * own[0] / w) ** 2)[:, None]
        assert np.all(np.abs(r.slosh - z) < slow * (1e-10 * np.abs(z) + 1e-14 * np.abs(z).max(axis=0)))


def test_verdict_count_of_unstable_poles_and_poles_are_the_oracles(many):
    unstable = 0
    for case, _, p, loop in many[:300]:
        values = hold_poles(case, p, loop)
        unstable += values.real.max() > 0
    assert 60 < unstable < 240


def test_the_drift_is_a_mode_of_its_own_and_its_frequency_is_that_of_a_mass_on_the_thrust():
    """Slow guidance over fast attitude: Z'' = a phi, phi = -(b0 Z + b1 Z')/a0, an oscillator of sqrt(a b0/a0)."""
    slow = {"drift_gain": 1.5e-7, "drift_rate_gain": 1.5e-5}
    poles = closed_loop_poles(open_loop(paper_case(xi(0.05), **slow)))
    assert poles.stable
    assert poles.drift_poles == 0
    assert poles.name.count("drift") in (1, 2)
    assert poles.kind[poles.name.index("drift")] == "rigid"
    a = 9e5 / 1.6e4
    expected = np.roots([1.0, a * 1.5e-5 / 0.08, a * 1.5e-7 / 0.08])
    ours = poles.value[[k for k, name in enumerate(poles.name) if name == "drift"]]
    # 3 %: the attitude loop is not infinitely faster
    assert np.abs(ours[:, None] / expected - 1).min(axis=1).max() < 0.03


def test_guidance_the_wrong_way_and_by_position_alone_is_unstable_by_a_drift_mode():
    for gains in ({"drift_gain": -1.5e-5, "drift_rate_gain": 3e-4}, {"drift_gain": 1.5e-5}, {"drift_rate_gain": -3e-4}):
        case = paper_case(xi(0.05), **gains)
        poles = closed_loop_poles(open_loop(case))
        assert not poles.stable
        assert poles.name[0] == "drift"
        found = margins(case)
        assert not found.stable
        assert found.trusted
        assert found.growth == pytest.approx(poles.value.real.max(), rel=1e-9)
        assert found.nichols_disc_margin < 0
        run = simulate(case, duration=10 / float(found.growth), initial_slosh=0.01, damping=0.05)
        # what is left of a disturbance at the end is the mode that grows, at its own rate
        late = run.attitude[-len(run.time) // 10 :]
        if poles.value[0].imag == 0.0:
            rate = np.log(abs(late[-1] / late[0])) / (run.step * (len(late) - 1))
            assert rate == pytest.approx(float(found.growth), rel=1e-3)


def test_the_broken_loop_has_its_drift_at_the_origin_exactly():
    for gains, held, gone in ((HELD, 2, 0), ({"drift_rate_gain": 3e-4}, 1, 1), ({}, 0, 2)):
        poles = open_loop_poles(open_loop(paper_case(xi(0.02), **gains)))
        assert poles.name.count("drift") == held
        assert poles.drift_poles == gone
        assert np.all(poles.value[[k for k, name in enumerate(poles.name) if name == "drift"]] == 0.0)
        np.testing.assert_allclose(poles.participation.sum(axis=1), 1.0, rtol=1e-12)
        plain = open_loop_poles(open_loop(paper_case(xi(0.02))))
        slosh = poles.value[poles.name.index("LOX slosh")]
        assert slosh == pytest.approx(plain.value[plain.name.index("LOX slosh")], rel=1e-12)
    locus = root_locus(paper_case(xi(0.02), **HELD))
    # from the origin the drift follows the gain: at the case's own gain the branches hold every closed-loop pole
    at_one = locus.branch[np.argmin(np.abs(locus.gain - 1.0))]
    for pole in locus.closed:
        assert np.abs(at_one - pole).min() < 0.02 * max(abs(pole), 0.05)


def test_every_minimum_on_a_dense_grid_is_listed_and_shares_sum_to_one():
    for case, damping in fleet(613, 20):
        p = second.second_order(case.vehicle, damping)
        found = margins(case, damping=damping)
        assert found.trusted
        size = np.abs(second.poles(p, case.autopilot.model_copy(update={"delay": 0.0})))
        w = np.geomspace(0.3 * size.min(), 3 * size.max(), 30001)
        L = np.concatenate([second.solved(p, case.autopilot, 1j * part)[0] for part in np.array_split(w, 30)])
        dm = oracle.disc_margin(L)
        ours, value = found.minima.omega, found.minima.value
        ours, value = ours[np.isfinite(ours)], value[np.isfinite(ours)]
        assert value.min(initial=4.0) <= dm.min() * (1 + 1e-6)
        for k in np.flatnonzero((dm[1:-1] < dm[:-2]) & (dm[1:-1] < dm[2:]) & (dm[1:-1] < 4)) + 1:
            close = (ours > w[k - 1] * (1 - 1e-9)) & (ours < w[k + 1] * (1 + 1e-9))
            assert np.any(close & (value <= dm[k] * (1 + 1e-9))), (w[k], dm[k])
        share = found.minima.share[np.isfinite(found.minima.omega)]
        np.testing.assert_allclose(share.sum(axis=-1), 1.0, rtol=1e-12)


def test_the_sensitivity_to_a_tanks_frequency_is_its_finite_difference():
    for case, damping in fleet(614, 10, tanks=1, modes=0):
        s = 1j * np.geomspace(0.01, 5, 9) * case.vehicle.tanks[0].frequency
        found = frequency_sensitivity(open_loop(case, damping), s)[:, 0]
        L = []
        for h in (1e-5, -1e-5, 0.0):
            tank = case.vehicle.tanks[0]
            tank = tank.model_copy(update={"frequency": tank.frequency * (1 + h)})
            changed = case.vehicle.model_copy(update={"tanks": (tank,)})
            L.append(second.solved(second.second_order(changed, damping), case.autopilot, s)[0])
        numeric = (L[0] - L[1]) / 2e-5
        # 1e-5: a central difference of step 1e-5 beside a resonance of 1e-3 damping
        assert np.all(np.abs(found - numeric) < 1e-5 * np.abs(numeric) + 1e-7 * np.abs(L[2]))


def test_zeros_grid_and_python_control_follow():
    omega = np.geomspace(0.02, 12.0, 200)
    for case, damping in fleet(615, 10, tanks=1, delay=False):
        p, loop = second.second_order(case.vehicle, damping), open_loop(case, damping)
        zeros = loop_zeros(loop)
        beside = np.abs(second.solved(p, case.autopilot, zeros * 1.01 + 1e-3)[0])
        assert np.all(np.abs(second.solved(p, case.autopilot, zeros)[0]) < 1e-4 * beside)
        L, _, cancelled = second.solved(p, case.autopilot, 1j * omega)
        allowed = 1e-6 * np.maximum(1.0, cancelled / 1e3)
        assert np.all(np.abs(to_control(loop)(1j * omega) - L) < allowed * np.abs(L))
        found = grid_sweep(open_loop(case, np.array([damping, 2 * damping])), omega, Criteria())
        assert found.least[0] == pytest.approx(oracle.disc_margin(L).min(), rel=1e-7)
        assert found.stable[0] == second.stable(p, case.autopilot)


@pytest.mark.parametrize(("kind", "delay", "air"), [("both", 0.0, True), ("rate", 0.0, False), ("both", 0.1, False)])
def test_time_histories_agree_with_dop853(kind, delay, air):
    rng = np.random.default_rng(616)
    while True:
        case, damping = guided_case(rng, kind=kind, felt=True, tanks=2, modes=1, engine=True, air=air, delay=False)
        p = second.second_order(case.vehicle, damping)
        if second.poles(p, case.autopilot).real.max() < 0.05:
            break
    pilot = case.autopilot.model_copy(update={"delay": delay / case.vehicle.tanks[0].frequency})
    hold_history(rng, case.model_copy(update={"autopilot": pilot}), damping, duration=10, step=0.02)


def test_a_batch_is_the_loop_over_it():
    gains = np.array([1e-5, 2e-5, -1e-5])
    for other in (3e-4, np.array([0.0, 3e-4, 5e-4])):
        batch = paper_case(xi(0.04), drift_gain=gains, drift_rate_gain=other)
        found, growth = margins(batch), greatest_growth(open_loop(batch))
        response = frequency_response(open_loop(batch), np.geomspace(0.01, 9, 30)).loop
        for k in range(3):
            rate = float(np.broadcast_to(other, 3)[k])
            one = paper_case(xi(0.04), drift_gain=float(gains[k]), drift_rate_gain=rate)
            np.testing.assert_allclose(
                response[k], frequency_response(open_loop(one), np.geomspace(0.01, 9, 30)).loop, rtol=1e-12
            )
            assert growth[k] == pytest.approx(float(greatest_growth(open_loop(one))), rel=1e-8)
            assert found.nichols_disc_margin[k] == pytest.approx(float(margins(one).nichols_disc_margin), rel=1e-6)


@pytest.mark.parametrize(
    "gains",
    [{"drift_gain": np.array([0.0, 1e-5])}, {"drift_rate_gain": np.array([0.0, 3e-4])}],
)
def test_a_batch_in_which_only_some_are_guided_is_refused(gains):
    """Those that are not have neutral poles, which would pass for an instability."""
    with pytest.raises(ValidationError, match="0 for some autopilots of the batch"):
        paper_case(xi(0.04), **gains)
    case = paper_case(xi(0.04))
    changed = case.model_copy(update={"autopilot": case.autopilot.model_copy(update=gains)})
    with pytest.raises(OutsideValidity, match="0 for some of the batch"):
        open_loop(changed)


def test_a_file_reads_writes_reports_and_is_assessed(tmp_path):
    case = paper_case(PowerDamping(slope=0.1, exponent=1.0), actuator=Actuator(frequency=40.0, damping=0.7), **HELD)
    path = write_case(case, tmp_path / "case.toml")
    back = read_case(path)
    assert back.autopilot == case.autopilot
    rows = {row.key: row for row in input_rows(back)}
    assert rows["autopilot.drift_rate_gain"].given == "0.0003 rad/(m/s)"
    review = json.loads(assess(back).to_json())
    kinds = {m["name"]: m["kind"] for m in review["modes"]}
    assert kinds["drift"] == kinds["rigid body"] == "rigid"
    assert review["stable"] == second.stable(second.second_order(back.vehicle, [0.0]), back.autopilot)
    assert "PD control alone" in danger_zone(paper_case(xi(0.04), **HELD)).note
    text = path.read_text()
    for old, new, rule in (
        ('"0.0003 rad/(m/s)"', '"0.0003 s/m"', "does not say of which angle"),
        ('"0.0003 rad/(m/s)"', "0.0003", "has no unit"),
        ('"1.5e-05 rad/m"', '"0.1 1/m"', "does not say of which angle"),
        ('"1.5e-05 rad/m"', '"0.1 deg"', "must be a ratio per length"),
    ):
        assert old in text
        path.write_text(text.replace(old, new))
        with pytest.raises(InputError) as caught:
            read_case(path)
        [problem] = caught.value.problems
        assert rule in problem.rule
        assert problem.cure


def test_rounding_at_the_origin_is_no_curve():
    # the poles of drift lie at the origin, rounded to 1e-7 rad/s: thousands of minima of noise were refined and listed
    law = PowerDamping(slope=0.09)
    case = paper_case(
        law,
        vehicle={"mass": 22000.0, "inertia": 1.6e5, "cg": 4.2, "thrust": 1.8e5},
        tank={"slosh_mass": 700.0, "station": 5.1, "frequency": 2.5},
        more=(
            SloshMass(name="NTO", slosh_mass=1100.0, hinge_station=4.9, pendulum_length=1.29, damping=law),
            SloshMass(name="tip", slosh_mass=150.0, station=6.3, frequency=2.55, damping=xi(0.008)),
        ),
        attitude_gain=0.35,
        rate_gain=0.45,
        drift_gain=np.radians(0.02),
        drift_rate_gain=np.radians(0.15),
        delay=0.04,
        actuator=Actuator(frequency=8.0 * np.pi, damping=0.7),
    )
    found = margins(case, damping=np.array([0.0257, 0.0279, 0.008]))
    assert found.minima.value.shape[-1] < 20
    assert np.min(found.minima.omega) > 0.1
