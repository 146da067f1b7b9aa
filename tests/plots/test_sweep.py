"""The damping sweep and the curves behind the figures."""

from dataclasses import replace

import numpy as np
import pytest

from sloshpy.case import Case
from sloshpy.dynamics import frequency_response, open_loop
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import LimitCycle
from sloshpy.simulation import simulate_degraded
from sloshpy.stability import (
    DampingSweep,
    damping_law_curve,
    damping_sweep,
    disc_margin_curve,
    margins,
    nichols_disc_margin,
    required_damping_map,
)


def test_default_dampings_are_unstable_then_not_robust_then_robust(sweep: DampingSweep) -> None:
    assert sweep.verdicts == ("unstable", "not robust", "robust", "robust")
    assert sweep.disc_margin[2] == pytest.approx(1.0, abs=1e-6)  # eq 24 at the required damping


def test_each_curve_of_a_sweep_is_the_response_of_its_own_loop(case: Case, sweep: DampingSweep) -> None:
    for xi, L in zip(sweep.damping, sweep.response.loop, strict=True):
        np.testing.assert_allclose(L, frequency_response(open_loop(case, xi), sweep.response.omega).loop, rtol=1e-12)


def test_dampings_given_are_swept_with_the_margins_of_each(case: Case) -> None:
    found = damping_sweep(case, (0.01, 0.03, 0.048))
    alone = [float(margins(case, xi).slosh_disc_margin(0)[0]) for xi in (0.01, 0.03, 0.048)]
    np.testing.assert_allclose(found.disc_margin, alone, rtol=1e-8)
    np.testing.assert_array_equal(found.margins.stable, [False, True, True])


def test_no_piece_of_a_curve_near_the_disc_is_long_enough_to_show_as_a_polygon(sweep: DampingSweep) -> None:
    c = sweep.case.criteria
    L = sweep.response.loop
    step = np.log(L[:, 1:] / L[:, :-1])
    chord = np.hypot(step.real / np.log(c.gain_margin), step.imag / c.phase_margin)
    near = nichols_disc_margin(L[:, 1:], c.gain_margin, c.phase_margin) < 3.0
    assert np.max(chord[near]) < 0.2  # of the half-axes, 40 points wide in the figure: 8 points


def test_an_undamped_curve_is_refused_because_it_is_infinite(case: Case) -> None:
    with pytest.raises(ValueError, match="must be > 0"):
        damping_sweep(case, (0.0, 0.01))


def test_disc_margin_curve_changes_sign_at_the_neutral_damping(case: Case, cycle: LimitCycle) -> None:
    curve = disc_margin_curve(case, required=cycle.required)
    neutral, needed = float(cycle.required.neutral), float(cycle.required.required)
    assert np.all(curve.disc_margin[curve.damping < neutral * 0.999] < 0.0)
    assert np.all(curve.disc_margin[curve.damping > neutral * 1.001] > 0.0)
    assert np.interp(needed, curve.damping, curve.disc_margin) == pytest.approx(1.0, abs=1e-6)


def test_the_law_gives_the_required_damping_at_the_amplitude_marked(case: Case, cycle: LimitCycle) -> None:
    curve = damping_law_curve(case, cycle.required)
    needed = float(cycle.required.required)
    assert np.interp(curve.required_amplitude, curve.amplitude, curve.ratio) == pytest.approx(needed)
    assert curve.required_amplitude == pytest.approx(needed / 0.1)  # alpha = 0.1 1/m


def test_datasets_of_the_sweeps_carry_units(case: Case, sweep: DampingSweep, cycle: LimitCycle) -> None:
    curve, law = disc_margin_curve(case, required=cycle.required), damping_law_curve(case, cycle.required)
    assert sweep.to_dataset()["tvc_gain"].attrs["units"] == "m/rad"
    assert curve.to_dataset()["growth"].attrs["units"] == "1/s"
    assert law.to_dataset()["amplitude"].attrs["units"] == "m"
    assert "robust" in str(sweep)
    assert "4.7358 %" in str(curve)
    assert "0.4736 m" in str(law)


def test_a_phase_advance_cannot_be_simulated(cycle: LimitCycle) -> None:
    with pytest.raises(OutsideValidity, match=r"phase advance of 20\.0 ms"):
        simulate_degraded(replace(cycle, delay=-0.02))


def test_a_station_beyond_the_mass_matrix_is_outside_validity(case: Case) -> None:
    with pytest.raises(OutsideValidity, match="mass matrix"):
        required_damping_map(case, station=np.array([100.0]))
