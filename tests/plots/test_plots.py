"""What is drawn equals the result, is named in words and units, and stays on the Axes given."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from sloshpy import plots
from sloshpy.case import Case
from sloshpy.damping import PowerDamping, TableDamping
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle import LimitCycle, degradation_map, growth_curve, limit_cycles, predict_limit_cycle
from sloshpy.plots.style import SMALL
from sloshpy.simulation import TimeHistory, simulate, simulate_degraded
from sloshpy.stability import (
    DampingSweep,
    damping_law_curve,
    disc_margin_curve,
    required_damping,
    required_damping_map,
    root_locus,
)


@pytest.fixture(scope="module")
def drawn(case: Case, sweep: DampingSweep, cycle: LimitCycle, history: TimeHistory) -> dict[str, Axes]:
    required = cycle.required
    return {
        "bode": plots.plot_bode(sweep)[0],
        "nichols": plots.plot_nichols(sweep),
        "locus": plots.plot_root_locus(root_locus(case)),
        "zone": plots.plot_danger_zone(required_damping_map(case)),
        "tvc": plots.plot_tvc_gain(sweep),
        "cycle": plots.plot_limit_cycle(cycle),
        "history": plots.plot_time_history(history)[0],
        "sweep": plots.plot_damping_sweep(disc_margin_curve(case, required=required)),
        "growth": plots.plot_growth(growth_curve(case), limit_cycles(case)),
        "law": plots.plot_damping_law(damping_law_curve(case, required)),
        "degradation": plots.plot_degradation_map(degradation_map(case)),
    }


@pytest.fixture(scope="module")
def history(cycle: LimitCycle) -> TimeHistory:
    return simulate_degraded(cycle)


def title(ax: Axes) -> str:
    return " ".join(ax.get_title(loc="left").split())


@pytest.mark.parametrize(
    ("name", "x", "y"),
    [
        ("bode", "", "[dB]"),
        ("nichols", "[deg]", "[dB]"),
        ("locus", "[1/s]", "[rad/s]"),
        ("zone", "[m]", "[%]"),
        ("tvc", "[Hz]", "[m/rad]"),
        ("cycle", "[Hz]", "[mrad]"),
        ("history", "", "[m]"),
        ("sweep", "[%]", ""),
        ("growth", "[m]", "[1/s]"),
        ("law", "[m]", "[%]"),
        ("degradation", "[ms]", "[dB]"),
    ],
)
def test_axis_labels_carry_units(drawn: dict[str, Axes], name: str, x: str, y: str) -> None:
    assert drawn[name].get_xlabel().endswith(x)
    assert y in drawn[name].get_ylabel()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("bode", "slosh mode at 0.338 Hz"),  # the open-loop pole of the plant, 2.1248 rad/s; the tank alone is at 0.318
        ("nichols", "needs 4.74 % damping"),
        ("degradation", "take 0.283 deg, within the limit of 0.5 deg"),
        ("locus", "+0.0511 1/s"),
        ("zone", "needs 4.74 % slosh damping; below 2.39 % it is unstable"),
        ("tvc", "m/rad at 1.2 % damping"),
        ("cycle", "slosh of 0.444 m moves the engine by 0.283 deg, within the limit of 0.5 deg"),
        ("history", "LOX slosh 0.444 m, engine 4.73 mrad"),
        ("sweep", "disc margin of 1 at 4.74 % slosh damping"),
        ("growth", "doubles in 13.6 s; with the loop as given it settles at 0.224 m"),
        ("law", "from 0.474 m on"),
    ],
)
def test_titles_say_the_number_of_the_result(drawn: dict[str, Axes], name: str, words: str) -> None:
    assert words in title(drawn[name])


def test_no_letter_is_smaller_than_nine_points(drawn: dict[str, Axes]) -> None:
    from matplotlib.text import Text

    for ax in drawn.values():
        figure = ax.get_figure(root=True)
        assert figure is not None
        assert all(t.get_fontsize() >= SMALL for t in figure.findobj(Text) if t.get_text())


def test_nichols_curves_are_the_response_and_the_ellipse_has_the_margins_for_half_axes(sweep: DampingSweep) -> None:
    ax = plots.plot_nichols(sweep)
    curves = [line for line in ax.lines if len(line.get_xdata()) == len(sweep.response.omega)]
    for k, line in enumerate(curves):
        np.testing.assert_array_equal(line.get_ydata(), sweep.response.gain_db[k])
        turned = np.exp(1j * np.radians(np.asarray(line.get_xdata(), dtype=float)))
        np.testing.assert_allclose(turned, sweep.response.loop[k] / np.abs(sweep.response.loop[k]), atol=1e-9)
    assert len(curves) == 4
    (disc,) = (p for p in ax.patches if isinstance(p, Ellipse))
    assert disc.get_center() == (-180.0, 0.0)
    assert disc.width / 2.0 == pytest.approx(30.0)
    assert disc.height / 2.0 == pytest.approx(6.0)


def test_the_required_curve_touches_the_ellipse_and_the_unstable_one_goes_round_the_critical_point(
    sweep: DampingSweep,
) -> None:
    phase, gain = sweep.phase_deg, sweep.response.gain_db
    distance = np.hypot((phase + 180.0) / 30.0, gain / 6.0)
    assert np.min(distance[2]) == pytest.approx(1.0, abs=2e-3)  # the nearest sample, not the minimum itself
    crossing = np.flatnonzero(np.diff(np.sign(phase[0] + 180.0)) != 0)
    assert np.max(gain[0, crossing]) > 0.0 > np.min(gain[0, crossing])


def test_bode_curves_differ_in_style_and_width_so_that_they_survive_in_grey(sweep: DampingSweep) -> None:
    gain, phase = plots.plot_bode(sweep)
    lines = [line for line in gain.lines if len(line.get_xdata()) > 2]
    assert len({(line.get_linestyle(), line.get_linewidth()) for line in lines}) >= 3
    assert len({line.get_linewidth() for line in lines}) == 4
    assert phase.get_xlabel() == "Frequency [Hz]"


def test_danger_zone_shows_the_damping_of_the_tank_where_it_stands(case: Case, cycle: LimitCycle) -> None:
    found = required_damping_map(case)
    ax = plots.plot_danger_zone(found)
    dots = [line for line in ax.lines if line.get_marker() == "o"]
    assert float(np.asarray(dots[0].get_xdata())[0]) == 9.0
    assert float(np.asarray(dots[0].get_ydata())[0]) == pytest.approx(100.0 * float(cycle.required.required), rel=1e-6)
    marks = sorted(
        float(np.asarray(line.get_xdata())[0]) for line in ax.lines if line.get_xdata()[0] == line.get_xdata()[-1]
    )
    assert min(marks) == pytest.approx(6.0 - 13.18359375)  # eq 23
    assert max(marks) == pytest.approx(6.0 + 9.375)  # eq 22


def test_limit_cycle_draws_both_conventions_and_the_limit_in_view(cycle: LimitCycle) -> None:
    ax = plots.plot_limit_cycle(cycle)
    drawn = [np.asarray(line.get_ydata()) for line in ax.lines]
    np.testing.assert_array_equal(drawn[0], 1e3 * cycle.band_tvc)
    np.testing.assert_array_equal(drawn[1], 1e3 * cycle.paper_band_tvc)
    assert drawn[2][0] == pytest.approx(1e3 * np.radians(0.5))


def test_time_history_draws_whole_signals_with_no_more_points_than_needed(history: TimeHistory) -> None:
    slosh, engine = plots.plot_time_history(history)
    shown = np.asarray(slosh.lines[0].get_ydata())
    assert len(shown) <= 4001
    assert np.max(np.abs(shown)) == pytest.approx(np.max(np.abs(history.slosh)), rel=0.01)
    assert engine.get_xlim() == (0.0, history.time[-1])


def test_plots_draw_on_the_axes_given(case: Case, sweep: DampingSweep, history: TimeHistory) -> None:
    ax = Figure().add_subplot()
    top, bottom = Figure().subplots(2)
    assert plots.plot_nichols(sweep, ax) is ax
    assert plots.plot_root_locus(root_locus(case), Figure().add_subplot()) is not ax
    assert plots.plot_time_history(history, (top, bottom)) == (top, bottom)
    assert plots.plot_bode(sweep, Figure().subplots(2))


def test_nichols_grid_is_drawn_behind_within_the_same_window(sweep: DampingSweep) -> None:
    plain, gridded = plots.plot_nichols(sweep), plots.plot_nichols(sweep, grid=True)
    assert gridded.get_xlim() == plain.get_xlim()
    assert len(gridded.lines) > len(plain.lines)


@pytest.mark.parametrize(("suffix", "start"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_figures_are_written_in_the_format_of_the_suffix_and_twice_the_same(
    sweep: DampingSweep, tmp_path: Path, suffix: str, start: bytes
) -> None:
    one = plots.save_figure(plots.plot_tvc_gain(sweep), tmp_path / f"one.{suffix}").read_bytes()
    two = plots.save_figure(plots.plot_tvc_gain(sweep), tmp_path / f"two.{suffix}").read_bytes()
    assert one.startswith(start)
    assert one == two
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"one.{suffix}", f"two.{suffix}"]


def test_svg_is_well_formed_and_names_no_program_or_date(sweep: DampingSweep) -> None:
    text = plots.figure_bytes(plots.plot_bode(sweep), "svg").decode()
    ET.fromstring(text)
    assert "metadata" not in text


def test_an_unknown_suffix_is_refused_with_the_known_ones(sweep: DampingSweep, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r'png, svg, pdf, not "jpeg"'):
        plots.save_figure(plots.plot_nichols(sweep), tmp_path / "a.jpeg")
    assert not list(tmp_path.iterdir())


def test_a_limit_cycle_without_amplitude_is_not_drawn_but_explained(cycle: LimitCycle) -> None:
    nothing = replace(cycle, tvc_amplitude=np.full(2, np.nan), reasons=("the data end at 0.3 m",))
    with pytest.raises(OutsideValidity, match=r"LOX: the data end at 0\.3 m"):
        plots.plot_limit_cycle(nothing)


@pytest.mark.parametrize(
    ("law", "known"),
    [
        (PowerDamping(slope=0.1, largest_amplitude=0.3), (0.0, 0.3)),
        (TableDamping(amplitude=[0.05, 0.2, 0.6], ratio=[0.004, 0.02, 0.06]), (0.05, 0.6)),
        (PowerDamping(slope=0.1), None),
    ],
    ids=["formula that ends", "table", "formula"],
)
def test_the_range_in_which_a_law_holds_is_shaded(case: Case, law: PowerDamping, known: tuple[float, float]) -> None:
    tank = case.vehicle.tanks[0].model_copy(update={"damping": law})
    other = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": (tank,)})})
    ax = plots.plot_damping_law(damping_law_curve(other, required_damping(other)))
    shaded = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in ax.patches]
    assert shaded == ([pytest.approx(known)] if known else [])
    words = [text.get_text() for text in ax.texts]
    assert words.count("unknown") == (0 if known is None else 1 + (known[0] > 0.0))
    assert words.count("known") == (known is not None)


def test_a_motion_that_dies_down_is_titled_by_its_peak_and_what_is_left(case: Case) -> None:
    run = simulate(case, 60.0, 0.2, damping=0.05)
    z = np.abs(run.slosh[:, 0])
    share = max(np.max(z[run.time > 54.0]) / 0.2, np.max(np.abs(run.tvc[run.time > 54.0])) / np.max(np.abs(run.tvc)))
    assert run.left == pytest.approx(share, rel=0.1)
    words = title(plots.plot_time_history(run)[0])
    assert words.startswith("Peaks at 0.2 m of LOX slosh")
    assert f"dies down to {100.0 * run.left:.2g} % of that within 60 s" in words


def test_the_map_names_the_number_of_the_five_steps_where_it_is_greater(case: Case) -> None:
    found = degradation_map(case)
    cycle = predict_limit_cycle(case)
    assert found.worst == max(found.worst_inside, cycle.worst_tvc_amplitude)
    assert found.worst > found.worst_inside
    between = case.criteria.model_copy(update={"tvc_amplitude": 0.5 * (found.worst_inside + found.worst)})
    tight = replace(found, case=case.model_copy(update={"criteria": between}))
    words = title(plots.plot_degradation_map(tight))
    assert "the five steps, which decide" in words
    assert "beyond the limit" in words
