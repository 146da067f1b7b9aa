"""The figure of the mode tracks draws the result, by tank, and says the exchange."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from sloshpy.files import read_case, write_example
from sloshpy.plots import plot_mode_tracks
from sloshpy.plots.style import SMALL
from sloshpy.stability import ModeTracks, track_modes


@pytest.fixture(scope="module")
def tracks(tmp_path_factory: pytest.TempPathFactory) -> ModeTracks:
    case = read_case(write_example("two_tanks", tmp_path_factory.mktemp("case")))
    w = np.linspace(1.8, 2.4, 13)
    tanks = (case.vehicle.tanks[0], case.vehicle.tanks[1].model_copy(update={"frequency": w}))
    batch = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": tanks})})
    return track_modes(batch, w, 0.03, name="LH2 frequency", unit="rad/s")


def stretches(ax: Axes) -> list[tuple[np.ndarray, np.ndarray, str]]:
    lines = [line for line in ax.lines if len(line.get_xdata()) > 2]
    return [(np.asarray(k.get_xdata()), np.asarray(k.get_ydata()), str(k.get_linestyle())) for k in lines]


def test_what_is_drawn_is_the_result(tracks: ModeTracks) -> None:
    top, bottom = plot_mode_tracks(tracks)
    for ax, values in ((top, tracks.f_hz), (bottom, 100.0 * tracks.damping_ratio)):
        for n in tracks.slosh:
            own = [(x, y) for x, y, _ in stretches(ax) if np.all(np.isin(y, values[:, n]))]
            assert {float(x) for xs, _ in own for x in xs} == set(tracks.parameter)  # no hole


def test_a_tank_keeps_its_line_style_when_the_mode_changes(tracks: ModeTracks) -> None:
    top, _ = plot_mode_tracks(tracks)
    legend = top.get_legend()
    assert legend is not None
    assert [t.get_text() for t in legend.get_texts()] == ["LH2 slosh", "LOX slosh", "another mode"]
    lines = [line for line in top.lines if len(line.get_xdata()) > 2]
    in_view = [
        line for line in lines if np.max(line.get_ydata()) > top.get_ylim()[0] and np.min(line.get_ydata()) < 1.0
    ]
    looks = {(str(line.get_color()), line.get_linewidth()) for line in in_view}
    assert len(in_view) == 4  # two modes, each in two stretches
    assert len(looks) == 2
    assert len({line.get_linewidth() for line in in_view}) == 2  # told apart in grey


def test_labels_carry_units_and_the_title_says_the_exchange(tracks: ModeTracks) -> None:
    top, bottom = plot_mode_tracks(tracks)
    assert bottom.get_xlabel() == "LH2 frequency [rad/s]"
    assert top.get_ylabel() == "Frequency [Hz]"
    assert "[%]" in bottom.get_ylabel()
    title = " ".join(top.get_title(loc="left").split())
    assert "Modes 1 and 2 exchange LH2 and LOX between 2.05 and 2.1 rad/s" in title
    assert f"{tracks.veering[0].gap_hz:.4f} Hz apart" in title
    figure = top.get_figure(root=True)
    assert figure is not None
    assert all(t.get_fontsize() >= SMALL for t in figure.findobj(Text) if t.get_text())


def test_it_draws_on_the_axes_given(tracks: ModeTracks, tmp_path: Path) -> None:
    top, bottom = Figure().subplots(2)
    assert plot_mode_tracks(tracks, (top, bottom)) == (top, bottom)
