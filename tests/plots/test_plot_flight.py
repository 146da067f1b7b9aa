"""The figures over flight time show the numbers of the assessment and say its message."""

from dataclasses import replace

import numpy as np
import pytest

from sloshpy.files import read_case, write_example
from sloshpy.flight import Phase, Trajectory, assess_flight, check_growth, growth_across
from sloshpy.plots import (
    plot_flight_cycles,
    plot_flight_damping,
    plot_flight_danger_zone,
    plot_flight_frequencies,
    plot_flight_growth,
    plot_flight_margins,
    plot_growth_check,
)
from sloshpy.report import write_flight_figures


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    case = read_case(write_example("upper_stage", tmp_path_factory.mktemp("stage")))
    tank = case.vehicle.tanks[0].model_copy(update={"station": np.array([9.0, 7.0, -9.0])})
    moved = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": (tank,)})})
    phases = (
        Phase(name="climb", time=np.array([0.0, 10.0, 20.0]), case=moved),
        Phase(name="coast in", time=np.array([20.0, 30.0]), case=case),
    )
    return assess_flight(Trajectory(name="flight", phases=phases), cycles=1)


def lines(ax):
    return [(np.asarray(line.get_xdata()), np.asarray(line.get_ydata())) for line in ax.lines]


def drawn(ax, x, y) -> bool:
    """Whether some line of the Axes has these points."""
    return any(
        a.shape == np.shape(x) and np.array_equal(a, x) and np.allclose(b, y, equal_nan=True) for a, b in lines(ax)
    )


def test_required_and_available_damping_are_drawn_phase_by_phase(flown):
    ax = plot_flight_damping(flown)
    for review in flown.reviews:
        assert drawn(ax, review.time, 100.0 * review.required_damping[:, 0])
    assert "LOX has less damping than it needs" in ax.get_title(loc="left")  # at small amplitude, without a radius


def test_every_station_of_the_danger_zone_is_the_result_s(flown):
    ax = plot_flight_danger_zone(flown)
    review = flown.reviews[0]
    assert drawn(ax, review.time, np.array([9.0, 7.0, -9.0]))
    assert drawn(ax, review.time, 6.0 + np.full(3, 9e5 / (16e3 * 6.0)))  # eq 22
    assert drawn(ax, np.array([0.0, 10.0]), np.array([9.0, 7.0]))  # inside


def test_cycles_stand_against_their_limits(flown):
    top, bottom = plot_flight_cycles(flown)
    review = flown.reviews[1]
    assert drawn(top, review.time, review.cycle_slosh[:, 0])
    assert drawn(bottom, review.time, np.degrees(review.cycle_tvc[:, 0]))
    assert drawn(bottom, review.time, [0.5, 0.5])


def test_growth_says_its_worst_start_and_factor(flown):
    top, bottom = plot_flight_growth(flown)
    window = flown.windows[0]
    assert drawn(bottom, [window.start, window.end], [window.factor] * 2)
    assert f"{window.factor:.3g}" in top.get_title(loc="left")
    review = flown.reviews[1]
    assert drawn(top, review.time, np.log(2.0) / review.margins.growth)


def test_margins_leave_unstable_times_out_and_frequencies_name_control(flown):
    ax = plot_flight_margins(flown)
    assert "unstable" in ax.get_title(loc="left")
    review = flown.reviews[0]
    assert not review.margins.stable[0]
    assert drawn(ax, review.time, np.where(review.margins.stable, review.disc_margin[:, 0], np.nan))
    shown = plot_flight_frequencies(flown).get_legend().get_texts()
    assert [text.get_text() for text in shown] == ["control (rigid body)", "LOX slosh"]


def test_all_figures_are_written(flown, tmp_path):
    written = write_flight_figures(flown, tmp_path / "figures", "svg")
    assert len(written) == 7  # with the growth against its simulation
    assert all(path.stat().st_size > 5000 for path in written)


def test_growth_across_an_event_shows_both_amplitudes_that_it_can_leave(tmp_path):
    case = read_case(write_example("upper_stage", tmp_path))
    stronger = case.model_copy(update={"autopilot": case.autopilot.model_copy(update={"rate_gain": 0.3})})
    phases = (
        Phase(name="one", time=np.array([0.0, 20.0]), case=case),
        Phase(name="two", time=np.array([20.0, 40.0]), case=stronger),
    )
    check = check_growth(growth_across(Trajectory(name="x", phases=phases), 0, 0.05), step=0.03)
    ax = plot_growth_check(check)
    for amplitude in (check.growth.amplitude, check.growth.least):
        assert drawn(ax, check.growth.time, amplitude)
        assert drawn(ax, check.growth.time, -amplitude)
    assert drawn(ax, check.history.time, check.history.slosh[:, 0])
    said = ax.get_title(loc="left").replace("\n", " ")
    assert f"grows from 0.05 to {np.max(check.growth.amplitude):.3g} m" in said
    assert "two" in [text.get_text() for text in ax.texts]
    assert f"simulation differs by {100.0 * check.worst:.2g} % at most" in said
    far = plot_growth_check(replace(check, simulated=8.2 * check.predicted)).get_title(loc="left")
    assert "simulation differs by 7.2 times the prediction at most" in far.replace("\n", " ")
