"""A nonlinear campaign along a flight: each case one simulated flight, drawn, kept and judged as any other case."""

import json
from dataclasses import replace

import numpy as np
import pytest
from uncertain import factor, short_flight, stage

from cases import paper_case
from flying import AIR, LIMITED, SECOND, SOFT, WIDE, burn
from sloshpy.cli import main
from sloshpy.damping import PowerDamping
from sloshpy.dispersion import (
    Dispersion,
    Linear,
    Nonlinear,
    Parameter,
    Uniform,
    against_time,
    campaign_dataset,
    findings,
    fly_case,
    moments_of,
    read_campaign,
    rerun,
    run_campaign,
)
from sloshpy.dispersion.flown import drawn_flight
from sloshpy.dispersion.rows import Status
from sloshpy.errors import InputError
from sloshpy.files import read_dispersion, write_example
from sloshpy.flight import Phase, simulate_flight
from sloshpy.flight.fly_fast import fly_fast
from sloshpy.report import write_campaign_figures
from sloshpy.simulation import OneMinusCosine

LOX = {"radius": 2.5}
LAGS = (SOFT, WIDE)


LAW = PowerDamping(slope=0.1)


def ascent(law=LAW, **pilot):
    """Two phases that go over into each other, in air, and one behind a gap with a second tank."""
    own = {"law": law, "tank": LOX, "vehicle": {"aerodynamics": AIR}, **pilot}
    upper = burn(18.0, 24.0, 3, name="upper", law=law, tank=LOX, more=(SECOND,), **pilot)
    return burn(0.0, 8.0, name="early", **own), burn(8.0, 16.0, 4, name="late", **own), upper


USUAL = (
    factor("vehicle.mass", 0.03),
    factor("tank.*.damping", 0.2),
    factor("tank.RP.frequency", 0.05),
    factor("autopilot.rate_gain", 0.1),
    factor("run.initial_slosh", 0.5),
)
GUSTY = (*USUAL, Parameter(input="run.gust_start", distribution=Uniform(low=1.0, high=11.0), factor=False))
CALM, WINDY = Nonlinear(initial_slosh=0.2), Nonlinear(initial_slosh=0.1, gust_speed=20.0, gust_duration=5.0)


def flight(phases=None, analysis=WINDY, parameters=GUSTY, **more):
    own = ascent() if phases is None else phases
    moments = moments_of(own)
    return Dispersion(
        name="flown",
        case=moments[0].case,
        parameters=parameters,
        analysis=analysis,
        flight=moments,
        phases=own,
        **{"coverage": 0.9, **more},
    )


@pytest.fixture(scope="module")
def campaign():
    return run_campaign(flight(), 45, 3)


def by_hand(draw):
    """The flight of one draw of USUAL, every number put in where it stands."""
    mass, damping, frequency, gain, _ = draw
    law = PowerDamping(slope=0.1 * damping)
    pilot = {"rate_gain": 0.14 * gain}
    found = []
    for start, end, count, more in ((0.0, 8.0, 5, ()), (8.0, 16.0, 4, ()), (18.0, 24.0, 3, (SECOND,))):
        s = np.linspace(start, end, count) / 24.0
        vehicle = {"mass": mass * 16e3 * (1.0 - 0.4 * s)} | ({} if more else {"aerodynamics": AIR})
        change = {"frequency": SECOND.frequency * frequency, "damping": PowerDamping(slope=0.2 * damping)}
        tanks = tuple(t.model_copy(update=change) for t in more)
        found.append(burn(start, end, count, law=law, tank=LOX, vehicle=vehicle, more=tanks, name=str(start), **pilot))
    return found


def test_a_case_is_the_plain_simulation_of_its_draw():
    done = run_campaign(flight(analysis=CALM, parameters=USUAL), 3, 8)
    for k, draw in enumerate(done.draws()):
        early, late, upper = by_hand(draw)
        slosh = 0.2 * draw[-1]
        first, second = simulate_flight((early, late), np.array([slosh])), simulate_flight(upper, np.full(2, slosh))
        lox = max(slosh, np.max(first.peaks(0)[1]), np.max(second.peaks(0)[1]))
        assert done.column("slosh_peak.LOX")[k] == pytest.approx(lox, rel=1e-9)
        top, size = second.peaks(1)
        size, top = np.append(size, slosh), np.append(top, 18.0)
        assert done.column("slosh_peak.RP")[k] == pytest.approx(np.max(size), rel=1e-9)
        assert done.column("slosh_peak_time.RP")[k] == pytest.approx(top[np.argmax(size)], abs=1e-6)
        top, size = first.peaks(0)
        late = np.append(size[top >= 44.0 / 3.0], np.abs(first.slosh[-1, 0]))  # the last window of 8, 32/3, 40/3, 16 s
        assert done.column("slosh_peak.LOX[8]")[k] == pytest.approx(np.max(late), rel=1e-9)
        tvc = max(np.max(np.abs(first.tvc)), np.max(np.abs(second.tvc)))
        assert done.column("engine_peak")[k] == pytest.approx(tvc, rel=2e-3)  # a step next to it
        assert done.column("engine_peak")[k] >= tvc
        ended = second.slosh[second.time >= 24.0 - 2.0 * np.pi / (2.0 * np.sqrt(1.8)), 0]
        assert done.column("slosh_end.LOX")[k] == pytest.approx(0.5 * np.ptp(ended), rel=2e-3)
    assert np.array_equal(done.column("slosh_radius.LOX"), done.column("slosh_peak.LOX") / 2.5)
    assert np.array_equal(done.column("slosh_radius.RP"), done.column("slosh_peak.RP"))


def test_a_flight_that_stands_still_is_the_campaign_of_its_case():
    """Another kernel, modal and with the delay by Pade, of the same draws."""
    case = paper_case(LAW, vehicle={"aerodynamics": AIR}, tank=LOX, delay=0.03)
    how = Nonlinear(duration=150.0, initial_slosh=0.2, gust_speed=20.0, gust_duration=5.0, gust_start=3.0, gain=1.2)
    parameters = (factor("vehicle.mass", 0.03), factor("tank.LOX.damping", 0.2), factor("run.gust_speed", 0.5))
    of_case = run_campaign(Dispersion(name="case", case=case, parameters=parameters, analysis=how), 8, 4)
    still = Phase(name="still", time=np.array([0.0, 40.0, 150.0]), case=case)
    flown = run_campaign(flight((still,), how, parameters), 8, 4)
    assert np.array_equal(of_case.draws(), flown.draws())
    for one, other in (
        ("slosh_peak.LOX", "slosh_peak.LOX"),
        ("engine_peak", "engine_peak"),
        ("slosh_amplitude.LOX", "slosh_end.LOX"),
        ("engine_amplitude", "engine_end"),
    ):
        # 5e-4 of a peak that falls into a gust, of the case campaign's step
        settled = np.isfinite(of_case.column(one))
        assert np.sum(settled) >= 6
        assert flown.column(other)[settled] == pytest.approx(of_case.column(one)[settled], rel=1e-3), one


def test_the_greatest_of_the_flight_is_the_greatest_of_its_windows(campaign):
    times = np.array([m.time for m in campaign.dispersion.flight])
    for name in ("slosh_peak.LOX", "engine_peak"):
        windows = np.stack([campaign.column(f"{name}[{k}]") for k in range(len(times))])
        assert np.array_equal(np.max(windows, axis=0), campaign.column(name))
        where = campaign.column("slosh_peak_time.LOX" if "LOX" in name else "engine_peak_time")
        assert np.max(np.abs(times[np.argmax(windows, axis=0)] - where)) <= 1.5
    assert [c.name for c in campaign.columns if c.name.startswith("slosh_peak.RP[")] == [
        f"slosh_peak.RP[{k}]" for k in (9, 10, 11)
    ]


def test_gust_and_initial_slosh_act(campaign):
    d = campaign.dispersion
    start = campaign.draws()[:, d.inputs.index("run.gust_start")]
    draw = campaign.draws()[0]
    k = int(np.flatnonzero([p.input == "run.initial_slosh" for p in d.parameters])[0])
    own = by_hand(draw[: len(USUAL)])[:2]
    alone = fly_fast(own, np.array([0.1 * draw[k]]), OneMinusCosine(size=20.0, start=start[0], duration=5.0))
    assert np.max(np.abs(alone.tvc)) == pytest.approx(campaign.column("engine_peak")[0], rel=1e-3)
    calm = run_campaign(replace(d, analysis=replace(WINDY, gust_speed=0.0), parameters=USUAL), 45, 3)
    ends = (1.0, 3.0, 5.0, 7.0, 8.0)  # of the windows of the first phase
    for n, end in enumerate(ends):
        one, other = campaign.column(f"engine_peak[{n}]"), calm.column(f"engine_peak[{n}]")
        assert np.array_equal(one[end <= start], other[end <= start])
        assert np.all(one[end > start + 1.0] != other[end > start + 1.0])
    assert np.all(campaign.column("engine_peak") > 1.5 * calm.column("engine_peak"))
    still = calm.column("slosh_peak.LOX[0]")
    assert np.max(still / (0.1 * calm.draws()[:, k])) == pytest.approx(1.0, rel=1e-12)  # its greatest at the start
    drivers = dict(findings(calm).criteria[0].drivers)
    assert findings(calm).criteria[0].column.name == "slosh_radius.LOX"
    assert drivers["run.initial_slosh"].estimate > 0.9


def test_the_bits_depend_on_nothing_but_the_case(campaign, tmp_path):
    d = campaign.dispersion
    stored = run_campaign(d, 45, 3, store=tmp_path / "s", workers=2)
    assert stored.digest == campaign.digest
    assert run_campaign(d, 45, 3, workers=4).digest == campaign.digest
    blocks = sorted((tmp_path / "s").rglob("*"), key=lambda p: p.name)
    blocks = [p for p in blocks if p.is_file() and p.read_bytes().startswith(b"sloshpy block")]
    assert len(blocks) == 3  # 20, 20 and 5
    blocks[1].unlink()
    with pytest.raises(InputError, match="holds 25 of 45"):
        read_campaign(d, tmp_path / "s")
    assert run_campaign(d, 45, 3, store=tmp_path / "s", resume=True, workers=1).digest == campaign.digest
    row = rerun(d, 3, 31)
    assert np.array_equal(row.values[0], campaign.values[31], equal_nan=True)
    assert row.status[0] == campaign.status[31]


def test_a_flight_that_diverges_or_leaves_its_data_is_counted_as_worst_and_listed():
    gain = Parameter(input="autopilot.rate_gain", distribution=Uniform(low=0.1, high=40.0), factor=False)
    wild = flight(ascent(delay=0.2), replace(CALM, initial_slosh=0.05), (gain,))
    done = run_campaign(wild, 12, 5)
    lost = np.flatnonzero(done.status == Status.DIVERGED)
    assert 0 < len(lost) < 12
    assert np.all(np.isposinf(done.column("engine_peak")[lost]))
    assert np.all(np.isposinf(done.column("slosh_peak.RP")[lost]))  # of the stretch that it never flew
    assert np.all(done.column("verdict")[lost] == -1.0)
    assert np.all(np.isfinite(done.column("slosh_peak.LOX[0]")))  # known before it diverged
    one = int(lost[np.argmax(done.draws()[lost, 0])])
    assert done.reasons[one].startswith("diverged at ")
    assert done.reasons[one].endswith((", early", ", late"))
    said = findings(done)
    assert said.lost == {"diverged": len(lost)}
    assert f"case {one}: diverged" in str(said)
    engine = next(c for c in said.criteria if c.column.name == "engine_peak")
    assert engine.broken >= len(lost)
    assert set(engine.worst) & set(lost.tolist())

    short = PowerDamping(slope=0.1, largest_amplitude=0.3)
    beyond = run_campaign(flight(ascent(short), CALM, USUAL), 12, 5)
    lost = np.flatnonzero(beyond.status == Status.FAILED)
    assert 0 < len(lost) < 12
    assert np.all(np.isnan(beyond.column("engine_peak")[lost]))
    assert all("beyond the damping data at " in beyond.reasons[k] for k in lost)
    assert np.all(np.isfinite(beyond.values[beyond.status == Status.OK]))


def test_a_draw_that_makes_no_vehicle_fails_alone():
    heavy = Parameter(input="tank.LOX.slosh_mass", distribution=Uniform(low=1.0, high=30.0))
    done = run_campaign(flight(analysis=CALM, parameters=(heavy,)), 8, 2)
    lost = np.flatnonzero(done.status == Status.FAILED)
    assert 0 < len(lost) < 8
    assert np.all(np.isnan(done.values[lost]))
    assert all(done.reasons[k] for k in lost)


def test_the_history_of_a_case_is_at_hand(campaign):
    early, upper = fly_case(campaign.dispersion, 3, 7)
    engine = max(np.max(np.abs(h.tvc)) for h in (early, upper))
    assert engine == pytest.approx(campaign.column("engine_peak")[7], rel=2e-3)
    assert upper.phases[0].name == "upper"
    assert (early.time[0], early.time[-1], upper.time[-1]) == (0.0, 16.0, 24.0)
    with pytest.raises(InputError, match="asked of a flight that is simulated"):
        fly_case(stage(), 3, 7)


def test_criteria_and_verdict_are_those_of_the_numbers(campaign):
    limits = {c.name: c.limit for c in campaign.columns if c.limit is not None}
    assert limits == {"slosh_radius.LOX": 0.15, "slosh_radius.RP": 0.15, "engine_peak": np.pi / 360.0, "verdict": 1}
    broken = campaign.column("engine_peak") > np.pi / 360.0
    for tank in ("LOX", "RP"):
        broken |= campaign.column(f"slosh_radius.{tank}") > 0.15
    assert np.array_equal(campaign.column("verdict"), np.where(broken, -1.0, 1.0))
    tight = flight(phases=tuple(replace(p, case=_limited(p.case, 1e-3)) for p in ascent()))
    harsh = run_campaign(tight, 10, 3)
    assert np.array_equal(harsh.column("verdict") == -1.0, harsh.column("engine_peak") > 1e-3)
    assert np.any(harsh.column("verdict") == -1.0)


def _limited(case, most):
    return case.model_copy(update={"criteria": case.criteria.model_copy(update={"tvc_amplitude": most})})


def test_what_is_said_of_a_flown_campaign(campaign, tmp_path):
    said = str(findings(campaign))
    assert "simulated from 0 s, 18 s on" in said
    assert "no oscillation is carried: 2 s lie between the phases" in said
    assert "tank.RP.frequency is not in early, late" in said
    bare = flight((burn(0.0, 8.0),), CALM, USUAL[:2])
    assert "not checked: slosh of LOX against the tank radius" in str(findings(run_campaign(bare, 2, 1)))
    found = against_time(campaign, "engine_peak")
    assert found.time.tolist() == [m.time for m in campaign.dispersion.flight]
    values = np.stack([campaign.column(f"engine_peak[{k}]") for k in range(12)])
    assert np.array_equal(found.percentile[0], np.sort(values, axis=1)[:, 22])
    assert against_time(campaign, "slosh_peak.RP").time.tolist() == [18.0, 21.0, 24.0]
    with pytest.raises(ValueError, match="no number against time"):
        against_time(campaign, "slosh_end.LOX")
    names = {path.name for path in write_campaign_figures(campaign, tmp_path)}
    assert names == {
        f"dispersed_{x}.{s}" for x in ("slosh_peak.LOX", "slosh_peak.RP", "engine_peak") for s in ("csv", "png")
    }
    assert campaign_dataset(campaign)["engine_peak[9]"].attrs["long_name"] == "greatest about 18 s, upper"


def test_what_cannot_be_flown_is_refused():
    d = flight()
    with pytest.raises(InputError, match="no phases that a simulation could go along"):
        run_campaign(replace(d, phases=()), 5, 1)
    with pytest.raises(InputError, match="from 0 s on: a flight is not simulated with a sampler"):
        run_campaign(flight(ascent(sample_time=0.02, delay=0.02), CALM, USUAL), 5, 1)
    felt = {"accelerometer_gain": 2e-3, "actuator": LIMITED}
    station = {"accelerometer_station": 8.0}
    switch = [
        burn(8.0 * k, 8.0 * k + 8.0, name=str(k), vehicle=station, filter=(f,), **felt) for k, f in enumerate(LAGS)
    ]
    with pytest.raises(InputError, match="other filters begin where an accelerometer is fed back"):
        run_campaign(flight(tuple(switch), CALM, USUAL[:2]), 5, 1)
    late = Parameter(input="run.gust_start", distribution=Uniform(low=1.0, high=12.5), factor=False)
    with pytest.raises(InputError, match=r"blow from 1 to 17.5 s .* there from 0 to 16 s"):
        run_campaign(flight(parameters=(*USUAL, late)), 5, 1)
    airless = burn(0.0, 8.0)
    with pytest.raises(InputError, match="where the flight has no air"):
        run_campaign(flight((airless,), replace(WINDY, gust_start=1.0), USUAL[:2]), 5, 1)
    run_campaign(replace(d, analysis=Linear(required=False), parameters=USUAL[:2], phases=()), 2, 1)  # as before


@pytest.fixture
def files(tmp_path):
    return short_flight(tmp_path, '[nonlinear]\ninitial_slosh = "0.1 m"\n')


def test_a_file_flies_from_the_command_line(files, capsys):
    words = ["disperse", str(files), "--seed", "2"]
    store = ["--store", str(files.with_name("s"))]
    with pytest.raises(SystemExit) as ended:
        main([*words, *store, "--cases", "6", "--workers", "1", "--json", "--figures", str(files.with_name("f"))])
    assert ended.value.code == 1  # so few show nothing
    said = json.loads(capsys.readouterr().out)
    assert {c["name"] for c in said["criteria"]} >= {"engine_peak", "verdict"}
    assert len(list(files.with_name("f").iterdir())) == 4
    with pytest.raises(SystemExit) as ended:
        main([*words, *store, "--case", "3"])
    assert ended.value.code == 0
    told = capsys.readouterr().out
    assert "slosh_peak_time.LOX" in told
    assert "the same bits as in the store" in told
    assert "[0]" not in told


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('initial_slosh = "0.1 m"', 'duration = "50 s"', "dispersed.toml:4: nonlinear duration.* a flight lasts from"),
        ('initial_slosh = "0.1 m"', 'gust_speed = "9 m/s"', "gust_speed.*acts by the aerodynamics"),
        ("[nonlinear]", "[nonlinear]\nstart = 3", "unknown key"),
        ("[nonlinear]\ninitial_slosh", "nonlinear = 3\n[linear]\namplitude", "must be a table"),
    ],
)
def test_faults_of_a_flown_file_are_told(files, old, new, told):
    text = files.read_text()
    assert old in text
    files.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=told):
        read_dispersion(files)


def test_a_sampled_flight_is_refused_by_its_file(files):
    stage = files.with_name("stage.toml")
    stage.write_text(stage.read_text().replace("[autopilot]", '[autopilot]\nsample_time = "20 ms"'))
    with pytest.raises(InputError, match=r"dispersed.toml:3: nonlinear.*not simulated with a sampler"):
        read_dispersion(files)


def test_the_shipped_ascent_flies(tmp_path):
    write_example("two_stage_ascent", tmp_path)
    d = read_dispersion(write_example("two_stage_ascent_flown", tmp_path))
    assert [[p.name for p in run] for run in d.stretches] == [
        ["first stage, soft filter", "first stage, wide filter"],
        ["second stage"],
    ]
    done = run_campaign(d, 2, 1)
    assert np.all(done.status == Status.OK)
    for k in range(2):
        for history in fly_case(d, 1, k):
            assert not history.stopped
        drawn = drawn_flight(d, done.draws()[k])
        plain = simulate_flight(drawn.phases[2], np.full(2, drawn.run["initial_slosh"]), end=175.0)
        fast = fly_fast(drawn.phases[2], np.full(2, drawn.run["initial_slosh"]))  # of the undispersed damping
        early = np.interp(plain.time, fast.time, fast.tvc)
        assert np.max(np.abs(plain.tvc - early)[:-1]) < 1e-11
    slosh = done.draws()[:, d.inputs.index("run.initial_slosh")] * 0.1
    assert done.column("slosh_peak.LOX[0]") == pytest.approx(slosh, rel=1e-12)
    assert done.column("slosh_radius.upper RP-1") == pytest.approx(done.column("slosh_peak.upper RP-1") / 1.2, rel=1e-9)
