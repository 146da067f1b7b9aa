"""Many runs at once agree with single runs on another integrator, and say what has not settled."""

import numpy as np
import pytest

from cases import paper_case, xi
from sloshpy.autopilot import Actuator, Filter
from sloshpy.damping import ConstantDamping, PowerDamping, SumDamping, TableDamping
from sloshpy.dynamics import open_loop
from sloshpy.dynamics.states import delay_parts
from sloshpy.errors import OutsideValidity
from sloshpy.simulation import OneMinusCosine, simulate, simulate_ensemble
from sloshpy.simulation.envelope import in_turn, level_envelope, level_envelopes
from sloshpy.vehicle import Aerodynamics, SloshMass

DELAYS = np.array([0.0, 0.05, 0.17])


def test_limit_cycles_of_a_batch_are_those_of_single_runs():
    found = simulate_ensemble(paper_case(delay=DELAYS), 400.0)
    for k, delay in enumerate(DELAYS):
        run = simulate(paper_case(delay=delay), 400.0, step=0.02)
        # the two integrators differ by 4e-5 at their default steps
        assert found.slosh_amplitude[k, 0] == pytest.approx(run.slosh_envelope().amplitude, rel=1e-4)
        assert found.slosh_omega[k, 0] == pytest.approx(run.slosh_envelope().omega, rel=1e-4)
        assert found.tvc_amplitude[k] == pytest.approx(run.tvc_envelope.amplitude, rel=1e-4)
        assert found.slosh_peak[k, 0] == pytest.approx(np.max(np.abs(run.slosh)), rel=1e-3)
        assert found.settled[k]
    assert len(set(found.slosh_amplitude[:, 0])) == 3


def test_two_tanks_with_sums_of_laws_filters_and_an_actuator():
    law = SumDamping(of=(ConstantDamping(ratio=0.004), PowerDamping(slope=0.05, exponent=0.5)))
    wall = SumDamping(of=(ConstantDamping(ratio=0.01), PowerDamping(slope=0.2)))
    other = SloshMass(name="b", slosh_mass=500.0, station=4.0, frequency=2.6, damping=wall)
    parts = {
        "more": (other,),
        "delay": 0.06,
        "actuator": Actuator(frequency=20.0, damping=0.7),
        "filter": (Filter(numerator=(1.0,), denominator=(0.03, 1.0)),),
    }
    run = simulate(paper_case(law, **parts), 700.0, np.array([0.1, 0.0]), step=0.025)
    found = simulate_ensemble(paper_case(law, **parts), 700.0, np.array([0.1, 0.0]))
    assert found.settled
    for j in range(2):
        assert found.slosh_amplitude[j] == pytest.approx(run.slosh_envelope(j).amplitude, rel=2e-4)
    assert found.tvc_amplitude == pytest.approx(run.tvc_envelope.amplitude, rel=2e-4)


def test_halving_the_step_divides_the_error_by_four():
    exact = simulate_ensemble(paper_case(), 400.0, 0.2, step=0.002).slosh_amplitude[0]
    errors = [
        abs(simulate_ensemble(paper_case(), 400.0, 0.2, step=h).slosh_amplitude[0] - exact) for h in (0.05, 0.025)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)


def test_a_batch_fills_its_lanes_in_any_number_and_order():
    stations = np.linspace(8.0, 10.0, 11)
    found = simulate_ensemble(paper_case(tank={"station": stations}), 300.0)
    alone = [simulate_ensemble(paper_case(tank={"station": x}), 300.0).slosh_amplitude[0] for x in stations[[0, 7, 10]]]
    np.testing.assert_allclose(found.slosh_amplitude[[0, 7, 10], 0], alone, rtol=1e-9)


def test_what_has_not_settled_says_why_and_gives_no_number():
    short = simulate_ensemble(paper_case(), 40.0)
    assert not short.settled
    assert "unconverged" in str(short.reason)
    assert np.isnan(short.slosh_amplitude[0])
    growing = simulate_ensemble(paper_case(xi(0.001)), 400.0, 1.0)
    assert "diverged" in str(growing.reason)
    still = simulate_ensemble(paper_case(xi(0.2)), 400.0)
    assert still.settled
    assert still.slosh_amplitude[0] == 0.0


def test_free_undamped_slosh_keeps_its_amplitude():
    """T39: no numerical damping at all, since the flow between the kicks is exact."""
    case = paper_case(xi(0.0), attitude_gain=1e-12, rate_gain=1e-12)
    found = simulate_ensemble(case, 500.0, 0.1)
    run = simulate(case, 60.0, 0.1, step=0.01)
    assert found.slosh_amplitude[0] == pytest.approx(0.5 * np.ptp(run.slosh[:, 0]), rel=1e-5)


def test_tables_and_limits_are_left_to_single_runs():
    law = TableDamping(amplitude=[0.0, 1.0], ratio=[0.0, 0.1])
    with pytest.raises(OutsideValidity, match="tabulated"):
        simulate_ensemble(paper_case(law))
    ends = PowerDamping(slope=0.1, largest_amplitude=1.0)
    with pytest.raises(OutsideValidity, match="LOX has a law that holds to 1 m only"):
        simulate_ensemble(paper_case(SumDamping(of=(ConstantDamping(ratio=0.001), ends))))
    with pytest.raises(OutsideValidity, match="limits"):
        simulate_ensemble(paper_case(actuator=Actuator(frequency=20.0, damping=0.7, rate_limit=0.1)))
    with pytest.raises(ValueError, match="duration"):
        simulate_ensemble(paper_case(), 0.0)


def test_an_accelerometer_that_feels_the_damping_force_is_counted():
    """The damper's force reaches the sensor at once; without that path the cycle is off by some per mille."""
    case = paper_case(
        vehicle={"accelerometer_station": 12.0},
        accelerometer_gain=0.01,
        filter=(Filter(numerator=(1.0,), denominator=(0.2, 1.0)),),
        actuator=Actuator(frequency=20.0, damping=0.7),
    )
    run = simulate(case, 400.0, 0.2, step=0.02)
    found = simulate_ensemble(case, 400.0, 0.2)
    assert found.slosh_amplitude[0] == pytest.approx(run.slosh_envelope().amplitude, rel=1e-4)
    assert found.tvc_amplitude == pytest.approx(run.tvc_envelope.amplitude, rel=1e-4)
    plain = simulate_ensemble(paper_case(actuator=Actuator(frequency=20.0, damping=0.7)), 400.0, 0.2)
    assert abs(plain.slosh_amplitude[0] / found.slosh_amplitude[0] - 1.0) > 1e-3


def test_a_damping_factor_is_a_law_of_its_own_in_each_run():
    law = SumDamping(of=(ConstantDamping(ratio=0.004), PowerDamping(slope=0.05, exponent=0.5)))
    factors, frequencies = np.array([0.7, 1.0, 1.6]), np.array([1.9, 2.0, 2.2])
    found = simulate_ensemble(
        paper_case(law, tank={"frequency": frequencies}), 300.0, step=0.04, damping_factor=factors[:, None]
    )
    for k, (f, w) in enumerate(zip(factors, frequencies, strict=True)):
        own = SumDamping(of=(ConstantDamping(ratio=0.004 * f), PowerDamping(slope=0.05 * f, exponent=0.5)))
        alone = simulate_ensemble(paper_case(own, tank={"frequency": w}), 300.0, step=0.04)
        assert found.slosh_peak[k, 0] == pytest.approx(alone.slosh_peak[0], rel=1e-12)
    assert len(set(found.slosh_peak[:, 0])) == 3
    with pytest.raises(ValueError, match="damping factors"):
        simulate_ensemble(paper_case(), damping_factor=-1.0)


def test_a_run_has_the_same_bits_alone_and_in_a_batch():
    """In the first group of the kernel, in the second, which is filled up, and with other neighbours."""
    stations = np.linspace(8.0, 10.0, 71)
    found = simulate_ensemble(paper_case(tank={"station": stations}, delay=0.05), 100.0, step=0.05)
    for k in (0, 7, 63, 64, 70):
        alone = simulate_ensemble(paper_case(tank={"station": stations[k]}, delay=0.05), 100.0, step=0.05)
        assert alone.slosh_peak[0] == found.slosh_peak[k, 0]
        assert alone.tvc_peak == found.tvc_peak[k]
        assert alone.reason == found.reason[k]
    turned = simulate_ensemble(paper_case(tank={"station": stations[::-1]}, delay=0.05), 100.0, step=0.05)
    np.testing.assert_array_equal(turned.slosh_peak[::-1], found.slosh_peak)
    np.testing.assert_array_equal(turned.tvc_amplitude[::-1], found.tvc_amplitude)


def test_the_step_of_the_kernel_leaves_less_than_a_ten_thousandth_of_a_cycle():
    """Against a step of a fortieth; with an accelerometer, to which the damping force goes at once, too."""
    lag = Actuator(frequency=20.0, damping=0.7)
    felt = {"vehicle": {"accelerometer_station": 12.0}, "accelerometer_gain": 0.01, "actuator": lag}
    for parts in ({}, {"delay": 0.17}, felt):
        own, fine = (simulate_ensemble(paper_case(**parts), 300.0, 0.2, step=h) for h in (None, 0.0025))
        assert own.settled
        for name in ("slosh_amplitude", "tvc_amplitude", "slosh_omega", "slosh_peak", "tvc_peak"):
            np.testing.assert_allclose(getattr(own, name), getattr(fine, name), rtol=1e-4, err_msg=f"{name} {parts}")


def test_envelopes_of_many_signals_are_those_of_each():
    """And the sums in one order: bit for bit. A straight line through logarithms is NumPy's."""
    k = np.arange(21.0)
    shapes = {
        "": 1.0 + 0.0 * k,
        "changes by": np.exp(0.01 * k),
        "cycles differ": 1.0 + 0.01 * np.cos(0.4 * np.pi * (k - 10.5)),
        "no single": np.where(k == 5.0, -1.0, 1.0),
        "drifts": 1.0 + 8e-5 * k + 2e-7 * k**2,
        "from its end": 1.0 - 5e-3 * np.exp(-0.02 * k),
    }
    high = np.array([*shapes.values(), 1e-12 * np.ones(21), np.ones(21)])
    time = np.broadcast_to(3.0 * k, high.shape)
    found = level_envelopes(time, high, -high, np.array([50] * 7 + [20]))
    for text, reason in zip(shapes, found.reason, strict=False):
        assert text in reason
        assert (text == "") == (reason == "")
    assert found.reason[-2:] == ("", "unconverged: only 20 cycles, needs more than 20")
    assert found.amplitude[0] == 1.0
    assert found.amplitude[-2] == 0.0
    assert np.isnan(found.omega[-2])
    assert found.omega[0] == pytest.approx(2.0 * np.pi / 3.0, rel=1e-14)
    slope = np.polyfit(np.arange(20), np.log(high[1, 1:]), 1)[0]
    assert f"{100.0 * np.expm1(10.0 * slope):+.3g} %" in found.reason[1]
    for one in range(7):
        alone = level_envelope(time[one], high[one], -high[one])
        assert (alone.reason, repr(alone.amplitude)) == (found.reason[one], repr(float(found.amplitude[one])))


def test_a_ring_is_read_from_its_oldest_entry_on():
    ring = np.array([[4.0, 5.0, 3.0], [0.0, 1.0, 7.0]])
    np.testing.assert_array_equal(in_turn(ring, np.array([5, 2])), [[3.0, 4.0, 5.0], [0.0, 1.0, 7.0]])


def test_gusts_of_a_batch_are_those_of_single_runs():
    """Each run with its own peak, start and duration; against the adaptive integrator."""
    air = Aerodynamics(normal_force_slope=2e5, center_of_pressure=9.0, speed=400.0)
    sizes, starts, durations = np.array([20.0, 35.0, 0.0]), np.array([10.0, 3.3, 0.0]), np.array([4.0, 1.7, 5.0])
    for parts in ({}, {"delay": 0.1, "actuator": Actuator(frequency=20.0, damping=0.7)}):
        case = paper_case(vehicle={"aerodynamics": air}, **parts)
        found = simulate_ensemble(
            case.model_copy(
                update={"vehicle": case.vehicle.model_copy(update={"mass": np.full(3, case.vehicle.mass)})}
            ),
            60.0,
            0.01,
            gust=OneMinusCosine(size=sizes, start=starts, duration=durations),
        )
        for k in range(3):
            wind = OneMinusCosine(size=sizes[k], start=starts[k], duration=durations[k])
            run = simulate(case, 60.0, 0.01, step=0.01, wind=wind)
            assert found.slosh_peak[k, 0] == pytest.approx(np.max(np.abs(run.slosh)), rel=2e-4)
            assert found.tvc_peak[k] == pytest.approx(np.max(np.abs(run.tvc)), rel=1e-3)
        assert found.slosh_peak[1, 0] > 1.5 * found.slosh_peak[2, 0]  # the gust is what moves it
    with pytest.raises(ValueError, match="the case has none"):
        simulate_ensemble(paper_case(), gust=OneMinusCosine(size=1.0, duration=5.0))
    for bad in ({"duration": 0.0}, {"duration": 5.0, "start": -1.0}, {"duration": np.nan}):
        with pytest.raises(ValueError, match="gust"):
            simulate_ensemble(case, gust=OneMinusCosine(size=1.0, **bad))


def test_a_delay_in_more_parts_changes_no_neighbour(monkeypatch):
    """What one run's delay is approximated in is its own: the same bits beside a longer one."""
    monkeypatch.setattr("sloshpy.dynamics.states.PART", 0.36)
    delays = np.array([0.16, 0.18, 0.15, 0.35])
    found = simulate_ensemble(paper_case(delay=delays), 60.0, 0.1, step=0.05)
    parts = delay_parts(open_loop(paper_case(delay=delays), 0.0))
    assert len(set(parts.tolist())) == 3
    for k, delay in enumerate(delays):
        alone = simulate_ensemble(paper_case(delay=delay), 60.0, 0.1, step=0.05)
        assert alone.slosh_peak[0] == found.slosh_peak[k, 0]
        assert alone.reason == found.reason[k]
