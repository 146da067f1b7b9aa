"""What N cases can say, against tables of order statistics, scipy.stats and plain counting."""

import numpy as np
import pytest
import scipy.stats

from sloshpy.dispersion.statements import (
    cases_needed,
    largest_coverage,
    probability,
    rank_correlation,
    tolerance_bound,
    unsupported,
    violates,
    worse_allowed,
)


@pytest.mark.parametrize(
    ("confidence", "worse", "cases"),
    [(0.9, 0, 1705), (0.9, 1, 2880), (0.9, 2, 3941), (0.95, 0, 2218), (0.95, 1, 3513), (0.95, 2, 4662)],
)
def test_the_published_numbers_of_cases_for_three_sigma(confidence, worse, cases):
    assert cases_needed(0.99865, confidence, worse) == cases
    assert worse_allowed(cases, 0.99865, confidence) == worse
    assert worse_allowed(cases - 1, 0.99865, confidence) == worse - 1
    chance = scipy.stats.binom.sf(worse, cases, 1.0 - 0.99865)  # by the binomial distribution itself
    assert chance >= confidence > scipy.stats.binom.sf(worse, cases - 1, 1.0 - 0.99865)


def test_too_few_cases_are_refused_with_the_largest_statement():
    assert largest_coverage(1000, 0.9) == pytest.approx(0.9977, abs=5e-6)
    assert "largest supported statement: 99.77 % at 90 %" in unsupported(1000, 0.99865, 0.9)
    with pytest.raises(ValueError, match="N = 1000 cannot support"):
        tolerance_bound(np.arange(1000.0), 1, 0.99865, 0.9)


def test_the_bound_holds_as_often_as_it_says():
    rng = np.random.default_rng(8)
    covered = 0
    for _ in range(2000):
        x = rng.uniform(size=200)
        covered += tolerance_bound(x, 1, 0.95, 0.9).value >= 0.95  # of a uniform the part below x is x
    exact = scipy.stats.binom.sf(worse_allowed(200, 0.95, 0.9), 200, 0.05)
    assert abs(covered / 2000 - exact) < 4.0 * np.sqrt(exact * (1.0 - exact) / 2000)


def test_cases_without_a_number_count_as_worst_and_what_they_change_is_told():
    x = np.arange(2000.0)
    x[:3] = np.nan  # of 2000, 0 may be worse
    bound = tolerance_bound(x, 1, 0.99865, 0.9)
    assert bound.value == np.inf
    assert bound.best == 1999.0
    low = tolerance_bound(x, -1, 0.5, 0.9)
    assert low.value < low.best < 1000.0
    assert violates(np.array([np.nan, 1.0, 2.0, np.inf]), 1, 1.0).tolist() == [True, False, True, True]
    assert violates(np.array([np.nan, 1.0, 2.0, -np.inf]), -1, 1.0).tolist() == [True, False, False, True]


@pytest.mark.parametrize(("hits", "count"), [(0, 50), (3, 1000), (50, 50), (17, 40)])
def test_the_interval_of_clopper_and_pearson_is_scipys(hits, count):
    ours = probability(hits, count, 0.9)
    theirs = scipy.stats.binomtest(hits, count).proportion_ci(0.9, method="exact")
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), rel=1e-9)


def test_rank_correlation_is_scipys_with_ties_and_infinities():
    rng = np.random.default_rng(2)
    x = rng.normal(size=500)
    y = np.round(x + rng.normal(size=500), 1)
    y[:5] = np.inf
    ours = rank_correlation(x, y, 0.9)
    assert ours.estimate == pytest.approx(scipy.stats.spearmanr(x, scipy.stats.rankdata(y)).statistic, rel=1e-12)
    assert ours.low < ours.estimate < ours.high
    inside, truth = 0, 6.0 / np.pi * np.arcsin(0.25)
    for _ in range(500):
        a, b = rng.multivariate_normal([0.0, 0.0], [[1.0, 0.5], [0.5, 1.0]], size=200).T
        found = rank_correlation(a, b, 0.9)
        inside += found.low <= truth <= found.high
    assert inside / 500 == pytest.approx(0.9, abs=0.05)
    assert np.isnan(rank_correlation(x, np.ones(500), 0.9).estimate)
