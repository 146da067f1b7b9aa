"""Growth curve: its zeros are the simulated cycles, its slope their stability, its start the small-amplitude pole."""

import numpy as np
import pytest

import oracle
from cases import paper_case
from sloshpy.damping import PowerDamping, TableDamping
from sloshpy.dynamics import closed_loop_poles, open_loop
from sloshpy.files import read_case, write_example
from sloshpy.limit_cycle import growth_curve, limit_cycles
from sloshpy.simulation import simulate

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


def test_a_cycle_where_damping_and_shape_do_not_settle_by_iteration_is_found(tmp_path):
    """Two nearly equal tanks at 5 dB: an amplitude beside the cycle has no settled growth, the cycle is there."""
    case = read_case(write_example("two_tanks", tmp_path))
    case = case.model_copy(update={"autopilot": case.autopilot.degraded(10 ** (5.0 / 20.0))})
    assert np.any(np.isnan(growth_curve(case, 0).growth))
    (cycle,) = limit_cycles(case)
    law = lambda a: 0.001 + 0.12 * a  # noqa: E731
    A, W = oracle.coupled_limit_cycle(oracle.numbers(case, 0.0), [law, law], [0.2, 0.3], 2.13)
    np.testing.assert_allclose(list(cycle.slosh_amplitude.values()), A, rtol=1e-7)
    assert cycle.omega == pytest.approx(W, rel=1e-8)
    assert cycle.stable
    run = simulate(case, 250.0, A)
    # 3e-3: one sinusoid against the simulation
    assert run.slosh_envelope().amplitude == pytest.approx(A[0], rel=3e-3)
