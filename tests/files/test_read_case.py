"""A case file becomes the case that it describes, with its source."""

import hashlib
import math
from pathlib import Path

import numpy as np
import pytest
from good_case import GOOD, POWER

from sloshpy.case import Case
from sloshpy.damping import PowerDamping, SumDamping, TableDamping
from sloshpy.files import read_case

DATA = Path(__file__).parents[2] / "src" / "sloshpy" / "data"


def _read(folder: Path, text: str) -> Case:
    path = folder / "case.toml"
    path.write_bytes(text.encode())
    return read_case(path)


@pytest.mark.parametrize(("file", "slope"), [("upper_stage.toml", 0.1), ("upper_stage_printed_alpha.toml", 0.01)])
def test_the_shipped_stage_has_the_numbers_of_table_1(file: str, slope: float) -> None:
    case = read_case(DATA / file)
    v, a, c = case.vehicle, case.autopilot, case.criteria
    assert (v.mass, v.inertia, v.cg, v.thrust, v.vectored_thrust, v.drag) == (16000.0, 9e5, 6.0, 9e5, 9e5, 0.0)
    [tank] = v.tanks
    assert (tank.slosh_mass, tank.station, tank.frequency, tank.radius) == (1000.0, 9.0, 2.0, None)
    assert tank.damping == PowerDamping(slope=slope, exponent=1.0)
    assert (a.attitude_gain, a.rate_gain, a.gain, a.delay, a.actuator, a.filter) == (0.08, 0.14, 1.0, 0.0, None, ())
    assert (c.gain_margin, c.phase_margin, c.tvc_amplitude) == pytest.approx(
        (10**0.3, math.pi / 6, math.pi / 360), rel=1e-15
    )
    assert (c.disc_margin, c.limit_cycle_disc_margin) == (1.0, 1.1)


def test_the_slope_corrected_gives_the_papers_damping_at_its_amplitude() -> None:
    [tank] = read_case(DATA / "upper_stage.toml").vehicle.tanks
    assert float(tank.damping.ratio(0.48)) == pytest.approx(0.048, abs=5e-4)  # sec C.2, two digits


def test_a_case_remembers_its_file_and_every_value_as_written(tmp_path: Path) -> None:
    source = _read(tmp_path, GOOD).source
    assert source is not None
    assert source.file == "case.toml"
    assert source.sha256 == hashlib.sha256(GOOD.encode()).hexdigest()
    assert list(source.given.items()) == [
        ("name", "A stage"),
        ("vehicle.mass", "16000 kg"),
        ("vehicle.inertia", "9e5 kg*m^2"),
        ("vehicle.cg", "6 m"),
        ("vehicle.thrust", "900 kN"),
        ("tank.LOX.name", "LOX"),
        ("tank.LOX.slosh_mass", "1000 kg"),
        ("tank.LOX.station", "9 m"),
        ("tank.LOX.frequency", "2 rad/s"),
        ("tank.LOX.damping.law", "power"),
        ("tank.LOX.damping.slope", "0.1 1/m"),
        ("tank.LOX.damping.exponent", "1"),
        ("tank.LH2.name", "LH2"),
        ("tank.LH2.slosh_mass", "100 kg"),
        ("tank.LH2.station", "12 m"),
        ("tank.LH2.frequency", "0.5 Hz"),
        ("tank.LH2.damping.law", "constant"),
        ("tank.LH2.damping.ratio", "0.01"),
        ("autopilot.attitude_gain", "0.08"),
        ("autopilot.rate_gain", "0.14 s"),
        ("autopilot.filter.1.numerator", "[1.0]"),
        ("autopilot.filter.1.denominator", "[ 0.02, 1.0, ]"),
        ("criteria.gain_margin", "6 dB"),
    ]


@pytest.mark.parametrize(
    "text",
    [
        GOOD.replace("\n", "\r\n"),
        GOOD.replace("\n", "\r"),
        "\ufeff" + GOOD,
        GOOD.rstrip("\n"),
        GOOD.replace("\n", "  \n"),
    ],
    ids=["CRLF", "CR", "byte order mark", "no last line end", "trailing spaces"],
)
def test_line_ends_and_a_byte_order_mark_change_nothing(tmp_path: Path, text: str) -> None:
    plain, other = _read(tmp_path, GOOD), _read(tmp_path, text)
    assert other.model_copy(update={"source": None}) == plain.model_copy(update={"source": None})
    assert plain.source is not None
    assert other.source is not None
    assert other.source.given == plain.source.given


def test_dotted_keys_inline_tables_and_tables_apart_say_the_same(tmp_path: Path) -> None:
    tanks = GOOD[GOOD.index('[[tank]]\nname = "LH2"') : GOOD.index("[autopilot]")]
    apart = GOOD.replace(tanks, "") + tanks
    dotted = GOOD.replace("[tank.damping]\nlaw = ", "damping.law = ").replace(
        "\nratio = 0.01", "\ndamping.ratio = 0.01"
    )
    plain = _read(tmp_path, GOOD).model_copy(update={"source": None})
    assert _read(tmp_path, apart).model_copy(update={"source": None}) == plain
    assert _read(tmp_path, dotted).model_copy(update={"source": None}) == plain


def test_a_damping_table_is_read_beside_the_case_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path.parent)  # not where the case file is
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "decay.csv").write_text("amplitude [in], ratio [%]\n0, 0.2\n10, 1.2\n")
    case = _read(tmp_path, GOOD.replace(POWER, '{ law = "table", file = "tests/decay.csv" }'))
    law = case.vehicle.tanks[0].damping
    assert isinstance(law, TableDamping)
    np.testing.assert_allclose(law.tested_amplitude, [0.0, 0.254], rtol=1e-15)
    np.testing.assert_allclose(law.tested_ratio, [0.002, 0.012], rtol=1e-15)
    assert case.source is not None
    assert case.source.given["tank.LOX.damping.file"] == "tests/decay.csv"
    digest = hashlib.sha256((tmp_path / "tests" / "decay.csv").read_bytes()).hexdigest()
    assert case.source.given["tank.LOX.damping.file sha256"] == digest


def test_a_damping_table_is_read_inside_a_sum(tmp_path: Path) -> None:
    (tmp_path / "decay.csv").write_text("amplitude [m], ratio\n0, 0.002\n1, 0.012\n")
    parts = '{ law = "constant", ratio = 0.01 }, { law = "table", file = "decay.csv" }'
    law = _read(tmp_path, GOOD.replace(POWER, f'{{ law = "sum", of = [{parts}] }}')).vehicle.tanks[0].damping
    assert isinstance(law, SumDamping)
    assert float(law.ratio(1.0)) == pytest.approx(0.022)
