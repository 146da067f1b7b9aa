"""What disturbs a decay: kicks found at their moment, coloured noise told as such, amplitudes left unknown."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

from sloshpy.damping import DecayRecord, free_decay
from sloshpy.damping.decay_band import KNOWN
from sloshpy.damping.decay_fit import DecayFit, fit_decay
from sloshpy.damping.decay_kick import kick_evidence
from sloshpy.damping.decay_model import CONSTANT, wave
from sloshpy.damping.decay_noise import Noise, noise_of
from sloshpy.damping.decay_tangent import tangent
from sloshpy.errors import InputError

TIME = np.arange(0.0, 63.0, 0.1)
TRUTH = np.array([2.0, 0.01, 0.0, 1.0, 0.0])


def record(value: np.ndarray) -> DecayRecord:
    return DecayRecord(time=TIME, value=value, unit="m", column="wave")


def fitted(value: np.ndarray) -> DecayFit:
    fit = fit_decay([CONSTANT], TRUTH[None], TIME, value)
    assert fit is not None
    return fit


def kicked(moment: float, jump: complex) -> np.ndarray:
    """Return a decay of 0.1 m that jumps by a share of its own amplitude: linear, so that the rest is exact."""
    z = wave(TRUTH, TIME)
    return 0.1 * np.real(np.where(moment <= TIME, z * (1.0 + jump), z))


def test_without_a_kick_the_evidence_of_one_is_chi_square_of_two_degrees_of_freedom() -> None:
    generator = np.random.default_rng(5)
    clean = 0.1 * np.real(wave(TRUTH, TIME))
    seen = []
    for _ in range(300):
        about = tangent(fitted(clean + 1e-3 * generator.standard_normal(len(TIME))))
        seen.append(kick_evidence(about)[1][40] / 1e-6)
    assert kstest(seen, "chi2", args=(2,)).pvalue > 0.01


@pytest.mark.parametrize("jump", [0.08, -0.08, 0.08j, 0.06 - 0.06j])
@pytest.mark.parametrize("moment", [15.0, 30.0, 45.0])
def test_a_kick_below_the_noise_is_refused_at_its_moment(jump: complex, moment: float) -> None:
    # a crest of the jump is 4 to 6 mm at the first moment and 2.4 to 3.4 mm at the last, of noise of 1 mm rms
    value = kicked(moment, jump) + 1e-3 * np.random.default_rng(11).standard_normal(len(TIME))
    with pytest.raises(InputError) as caught:
        free_decay(record(value), frequency_hint=2.0)
    said = str(caught.value)
    if "jumps" in said:  # the greater ones are refused by other checks before
        assert float(said.split(" at ")[1].split(" s")[0]) == pytest.approx(moment, abs=3.2)


def test_a_jump_is_measured_at_its_size_and_moment() -> None:
    value = kicked(30.0, 0.02 + 0.01j) + 1e-5 * np.random.default_rng(12).standard_normal(len(TIME))
    moments, evidence, jump = kick_evidence(tangent(fitted(value)))
    k = int(np.argmax(evidence))
    assert TIME[moments[k]] == pytest.approx(30.0, abs=1.6)  # a quarter of a cycle is 0.8 s
    assert jump[k] == pytest.approx(abs(0.02 + 0.01j), rel=0.2)


def test_rows_of_a_coloured_noise_are_those_of_its_shocks() -> None:
    generator = np.random.default_rng(6)
    noise = Noise(shocks=generator.standard_normal(100), filter=np.array([0.7, -0.2]))
    rows = generator.standard_normal((3, 80))
    adjoint = noise.adjoint(rows)
    shocks = generator.standard_normal(adjoint.shape[1])
    made = lfilter([1.0], [1.0, -0.7, 0.2], shocks)[-80:]
    np.testing.assert_allclose(adjoint @ shocks, rows @ made, rtol=1e-10)


def test_the_power_of_coloured_noise_at_the_line_is_what_was_put_in() -> None:
    generator = np.random.default_rng(7)
    clean = 0.1 * np.real(wave(TRUTH, TIME))
    known = 1e-6 / np.abs(1.0 - 0.8 * np.exp(-0.2j)) ** 2  # at 2 rad/s and 0.1 s
    found = []
    for _ in range(60):
        red = lfilter([1.0], [1.0, -0.8], 1e-3 * generator.standard_normal(len(TIME) + 200))[200:]
        found.append(noise_of(tangent(fitted(clean + red))).power(0.2))
    assert np.mean(found) == pytest.approx(known, rel=0.12)  # 60 spectra of order one: 4 % of scatter, and its skew


def test_amplitudes_at_which_the_damping_is_not_known_are_left_out_and_said() -> None:
    values = np.array([2.0, 0.0, 0.03, 1.0, 0.0])
    clean = 0.1 * np.real(wave(values, TIME))
    noisy = free_decay(record(clean + 2e-3 * np.random.default_rng(8).standard_normal(len(TIME))), frequency_hint=2.0)
    low, high = noisy.tested
    assert low > 1.1 * noisy.envelope[-1]
    assert any("shows the damping to 8 % only" in note for note in noisy.notes)
    half = 0.5 * (noisy.ratio_high - noisy.ratio_low)
    assert np.all(half < 1.15 * KNOWN * noisy.ratio)  # a bootstrap of 2000 draws scatters by 3 %
    assert noisy.law.ratio(np.array([0.9 * low, 1.1 * high])) == pytest.approx([np.nan, np.nan], nan_ok=True)
    with pytest.raises(InputError, match=r"is not known to 8 %"):
        free_decay(record(clean + 9e-3 * np.random.default_rng(8).standard_normal(len(TIME))), frequency_hint=2.0)


def test_a_small_kick_is_told_with_its_size_and_moment_in_a_whole_sentence() -> None:
    value = kicked(30.0, 0.02j) + 1e-3 * np.random.default_rng(11).standard_normal(len(TIME))
    with pytest.raises(InputError) as caught:
        free_decay(record(value), frequency_hint=2.0)
    said = str(caught.value)
    assert "; a free decay has no jump, and this one is " in said
    size, moment = said.split("jumps by ")[1].split(" s;")[0].split(" % at ")
    assert float(size) == pytest.approx(2.0, abs=1.2)  # three of its standard errors, 0.4 %
    assert float(moment) == pytest.approx(30.0, abs=3.2)
