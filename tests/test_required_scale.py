"""The common scale of all tanks' damping: one tank is the requirement itself, several are checked by substitution."""

from pathlib import Path

import numpy as np
import pytest

import oracle
import sloshpy
from cases import paper_case, xi
from sloshpy.dynamics import open_loop
from sloshpy.files import read_case
from sloshpy.stability import margins, required_damping, required_scale

DATA = Path(sloshpy.__file__).parent / "data"


def test_for_one_tank_it_is_the_required_damping_over_the_given():
    case = paper_case(xi(0.02))
    found, needed = required_scale(case), required_damping(case)
    assert found.scale == pytest.approx(float(needed.required) / 0.02, rel=1e-7)
    assert found.neutral == pytest.approx(float(needed.neutral) / 0.02, rel=1e-7)


def test_for_two_tanks_the_margin_is_met_there_and_short_of_it_just_below():
    case = read_case(DATA / "two_tanks.toml")
    found = required_scale(case, amplitude=0.2)
    for factor, enough in ((1.0 + 1e-6, True), (1.0 - 1e-4, False), (1.5, True), (0.7, False)):
        least = margins(case, damping=factor * found.damping).minima.value[0]
        assert (least >= 1.0) == enough
    numbers = oracle.numbers(case, found.damping * found.neutral / found.scale)
    assert abs(max(p.real for p in _polished(numbers))) < 1e-7
    ratios = open_loop(case, amplitude=0.2).damping
    assert found.damping / ratios == pytest.approx(np.full(2, found.scale))
    assert "neutral x" in str(found)


def _polished(numbers):
    """Roots of the oracle's exact characteristic function near those without delay, by secant steps."""
    for start in oracle.poles(numbers):
        if start.imag > 1.0 and abs(start) < 4.0:
            a, b = start, start * (1 + 1e-4)
            for _ in range(50):
                fa, fb = oracle.characteristic(numbers, a)[0], oracle.characteristic(numbers, b)[0]
                if fa == fb:
                    break
                a, b = b, b - fb * (b - a) / (fb - fa)
            yield b


def test_nothing_to_scale_and_nothing_needed():
    with pytest.raises(ValueError, match="amplitude"):
        required_scale(paper_case())
    behind = paper_case(xi(0.01), tank={"station": 17.0})
    assert required_scale(behind).scale == 0.0
