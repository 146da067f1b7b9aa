"""The command line: every command answers, draws, and refuses in the one error form with exit status 2."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from sloshpy.files import write_example


@pytest.fixture
def case(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return write_example("upper_stage", tmp_path)


def changed(case: Path, old: str, new: str) -> Path:
    text = case.read_text(encoding="utf-8")
    assert old in text
    path = case.with_name("changed.toml")
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def test_assess_says_pass_with_the_papers_numbers_and_exits_0(run, case):
    status, out, err = run("assess", case)
    assert (status, err) == (0, "")
    for number in (
        "PASS",
        "13.1836 m behind",
        "9.3750 m ahead",
        "4.7358 %",
        "4.978-5.334 mrad",
        "0.4736 m",
        "170.9 ms",
    ):
        assert number in out


def test_json_is_one_object_with_the_same_verdict(run, case):
    status, out, _ = run("assess", case, "--json")
    review = json.loads(out)
    assert status == 0
    assert review["verdict"] == "pass"
    assert review["tanks"][0]["required_damping"] == pytest.approx(0.047358, abs=1e-6)


def test_a_criterion_that_is_not_met_exits_1(run, case):
    status, out, _ = run("assess", changed(case, '"0.5 deg"', '"0.2 deg"'))
    assert status == 1
    assert out.startswith("FAIL")


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--damping", "4.8%", "+1.0183"),
        ("--damping", "LOX=4.8 %", "+1.0183"),
        ("--damping", "0.048", "+1.0183"),
        ("--amplitude", "0.48 m", "+1.0183"),
        ("--amplitude", "LOX=48cm", "+1.0183"),
        ("--damping", "1%", "UNSTABLE, nichols disc margin -1.2892"),
    ],
)
def test_the_loop_is_read_at_the_damping_or_amplitude_asked_for(run, case, option, value, said):
    _, out, err = run("assess", case, option, value)
    assert said in out, err


@pytest.mark.parametrize(
    "words",
    [
        ("bode",),
        ("nichols", "--damping", "1%,3%,4.8%"),
        ("gain",),
        ("sweep",),
        ("locus",),
        ("danger-zone",),
        ("danger-zone", "--all"),
        ("limit-cycle",),
        ("growth",),
        ("map",),
        ("simulate", "--duration", "60 s"),
        ("simulate", "--degraded", "--duration", "60 s"),
    ],
    ids=" ".join,
)
def test_a_command_prints_and_draws_beside_the_case(run, case, words):
    status, out, err = run(words[0], case, *words[1:])
    assert (status, err) == (0, "")
    figure = Path(out.strip().splitlines()[-1].removeprefix("figure: "))
    assert figure.parent == case.parent
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert len(out.splitlines()) >= 3


def test_one_tank_and_all_of_them_exclude_each_other(run, case):
    status, _, err = run("danger-zone", case, "--all", "--tank", "LOX")
    assert status == 2
    assert "exclude each other" in err


@pytest.mark.parametrize(("suffix", "start"), [("svg", b"<?xml"), ("pdf", b"%PDF"), ("png", b"\x89PNG")])
def test_the_suffix_chooses_the_format(run, case, suffix, start):
    status, _, _ = run("limit-cycle", case, "-o", case.with_name(f"figure.{suffix}"))
    assert status == 0
    assert case.with_name(f"figure.{suffix}").read_bytes().startswith(start)


def test_margins_of_every_mode_are_printed_with_status_by_stability(run, case):
    status, out, _ = run("margins", case)
    assert (status, "UNSTABLE" in out) == (1, True)
    status, out, _ = run("margins", case, "--damping", "4.8%")
    assert status == 0
    assert "stays stable within 5.50 dB, or within 34.1 deg" in out  # alpha 0.613
    assert "driven by" in out


def test_two_axes_are_told_from_one_case_or_two(run, case):
    status, out, _ = run("axes", case)
    assert status == 0
    assert "circular limit cycle at 0.3394 Hz, attracts: LOX 0.1905 x 0.1905 m" in out
    weak = changed(case, "[autopilot]", '[autopilot]\ngain = "-1 dB"')
    assert "elliptic" in run("axes", case, weak)[1]


def test_the_exact_orbit_is_told_with_its_multipliers(run, case):
    status, out, _ = run("orbit", case)
    assert status == 0
    assert "0.2244 m" in out


def test_noise_is_told_as_rms(run, case):
    text = case.read_text(encoding="utf-8")
    case.write_text(
        re.sub(r'law = "power"\nslope = .*\nexponent = .*', 'law = "constant"\nratio = 0.06', text), "utf-8"
    )
    status, out, _ = run("noise", case, "--engine", "0.1 deg")
    assert status == 0
    assert "LOX slosh" in out
    assert "damped 6 %" in out


def test_report_and_figures_are_written(run, case):
    status, _, _ = run("assess", case, "--report", "review.html", "--figures", "figures")
    assert status == 0
    assert "Hypothetical large upper stage" in Path("review.html").read_text(encoding="utf-8")
    assert len(list(Path("figures").glob("*.png"))) >= 6


def test_validate_schema_example_and_version_answer(run, case, monkeypatch, tmp_path):
    assert "valid" in run("validate", case)[1]
    assert json.loads(run("schema")[1])["properties"]["tank"]
    assert "upper_stage" in run("example")[1].splitlines()
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    assert run("example", "upper_stage")[0] == 0
    assert Path("upper_stage.toml").exists()
    assert run("--version")[1].strip().count(".") == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("assess", "missing.toml"), "missing.toml"),
        (("assess", "upper_stage.toml", "--damping", "4.8"), "4.8"),
        (("assess", "upper_stage.toml", "--damping", "LH2=1%"), "tanks: LOX"),
        (("assess", "upper_stage.toml", "--damping=-1%"), "-1%"),
        (("assess", "upper_stage.toml", "--amplitude", "0.2"), "no unit"),
        (("assess", "upper_stage.toml", "--amplitude", "0.2 s"), "a time"),
        (("assess", "upper_stage.toml", "--amplitude=-0.2 m"), "-0.2 m"),
        (("assess", "upper_stage.toml", "--damping", "1%", "--amplitude", "1 m"), "exclude"),
        (("bode", "upper_stage.toml", "--tank", "LH2"), "LH2"),
        (("bode", "upper_stage.toml", "--damping", "1%,x"), "x"),
        (("bode", "upper_stage.toml", "-o", "figure.docx"), "docx"),
        (("bode", "upper_stage.toml", "-o", "no/such/folder/figure.png"), "figure.png"),
        (("simulate", "upper_stage.toml", "--duration", "0 s"), "duration"),
        (("simulate", "upper_stage.toml", "--duration", "20"), "no unit"),
        (("simulate", "upper_stage.toml", "--delay=-1 s"), "delay"),
        (("simulate", "upper_stage.toml", "--gain", "2"), "dB"),
        (("simulate", "upper_stage.toml", "--gust", "9 m/s"), "aerodynamics"),
        (("simulate", "upper_stage.toml", "--gust", "9 m/s", "--gust-duration", "0 s"), "must be > 0 s"),
        (("noise", "upper_stage.toml"), "--wind"),
        (("noise", "upper_stage.toml", "--engine", "0.1"), "no unit"),
        (("noise", "upper_stage.toml", "--engine", "0.1 deg", "--low", "9 Hz"), "low < high"),
        (("noise", "upper_stage.toml", "--engine", "0.1 deg"), "by itself"),
        (("example", "no such"), "upper_stage"),
        (("example", "upper_stage"), "already"),
        (("assess",), "case"),
        (("asses", "upper_stage.toml"), "asses"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_what_is_wrong_is_told_on_standard_error_with_status_2_and_nothing_written(run, case, words, said):
    before = sorted(case.parent.iterdir())
    status, out, err = run(*words)
    assert status == 2
    assert said in err
    assert err.startswith("error: ")
    assert "Traceback" not in out + err
    assert sorted(case.parent.iterdir()) == before


def test_every_fault_of_a_file_is_told_with_its_line(run, case):
    bad = changed(case, 'mass = "16000 kg" ', 'mass = "-16000 kg" ')
    bad.write_text(bad.read_text(encoding="utf-8").replace('cg = "6 m"', "cg = 6"), encoding="utf-8")
    status, _, err = run("assess", bad)
    assert status == 2
    assert err.count("error: ") == 2
    assert "changed.toml:12" in err


@pytest.mark.parametrize(
    ("words", "absent"),
    [
        (["--help"], ["scipy.signal", "matplotlib", "control", "pandas", "xarray", "scipy.optimize"]),
        (["assess", "upper_stage.toml"], ["scipy.signal", "matplotlib", "control", "pandas", "xarray"]),
        (
            ["assess", "upper_stage.toml", "--report", "r.html"],
            ["scipy.signal", "matplotlib.pyplot", "control", "xarray"],
        ),
    ],
    ids=["help", "assess", "report"],
)
def test_heavy_libraries_are_not_loaded_before_they_are_used(case, words, absent):
    code = (
        "import sys; sys.argv = ['sloshpy', *sys.argv[1:]]\n"
        "from sloshpy.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "print('LOADED', *[m for m in sys.modules if m.count('.') < 2])"
    )
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True)
    loaded = done.stdout.rsplit("LOADED", 1)[1].split()
    assert "numpy" in loaded
    assert not set(absent) & set(loaded)


def test_a_neutral_loop_has_nothing_to_verify(run, case):
    """Without slosh damping and with the mass at the centre of percussion the slosh pole stays on the axis."""
    text = case.read_text(encoding="utf-8")
    text = text.replace('station = "9 m"', 'station = "15.375 m"')
    case.write_text(text, encoding="utf-8")
    status, out, _ = run("verify", case)
    assert (status, "neutral" in out) == (1, True)
