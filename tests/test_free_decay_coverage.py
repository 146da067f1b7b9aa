"""Over a thousand synthetic records of each law: bias of the damping at most 2 %, and 95 % bands that hold the truth.

A thousand records leave 0.7 % of scatter on a coverage of 95 %, so that 93-97 % is three of it. The records come from
the closed form; that it is the decay of the damper's force is shown in test_free_decay.py.
"""

import numpy as np
import pytest

from sloshpy.damping import DecayRecord, free_decay
from sloshpy.damping.decay_model import wave

RECORDS = 1000
PLACES = [0, 6, 12, 18, 24]  # of the 25 amplitudes of a band, from the smallest to the largest tested
TRUTHS = {  # w, xi0, q, p, k; q at the first sample
    "constant": [2.0, 0.01, 0.0, 1.0, 0.0],
    "power": [2.0, 0.0, 0.03, 1.0, 0.0],
    "sum": [2.0, 0.005, 0.025, 1.0, 0.0],
}


@pytest.mark.parametrize("law", TRUTHS)
def test_bands_hold_the_truth_and_the_damping_is_unbiased(law: str) -> None:
    truth = np.array(TRUTHS[law])
    time = np.arange(0.0, 63.0, 0.2)  # 20 cycles of 16 samples
    clean = wave(truth, time)
    errors, held, frequency_held = [], [], []
    for seed in range(RECORDS):
        generator = np.random.default_rng(seed)
        start = 0.1 * np.exp(1j * generator.uniform(0.0, 2.0 * np.pi))
        value = np.real(clean * start) + 0.01 + 0.001 * generator.standard_normal(len(time))
        found = free_decay(DecayRecord(time=time, value=value, unit="m"), frequency_hint=2.0, draws=1000, seed=seed)
        xi = truth[1] + truth[2] * (found.amplitude[PLACES] / 0.1) ** truth[3]
        errors.append(found.ratio[PLACES] / xi - 1.0)
        held.append((found.ratio_low[PLACES] <= xi) & (xi <= found.ratio_high[PLACES]))
        frequency_held.append(found.estimates[0].low <= truth[0] <= found.estimates[0].high)
    bias, coverage = np.mean(errors, axis=0), np.mean(held, axis=0)
    print(f"{law}: bias {100 * bias} %, coverage {100 * coverage} %, frequency {100 * np.mean(frequency_held)} %")
    assert len(held) == RECORDS  # none was refused
    assert np.all(np.abs(bias) < 0.02)
    inner, ends = coverage[1:-1], coverage[[0, -1]]
    assert np.all((inner >= 0.93) & (inner <= 0.97))
    # at the ends of the tested range the laws that share the band differ most; 93.1 to 97.0 % is what was found
    assert np.all((ends >= 0.92) & (ends <= 0.98))
    assert 0.93 <= np.mean(frequency_held) <= 0.97
