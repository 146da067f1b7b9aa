"""Bounded distributions of an uncertain input, each by its quantiles: a draw is the quantile of a number in (0, 1)."""

from dataclasses import dataclass

import numpy as np

from sloshpy.units import Array

LEAST_MASS = 1e-6  # of a normal between its bounds: with less the bounds say more than mean and sigma


@dataclass(frozen=True, kw_only=True)
class Uniform:
    """Every value between two bounds alike."""

    low: float
    high: float

    def __post_init__(self) -> None:
        _ordered(low=self.low, high=self.high)

    def quantile(self, u: Array) -> Array:
        """Return the values below which the parts u of all draws lie."""
        return np.asarray(np.clip(self.low + (self.high - self.low) * u, self.low, self.high))


@dataclass(frozen=True, kw_only=True)
class Triangular:
    """A density that rises from `low` to `mode` and falls to `high`, linearly."""

    low: float
    mode: float
    high: float

    def __post_init__(self) -> None:
        _ordered(low=self.low, high=self.high)
        if not self.low <= self.mode <= self.high:
            raise ValueError(f"mode: {self.mode:g} must lie between low {self.low:g} and high {self.high:g}")

    def quantile(self, u: Array) -> Array:
        """Return the values below which the parts u of all draws lie."""
        a, c, b = self.low, self.mode, self.high
        turn = (c - a) / (b - a)
        rising, falling = a + np.sqrt((b - a) * (c - a) * u), b - np.sqrt((b - a) * (b - c) * (1.0 - u))
        return np.asarray(np.clip(np.where(u < turn, rising, falling), a, b))


@dataclass(frozen=True, kw_only=True)
class TruncatedNormal:
    """A normal density cut off at two bounds, its mean and sigma those before the cut.

    Nothing is drawn again and nothing is clipped to a bound: the density between the bounds is scaled up.
    """

    mean: float
    sigma: float
    low: float
    high: float

    def __post_init__(self) -> None:
        _ordered(low=self.low, high=self.high)
        if not (np.isfinite(self.mean) and np.isfinite(self.sigma) and self.sigma > 0.0):
            raise ValueError(f"sigma: {self.sigma:g} must be > 0, and mean {self.mean:g} finite")
        if self.cut > 1.0 - LEAST_MASS:
            raise ValueError(
                f"low: the bounds {self.low:g} to {self.high:g} leave less than {LEAST_MASS:g} of a normal of mean "
                f"{self.mean:g} and sigma {self.sigma:g}"
            )

    @property
    def cut(self) -> float:
        """The part of the normal that lies outside the bounds."""
        from scipy.special import ndtr  # as in `quantile`

        a, b = (self.low - self.mean) / self.sigma, (self.high - self.mean) / self.sigma
        return float(ndtr(a) + ndtr(-b))

    def quantile(self, u: Array) -> Array:
        """Return the values below which the parts u of all draws lie."""
        from scipy.special import ndtr, ndtri  # 0.1 s: only when something is drawn

        a, b = (self.low - self.mean) / self.sigma, (self.high - self.mean) / self.sigma
        side = -1.0 if a > 0.0 else 1.0  # both in the upper tail, where no digits are left: draw its mirror image
        a, b = side * a, side * b
        z = side * ndtri(ndtr(a) + (ndtr(b) - ndtr(a)) * u)
        return np.asarray(np.clip(self.mean + self.sigma * z, self.low, self.high))


Distribution = Uniform | Triangular | TruncatedNormal


def _ordered(low: float, high: float) -> None:
    if not (np.isfinite(low) and np.isfinite(high)):
        raise ValueError("low: both bounds must be finite")
    if not low < high:
        raise ValueError(f"high: {high:g} must be > low {low:g}")
