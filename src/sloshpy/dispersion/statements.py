"""What N independent cases can say: tolerance bounds by order statistics, probabilities, rank correlations.

Nothing here assumes a distribution of the answers. With r the number of cases allowed to be worse,

    confidence that a part p of all cases is no worse than the (r + 1)-th worst of N = P(Binomial(N, 1 - p) > r)

(Wilks 1941; Clopper and Pearson 1934; Bonett and Wright 2000 for the rank correlation).
"""

from dataclasses import dataclass

import numpy as np

from sloshpy.units import Array, BoolArray


def cases_needed(coverage: float, confidence: float, worse: int = 0) -> int:
    """Return how many cases support a coverage at a confidence where so many may be worse than the bound.

    99.865 % at 90 % needs 1705 with none worse, 2880 with one, 3941 with two.
    """
    low, high = worse, worse + 1
    while _confidence(high, coverage, worse) < confidence:
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if _confidence(middle, coverage, worse) >= confidence else (middle, high)
    return high


def worse_allowed(count: int, coverage: float, confidence: float) -> int:
    """Return how many of N cases may be worse than the bound of a tolerance statement; -1 if N supports none."""
    if _confidence(count, coverage, 0) < confidence:
        return -1
    low, high = 0, count
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if _confidence(count, coverage, middle) >= confidence else (low, middle)
    return low


def largest_coverage(count: int, confidence: float) -> float:
    """Return the greatest coverage that N cases, none worse than the bound, support: 1 - p^N = confidence."""
    return float((1.0 - confidence) ** (1.0 / count))


def _confidence(count: int, coverage: float, worse: int) -> float:
    """Return P(Binomial(N, 1 - p) > r) by the incomplete beta function."""
    from scipy.special import betainc  # 0.1 s: only when a statement is wanted

    return float(betainc(worse + 1, count - worse, 1.0 - coverage)) if count > worse else 0.0


@dataclass(frozen=True, kw_only=True)
class Interval:
    """An estimate with its two-sided interval at a confidence."""

    estimate: float
    low: float
    high: float


def probability(hits: int, count: int, confidence: float) -> Interval:
    """Return the probability of an event seen so often, with the exact interval of Clopper and Pearson."""
    from scipy.special import betaincinv  # as above

    a = 0.5 * (1.0 - confidence)
    low = float(betaincinv(hits, count - hits + 1, a)) if hits > 0 else 0.0
    high = float(betaincinv(hits + 1, count - hits, 1.0 - a)) if hits < count else 1.0
    return Interval(estimate=hits / count, low=low, high=high)


@dataclass(frozen=True, kw_only=True)
class Bound:
    """With a confidence at least a part `coverage` of all cases is no worse than `value`.

    worse: cases that are; `estimate`: the percentile of the cases themselves. best, estimate_best: the same with every
    case without a number counted as best, not as worst: between the two lies what those cases can change.
    """

    coverage: float
    confidence: float
    value: float
    worse: int
    estimate: float
    best: float
    estimate_best: float


def tolerance_bound(values: Array, worst: int, coverage: float, confidence: float) -> Bound:
    """Return the distribution-free bound of a number that is bad where it is small (worst -1) or great (+1).

    nan is a case without a number: it is worse than every number.

    Raises:
        ValueError: so many cases do not support the coverage; the text says which one they do support.
    """
    count = len(values)
    worse = worse_allowed(count, coverage, confidence)
    if worse < 0:
        raise ValueError(unsupported(count, coverage, confidence))
    signed = worst * values
    place = min(int(np.ceil(coverage * count * (1.0 - 1e-12))), count) - 1
    pessimistic = np.sort(np.where(np.isnan(signed), np.inf, signed))
    optimistic = np.sort(np.where(np.isnan(signed), -np.inf, signed))
    at = count - 1 - worse
    return Bound(
        coverage=coverage,
        confidence=confidence,
        value=worst * float(pessimistic[at]),
        worse=worse,
        estimate=worst * float(pessimistic[place]),
        best=worst * float(optimistic[at]),
        estimate_best=worst * float(optimistic[place]),
    )


def unsupported(count: int, coverage: float, confidence: float) -> str:
    """Return why so few cases support no such statement, and the largest one that they do support."""
    most = largest_coverage(count, confidence)
    return (
        f"N = {count} cannot support {100 * coverage:g} % at {100 * confidence:g} % confidence, which takes "
        f"{cases_needed(coverage, confidence)}; largest supported statement: {_floored(most)} % at "
        f"{100 * confidence:g} %"
    )


def _floored(part: float) -> str:
    """Return a part in percent, never rounded up."""
    return f"{np.floor(part * 1e5) / 1e3:.2f}" if part < 0.9998 else f"{np.floor(part * 1e7) / 1e5:.5f}"


def rank_correlation(x: Array, y: Array, confidence: float) -> Interval:
    """Return Spearman's rank correlation with its interval by Fisher's z and the error of Bonett and Wright.

    Ties share their mean rank; nan in x or y is worth no rank and must have been put to an end before.
    """
    from scipy.special import ndtri  # as above

    a, b = _ranks(x), _ranks(y)
    a, b = a - np.mean(a), b - np.mean(b)
    size = float(np.sqrt(np.sum(a * a) * np.sum(b * b)))
    if size == 0.0 or len(x) < 5:
        return Interval(estimate=np.nan, low=-1.0, high=1.0)
    rho = float(np.clip(np.sum(a * b) / size, -1.0, 1.0))
    if abs(rho) > 1.0 - 1e-12:
        return Interval(estimate=rho, low=rho, high=rho)
    z, error = np.arctanh(rho), np.sqrt((1.0 + 0.5 * rho**2) / (len(x) - 3))
    reach = float(ndtri(0.5 * (1.0 + confidence))) * error
    return Interval(estimate=rho, low=float(np.tanh(z - reach)), high=float(np.tanh(z + reach)))


def _ranks(x: Array) -> Array:
    """Return ranks from 1 on; equal values share their mean rank."""
    _, place, count = np.unique(x, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    return np.asarray((last - 0.5 * (count - 1))[place])


def violates(values: Array, worst: int, limit: float, tolerance: float = 0.0) -> BoolArray:
    """Return which cases do not surely keep a limit; one without a number does not (`nan <= limit` is False)."""
    sure = limit - worst * tolerance
    return np.asarray(~(values >= sure) if worst < 0 else ~(values <= sure))


def marginal(values: Array, limit: float, tolerance: float) -> BoolArray:
    """Return which cases are so near a limit that they are on no sure side of it."""
    return np.asarray((np.abs(values - limit) <= tolerance) & (tolerance > 0.0))
