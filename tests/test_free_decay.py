"""Free decays: closed forms, the true decay of each law's own force, and what the result says and gives."""

import json
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from sloshpy.damping import (
    ConstantDamping,
    DampingLaw,
    DecayRecord,
    PowerDamping,
    SumDamping,
    TableDamping,
    free_decay,
)
from sloshpy.damping.decay_fit import DecayFit, fit_decay
from sloshpy.damping.decay_model import LAWS, log_envelope_and_phase, ratio_at, second_order, wave, wave_slopes
from sloshpy.damping.decay_tangent import shape_slopes, tangent
from sloshpy.errors import InputError, OutsideValidity
from synthetic_decay import decay

TIME = np.arange(0.0, 63.0, 0.1)
WALL_AND_BAFFLE = SumDamping(of=(ConstantDamping(ratio=0.004), PowerDamping(slope=0.3, exponent=1.0)))
DAMPERS = [
    ConstantDamping(ratio=0.03),
    PowerDamping(slope=0.5, exponent=1.0),
    PowerDamping(slope=0.15, exponent=0.5),
    WALL_AND_BAFFLE,
]


def record(law: DampingLaw, noise: float = 3e-4, unit: str = "m", scale: float = 1.0) -> DecayRecord:
    x = decay(law, 2.0, 0.1, TIME) + noise * np.random.default_rng(3).standard_normal(len(TIME))
    return DecayRecord(time=TIME, value=scale * x, unit=unit, column="x")


def test_hyperbola_of_the_odd_square_law_halves_in_10_s() -> None:
    # A0 = 0.5 m, alpha = 0.1 1/m, w = 2 rad/s: 0.25 m at 10 s
    log_a, _ = log_envelope_and_phase(np.array([2.0, 0.0, 0.05, 1.0, 0.0]), np.array([0.0, 10.0]))
    assert 0.5 * np.exp(log_a[1]) == pytest.approx(0.25, rel=1e-12)


@pytest.mark.parametrize(("xi0", "q"), [(0.01, 0.0), (0.0, 0.05), (0.01, 0.05), (1e-12, 0.05), (0.05, 1e-9)])
def test_linear_plus_quadratic_damping_has_its_closed_form(xi0: float, q: float) -> None:
    # A0 e^(-z t) / (1 + (alpha A0/xi0)(1 - e^(-z t))), z = xi0 w
    t = np.linspace(0.0, 60.0, 50)
    log_a, _ = log_envelope_and_phase(np.array([2.0, xi0, q, 1.0, 0.0]), t)
    z = 2.0 * xi0
    known = np.exp(-z * t) / (1.0 + (q * -np.expm1(-z * t) / xi0 if xi0 > 0.0 else q * 2.0 * t))
    np.testing.assert_allclose(np.exp(log_a), known, rtol=1e-10)


@pytest.mark.parametrize("p", [0.3, 0.5, 1.0, 1.7, 3.0])
def test_envelope_solves_its_differential_equation_at_every_exponent(p: float) -> None:
    t = np.linspace(0.0, 60.0, 40)
    solved = solve_ivp(
        lambda _t, A: -2.0 * A * (0.004 + 0.05 * A**p), (0.0, 60.0), [1.0], "DOP853", t, rtol=1e-11, atol=1e-14
    )
    log_a, _ = log_envelope_and_phase(np.array([2.0, 0.004, 0.05, p, 0.0]), t)
    np.testing.assert_allclose(np.exp(log_a), solved.y[0], rtol=1e-9)


def test_phase_of_a_linear_damper_is_that_of_the_damped_frequency() -> None:
    _, theta = log_envelope_and_phase(np.array([2.0, 0.05, 0.0, 1.0, 0.0]), TIME)
    np.testing.assert_allclose(theta, 2.0 * np.sqrt(1.0 - 0.05**2) * TIME, atol=1e-4)
    assert second_order(0.0) == pytest.approx(0.5, rel=1e-12)


def test_derivatives_of_the_model_are_those_of_differences() -> None:
    values = np.array([2.0, 0.004, 0.03, 0.8, -0.01])
    law = next(law for law in LAWS if law.name == "sum" and "p" in law.free)
    law = type(law)(name="sum", free=(*law.free, "k"))
    for at, slope in zip(law.at, wave_slopes(law, values, TIME), strict=True):
        step = 1e-5 * np.eye(5)[at]
        (log_up, up), (log_down, down) = (log_envelope_and_phase(values + s, TIME) for s in (step, -step))
        np.testing.assert_allclose(slope, (log_up - log_down + 1j * (up - down)) / 2e-5, rtol=2e-5, atol=2e-4)


@pytest.mark.parametrize("law", DAMPERS, ids=lambda law: law.law)
def test_the_decay_of_a_dampers_own_force_gives_its_damping_back(law: DampingLaw) -> None:
    found = free_decay(record(law, noise=3e-5), frequency_hint=2.0)
    true = law.ratio(found.amplitude)
    np.testing.assert_allclose(found.ratio, true, rtol=0.003)
    assert np.all((found.ratio_low <= true) & (true <= found.ratio_high))
    frequency = found.estimate("frequency")
    assert frequency.low <= 2.0 <= frequency.high
    assert frequency.high - frequency.low < 1e-4
    believed = [fit.laws[0].name for fit, w in zip(found.choice.fits, found.choice.weights, strict=True) if w > 0.05]
    assert law.law in believed  # Akaike's criterion takes one number too many in every sixth record
    assert found.tested[1] == pytest.approx(0.1, rel=0.01)
    np.testing.assert_allclose(found.law.ratio(found.amplitude[1:-1]), found.ratio[1:-1], rtol=2e-3)
    np.testing.assert_allclose(found.formula.ratio(found.amplitude), found.ratio, rtol=1e-4)


@pytest.mark.parametrize(
    ("p", "top", "constant"), [(1.5, 0.1, 0.0), (2.0, 0.1, 0.03), (2.0, 0.14, 0.04), (0.5, 0.14, 0.0)]
)
def test_strong_damping_is_found_where_its_own_harmonics_stand_out_of_the_noise(
    p: float, top: float, constant: float
) -> None:
    power = PowerDamping(slope=(top - constant) / 0.1**p, exponent=p)
    law = SumDamping(of=(ConstantDamping(ratio=constant), power)) if constant else power
    found = free_decay(record(law, noise=1e-7), frequency_hint=2.0)
    true = law.ratio(found.amplitude)
    np.testing.assert_allclose(found.ratio, true, rtol=0.4 * top**2 + 1e-4)
    assert np.all((found.ratio_low <= true) & (true <= found.ratio_high))


def test_bands_agree_with_a_full_refit_of_every_resampled_record() -> None:
    truth = np.array([2.0, 0.0, 0.03, 1.0, 0.0])
    time = np.arange(0.0, 63.0, 0.2)
    generator = np.random.default_rng(1)
    clean = 0.1 * np.real(wave(truth, time))
    A = np.array([0.03, 0.0447, 0.08])

    def noisy() -> DecayRecord:
        return DecayRecord(time=time, value=clean + 0.001 * generator.standard_normal(len(time)), unit="m")

    def widest(record_: DecayRecord) -> np.ndarray:  # the sum with a free exponent, started at the truth
        law = LAWS[-1]
        fit = fit_decay([law], np.array([[2.0, 1e-3, 0.029, 1.0, 0.0]]), time, record_.value)
        assert fit is not None
        return ratio_at(fit.values[0], A / fit.start_amplitude[0])

    refits = np.array([widest(noisy()) for _ in range(400)])
    found = free_decay(noisy(), frequency_hint=2.0)
    widths = [np.interp(A, found.amplitude, bound) for bound in (found.ratio_low, found.ratio_high)]
    true_width = np.subtract(*np.quantile(refits, [0.975, 0.025], axis=0))
    np.testing.assert_allclose(widths[1] - widths[0], true_width, rtol=0.2)  # 400 refits: 8 % of scatter


@pytest.mark.parametrize("name", ["constant", "power", "sum"])
def test_the_shapes_of_a_change_hold_the_derivatives_of_the_laws(name: str) -> None:
    law = next(law for law in LAWS if law.name == name and ("p" in law.free or name == "constant"))
    values = np.array([[2.0, 0.004 * (name != "power"), 0.03 * (name != "constant"), 0.8, 0.0]])
    time = np.arange(0.0, 63.0, 0.02)
    mode = wave(values[0], time)
    fit = DecayFit(
        laws=(law,), values=values, coefficient=np.array([0.1, 0.0, 0.0, 0.0, 0.0]), time=time,
        residual=np.zeros(len(time)),
    )  # fmt: skip
    shapes = mode[:, None] * shape_slopes(fit)
    X = np.concatenate([np.stack([mode, 1j * mode, 1j * time * mode], axis=1), shapes], axis=1)
    both = np.concatenate([X.real, X.imag])
    for kind, slope in zip(law.free, wave_slopes(law, values[0], time), strict=True):
        change = np.concatenate([(mode * slope).real, (mode * slope).imag])
        left = change - both @ np.linalg.lstsq(both, change, rcond=None)[0]
        # the phase is carried to the square of xi = 3 %: a tenth of that is left in the change
        assert np.linalg.norm(left) < 5e-3 * np.linalg.norm(change), kind


def test_a_curve_without_a_law_follows_one_that_is_between_those_tried() -> None:
    # 0.1 % + 3 % (A/A0)^1.1, fitted as if it were an odd square law: the curve is right to second order in the misfit
    time = np.arange(0.0, 63.0, 0.1)
    truth = np.array([2.0, 0.001, 0.03, 1.1, 0.0])
    fit = fit_decay([LAWS[1]], np.array([[2.0, 0.0, 0.03, 1.0, 0.0]]), time, 0.1 * np.real(wave(truth, time)))
    assert fit is not None
    A = np.geomspace(0.025, 0.1, 9)
    true = ratio_at(truth, A / 0.1)
    by_law = ratio_at(fit.values[0], A / fit.start_amplitude[0])
    assert np.max(np.abs(by_law / true - 1.0)) > 0.02
    np.testing.assert_allclose(tangent(fit).ratio(A), true, rtol=5e-4)


def test_a_law_is_never_read_outside_the_tested_amplitudes() -> None:
    found = free_decay(record(PowerDamping(slope=0.5, exponent=1.0)), frequency_hint=2.0)
    low, high = found.tested
    assert isinstance(found.law, TableDamping)
    assert np.isnan(found.law.ratio(np.array([0.9 * low, 1.1 * high]))).all()
    assert (found.law.smallest_amplitude, found.law.largest_amplitude) == pytest.approx((low, high), rel=1e-5)


def test_a_wave_and_a_force_give_the_damping_of_the_displacement() -> None:
    law = PowerDamping(slope=0.5, exponent=1.0)
    base = free_decay(record(law), frequency_hint=2.0)
    wave_ = free_decay(record(law, scale=1.54), "wave", per_displacement=1.54, frequency_hint=2.0)
    force = free_decay(record(law, scale=4000.0, unit="N"), "force", per_displacement=4000.0, frequency_hint=2.0)
    for other in (wave_, force):
        np.testing.assert_allclose(other.amplitude, base.amplitude, rtol=1e-6)
        np.testing.assert_allclose(other.ratio, base.ratio, rtol=1e-6)
        assert other.estimate("slope").value == pytest.approx(base.estimate("slope").value, rel=1e-6)


def test_without_its_scale_only_a_constant_becomes_a_law() -> None:
    constant = free_decay(record(ConstantDamping(ratio=0.01), unit="N", scale=4000.0), "force", frequency_hint=2.0)
    assert constant.law.ratio(1.0) == pytest.approx(0.01, rel=0.01)
    power = free_decay(
        record(PowerDamping(slope=0.5, exponent=1.0), unit="N", scale=4000.0), "force", frequency_hint=2.0
    )
    with pytest.raises(OutsideValidity, match="force per displacement"):
        _ = power.law
    assert any("not given" in note for note in power.notes)


@pytest.mark.parametrize(
    ("measured", "scale", "said"),
    [
        ("force", None, "is no force"),
        ("displacement", 1.54, "needs no factor"),
        ("wave", -1.0, "must be > 0"),
        ("height", None, "displacement, wave or force"),
    ],
)
def test_what_the_column_is_must_be_said_and_must_fit(measured: str, scale: float | None, said: str) -> None:
    with pytest.raises(InputError, match=said):
        free_decay(record(ConstantDamping(ratio=0.01)), measured, per_displacement=scale, frequency_hint=2.0)  # type: ignore[arg-type]


def test_scaling_by_radius_is_for_power_laws_alone() -> None:
    found = free_decay(record(PowerDamping(slope=0.5, exponent=1.0)), frequency_hint=2.0)
    assert found.coefficient(0.5) == pytest.approx(0.25, rel=0.01)
    full = found.similar(0.5, 2.5)
    assert full.largest_amplitude == pytest.approx(5.0 * found.tested[1], rel=1e-5)
    assert full.ratio(0.4) == pytest.approx(0.1 * 0.4, rel=0.01)
    with pytest.raises(OutsideValidity, match="wall"):
        free_decay(record(WALL_AND_BAFFLE), frequency_hint=2.0).similar(0.5, 2.5)


def test_a_moving_frequency_and_a_separate_line_are_fitted_and_said() -> None:
    softening = 0.1 * np.real(wave(np.array([2.0, 0.002, 0.03, 1.0, -0.01]), TIME))
    noise = 5e-4 * np.random.default_rng(2).standard_normal(len(TIME))
    found = free_decay(DecayRecord(time=TIME, value=softening + noise, unit="m"), frequency_hint=2.0)
    assert found.estimate("frequency_change").value == pytest.approx(-0.01, rel=0.05)
    assert found.frequency == pytest.approx(2.0, rel=2e-4)
    np.testing.assert_allclose(found.ratio, 0.002 + 0.3 * found.amplitude, rtol=0.03)
    assert any("moves with the amplitude" in note for note in found.notes)
    second = 0.02 * np.exp(-0.06 * TIME) * np.cos(6.6 * TIME)
    plain = 0.1 * np.real(wave(np.array([2.0, 0.01, 0.0, 1.0, 0.0]), TIME))
    found = free_decay(DecayRecord(time=TIME, value=plain + second + noise, unit="m"), frequency_hint=2.0)
    assert found.second_line is not None
    assert found.second_line[0] == pytest.approx(6.6, rel=1e-3)
    np.testing.assert_allclose(found.ratio, 0.01, rtol=0.01)
    assert any("1.05 Hz is fitted beside" in note for note in found.notes)


def test_coloured_noise_widens_the_band_by_its_power_at_the_line() -> None:
    generator = np.random.default_rng(4)
    time = np.arange(0.0, 63.0, 0.05)
    clean = 0.1 * np.real(wave(np.array([2.0, 0.01, 0.0, 1.0, 0.0]), time))
    held = []
    for _ in range(100):
        noise = lfilter([1.0], [1.0, -0.9], 5e-4 * generator.standard_normal(len(time) + 200))[200:]
        try:
            found = free_decay(DecayRecord(time=time, value=clean + noise, unit="m"), frequency_hint=2.0, draws=500)
        except InputError:  # red noise has some power at the line, as a disturbance has
            continue
        assert any("not white" in note for note in found.notes)
        held.append((found.ratio_low <= 0.01) & (found.ratio_high >= 0.01))
    assert len(held) >= 97
    assert np.mean(held) > 0.9  # a hundred records: 95 % less two of its scatter; white bands would hold 50 %


def test_a_result_prints_on_one_screen_and_keeps_its_numbers() -> None:
    found = free_decay(record(WALL_AND_BAFFLE), frequency_hint=2.0)
    said = str(found)
    assert said.count("\n") < 24
    assert max(map(len, said.splitlines())) <= 120
    assert "% tested from" in said.splitlines()[0]
    assert "Hz" in said
    assert "rad/s" in said
    json.dumps(found.to_dict())
    dataset = found.to_dataset()
    np.testing.assert_array_equal(dataset["damping"], found.ratio)
    assert dataset["time"].attrs["units"] == "s"
    np.testing.assert_allclose(dataset["record"] - dataset["fit"], found.choice.best.residual)
    with pytest.raises(FrozenInstanceError):
        found.seed = 1  # type: ignore[misc]
    assert str(free_decay(record(WALL_AND_BAFFLE), frequency_hint=2.0)) == said  # the seed is an argument


def test_a_part_of_a_record_is_fitted_alone() -> None:
    found = free_decay(record(ConstantDamping(ratio=0.01)), frequency_hint=2.0, start=10.0, end=50.0)
    assert (found.record.time[0], found.record.time[-1]) == pytest.approx((10.0, 50.0))
    assert found.tested[1] == pytest.approx(0.1 * np.exp(-0.2), rel=0.01)
