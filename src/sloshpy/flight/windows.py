"""Stretches of flight in which a mode grows, and by how much: exp of the integral of sigma over time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sloshpy.stability import ModeTracks
from sloshpy.units import Array


@dataclass(frozen=True, kw_only=True)
class GrowthWindow:
    """A stretch in which one mode grows.

    mode: what takes part most, one label after the other where modes exchange tanks. start, end: s. exponent: integral
    of sigma dt. growth: greatest sigma, 1/s, at the time `at`.
    """

    phase: str
    mode: str
    start: float
    end: float
    exponent: float
    growth: float
    at: float

    @property
    def factor(self) -> float:
        """Growth factor of the amplitude over the window; inf beyond any number."""
        return float(np.exp(min(self.exponent, 700.0)))

    @property
    def time_to_double(self) -> float:
        """ln 2 over the greatest growth, s."""
        return float(np.log(2.0) / self.growth)

    def __str__(self) -> str:
        return (
            f"{self.mode} grows from {self.start:.2f} to {self.end:.2f} s by a factor of {self.factor:.4g}, "
            f"doubling in {self.time_to_double:.3g} s at {self.at:g} s ({self.phase})"
        )


@dataclass(frozen=True, kw_only=True)
class GrowthChain:
    """Windows of one mode that follow each other across events which an oscillation passes; what those do is apart."""

    windows: tuple[GrowthWindow, ...]

    @property
    def exponent(self) -> float:
        """Integral of sigma dt over all of them."""
        return sum(one.exponent for one in self.windows)

    @property
    def mode(self) -> str:
        """What grows."""
        return self.windows[0].mode

    @property
    def start(self) -> float:
        """Begin of the first, s."""
        return self.windows[0].start

    @property
    def end(self) -> float:
        """End of the last, s."""
        return self.windows[-1].end

    @property
    def factor(self) -> float:
        """Growth over all of them; the greatest number that is shown stands for more."""
        return float(np.exp(min(self.exponent, 700.0)))

    def __str__(self) -> str:
        return (
            f"{self.mode} grows on from window to window, {self.start:.2f} to {self.end:.2f} s, by a factor of "
            f"{self.factor:.4g} in all, without what the events between do themselves"
        )


def growth_chains(windows: Sequence[GrowthWindow], passed: Sequence[float]) -> tuple[GrowthChain, ...]:
    """Return the windows that go on across events.

    Args:
        windows: of a flight. passed: times in s of the events that an oscillation passes.
    """
    chains: list[list[GrowthWindow]] = []
    for one in sorted(windows, key=lambda window: window.start):
        before = next((c for c in chains if c[-1].end == one.start in passed and c[-1].mode == one.mode), None)
        if before is None:
            chains.append([one])
        else:
            before.append(one)
    return tuple(GrowthChain(windows=tuple(chain)) for chain in chains if len(chain) > 1)


def growth_windows(tracks: ModeTracks, phase: str) -> tuple[GrowthWindow, ...]:
    """Return the windows in which a branch has sigma > 0, greatest growth factor first.

    sigma is taken linear between the times, so that a window begins and ends where it crosses zero. The worst start of
    a window is its beginning: from any later one the growth is less.
    """
    found = []
    t, sigma = tracks.parameter, np.asarray(tracks.pole.real, dtype=float)
    for n in range(sigma.shape[1]):
        for first, last, exponent in positive_stretches(t, sigma[:, n]):
            inside = (t >= first) & (t <= last) & (sigma[:, n] > 0.0)
            k = int(np.argmax(np.where(inside, sigma[:, n], -np.inf)))
            labels = dict.fromkeys(tracks.label[p][n] for p in np.flatnonzero(inside))
            found.append(
                GrowthWindow(
                    phase=phase,
                    mode=", then ".join(labels),
                    start=first,
                    end=last,
                    exponent=exponent,
                    growth=float(sigma[k, n]),
                    at=float(t[k]),
                )
            )
    return tuple(sorted(found, key=lambda window: -window.exponent))


def positive_stretches(t: Array, y: Array) -> list[tuple[float, float, float]]:
    """Return start, end and integral of every stretch in which y, linear between its points, is positive.

    Args:
        t: (P,), increasing. y: (P,), nan where it is not known: a stretch ends there.
    """
    found: list[tuple[float, float, float]] = []
    start, total = np.nan, 0.0
    for k in range(len(t) - 1):
        a, b, h = float(y[k]), float(y[k + 1]), float(t[k + 1] - t[k])
        if not (np.isfinite(a) and np.isfinite(b)) or (a <= 0.0 and b <= 0.0):
            if total > 0.0:
                found.append((start, float(t[k]), total))
            start, total = np.nan, 0.0
            continue
        low, high = 0.0, 1.0  # the part of the interval in which y > 0
        if a < 0.0:
            low = a / (a - b)
        if b < 0.0:
            high = a / (a - b)
        if np.isnan(start) or a <= 0.0:
            start, total = float(t[k]) + low * h, 0.0
        total += 0.5 * h * (high - low) * (max(a, 0.0) + max(b, 0.0))
        if b <= 0.0:
            found.append((start, float(t[k]) + high * h, total))
            start, total = np.nan, 0.0
    if total > 0.0:
        found.append((start, float(t[-1]), total))
    return found
