"""A flight against single cases: batch equals loop, a flight that stands still equals the one case, windows by hand."""

import numpy as np
import pytest

from sloshpy.assess import assess
from sloshpy.batch import for_each
from sloshpy.files import read_case, write_example
from sloshpy.flight import Phase, Trajectory, assess_flight
from sloshpy.flight.windows import growth_windows, positive_stretches
from sloshpy.plots import plot_flight_growth
from sloshpy.stability import danger_zone, joint_damping, margins, required_damping, track_modes


@pytest.fixture(scope="module")
def upper_stage(tmp_path_factory):
    return read_case(write_example("upper_stage", tmp_path_factory.mktemp("stage")))


def burning(case, count):
    """Return the stage along a burn: mass, inertia, c.g., station and frequency change."""
    share = np.linspace(1.0, 0.7, count)
    v, tank = case.vehicle, case.vehicle.tanks[0]
    moved = tank.model_copy(
        update={"frequency": tank.frequency / np.sqrt(share), "station": np.linspace(9.0, 4.0, count)}
    )
    update = {"mass": v.mass * share, "inertia": v.inertia * share, "cg": 6.0 + 0.5 * (1.0 - share), "tanks": (moved,)}
    return case.model_copy(update={"vehicle": v.model_copy(update=update)})


@pytest.fixture(scope="module")
def flown(upper_stage):
    phase = Phase(name="burn", time=np.linspace(0.0, 90.0, 7), case=burning(upper_stage, 7))
    return assess_flight(Trajectory(name="burn", phases=(phase,)), cycles=3)


def test_every_time_of_a_flight_is_the_single_case(flown):
    review = flown.reviews[0]
    for k, case in enumerate(review.phase.cases):
        alone = margins(case)
        assert review.margins.growth[k] == pytest.approx(float(alone.growth), rel=1e-9)
        assert review.disc_margin[k, 0] == pytest.approx(float(alone.slosh_disc_margin(0)[0]), rel=1e-8)
        assert review.required_damping[k, 0] == pytest.approx(float(required_damping(case).required), rel=1e-7)
        zone = danger_zone(case)
        assert [review.zones[0].aft[k], review.zones[0].forward[k]] == pytest.approx([zone.aft, zone.forward])
        assert review.witness[k] == alone.witness


def test_limit_cycles_along_a_flight_are_those_of_the_review_of_one_case(flown):
    review = flown.reviews[0]
    asked = [k for k, one in enumerate(review.assessments) if one is not None]
    assert asked == [0, 3, 6]
    for k in asked:
        alone = assess(review.phase.cases[k])
        cycle = alone.tanks[0].limit_cycle
        assert alone.verdict == review.assessments[k].verdict
        if cycle.band.size:
            assert review.cycle_tvc[k, 0] == pytest.approx(cycle.worst_tvc_amplitude)
            assert review.cycle_slosh[k, 0] == pytest.approx(cycle.worst_slosh_amplitude)
    assert np.all(np.isnan(review.cycle_tvc[[1, 2, 4, 5], 0]))


def test_a_flight_that_stands_still_says_what_the_one_case_says(upper_stage):
    phase = Phase(name="still", time=np.array([0.0, 1.0, 5.0]), case=upper_stage)
    found = assess_flight(Trajectory(name="still", phases=(phase,)), cycles=2)
    alone = assess(upper_stage)
    assert found.verdict == alone.verdict == "pass"
    assert np.ptp(found.reviews[0].margins.growth) == 0.0
    assert found.reviews[0].cycle_tvc[0, 0] == pytest.approx(alone.worst_tvc_amplitude)
    window = found.windows[0]
    assert window.exponent == pytest.approx(5.0 * float(alone.margins.growth))  # constant sigma over 5 s
    assert window.factor == pytest.approx(np.exp(5.0 * 0.05113), rel=1e-4)  # the sigma that the theory gives


def test_a_law_of_its_own_at_each_time_counts(upper_stage):
    law = upper_stage.vehicle.tanks[0].damping
    laws = tuple((law.model_copy(update={"slope": slope}),) for slope in (0.1, 0.2))
    phase = Phase(name="two", time=np.array([0.0, 1.0]), case=upper_stage, laws=laws)
    found = assess_flight(Trajectory(name="two", phases=(phase,)), cycles=1).reviews[0]
    assert found.cycle_slosh[0, 0] == pytest.approx(2.0 * found.cycle_slosh[1, 0])  # A = xi / alpha


def test_several_tanks_are_held_where_all_meet_the_margin(tmp_path):
    case = read_case(write_example("two_tanks", tmp_path))
    phase = Phase(name="two", time=np.array([0.0, 1.0]), case=case)
    found = assess_flight(Trajectory(name="two", phases=(phase,)), cycles=0)
    assert found.verdict == "linear"
    assert found.reviews[0].held[1] == pytest.approx(joint_damping(case), rel=1e-9)
    data = found.to_dataset()
    assert data["required_damping"].sel(tank="LOX").shape == (2,)
    assert data["disc_margin"].attrs["units"] == "1"


def test_another_mode_below_its_margin_fails_without_limit_cycles(upper_stage):
    late = upper_stage.autopilot.model_copy(update={"delay": np.array([0.0, 0.9])})
    phase = Phase(name="late", time=np.array([0.0, 1.0]), case=upper_stage.model_copy(update={"autopilot": late}))
    found = assess_flight(Trajectory(name="late", phases=(phase,)), cycles=0)
    assert found.verdict == "fail"
    rigid = next(one for one in found.worst if one.criterion == "disc margin, rigid body")
    assert rigid.met is False
    assert rigid.time == 1.0


def test_both_sides_of_an_event_are_analysed_and_phases_do_not_overlap(upper_stage):
    one = Phase(name="one", time=np.array([0.0, 10.0]), case=upper_stage)
    v = upper_stage.vehicle.model_copy(update={"mass": 15000.0})
    other = Phase(name="two", time=np.array([10.0, 20.0]), case=upper_stage.model_copy(update={"vehicle": v}))
    flight = Trajectory(name="x", phases=(one, other))
    assert flight.events == (10.0,)
    assert flight.count == 4
    found = assess_flight(flight, cycles=0)
    assert found.reviews[0].margins.growth[-1] != found.reviews[1].margins.growth[0]
    late = Phase(name="two", time=np.array([9.0, 20.0]), case=upper_stage)
    with pytest.raises(ValueError, match="begins before"):
        Trajectory(name="x", phases=(one, late))


@pytest.mark.parametrize(
    ("time", "words"), [([0.0], "two or more"), ([0.0, 0.0], "increasing"), ([0.0, np.nan], "fin")]
)
def test_times_that_are_none_are_refused(upper_stage, time, words):
    with pytest.raises(ValueError, match=words):
        Phase(name="x", time=np.array(time), case=upper_stage)


def test_stretches_by_hand():
    t = np.array([0.0, 1.0, 2.0, 4.0, 5.0])
    y = np.array([-1.0, 1.0, 0.0, -1.0, 2.0])
    found = positive_stretches(t, y)
    assert found[0] == pytest.approx((0.5, 2.0, 0.75))  # triangles of 0.5 x 1 and 1 x 1
    assert found[1] == pytest.approx((4.0 + 1.0 / 3.0, 5.0, 2.0 / 3.0))
    assert positive_stretches(t, np.full(5, 2.0)) == [(0.0, 5.0, 10.0)]
    assert positive_stretches(t, np.array([1.0, 1.0, np.nan, 1.0, 1.0])) == [(0.0, 1.0, 1.0), (4.0, 5.0, 1.0)]


def test_a_window_integrates_the_growth_of_its_own_mode(upper_stage):
    cases = burning(upper_stage, 31)
    time = np.linspace(0.0, 90.0, 31)
    tracks = track_modes(cases, time)
    window = growth_windows(tracks, "burn")[0]
    growth = for_each(margins, cases).values("growth")
    assert window.mode == "LOX slosh"
    assert window.growth == pytest.approx(np.max(growth), rel=1e-9)
    fine = np.linspace(0.0, 90.0, 200_001)
    assert window.exponent == pytest.approx(
        np.trapezoid(np.maximum(np.interp(fine, time, growth), 0.0), fine), rel=1e-6
    )


def test_windows_that_meet_at_an_event_are_one_where_the_oscillation_goes_on(upper_stage):
    """The paper's stage grows at 0.05113 1/s on both sides; a stage that leaves ends it."""
    one = Phase(name="one", time=np.array([0.0, 10.0]), case=upper_stage)
    two = Phase(name="two", time=np.array([10.0, 30.0]), case=upper_stage)
    found = assess_flight(Trajectory(name="x", phases=(one, two)), cycles=0)
    assert found.chains[0].exponent == pytest.approx(30.0 * 0.05113, rel=1e-3)
    assert f"by a factor of {np.exp(found.chains[0].exponent):.4g} in all" in str(found)
    title = plot_flight_growth(found)[0].get_title(loc="left")
    assert f"grows by {found.chains[0].factor:.3g} from 0 to 30 s" in title
    lighter = upper_stage.model_copy(update={"vehicle": upper_stage.vehicle.model_copy(update={"mass": 12e3})})
    other = Phase(name="two", time=np.array([10.0, 30.0]), case=lighter)
    assert assess_flight(Trajectory(name="x", phases=(one, other)), cycles=0).chains == ()
