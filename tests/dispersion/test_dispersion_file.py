"""The dispersion file: what is read, and every fault at once with its line."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from sloshpy.cli import main
from sloshpy.dispersion import Linear, TruncatedNormal
from sloshpy.errors import InputError
from sloshpy.files import read_dispersion, write_example


@pytest.fixture
def example(tmp_path):
    write_example("upper_stage", tmp_path)
    return write_example("upper_stage_dispersed", tmp_path)


def test_the_shipped_dispersion_is_read(example):
    d = read_dispersion(example)
    assert d.analysis == Linear(amplitude=0.8)
    assert (d.coverage, d.confidence) == pytest.approx((0.99865, 0.9))
    assert d.parameters[0].distribution == TruncatedNormal(mean=1.0, sigma=0.01, low=0.97, high=1.03)
    delay = d.parameters[-1]
    assert not delay.factor
    assert delay.distribution.high == pytest.approx(0.02)
    assert "reconstructed" in example.read_text()


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('input = "vehicle.mass"', 'input = "vehicle.mas"', r"toml:\d+: .*it has .*mass"),
        ('input = "tank.LOX.slosh_mass"', 'input = "tank.LH2.slosh_mass"', "names no tank"),
        ('input = "vehicle.mass"', 'input = "autopilot.filter.1.frequency"', 'write "filter.1.frequency"'),
        ('high = "20 ms"', 'high = "20 kg"', "is a mass, must be a time"),
        ('low = "0 s"', 'low = "-1 s"', r"must be >= 0 s"),
        ("low = 0.9\n", "low = 1.2\n", "must be > low"),
        ("sigma = 0.02", "sigma = -0.02", "sigma"),
        ("[1.0, 0.8], [0.8, 1.0]", "[1.0, 1.8], [1.8, 1.0]", "symmetric, with 1"),
        ('sampling = "random"', 'sampling = "sobel"', 'did you mean "sobol"'),
        ('coverage = "99.865 %"', "coverage = 1.5", "must be > 0 and < 1"),
        ('case = "upper_stage.toml"', 'case = "../upper_stage.toml"', "leads out of"),
        ('amplitude = "0.8 m"', "amplitude = 0.8", "has no unit"),
        ('input = "tank.*.frequency"', 'input = "tank.LOX.slosh_mass"', "varies what"),
        ('as = "absolute"', 'az = "absolute"', "unknown key"),
    ],
)
def test_a_fault_is_told_with_its_line(example, old, new, told):
    text = example.read_text()
    assert old in text
    example.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=told) as error:
        read_dispersion(example)
    assert all(problem.line for problem in error.value.problems)


def test_all_faults_are_told_at_once_and_nothing_is_written(example, capsys):
    text = example.read_text().replace("sigma = 0.02", "sigma = -0.02").replace('low = "0 s"', 'low = "-1 s"')
    example.write_text(text)
    store = example.with_name("s")
    with pytest.raises(SystemExit) as ended:
        main(["disperse", str(example), "--cases", "5", "--seed", "1", "--store", str(store)])
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("error: ") == 2
    assert not store.exists()


@pytest.mark.parametrize(
    "words", [["--cases", "0"], ["--cases", "5", "--seed", "-1"], ["--resume"], ["--case", "3"], []]
)
def test_options_that_make_no_campaign_are_refused(example, words, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["disperse", str(example), *words])
    assert ended.value.code == 2
    assert "Cure" in capsys.readouterr().err


def test_a_campaign_from_the_command_line_is_read_again_and_a_case_is_the_same(example):
    program, store = Path(sys.executable).with_name("sloshpy"), example.with_name("s")

    def run(*words):
        return subprocess.run([program, "disperse", example, "--store", store, *words], capture_output=True, text=True)

    first = run("--cases", "20", "--seed", "3", "--workers", "1")
    assert first.returncode == 1, first.stderr  # 20 cases show too little
    assert "N = 20 cannot support 99.865 %" in first.stdout
    assert run().stdout == first.stdout
    assert "the same bits as in the store" in run("--case", "7").stdout
    beyond = run("--case", "20")
    assert (beyond.returncode, "NOT compared with the store: the store ends with case 19" in beyond.stdout) == (0, True)
    assert "is 3 in the store" in run("--seed", "4").stderr
    (block,) = store.glob("block-*.bin")
    data = bytearray(block.read_bytes())
    data[len(data) // 2] ^= 1
    block.write_bytes(data)
    damaged = run("--case", "7")
    assert damaged.returncode == 1
    assert "NOT compared with the store: block-00000000.bin, cases 0 to 19, is damaged" in damaged.stdout
    told = json.loads(run("--case", "7", "--json").stdout)
    assert (told["same"], told["not_compared"]) == (None, "block-00000000.bin, cases 0 to 19, is damaged")
    block.unlink()
    assert "cases 0 to 19, is not there yet" in run("--case", "7").stdout


def test_a_case_that_diverges_says_so_once(example, capsys):
    stage = example.with_name("upper_stage.toml")
    head, _, rest = stage.read_text().partition("[tank.damping]")
    stage.write_text(f'{head}[tank.damping]\nlaw = "constant"\nratio = "0.1 %"\n\n{rest[rest.index("[autopilot]") :]}')
    vary = '[[vary]]\ninput = "vehicle.mass"\ndistribution = "uniform"\nlow = 0.99\nhigh = 1.01\n'
    run = '[nonlinear]\nduration = "900 s"\ninitial_slosh = "1 m"\n'
    example.write_text(f'name = "wild"\ncase = "upper_stage.toml"\n{run}{vary}')
    with pytest.raises(SystemExit) as ended:
        main(["disperse", str(example), "--case", "0", "--seed", "4"])
    assert ended.value.code == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("case 0 of seed 4: diverged at ")
    assert first.count("diverged") == 1
