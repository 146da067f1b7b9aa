"""The report of a flight: one page with everything in it, and as JSON; numbers against the review itself."""

import json
import re

import numpy as np
import pytest

from report.test_report import Page
from sloshpy.files import read_case, read_flight, write_example
from sloshpy.flight import Phase, Trajectory, assess_flight
from sloshpy.report import flight_report_html, write_flight_report


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Return a flight of two phases: at the first slosh ahead of the c.g. grows, at the second nothing does."""
    case = read_case(write_example("upper_stage", tmp_path_factory.mktemp("stage")))
    v, tank = case.vehicle, case.vehicle.tanks[0]
    share = np.linspace(1.0, 0.98, 3)
    moved = tank.model_copy(update={"station": np.array([9.0, 8.5, 8.0])})
    burning = case.model_copy(update={"vehicle": v.model_copy(update={"mass": v.mass * share, "tanks": (moved,)})})
    aft = tank.model_copy(update={"station": -9.0})
    other = case.model_copy(update={"vehicle": v.model_copy(update={"mass": 12e3, "tanks": (aft,)})})
    phases = (
        Phase(
            name="boost", time=np.array([0.0, 10.0, 20.0]), case=burning, schedules=(("vehicle.mass", 'table "x", y'),)
        ),
        Phase(name="sustain", time=np.array([20.0, 30.0]), case=other),
    )
    return assess_flight(Trajectory(name="flight <of> two & more", phases=phases), cycles=1)


@pytest.fixture(scope="module")
def page(flown):
    return Page(flight_report_html(flown))


def test_the_page_is_whole_and_needs_nothing_from_outside(page, flown):
    assert page.open == []
    assert not [link for link in page.links if not link.startswith("#")]
    assert "script" not in page.tags
    assert page.tags.count("svg") == 7
    assert "flight <of> two & more" in page.words
    assert flight_report_html(flown) == flight_report_html(flown)


def test_verdict_worst_windows_phases_and_events_are_told(page, flown):
    assert flown.verdict.upper() in page.words
    for one in flown.worst:
        assert one.criterion in page.words
        assert one.shown in page.words
    assert f"{flown.windows[0].factor:.4g}" in page.words
    assert "boost 0 to 20 s 3 LOX" in page.words
    assert "something leaves" in page.words  # 15680 to 12000 kg at 20 s
    assert "Damping required of LOX" in page.words
    assert "vehicle.mass M vehicle mass with engines and sloshing fluid 16000 kg" in page.words


def test_a_flight_without_limit_cycles_says_so(flown):
    linear = assess_flight(Trajectory(name="x", phases=flown.trajectory.phases[1:]), cycles=0)
    words = Page(flight_report_html(linear)).words
    assert "NO VERDICT" in words
    assert "Not drawn: limit cycles were not asked for" in words


def test_the_json_is_the_review_in_si(flown):
    told = json.loads(flown.to_json(), parse_constant=lambda text: pytest.fail(text))
    assert (told["name"], told["verdict"]) == (flown.trajectory.name, flown.verdict)
    assert [len(phase["times"]) for phase in told["phases"]] == [3, 2]
    for phase, review in zip(told["phases"], flown.reviews, strict=True):
        for k, moment in enumerate(phase["times"]):
            tank = moment["tanks"][0]
            assert moment["time"] == review.time[k]
            assert tank["station"] == pytest.approx(float(review.phase.cases[k].vehicle.tanks[0].station))
            assert tank["required_damping"] == pytest.approx(float(review.required[0].required[k]))
            assert moment["stable"] is bool(review.margins.growth[k] < 0.0)
            whole = json.loads(review.assessments[k].to_json())
            assert moment["limit_cycles"] == whole["limit_cycles"]
            assert moment["verdict"] == whole["verdict"]
    assert told["growth_windows"][0]["factor"] == pytest.approx(np.exp(told["growth_windows"][0]["exponent"]))
    assert told["events"][0]["carries"] is False
    units = {one["criterion"]: one["unit"] for one in told["worst"]}
    assert units["LOX: limit cycle, engine"] == "rad"
    assert {one["met"] for one in told["worst"]} <= {True, False, None}


def test_files_and_schedules_of_a_flight_file_are_named(tmp_path):
    flight = read_flight(write_example("two_stage_ascent", tmp_path))
    names = {one.file: one.sha256 for one in flight.files}
    assert set(names) >= {
        "two_stage_ascent.toml",
        "two_stage_ascent/second_stage.csv",
        "two_stage_ascent/first_lox.toml",
    }
    assert len(names) == 10
    assert all(re.fullmatch("[0-9a-f]{64}", digest) for digest in names.values())
    assert dict(flight.phases[0].schedules)["vehicle.mass"] == 'table "first stage", monotone cubic between rows'
    first, second = flight.crossings
    assert first.carries
    assert first.changes == ("other filters",)
    assert not second.carries
    assert "5 s lie between the phases" in second.barriers[0]


def test_a_report_goes_nowhere_or_whole(flown, tmp_path):
    path = write_flight_report(flown, tmp_path / "flight.html")
    assert path.read_text(encoding="utf-8") == flight_report_html(flown)
    assert [one.name for one in tmp_path.iterdir()] == ["flight.html"]
