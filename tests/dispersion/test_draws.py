"""Draws: a function of seed, name and case number; distributions against scipy.stats; Philox as published."""

import numpy as np
import pytest
import scipy.stats
from uncertain import factor, stage

from sloshpy.dispersion import Correlation, Parameter, Triangular, TruncatedNormal, Uniform, drawn
from sloshpy.dispersion.streams import _key, _reversed, _words, random_stream, sobol_stream

WORD = 2**64


def philox(counter, key):
    """Philox4x64-10 as published (Salmon et al. 2011), in whole numbers."""
    x, k = list(counter), list(key)
    for turn in range(10):
        if turn:
            k = [(k[0] + 0x9E3779B97F4A7C15) % WORD, (k[1] + 0xBB67AE8584CAA73B) % WORD]
        a, b = 0xD2E7470EE14C6C93 * x[0], 0xCA5A826395121157 * x[2]
        x = [b // WORD ^ x[1] ^ k[0], b % WORD, a // WORD ^ x[3] ^ k[1], a % WORD]
    return x


def test_the_published_vector_of_philox():
    # the known answers that come with the authors' Random123: counter 0, key 0
    assert philox((0, 0, 0, 0), (0, 0)) == [
        0x16554D9ECA36314C,
        0xDB20FE9D672D0FDC,
        0xD7E772CEE186176B,
        0x7E68B68AEC7BA23B,
    ]


def test_a_draw_is_philox_of_name_and_case_number():
    key = _key(3, "vehicle.mass")
    for case in (0, 5, 123456):
        expected = philox((case + 1, 0, 0, 0), (key % WORD, key // WORD))[0]
        assert int(_words(3, "vehicle.mass", case, 1)[0]) == expected


@pytest.mark.parametrize("sampling", ["random", "sobol"])
def test_neither_order_nor_block_nor_another_input_changes_a_draw(sampling):
    group = Correlation(inputs=("vehicle.mass", "vehicle.inertia"), matrix=np.array([[1.0, 0.7], [0.7, 1.0]]))
    d = stage(sampling=sampling, correlations=(group,))
    whole = drawn(d, 11, 0, 64)
    for first, count in ((63, 1), (5, 7), (0, 1), (32, 32)):
        assert np.array_equal(drawn(d, 11, first, count), whole[first : first + count])
    more = stage(
        sampling=sampling, correlations=(group,), parameters=(factor("vehicle.thrust", 0.02), *d.parameters[::-1])
    )
    assert np.array_equal(drawn(more, 11, 0, 64)[:, :0:-1], whole)
    assert not np.any(drawn(d, 12, 0, 64) == whole)


@pytest.mark.parametrize(
    ("distribution", "reference"),
    [
        (Uniform(low=-2.0, high=3.0), scipy.stats.uniform(-2.0, 5.0)),
        (Triangular(low=1.0, mode=1.5, high=4.0), scipy.stats.triang(0.5 / 3.0, 1.0, 3.0)),
        (Triangular(low=1.0, mode=1.0, high=4.0), scipy.stats.triang(0.0, 1.0, 3.0)),
        (TruncatedNormal(mean=1.0, sigma=0.4, low=0.2, high=1.6), scipy.stats.truncnorm(-2.0, 1.5, 1.0, 0.4)),
        (TruncatedNormal(mean=0.0, sigma=1.0, low=3.0, high=4.0), scipy.stats.truncnorm(3.0, 4.0)),
        (TruncatedNormal(mean=0.0, sigma=1.0, low=-4.0, high=-3.0), scipy.stats.truncnorm(-4.0, -3.0)),
    ],
)
def test_quantiles_and_draws_are_those_of_scipy(distribution, reference):
    u = np.concatenate([[1e-12, 1e-6], np.linspace(0.01, 0.99, 99), [1.0 - 1e-6]])
    np.testing.assert_allclose(distribution.quantile(u), reference.ppf(u), rtol=1e-9, atol=1e-12)
    for stream in (random_stream, sobol_stream):
        values = distribution.quantile(stream(5, "x", 0, 4096))
        assert scipy.stats.kstest(values, reference.cdf).pvalue > 0.01
        assert np.min(values) >= distribution.low
        assert np.max(values) <= distribution.high


def test_names_and_neighbours_are_independent():
    a, b = random_stream(1, "a", 0, 20000), random_stream(1, "b", 0, 20000)
    for x, y in ((a, b), (a[1:], a[:-1]), (a, random_stream(2, "a", 0, 20000))):
        assert abs(scipy.stats.pearsonr(x, y).statistic) < 4.0 / np.sqrt(20000)


def test_evenly_spread_draws_have_one_in_each_part_and_names_stay_independent():
    for k in (1, 4, 8, 12):
        u = sobol_stream(7, "vehicle.mass", 0, 2**k)
        assert np.array_equal(np.sort(np.floor(u * 2**k)), np.arange(2**k))
    points = np.sort(_reversed(np.arange(256, dtype=np.uint64)) / 2.0**32)
    reference = scipy.stats.qmc.Sobol(1, scramble=False).random(256)[:, 0]
    assert np.array_equal(points, np.sort(reference))  # unscrambled it is the sequence of scipy
    n = 2**14
    x, y = sobol_stream(7, "a", 0, n), sobol_stream(7, "b", 0, n)
    counts = np.histogram2d(x, y, bins=16, range=[[0, 1], [0, 1]])[0].ravel()
    assert scipy.stats.chisquare(counts).pvalue > 1e-3


def test_the_copula_has_the_rank_correlation_of_the_normal():
    R = np.array([[1.0, 0.8, -0.3], [0.8, 1.0, 0.0], [-0.3, 0.0, 1.0]])
    names = ("vehicle.mass", "vehicle.inertia", "tank.LOX.frequency")
    x = drawn(stage(correlations=(Correlation(inputs=names, matrix=R),)), 3, 0, 40000)[:, :3]
    expected = 6.0 / np.pi * np.arcsin(R / 2.0)  # Spearman of a Gaussian copula, Kruskal 1958
    np.testing.assert_allclose(scipy.stats.spearmanr(x).statistic, expected, atol=0.02)
    assert scipy.stats.kstest(x[:, 1], scipy.stats.uniform(0.95, 0.1).cdf).pvalue > 0.01


def test_a_correlation_that_cannot_be_is_refused_and_a_perfect_one_is_kept():
    names = ("a", "b", "c")
    bad = np.array([[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]])
    with pytest.raises(ValueError, match="not positive semidefinite"):
        Correlation(inputs=names, matrix=bad)
    with pytest.raises(ValueError, match="symmetric"):
        Correlation(inputs=names[:2], matrix=np.array([[1.0, 0.5], [0.4, 1.0]]))
    one = Correlation(inputs=names[:2], matrix=np.ones((2, 2)))
    np.testing.assert_allclose(one.root @ one.root.T, np.ones((2, 2)))


def test_a_systematic_input_is_the_same_in_every_case():
    fixed = factor("vehicle.thrust", 0.02, systematic=True)
    x = drawn(stage(parameters=(fixed, factor("vehicle.mass", 0.02))), 3, 0, 50)
    assert len(set(x[:, 0])) == 1
    assert len(set(x[:, 1])) == 50


def test_bounds_that_leave_nothing_are_refused():
    for wrong in (
        lambda: Uniform(low=1.0, high=1.0),
        lambda: Triangular(low=0.0, mode=2.0, high=1.0),
        lambda: TruncatedNormal(mean=0.0, sigma=0.0, low=-1.0, high=1.0),
        lambda: TruncatedNormal(mean=0.0, sigma=1.0, low=8.0, high=9.0),
        lambda: Uniform(low=float("nan"), high=1.0),
    ):
        with pytest.raises(ValueError, match=r"low|high|mode|sigma"):
            wrong()
    assert Parameter(input="vehicle.mass", distribution=Uniform(low=0.9, high=1.1)).factor
