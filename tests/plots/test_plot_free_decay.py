"""The figure of a free decay shows record, fit, damping with its band, and which amplitudes were tested."""

import numpy as np
import pytest
from matplotlib.colors import to_rgba

from sloshpy import plots
from sloshpy.damping import DecayRecord, FreeDecay, free_decay
from sloshpy.damping.decay_model import wave
from sloshpy.plots.style import SMALL, VALID


@pytest.fixture(scope="module")
def found() -> FreeDecay:
    time = np.arange(0.0, 60.0, 0.1)
    clean = 0.1 * np.real(wave(np.array([2.0, 0.005, 0.025, 1.0, 0.0]), time))
    value = clean + 0.02 + 0.002 * np.random.default_rng(1).standard_normal(len(time))
    return free_decay(DecayRecord(time=time, value=value, unit="m", column="slosh"), frequency_hint=2.0)


def test_the_figure_shows_the_result(found: FreeDecay) -> None:
    above, below = plots.plot_free_decay(found)
    above.figure.canvas.draw()
    record, up, down = (line.get_ydata() for line in above.lines)
    np.testing.assert_array_equal(record, found.record.value)
    np.testing.assert_allclose(0.5 * (np.asarray(up) + np.asarray(down)), found.center)
    np.testing.assert_allclose(0.5 * (np.asarray(up) - np.asarray(down)), found.envelope)
    np.testing.assert_allclose(below.lines[0].get_xydata()[:, 1], 100.0 * found.ratio)
    edges = below.collections[0].get_paths()[0].vertices
    assert edges[:, 1].max() == pytest.approx(100.0 * found.ratio_high.max())
    assert edges[:, 1].min() == pytest.approx(100.0 * found.ratio_low.min())
    (tested,) = below.patches
    assert (tested.get_x(), tested.get_x() + tested.get_width()) == pytest.approx(found.tested)
    assert tested.get_facecolor() == to_rgba(VALID)
    assert [text.get_text() for text in below.get_legend().get_texts()].count("tested") == 1
    assert f"{found.f_hz:.4g} Hz" in above.get_title(loc="left")
    assert all(text.get_fontsize() >= SMALL for ax in (above, below) for text in ax.texts)
    assert "[m]" in below.get_xlabel()


def test_a_constant_ratio_reads_as_one_number_and_a_missing_scale_is_said(found: FreeDecay) -> None:
    time = np.arange(0.0, 60.0, 0.1)
    value = 400.0 * np.real(wave(np.array([2.0, 0.01, 0.0, 1.0, 0.0]), time))
    value += 0.5 * np.random.default_rng(1).standard_normal(len(time))
    force = free_decay(DecayRecord(time=time, value=value, unit="N", column="load"), "force", frequency_hint=2.0)
    above, below = plots.plot_free_decay(force)
    assert "load: 1 % damping" in above.get_title(loc="left")
    assert below.get_xlabel() == "Amplitude of the force [N]"
