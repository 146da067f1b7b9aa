"""One loop at many dampings of its tanks, sampled on common frequencies."""

import numpy as np
import pytest

import oracle
from cases import paper_case, random_case, xi
from sloshpy.case import Criteria
from sloshpy.dynamics import frequency_response, open_loop
from sloshpy.stability.family import sampled_family
from sloshpy.stability.margins import loop_margins
from sloshpy.stability.touching import touching_critical_point, touching_level
from sloshpy.vehicle import SloshMass

RATIO = np.array([0.0, 1e-4, 0.002, 0.01, 0.04, 0.3])


def below(values, level):
    return [np.sort(row[row < level]) for row in values]


@pytest.mark.parametrize("all_move", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_every_minimum_below_the_level_is_found_at_every_damping(seed, all_move):
    rng = np.random.default_rng(700 + seed)
    case, _ = random_case(rng, tanks=2 + seed % 3, delay=True, actuator=True)
    criteria, moved = Criteria(), tuple(range(2 + seed % 3)) if all_move else (seed % 2,)
    damping = np.full((len(RATIO), 2 + seed % 3), 0.003)
    damping[:, moved] = RATIO[:, None] * rng.uniform(0.3, 1.0, len(moved))
    batch = open_loop(case, damping)
    curves = sampled_family(batch, moved, criteria, below=1.5)
    common = loop_margins(batch, criteria, crossings=False, curves=curves, below=1.5).minima.value
    each = loop_margins(batch, criteria, crossings=False).minima.value
    for one, other in zip(below(common, 1.5), below(each, 1.5), strict=True):
        assert one == pytest.approx(other, rel=1e-9)


@pytest.mark.parametrize("moves", [False, True])
def test_its_curves_are_the_loops_themselves(moves):
    aux = SloshMass(name="aux", slosh_mass=60.0, station=3.0, frequency=3.1, damping=xi(0.001))
    case = paper_case(xi(0.02), more=(aux,))
    damping = np.stack([RATIO[1:], 0.001 + moves * RATIO[1:]], axis=-1)
    curves = sampled_family(open_loop(case, damping), (0, 1)[: 1 + moves], Criteria(), below=2.0)
    for k, ratios in enumerate(damping):
        own = curves.index == k
        c = oracle.numbers(case, ratios)
        assert curves.loop[own] == pytest.approx(oracle.loop(c, 1j * curves.omega[own]), rel=1e-10)


def test_the_damping_of_neutral_stability_and_of_the_level_fulfil_their_equations():
    def loops(ratio, _):
        return open_loop(paper_case(), ratio[..., None])

    ends = np.array([[0.01], [0.06]])
    neutral = touching_critical_point(loops, (np.array([2.1]), np.array([0.03])), ends)
    # theory: 2.3929 % at 2.132783 rad/s
    L = frequency_response(open_loop(paper_case(), float(neutral[0])), np.array([2.132783])).loop
    assert neutral[0] == pytest.approx(0.023929, rel=1e-4)
    assert L[0] == pytest.approx(-1.0, abs=1e-4)
    omega, level = touching_level(loops, 1.0, Criteria(), (np.array([2.13]), np.array([0.04])), ends)
    dense = frequency_response(open_loop(paper_case(), float(level[0])), np.linspace(2.0, 2.3, 20001)).loop
    assert np.min(oracle.disc_margin(dense)) == pytest.approx(1.0, abs=1e-7)
    # 1e-5: a minimum is known to the root of its value's rounding
    assert omega[0] == pytest.approx(np.linspace(2.0, 2.3, 20001)[np.argmin(oracle.disc_margin(dense))], abs=2e-5)
    outside = np.array([[0.05], [0.06]])
    assert np.isnan(touching_level(loops, 1.0, Criteria(), (np.array([2.13]), np.array([0.055])), outside)[1][0])
