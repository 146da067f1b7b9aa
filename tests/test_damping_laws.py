"""Laws of damping: the force has the describing function 2 xi w, never extrapolates, always dissipates."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.integrate import quad

from cases import paper_case
from sloshpy.damping import ConstantDamping, PowerDamping, SumDamping, TableDamping
from sloshpy.errors import OutsideValidity
from sloshpy.stability import margins

TABLE = TableDamping(amplitude=[0.0, 0.05, 0.15, 0.3, 0.6], ratio=[0.002, 0.006, 0.012, 0.03, 0.05])
LAWS = {
    "constant": ConstantDamping(ratio=0.013),
    "square": PowerDamping(slope=0.1, exponent=1.0),
    "baffle": PowerDamping(slope=0.08, exponent=0.5),
    "limited": PowerDamping(slope=0.08, exponent=0.5, largest_amplitude=0.6),
    "cubic": PowerDamping(slope=0.2, exponent=2.0),
    "table": TABLE,
    "sum": SumDamping(of=(ConstantDamping(ratio=0.004), PowerDamping(slope=0.05, exponent=0.5), TABLE)),
}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("w", [0.7, 2.0, 9.0])
def test_describing_function_of_the_force_is_two_xi_w(name, w):
    """N(V) = (1/(pi V)) int_0^2pi -acc(V sin t) sin t dt, by an independent quadrature."""
    law = LAWS[name]
    for A in (0.02, 0.11, 0.27, 0.55):
        V = w * A

        def integrand(t, V=V):
            return -float(law.acceleration(V * np.sin(t), w)) * np.sin(t)

        edges = [np.arcsin(x / A) for x in (0.05, 0.15, 0.3) if x < A]
        N = (
            4
            * quad(integrand, 0, np.pi / 2, points=edges or None, epsabs=1e-13, epsrel=1e-9, limit=200)[0]
            / (np.pi * V)
        )
        # 2e-5: a table's force is itself interpolated between 64 nodes to a row
        assert pytest.approx(2 * float(law.ratio(A)) * w, rel=2e-5 if name in ("table", "sum") else 1e-8) == N


def test_odd_square_law_is_the_papers_b():
    """Eqs 18, 19: b = 3 pi alpha / 4, whatever the slosh frequency."""
    for w in (1.0, 2.0, 5.0):
        law = PowerDamping(slope=0.1)
        assert law.coefficient(w) == pytest.approx(3 * np.pi * 0.1 / 4, rel=1e-14)
        assert float(law.acceleration(-0.3, w)) == pytest.approx(3 * np.pi * 0.1 / 4 * 0.09, rel=1e-13)


def test_work_over_a_cycle_is_lost_for_both_signs_of_velocity():
    """T24: eq 20 without |v| has no fundamental; ours takes energy out in each half cycle."""
    t = (np.arange(2000) + 0.5) * np.pi / 1000
    for law in LAWS.values():
        v = 0.5 * np.cos(t)
        power = law.acceleration(v, 2.0) * v
        assert np.all(power <= 0)
        assert power[v > 0].sum() == pytest.approx(power[v < 0].sum(), rel=1e-9)


def test_tables_never_extrapolate():
    """T28: beyond the last row there is no number, at any door."""
    assert np.isnan(TABLE.ratio(0.6000001))
    assert np.isnan(TABLE.acceleration(2.0 * 0.61, 2.0))
    assert np.isnan(TABLE.amplitude(0.0501))
    late = TableDamping(amplitude=[0.1, 0.2], ratio=[0.01, 0.02])
    assert np.isnan(late.ratio(0.09))
    with pytest.raises(OutsideValidity, match=r"starts at 0\.1 m"):
        late.acceleration(0.3, 2.0)
    with pytest.raises(OutsideValidity, match="LOX"):
        margins(paper_case(TABLE), amplitude=0.7)


def test_a_formula_with_an_end_has_no_number_beyond_it():
    """T28: ratio, force and inverse are nan from there on, and it ends a sum that it is part of."""
    law, free = LAWS["limited"], LAWS["baffle"]
    inside, beyond = np.array([0.0, 0.3, 0.6]), np.array([0.6000001, 5.0])
    np.testing.assert_array_equal(law.ratio(inside), free.ratio(inside))
    assert np.all(np.isnan(law.ratio(beyond)))
    for sign in (1.0, -1.0):
        np.testing.assert_array_equal(
            law.acceleration(sign * 2.0 * inside, 2.0), free.acceleration(sign * 2.0 * inside, 2.0)
        )
        assert np.all(np.isnan(law.acceleration(sign * 2.0 * beyond, 2.0)))
    assert np.isnan(law.amplitude(1.001 * 0.08 * 0.6**0.5))
    both = SumDamping(of=(ConstantDamping(ratio=0.004), law))
    assert both.largest_amplitude == law.largest_amplitude == 0.6
    assert np.isnan(both.ratio(0.61))
    assert np.isnan(both.amplitude(0.08 * 0.6**0.5 + 0.005))
    with pytest.raises(OutsideValidity, match="LOX"):
        margins(paper_case(law), amplitude=0.7)


def test_a_sum_of_laws_without_a_common_range_is_refused():
    late = TableDamping(amplitude=[0.7, 0.9], ratio=[0.01, 0.02])
    with pytest.raises(ValidationError, match=r"begins at 0\.7 m, one ends at 0\.6 m"):
        SumDamping(of=(late, LAWS["limited"]))


def test_table_goes_through_its_rows_and_stays_between_them():
    np.testing.assert_allclose(TABLE.ratio(TABLE.tested_amplitude), TABLE.tested_ratio, rtol=1e-14)
    a = np.linspace(0, 0.6, 5001)
    assert np.all(np.diff(TABLE.ratio(a)) >= 0)


@pytest.mark.parametrize("name", ["square", "baffle", "limited", "cubic", "table", "sum"])
def test_amplitude_inverts_the_ratio(name):
    law = LAWS[name]
    A = np.array([0.01, 0.1, 0.2, 0.5])
    np.testing.assert_allclose(law.amplitude(law.ratio(A)), A, rtol=1e-9)


def test_constant_law_never_reaches_more_than_itself():
    np.testing.assert_array_equal(
        ConstantDamping(ratio=0.01).amplitude(np.array([0.005, 0.01, 0.0101])), [0, 0, np.inf]
    )


def test_inverse_of_a_law_that_dips_is_the_amplitude_beyond_which_it_suffices():
    """T26: 4 % is reached at two amplitudes below a dip; only beyond the dip it always suffices."""
    dip = TableDamping(amplitude=[0.0, 0.1, 0.2, 0.4], ratio=[0.0, 0.05, 0.02, 0.06])
    A = float(dip.amplitude(0.04))
    assert 0.2 < A < 0.4
    assert float(dip.ratio(A)) == pytest.approx(0.04, rel=1e-9)
    total = SumDamping(of=(dip, ConstantDamping(ratio=0.001)))
    B = float(total.amplitude(0.041))
    assert pytest.approx(A, rel=1e-9) == B


def test_sum_adds_ratios_and_forces():
    parts = LAWS["sum"].of
    a, v = np.array([0.0, 0.1, 0.5]), np.array([-0.9, 0.2, 1.1])
    np.testing.assert_allclose(LAWS["sum"].ratio(a), sum(p.ratio(a) for p in parts), rtol=1e-14)
    np.testing.assert_allclose(LAWS["sum"].acceleration(v, 2.0), sum(p.acceleration(v, 2.0) for p in parts), rtol=1e-14)
    assert LAWS["sum"].largest_amplitude == 0.6


def test_percentages_and_disorder_are_refused():
    for bad in ({"amplitude": [0, 0.1], "ratio": [0, 4.8]}, {"amplitude": [0.1, 0.0], "ratio": [0, 0.1]}):
        with pytest.raises(ValidationError):
            TableDamping(**bad)
    with pytest.raises(ValidationError):
        TableDamping(amplitude=[0.0], ratio=[0.01])


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(1e-3, 2.0), st.floats(0.25, 3.0), st.floats(0.3, 10.0), st.floats(-3.0, 3.0))
def test_power_force_is_odd_dissipative_and_scales(slope, p, w, v):
    law = PowerDamping(slope=slope, exponent=p)
    force = float(law.acceleration(v, w))
    assert force == -float(law.acceleration(-v, w))
    assert force * v <= 0
    assert float(law.acceleration(2 * v, w)) == pytest.approx(2 ** (p + 1) * force, rel=1e-9, abs=1e-300)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    st.lists(st.floats(0.01, 0.5), min_size=2, max_size=6),
    st.lists(st.floats(0.0, 0.05), min_size=7, max_size=7),
    st.floats(0.5, 6.0),
)
def test_force_of_a_growing_table_is_odd_and_dissipative(steps, gains, w):
    A = np.concatenate([[0.0], np.cumsum(steps)])
    xi = np.cumsum([0.001, *gains[: len(steps)]])
    if xi[-1] > 0.3:
        return
    law = TableDamping(amplitude=A, ratio=xi)
    v = np.linspace(-0.999, 0.999, 51) * A[-1] * w
    force = law.acceleration(v, w)
    assert np.all(force * v <= 0)
    np.testing.assert_allclose(force, -force[::-1], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", ["constant", "limited", "table", "sum"])
def test_what_a_law_gives_at_most_it_gives_whatever_the_rounding(name):
    law = LAWS[name]
    end = 0.0 if name == "constant" else law.largest_amplitude
    most = float(law.ratio(end))
    assert [float(law.amplitude(most * f)) for f in (1.0 - 1e-9, 1.0, 1.0 + 1e-9)] == pytest.approx([end] * 3, rel=1e-6)
    assert not np.isfinite(law.amplitude(most * (1.0 + 1e-5)))
