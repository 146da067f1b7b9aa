"""Growth curve: its zeros are the simulated cycles, its slope their stability, its start the small-amplitude pole."""

from pathlib import Path

import numpy as np
import pytest

import oracle
import sloshpy
from cases import PAPER_LAW, paper_case
from sloshpy.damping import PowerDamping, TableDamping
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.errors import OutsideValidity
from sloshpy.files import read_case
from sloshpy.limit_cycle import growth_curve, limit_cycles, liveliest_tank
from sloshpy.simulation import simulate
from sloshpy.stability import required_damping
from sloshpy.vehicle import SloshMass

DATA = Path(sloshpy.__file__).parent / "data"
DIP = TableDamping(amplitude=[0.0, 0.07, 0.15, 0.3, 0.5, 0.8], ratio=[0.005, 0.026, 0.029, 0.020, 0.030, 0.045])


def test_start_of_the_curve_is_the_small_amplitude_pole():
    curve = growth_curve(paper_case())
    pole = closed_loop_poles(open_loop(paper_case(), damping=0.0)).value[0]
    assert curve.pole[0] == pytest.approx(pole, rel=1e-3)
    assert curve.time_to_double == pytest.approx(13.56, rel=1e-2)


def test_each_point_is_a_pole_at_the_damping_of_its_own_amplitude():
    amplitude = np.array([0.01, 0.1, 0.3, 0.6])
    curve = growth_curve(paper_case(), amplitude=amplitude)
    for a, pole in zip(amplitude, curve.pole, strict=True):
        roots = oracle.poles(oracle.numbers(paper_case(), 0.1 * pole.imag * a / 2.0))
        assert np.abs(roots - pole).min() < 1e-9
        z = oracle.solved(oracle.numbers(paper_case(), 0.1 * pole.imag * a / 2.0), np.array(pole))[1]
        at = curve.tvc[list(amplitude).index(a)]
        assert at == pytest.approx(a / abs(z[0]), rel=1e-8)


@pytest.mark.parametrize("seed", [60, 61, 62])
def test_zeros_are_the_simulated_limit_cycles_of_random_vehicles(seed):
    rng = np.random.default_rng(seed)
    while True:
        law = PowerDamping(slope=rng.uniform(0.05, 0.3))
        case = paper_case(
            law,
            tank={
                "station": rng.uniform(5, 11),
                "frequency": rng.uniform(1.8, 2.6),
                "slosh_mass": rng.uniform(500, 1200),
            },
            delay=rng.uniform(0, 0.1),
        )
        curve = growth_curve(case)
        # one growing mode: with two no single sinusoid is a solution
        growing = oracle.unstable_poles(oracle.numbers(case, 0.0)) == 2
        if growing and 0.03 < curve.growth[0] < 0.06:
            break
    (cycle,) = limit_cycles(case)
    a = cycle.slosh_amplitude["LOX"]
    run = simulate(case, duration=30 / curve.growth[0] * 0.4 + 150, initial_slosh=a)
    found = run.slosh_envelope()
    # 1e-3: the third harmonic that the describing function leaves out moves the amplitude by up to its square
    assert found.amplitude == pytest.approx(a, rel=1e-3)
    assert found.omega == pytest.approx(cycle.omega, rel=1e-3)


def test_the_unstable_cycle_separates_the_basins_in_simulation():
    """T26: started below it the vehicle settles in the small cycle, above it in the large one."""
    case = paper_case(DIP)
    small, middle, large = sorted(limit_cycles(case), key=lambda x: x.slosh_amplitude["LOX"])
    ends = [
        simulate(case, duration=700.0, initial_slosh=f * middle.slosh_amplitude["LOX"]).slosh_envelope()
        for f in (0.85, 1.2)
    ]
    for end, cycle in zip(ends, (small, large), strict=True):
        assert end.settled
        assert end.amplitude == pytest.approx(cycle.slosh_amplitude["LOX"], rel=5e-3)


def test_growth_falls_with_amplitude_under_a_growing_law():
    curve = growth_curve(paper_case())
    assert np.all(np.diff(curve.growth) < 0)


def test_a_branch_that_turns_back_holds_its_equation_at_every_point():
    """Two tanks nearly in tune: no LOX mode beyond 0.12 m, there LH2 takes over; each point is an oracle's pole."""
    case = read_case(DATA / "two_tanks.toml")
    curve = growth_curve(case, 0)
    assert curve.folded
    assert 0.11 < np.max(curve.amplitude) < 0.12
    wave = [PowerDamping(slope=t.damping.of[1].slope, exponent=t.damping.of[1].exponent) for t in case.vehicle.tanks]
    wall = [t.damping.of[0].constant_ratio for t in case.vehicle.tanks]
    w = [t.frequency for t in case.vehicle.tanks]
    for k in range(0, len(curve.amplitude), 12):
        pole, slosh = curve.pole[k], curve.slosh[k]
        xi = [
            c + law.slope * (pole.imag * A / wj) ** law.exponent
            for c, law, A, wj in zip(wall, wave, slosh, w, strict=True)
        ]
        numbers = oracle.numbers(case, xi)
        value, size = oracle.characteristic(numbers, pole)  # delay exact
        assert abs(value) < 1e-9 * size
        z = oracle.solved(numbers, np.array(pole * (1 + 1e-9)))[1]
        assert np.abs(z[0] / z[1]) == pytest.approx(slosh[0] / slosh[1], rel=1e-5)
    steps = np.abs(np.diff(curve.pole))
    assert np.max(steps) < 0.1  # no jump to another branch


def test_amplitudes_beyond_a_turning_branch_have_no_mode():
    case = read_case(DATA / "two_tanks.toml")
    curve = growth_curve(case, 0, amplitude=np.array([0.05, 0.1, 0.2]))
    assert np.isnan(curve.growth).tolist() == [False, False, True]


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_a_disturbed_cycle_returns_at_the_rate_a_sigma_of_a_for_one_tank(exponent):
    case = paper_case(PowerDamping(slope=0.1, exponent=exponent), delay=0.05)
    (cycle,) = limit_cycles(case)
    a = cycle.slosh_amplitude["LOX"]
    h = 1e-4
    low, high = growth_curve(case, amplitude=a * np.array([1 - h, 1 + h])).growth
    # slow motion follows sigma(a); the exact rate differs by its square over the frequency
    assert cycle.disturbance == pytest.approx((high - low) / (2 * h), rel=0.03)
    assert cycle.stable


def test_a_disturbed_cycle_of_two_tanks_returns_at_its_rate_in_simulation():
    case = read_case(DATA / "two_tanks.toml")
    (cycle,) = limit_cycles(case)
    at = np.array(list(cycle.slosh_amplitude.values()))
    # the difference of two runs falls to 1e-5 m: peaks and steps are finer than that
    runs = [simulate(case, 170.0, f * at[1], step=0.005, rtol=1e-8) for f in (0.95, 1.05)]
    peaks = []
    for run in runs:
        z = run.slosh[:, 1]
        k = np.flatnonzero((z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])) + 1
        peaks.append((run.time[k], z[k]))
    t = np.linspace(60.0, 160.0, 50)
    apart = np.abs(np.interp(t, *peaks[1]) - np.interp(t, *peaks[0]))
    rate = np.polyfit(t, np.log(apart), 1)[0]
    assert rate == pytest.approx(cycle.disturbance, rel=0.05)


def test_time_between_amplitudes_is_that_of_the_simulation():
    case = paper_case()
    curve = growth_curve(case)
    run = simulate(case, duration=150.0, initial_slosh=0.005)
    z = run.slosh[:, 0]
    k = np.flatnonzero((z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])) + 1
    at = np.interp([0.05, 0.2], z[k], run.time[k])  # the envelope grows monotonously
    assert curve.time_between(0.05, 0.2) == pytest.approx(at[1] - at[0], rel=5e-3)
    assert curve.time_between(0.05, 0.3) == np.inf  # the limit cycle lies between
    assert curve.time_between(0.6, 0.3) > 0.0
    assert curve.time_between(0.3, 0.6) == np.inf
    assert curve.time_between(0.3, 0.3) == 0.0
    assert np.isnan(curve.time_between(0.1, 99.0))


def test_two_cycles_between_two_points_of_the_curve_are_both_found():
    """A dip that just touches the needed damping: a pair of cycles closer than the branch's points."""
    needed = float(required_damping(paper_case()).neutral)

    def law(depth):
        A = [0.0, 0.05, 0.2, 0.30, 0.31, 0.32, 0.5, 0.8]
        at = [0.005, needed + 0.004, needed + 0.004, needed + 1e-3, needed - depth, needed + 1e-3, 0.04, 0.06]
        return TableDamping(amplitude=A, ratio=at)

    assert len(limit_cycles(paper_case(law(-5e-4)))) == 1
    cycles = limit_cycles(paper_case(law(2e-4)))
    assert [c.stable for c in sorted(cycles, key=lambda c: c.slosh_amplitude["LOX"])] == [True, False, True]


def test_a_cycle_of_strongly_coupled_tanks_is_the_oracles():
    """Two nearly equal tanks at 5 dB more gain: iteration of damping and shape fails beside this cycle."""
    case = read_case(DATA / "two_tanks.toml")
    case = case.model_copy(update={"autopilot": case.autopilot.degraded(10 ** (5.0 / 20.0))})
    (cycle,) = limit_cycles(case)
    law = lambda a: 0.001 + 0.12 * a  # noqa: E731
    A, W = oracle.coupled_limit_cycle(oracle.numbers(case, 0.0), [law, law], [0.2, 0.3], 2.13)
    np.testing.assert_allclose(list(cycle.slosh_amplitude.values()), A, rtol=1e-7)
    assert cycle.omega == pytest.approx(W, rel=1e-8)
    assert cycle.stable


@pytest.mark.parametrize(("exponent", "slope"), [(0.1, 0.03), (0.15, 0.02), (0.25, 0.025)])
def test_a_law_of_low_exponent_hides_no_limit_cycle(exponent, slope):
    """At 1e-7 of the amplitude at which it gives 30 % such a law still damps more than the cycle needs."""
    case = paper_case(PowerDamping(slope=slope, exponent=exponent))
    curve = growth_curve(case)
    assert curve.growth[0] == pytest.approx(0.05112516, rel=5e-4)  # theory.md: at no damping
    (cycle,) = limit_cycles(case)
    neutral = (0.0239287 / slope) ** (1.0 / exponent)  # in the law's own convention, at the slosh frequency
    # relative error of the neutral damping times 1/exponent; 2.0/2.132783 turns it into the cycle's own frequency
    assert cycle.slosh_amplitude["LOX"] == pytest.approx(neutral * 2.0 / 2.132783, rel=1e-3)


def test_a_law_that_never_falls_is_refused():
    with pytest.raises(OutsideValidity, match="hardly falls with the amplitude"):
        growth_curve(paper_case(PowerDamping(slope=0.024, exponent=0.02)))


def test_the_liveliest_tank_is_the_one_whose_mode_grows():
    quiet = SloshMass(name="quiet", slosh_mass=60.0, station=3.0, frequency=3.1, damping=PAPER_LAW)
    case = paper_case(more=(quiet,))
    assert liveliest_tank(case) == 0
    turned = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": case.vehicle.tanks[::-1]})})
    assert liveliest_tank(turned) == 1
