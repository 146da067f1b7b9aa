"""Root locus: every point is a closed-loop pole at its gain, branches are continuous, ends are right."""

import control
import numpy as np
import pytest

import oracle
from cases import paper_case
from sloshpy.stability import root_locus


def test_every_branch_point_is_a_pole_at_its_gain():
    gain = np.geomspace(1e-3, 50, 80)
    for tau in (0.0, 0.17):
        locus = root_locus(paper_case(delay=tau), damping=0.01, gain=gain)
        c = oracle.numbers(paper_case(delay=tau), 0.01)
        for g, row in zip(gain, locus.branch, strict=True):
            row = row[np.isfinite(row)]
            f, size = oracle.characteristic(oracle.replace(c, gain=g), row)
            assert np.max(np.abs(f) / size) < 1e-8


def test_locus_agrees_with_python_control():
    num, den = oracle.one_tank_polynomials(oracle.numbers(paper_case(), 0.01))
    gain = np.geomspace(0.01, 20, 30)
    theirs = control.root_locus_map(control.tf(np.polymul(num, [0.14, 0.08]), den), gains=gain)
    ours = root_locus(paper_case(), damping=0.01, gain=gain)
    for a, b in zip(ours.branch, theirs.loci, strict=True):
        np.testing.assert_allclose(np.sort_complex(a), np.sort_complex(b), rtol=1e-8)


def test_slosh_pole_departs_to_the_right_and_lies_below_its_zero():
    """Fig 4: undamped, in the danger zone."""
    locus = root_locus(paper_case())
    pole = next(p for p in locus.open_poles if p.imag > 1)
    zero = next(z for z in locus.zeros if z.imag > 1)
    num, den = oracle.one_tank_polynomials(oracle.numbers(paper_case(), 0.0))
    assert pole.imag == pytest.approx(np.sqrt(den[2] / den[0]), rel=1e-9)
    assert zero.imag == pytest.approx(np.sqrt(num[2] / num[0]), rel=1e-9)
    near = locus.branch[0][np.argmin(np.abs(locus.branch[0] - pole))]
    assert near.real > 0
    assert sorted(np.round(z.real, 6) for z in locus.zeros)[0] == pytest.approx(-0.08 / 0.14, rel=1e-5)


def test_branches_are_continuous():
    """Before the rigid pair meets on the real axis (gain 2.5) no branch may jump to another."""
    locus = root_locus(paper_case(), damping=0.02, gain=np.geomspace(1e-3, 1.5, 2000))
    assert np.abs(np.diff(locus.branch, axis=0)).max() < 0.03


def test_rate_feedback_alone_and_attitude_feedback_alone_have_the_right_zeros():
    for a0, a1, expected in ((0.08, 0.0, 2), (0.0, 0.14, 3), (0.08, 0.14, 3)):
        zeros = root_locus(paper_case(attitude_gain=a0, rate_gain=a1)).zeros
        assert len(zeros) == expected
        num, _ = oracle.one_tank_polynomials(oracle.numbers(paper_case(), 0.0))
        slosh = [z for z in zeros if z.imag > 0]
        assert slosh[0].imag == pytest.approx(np.sqrt(num[2] / num[0]), rel=1e-8)


def test_slosh_pole_and_zero_trade_places_at_the_bounds_of_the_danger_zone():
    # eqs 22 and 23: they coincide at l = -I/(M Xcg) and l = a (1 - m/M)/w^2
    for station, below in (
        (9.0, True),
        (6.0 + 9.3, True),
        (6.0 + 9.45, False),
        (6.0 - 13.1, True),
        (6.0 - 13.25, False),
    ):
        pole, zero = root_locus(paper_case(tank={"station": station})).slosh_order["LOX"]
        assert (pole < zero) == below
