"""Beats shorter than the record: refused where two lines explain it too; and what no test of one record can see."""

import json

import numpy as np
import pytest

from sloshpy.damping import DecayRecord, free_decay
from sloshpy.damping.decay_band import check_law
from sloshpy.damping.decay_model import wave
from sloshpy.errors import InputError

CYCLE = np.pi  # s, at 2 rad/s


def record(value: np.ndarray, time: np.ndarray) -> DecayRecord:
    return DecayRecord(time=time, value=value, unit="m", column="wave")


def two_lines(xi: float, apart: float, share: float, turn: float, cycles: int, seed: int) -> DecayRecord:
    """Return two lines of one damping, `apart` in relative frequency, the second turned by `turn` rad at the start."""
    time = np.arange(0.0, cycles * CYCLE, CYCLE / 16)
    generator = np.random.default_rng(seed)
    first = np.exp(1j * generator.uniform(0.0, 2.0 * np.pi))
    z = first * (1.0 + share * np.exp(1j * (turn + 2.0 * apart * time))) * np.exp((2j - 2.0 * xi) * time)
    return record(0.2 * np.real(z) + 1e-3 * generator.standard_normal(len(time)), time)


def refusals(xi: float, apart: float, share: float, turn: float, cycles: int) -> list[str]:
    """Return what is said of those of eight records that are refused."""
    said = []
    for seed in range(8):
        try:
            free_decay(two_lines(xi, apart, share, turn, cycles, seed), frequency_hint=2.0)
        except InputError as error:
            said.append(str(error))
    return said


@pytest.mark.parametrize(
    ("xi", "apart", "share", "turn", "cycles"),
    [(0.0101, 0.01, 0.1, 1.57, 15), (0.0141, -0.02, 0.3, 4.7, 8), (0.0045, 0.02, 0.1, 3.63, 15)],
)
def test_a_third_of_a_beat_is_mostly_refused(xi: float, apart: float, share: float, turn: float, cycles: int) -> None:
    # answered by one line with a law, or with a frequency that moves, they are off by 12, 45 and 42 %
    said = refusals(xi, apart, share, turn, cycles)
    assert len(said) >= 6
    assert any("two close lines, less than a beat or little more, explain it nearly as well as" in one for one in said)


def test_a_law_far_outside_its_band_is_refused() -> None:
    one = record(np.ones(3), np.arange(3.0))
    A, low, high = np.array([0.05, 0.1]), np.array([0.009, 0.009]), np.array([0.011, 0.011])
    check_law(one, A, np.array([0.01, 0.0119]), low, high)
    with pytest.raises(InputError, match=r"damping 1\.21 % by the best law, 0\.9 to 1\.1 % without one, at .* 0\.1 m"):
        check_law(one, A, np.array([0.01, 0.0121]), low, high)


@pytest.mark.parametrize("drift", [0.05, -0.05])
def test_what_a_gain_that_drifts_adds_is_what_the_answer_warns_of(drift: float) -> None:
    # a gain that falls exponentially is a damping of its own: the record cannot show it, and the ratios add up
    time = np.arange(0.0, 20.0 * CYCLE, 0.1)
    clean = 0.1 * np.real(wave(np.array([2.0, 0.01, 0.0, 1.0, 0.0]), time))
    gain = (1.0 - drift) ** (time / time[-1])
    value = clean * gain + 1e-5 * np.random.default_rng(3).standard_normal(len(time))
    found = free_decay(record(value, time), frequency_hint=2.0)
    np.testing.assert_allclose(found.ratio - 0.01, found.drift_ratio(drift), rtol=0.03)
    assert found.drift_ratio(0.01) == pytest.approx(0.01 / (2.0 * np.pi * 20.0), rel=0.01)


def test_text_and_json_say_how_near_a_second_line_could_hide() -> None:
    time = np.arange(0.0, 50.0, 0.1)
    value = 0.1 * np.real(wave(np.array([2.0, 0.01, 0.0, 1.0, 0.0]), time))
    found = free_decay(record(value + 1e-4 * np.random.default_rng(3).standard_normal(500), time), frequency_hint=2.0)
    note = (
        "not to be seen: a second line within 0.02 Hz; a sensor's gain drift, of which 1 % reads as 0.01 % of damping"
    )
    assert note in found.notes
    assert f"  - {note}\n" in str(found)
    said = json.loads(json.dumps(found.to_dict()))
    assert note in said["notes"]
    assert said["hidden_line_within_hz"] == pytest.approx(1.0 / 49.9)
    assert said["damping_per_percent_of_gain_drift"] == pytest.approx(1.0e-4, rel=0.02)
