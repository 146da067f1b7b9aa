"""The decay command, and the walk from a sub-scale record to a case file to its assessment."""

import json

import numpy as np
import pytest

import synthetic_decay
from sloshpy.assess import assess
from sloshpy.damping import TableDamping
from sloshpy.files import example_record_names, read_case, write_example

TOLD = ("--column", "wave", "--amplitude", "wave", "--wave-per-displacement", "1.54", "--frequency-hint", "0.96Hz")


@pytest.fixture
def record(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return write_example("subscale_decay", tmp_path)


def test_the_shipped_record_is_what_its_script_makes_and_says_that_it_is_synthetic(record):
    text = record.read_text(encoding="utf-8")
    assert text.startswith("# SYNTHETIC")
    assert text.splitlines()[:9] == synthetic_decay.text().splitlines()[:9]
    shipped = np.loadtxt(record, delimiter=",", comments="#", skiprows=8)
    np.testing.assert_allclose(shipped, synthetic_decay.table(), atol=0.1001)  # one step where a rounding falls else
    assert example_record_names() == ["subscale_decay"]


def test_from_record_to_case_file_to_assessment(run, record, tmp_path):
    status, out, err = run("decay", record, *TOLD, "--radius", "0.5m", "--full-radius", "2.5m")
    assert (status, err) == (0, "")
    assert record.with_name("subscale_decay-decay.png").stat().st_size > 10_000
    line = next(line for line in out.splitlines() if line.startswith("damping = "))
    stage = write_example("upper_stage", tmp_path)
    text = stage.read_text(encoding="utf-8")
    low, high = text.index("[tank.damping]"), text.index("[autopilot]")
    mine = tmp_path / "mine.toml"
    mine.write_text(text[:low] + line + "\n\n" + text[high:], encoding="utf-8")
    case = read_case(mine)
    law = case.vehicle.tanks[0].damping
    assert isinstance(law, TableDamping)
    # the truth: 0.5 1/m in the model is 0.1 1/m in the full tank, the paper's slope
    np.testing.assert_allclose(law.tested_ratio, 0.1 * law.tested_amplitude, rtol=0.01)
    review, paper = assess(case), assess(read_case(stage))
    assert review.verdict == paper.verdict == "pass"
    found, known = (r.tanks[0].limit_cycle.slosh_amplitude for r in (review, paper))
    assert found == pytest.approx(known, rel=0.01)
    assert law.smallest_amplitude < found < law.largest_amplitude


def test_json_holds_the_numbers_and_the_line_and_draws_only_where_asked(run, record):
    status, out, _ = run("decay", record, *TOLD, "--json")
    said = json.loads(out)
    assert status == 0
    assert not record.with_name("subscale_decay-decay.png").exists()
    assert said["law"] == "power"
    assert said["estimates"]["slope"]["value"] == pytest.approx(0.5, rel=0.01)
    assert said["estimates"]["slope"]["low"] < 0.5 < said["estimates"]["slope"]["high"]
    frequency = said["estimates"]["frequency"]
    assert frequency["low"] < synthetic_decay.FREQUENCY < frequency["high"]
    assert said["damping"].startswith('damping = { law = "table"')
    assert said["formula"].startswith('damping = { law = "power"')
    run("decay", record, *TOLD, "--json", "-o", "decay.svg")
    assert record.with_name("decay.svg").exists()


def test_without_a_scale_there_is_no_line_and_the_reason_is_said(run, record):
    status, out, _ = run("decay", record, "--column", "wave", "--amplitude", "wave", "--frequency-hint", "0.96Hz")
    assert status == 1
    assert "no damping line: the damping depends on the amplitude" in out


def test_a_tank_file_gives_scale_and_frequency(run, record):
    tank = record.with_name("model.toml")
    tank.write_text(
        'name = "model"\nfill = "1.5 m"\nacceleration = "9.81 m/s^2"\n[liquid]\ndensity = "998 kg/m^3"\n'
        '[shape]\nkind = "cylinder"\nradius = "0.5 m"\nheight = "2 m"\n',
        encoding="utf-8",
    )
    status, out, _ = run("decay", record, "--column", "wave", "--amplitude", "wave", "--tank", tank, "--json")
    said = json.loads(out)
    assert status == 0
    assert said["per_displacement"] == pytest.approx(1.54, rel=1e-3)  # of a deep cylinder
    assert not any("no frequency hint" in note for note in said["notes"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("none.csv", *TOLD), "does not exist"),
        (("subscale_decay.csv", "--column", "wave"), "say what \"wave\" is: --amplitude wave or displacement"),
        (("subscale_decay.csv", "--column", "height", "--amplitude", "wave"), "is not in the file"),
        (("subscale_decay.csv", "--column", "wave", "--amplitude", "force"), "is no force"),
        (("subscale_decay.csv", *TOLD[:-1], "2Hz"), "contradicts the frequency hint"),
        (("subscale_decay.csv", *TOLD[:-1], "5 m"), "must be a frequency"),
        (("subscale_decay.csv", *TOLD, "--end", "3s"), "must be at least 5 cycles"),
        (("subscale_decay.csv", *TOLD, "--start", "99s"), "leaves no samples"),
        (("subscale_decay.csv", *TOLD, "--force-per-displacement", "4 N/m"), "does not belong to a wave"),
        (("subscale_decay.csv", *TOLD, "--full-radius", "2 m"), "needs --radius"),
        (("subscale_decay.csv", *TOLD, "--radius", "0 m"), "must be > 0 m"),
        (("subscale_decay.csv", *TOLD, "--seed", "-1"), "must be >= 0"),
        (("subscale_decay.csv", *TOLD, "-o", "x.jpg"), "must end in"),
        (("subscale_decay.csv", *TOLD, "-o", "subscale_decay.csv"), "must end in"),
    ],
)  # fmt: skip
def test_decay_refuses_with_status_2(run, record, words, said):
    status, out, err = run("decay", *words)
    assert (status, out) == (2, "")
    assert said in err


@pytest.mark.parametrize(("radius", "percent"), [("0.8m", None), ("0.5m", 22), ("0.23m", 48), ("0.2m", 55)])
def test_slosh_beyond_15_percent_of_the_radius_is_a_caution_and_beyond_half_of_it_is_refused(
    run, record, radius, percent
):
    # released with 0.11 m of slosh-mass displacement: of 0.5 m that is 22 %
    status, out, err = run("decay", record, *TOLD, "--radius", radius)
    if percent is None:
        assert (status, err) == (0, "")
        assert "of the tank radius" not in out
    elif percent < 50:
        assert status == 0
        assert f"caution: slosh of 0.11 m is {percent} % of the tank radius; the spring-mass model is less valid" in out
    else:
        assert (status, out) == (2, "")
        assert (
            f"is {percent} % of the tank radius of 0.2 m: no spring-mass describes that. Cure: check the units" in err
        )
        assert not record.with_name("subscale_decay-decay.png").exists()


@pytest.mark.parametrize(("radius", "status"), [("0.2 m", 2), ("0.5 m", 0)])
def test_the_tank_file_given_bounds_the_slosh_too(run, record, tmp_path, radius, status):
    tank = tmp_path / "tested.toml"
    tank.write_text(
        f'name = "t"\nfill = "0.5 m"\nacceleration = "9.80665 m/s^2"\n\n[liquid]\ndensity = "1000 kg/m^3"\n\n'
        f'[shape]\nkind = "cylinder"\nradius = "{radius}"\nheight = "2 m"\n',
        encoding="utf-8",
    )
    words = ("--column", "wave", "--amplitude", "wave", "--frequency-hint", "0.96Hz", "--tank", tank, "--json")
    found, out, err = run("decay", record, *words)
    assert found == status
    if status:
        assert "of the tank radius of 0.2 m" in err
    else:
        assert any(note.startswith("caution: slosh of") for note in json.loads(out)["notes"])
