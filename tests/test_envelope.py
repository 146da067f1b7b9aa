"""Amplitude and frequency of a settled oscillation, and the refusal of an unsettled one."""

import numpy as np
import pytest

from sloshpy.simulation import settled_envelope

T = np.arange(0, 200, 0.02)


def test_a_sine_gives_its_amplitude_and_frequency_about_any_mean():
    found = settled_envelope(T, 0.3 + 0.447 * np.sin(2.13 * T + 0.4))
    assert found.settled
    # peaks between samples 0.02 s apart: cos(w dt/2) is 2e-4 low at worst if not interpolated
    assert found.amplitude == pytest.approx(0.447, rel=3e-4)
    assert found.omega == pytest.approx(2.13, rel=1e-4)


def test_growth_decay_and_beating_are_unconverged():
    for signal in (
        np.exp(0.01 * T) * np.sin(2 * T),
        np.exp(-0.01 * T) * np.sin(2 * T),
        np.sin(2 * T) + 0.3 * np.sin(2.1 * T),
    ):
        found = settled_envelope(T, signal)
        assert not found.settled
        assert np.isnan(found.amplitude)
        assert found.reason.startswith("unconverged")


def test_a_slope_of_a_thousandth_per_ten_cycles_is_the_limit():
    """T27: 0.1 % per 10 cycles over 20 cycles."""
    period = 2 * np.pi / 2.0
    for slope, settled in ((0.0003, True), (0.003, False)):
        signal = np.exp(slope / (10 * period) * T) * np.sin(2 * T)
        assert settled_envelope(T, signal).settled is settled


def test_fewer_than_twenty_cycles_are_unconverged():
    t = T[T < 40]
    assert not settled_envelope(t, np.sin(2 * t)).settled
