"""A dispersed flight: one draw holds for all times, each assessed as by a campaign of its own, bit for bit."""

import json
from dataclasses import replace

import numpy as np
import pytest
from uncertain import factor, short_flight, stage

from cases import paper_case
from sloshpy.cli import main
from sloshpy.damping import PowerDamping
from sloshpy.dispersion import Linear, Moment, against_time, campaign_dataset, findings, run_campaign
from sloshpy.dispersion.rows import Status
from sloshpy.errors import InputError
from sloshpy.files import read_dispersion
from sloshpy.report import write_campaign_figures
from sloshpy.vehicle import SloshMass

OTHER = SloshMass(name="b", slosh_mass=300.0, station=4.0, frequency=2.6, damping=PowerDamping(slope=0.2))
EARLY = [paper_case(vehicle={"mass": m}, more=(OTHER,)) for m in (1.7e4, 1.65e4)]
LATE = [paper_case(vehicle={"mass": m}) for m in (1.6e4, 1.5e4, 1.4e4)]


def ascent(analysis=None, **more):
    """Five moments in two phases; the first has a second tank."""
    moments = [Moment(phase="early", time=t, case=c) for t, c in zip((0.0, 5.0), EARLY, strict=True)]
    moments += [Moment(phase="late", time=t, case=c) for t, c in zip((5.0, 10.0, 15.0), LATE, strict=True)]
    parameters = (factor("vehicle.inertia", 0.05), factor("tank.b.frequency", 0.05), factor("tank.*.damping", 0.2))
    return stage(analysis, case=EARLY[0], parameters=parameters, flight=tuple(moments), **more)


def test_every_time_of_a_flight_is_a_campaign_of_its_own():
    d = ascent()
    whole = run_campaign(d, 12, 3)
    assert len(set(whole.draws()[:, 0])) == 12
    margin, engine = [], []
    for k, moment in enumerate(d.flight):
        own = d.parameters if k < 2 else (d.parameters[0], d.parameters[2])
        alone = run_campaign(replace(d, case=moment.case, flight=(), parameters=own), 12, 3)
        for column in alone.columns[:-1]:
            assert np.array_equal(whole.column(f"{column.name}[{k}]"), alone.column(column.name)), (k, column.name)
        margin.append(alone.column("disc_margin"))
        engine.append(alone.column("engine.LOX"))
    assert np.array_equal(whole.column("disc_margin"), np.min(margin, axis=0))
    assert np.array_equal(whole.column("engine.LOX"), np.max(engine, axis=0))
    times = np.array([0.0, 5.0, 5.0, 10.0, 15.0])
    assert np.array_equal(whole.column("disc_margin_time"), times[np.argmin(margin, axis=0)])
    assert np.array_equal(whole.column("slosh.b"), np.maximum(whole.column("slosh.b[0]"), whole.column("slosh.b[1]")))
    assert run_campaign(d, 12, 3, workers=1).digest == whole.digest


def test_percentiles_against_time_are_those_of_each_time():
    d = ascent(Linear(amplitude=0.5, required=False), coverage=0.9)
    campaign = run_campaign(d, 40, 3)
    found = against_time(campaign, "disc_margin")
    assert found.time.tolist() == [0.0, 5.0, 5.0, 10.0, 15.0]
    assert found.phase == ("early", "early", "late", "late", "late")
    values = np.stack([campaign.column(f"disc_margin[{k}]") for k in range(5)])
    assert np.array_equal(found.percentile[0], np.sort(values, axis=1)[:, ::-1][:, 19])  # half of 40 are no worse
    # of 40, one worse is allowed for 90 % at 90 %: 1 - 0.9^40 - 40 0.1 0.9^39 = 0.92; none for 99 %
    assert np.array_equal(found.bound[1], np.sort(values, axis=1)[:, 1])
    assert np.all(np.isnan(found.bound[2]))
    assert np.all(np.isnan(found.percentile[2:]))  # 40 flights have no 99th percentile, but a worst
    assert "90 % of all flights, at 90 % confidence: disc margin >= " in found.message
    assert len(found.columns()["time [s]"]) == 5
    with pytest.raises(ValueError, match="no number against time"):
        against_time(campaign, "engine.LOX")
    with pytest.raises(ValueError, match="not of a flight"):
        against_time(run_campaign(stage(), 5, 1), "disc_margin")
    said = str(findings(campaign))
    assert "each draw holds for the whole flight: 5 times" in said
    assert "tank.b.frequency is not in late" in said
    assert "[3]" not in said
    assert campaign_dataset(campaign)["disc_margin[3]"].attrs["long_name"] == "10 s, late"


def test_a_draw_that_fails_at_one_time_is_a_lost_flight_with_its_time():
    heavy = paper_case(tank={"slosh_mass": 5000.0, "station": 12.0})
    d = ascent(Linear(amplitude=0.5, required=False))
    d = replace(
        d,
        flight=(d.flight[2], Moment(phase="late", time=10.0, case=heavy)),
        parameters=(factor("tank.LOX.slosh_mass", 0.99),),
    )
    campaign = run_campaign(d, 40, 4)
    lost = np.flatnonzero(campaign.status == Status.FAILED)
    assert 0 < len(lost) < 40
    assert np.array_equal(lost, np.flatnonzero(np.isnan(campaign.column("disc_margin[1]"))))
    assert np.all(np.isfinite(campaign.column("disc_margin[0]")))
    assert np.all(np.isnan(campaign.column("disc_margin")[lost]))
    assert campaign.reasons[int(lost[0])].startswith("10 s, late: ")
    assert findings(campaign).criteria[0].broken >= len(lost)


def test_figures_and_tables_over_time_are_written(tmp_path):
    import pandas as pd

    campaign = run_campaign(ascent(Linear(amplitude=0.5, required=False)), 25, 3)
    names = {path.name for path in write_campaign_figures(campaign, tmp_path / "f")}
    assert names == {f"dispersed_{x}.{s}" for x in ("disc_margin", "growth") for s in ("csv", "png")}
    table = pd.read_csv(tmp_path / "f" / "dispersed_disc_margin.csv")
    assert table["time [s]"].tolist() == [0.0, 5.0, 5.0, 10.0, 15.0]
    half = against_time(campaign, "disc_margin").percentile[0]
    assert np.array_equal(table["disc_margin 50 % of the flights drawn [1]"], half)


@pytest.fixture
def files(tmp_path):
    return short_flight(tmp_path, '[linear]\namplitude = "0.5 m"\nrequired_damping = false\n')


def test_a_file_that_names_a_flight_assesses_every_time(files, capsys):
    d = read_dispersion(files)
    assert [(m.time, m.phase, float(m.case.vehicle.mass)) for m in d.flight] == [
        (0.0, "coast", 16000.0),
        (10.0, "coast", 15600.0),
        (20.0, "coast", 15200.0),
    ]
    words = ["disperse", str(files), "--cases", "8", "--seed", "2", "--workers", "1"]
    with pytest.raises(SystemExit) as ended:
        main([*words, "--json", "--figures", str(files.with_name("f"))])
    assert ended.value.code == 1
    assert json.loads(capsys.readouterr().out)["cases"] == 8
    assert len(list(files.with_name("f").iterdir())) == 4
    with pytest.raises(SystemExit):
        main(["disperse", str(files), "--seed", "2", "--case", "3"])
    assert "disc_margin_time" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('flight = "short.toml"', 'flight = "short.toml"\ncase = "stage.toml"', "stands beside flight"),
        ('flight = "short.toml"', 'flight = "none.toml"', "none.toml"),
        ('"vehicle.mass"', '"tank.none.frequency"', "names no tank"),
        ("low = 0.98", 'as = "absolute"\nlow = "1 kg"', "changes along the flight"),
        ("required_damping = false", "required_damping = 3", "must be true or false"),
    ],
)
def test_faults_of_a_dispersed_flight_are_told(files, old, new, told):
    text = files.read_text()
    assert old in text
    text = text.replace(old, new)
    files.write_text(text.replace("high = 1.02", 'high = "3e4 kg"') if "absolute" in new else text)
    with pytest.raises(InputError, match=told):
        read_dispersion(files)
