"""Amplitude and frequency of a settled oscillation, and the refusal of an unsettled one."""

import numpy as np
import pytest

from sloshpy.simulation import settled_envelope
from sloshpy.simulation.envelope import level_envelopes

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


def test_a_slope_that_does_not_slow_down_is_no_settled_oscillation():
    """T27 asks for 0.1 % per 10 cycles; a steady drift below that is growth or decay all the same."""
    period = 2 * np.pi / 2.0
    for slope, settled in ((3e-6, True), (0.0003, False), (0.003, False)):
        signal = np.exp(slope / (10 * period) * T) * np.sin(2 * T)
        assert settled_envelope(T, signal).settled is settled


@pytest.mark.parametrize(
    ("ten_cycles", "words"),
    [(8.21, "grows to 8.21 times its size"), (1.5, "changes by +50 %"), (0.05, "changes by -95 %")],
)
def test_a_change_of_more_than_all_is_told_in_times(ten_cycles, words):
    high = ten_cycles ** (np.arange(21.0)[None] / 10.0)
    (reason,) = level_envelopes(np.arange(21.0)[None], high, -high, np.array([21])).reason
    assert f"the envelope {words} in ten cycles; run longer" in reason


def test_fewer_than_twenty_cycles_are_unconverged():
    t = T[T < 40]
    assert not settled_envelope(t, np.sin(2 * t)).settled


def test_a_slow_approach_is_settled_only_where_its_end_is_near():
    """Towards 1 at 1 % a cycle: what is left after the run decides, not the slope alone."""
    period = np.pi
    for left, settled in ((1e-4, True), (1e-2, False)):
        approach = 1.0 - left * np.exp(-0.01 * (T - T[-1]) / period)
        assert settled_envelope(T, approach * np.sin(2 * T)).settled is settled


def test_the_flat_and_rippled_top_of_a_limited_engine_counts_once_a_swing():
    clipped = np.clip(1.5 * np.sin(2 * T), -1.0, 1.0) + 1e-3 * np.sin(10 * T)
    found = settled_envelope(T, clipped)
    assert found.settled
    assert found.amplitude == pytest.approx(1.0, abs=2e-3)
    assert found.omega == pytest.approx(2.0, rel=2e-2)
