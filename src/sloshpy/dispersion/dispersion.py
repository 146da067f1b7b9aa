"""What one dispersion file describes: a case, which of its inputs vary and how, and what is asked of each draw."""

import functools
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from sloshpy.case import Case
from sloshpy.dispersion.distribution import Distribution
from sloshpy.dispersion.streams import random_stream, sobol_stream
from sloshpy.flight.events import Event
from sloshpy.flight.peaks import stretches
from sloshpy.flight.trajectory import Phase, events_of
from sloshpy.units import Array

SEMIDEFINITE = 1e-10  # an eigenvalue of a correlation matrix this little below 0 is rounding


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One uncertain input, "vehicle.mass", "tank.LOX.frequency", "tank.*.damping" (one draw for all tanks).

    Of a nonlinear campaign also "run.initial_slosh", "run.gust_speed", "run.gust_start", "run.gust_duration".

    factor: the draw multiplies the case's value; else it stands in its place, in SI units.
    systematic: drawn once for the whole campaign, the same in every case; else for each case.
    """

    input: str
    distribution: Distribution
    factor: bool = True
    systematic: bool = False


@dataclass(frozen=True, kw_only=True)
class Correlation:
    """Correlation of some parameters through a Gaussian copula: of the normal scores, not of the values.

    inputs: names of parameters. matrix: (K, K), symmetric, ones on the diagonal, positive semidefinite.
    """

    inputs: tuple[str, ...]
    matrix: Array

    def __post_init__(self) -> None:
        R = np.array(self.matrix, dtype=float)
        K = len(self.inputs)
        if R.shape != (K, K):
            raise ValueError(f"must have {K} rows of {K} numbers, one for each input")
        if not np.array_equal(R, R.T) or np.any(np.diag(R) != 1.0) or not np.all(np.abs(R) <= 1.0):
            raise ValueError("must be symmetric, with 1 on the diagonal and nothing beyond +-1")
        least = float(np.linalg.eigvalsh(R)[0])
        if least < -SEMIDEFINITE:
            raise ValueError(f"is not positive semidefinite: its least eigenvalue is {least:.4g}")
        R.setflags(write=False)
        object.__setattr__(self, "matrix", R)

    @property
    def root(self) -> Array:
        """Lower triangle T with T T' = R; a later input changes no row above its own."""
        K = len(self.inputs)
        T = np.zeros((K, K))
        for k in range(K):
            for j in range(k):
                rest = self.matrix[k, j] - T[k, :j] @ T[j, :j]
                T[k, j] = rest / T[j, j] if T[j, j] > 0.0 else 0.0
            T[k, k] = np.sqrt(max(self.matrix[k, k] - T[k, :k] @ T[k, :k], 0.0))
            if T[k, k] < np.sqrt(SEMIDEFINITE):
                T[k, k] = 0.0
        return T


@dataclass(frozen=True, kw_only=True)
class Linear:
    """Margins and required damping of each case; slosh damping read at an amplitude in m (None: small amplitude).

    required: whether the required damping is asked for, and slosh and engine at it: most of the work.
    """

    amplitude: float | None = None
    required: bool = True


@dataclass(frozen=True, kw_only=True)
class Nonlinear:
    """A nonlinear simulation of each case from displaced slosh, extra gain and delay added to the loop.

    duration: s, of a case; a flight has its own. initial_slosh: m. gain: amplitude ratio. delay: s. gust_speed,
    gust_start, gust_duration: peak in m/s, start and duration in s of one 1-cosine gust of the lateral wind; none where
    the peak is 0. Of a flight the start is in its own time, and each stretch into which nothing is carried begins with
    the initial slosh.
    """

    duration: float = 300.0
    initial_slosh: float = 0.01
    gain: float = 1.0
    delay: float = 0.0
    gust_speed: float = 0.0
    gust_start: float = 0.0
    gust_duration: float = 10.0


@dataclass(frozen=True, kw_only=True)
class Moment:
    """One time of a flight in s, the phase it lies in, and the single case at it."""

    phase: str
    time: float
    case: Case


def moments_of(phases: tuple[Phase, ...]) -> tuple[Moment, ...]:
    """Return every time of every phase."""
    each = ((p, float(t), case) for p in phases for t, case in zip(p.time, p.cases, strict=True))
    return tuple(Moment(phase=p.name, time=t, case=case) for p, t, case in each)


@dataclass(frozen=True, kw_only=True)
class Dispersion:
    """An uncertain case, or the moments of an uncertain flight, and what is asked of it.

    case: of a flight, that of its first moment. flight: each draw holds for all moments, and each is assessed; () where
    there is one case.
    sampling: "random", independent draws, on which statements with a confidence rest; "sobol", evenly spread ones.
    coverage, confidence: of the statement that decides the verdict.
    digest: hash of the files it was read from, "" for none.
    phases: of a flight that is simulated; its moments are theirs, in order.
    """

    name: str
    case: Case
    parameters: tuple[Parameter, ...]
    correlations: tuple[Correlation, ...] = ()
    sampling: Literal["random", "sobol"] = "random"
    analysis: Linear | Nonlinear = field(default_factory=Linear)
    coverage: float = 0.99865
    confidence: float = 0.9
    digest: str = ""
    flight: tuple[Moment, ...] = ()
    phases: tuple[Phase, ...] = ()

    @functools.cached_property
    def events(self) -> tuple[Event, ...]:
        """The events between the phases of a flight that is simulated."""
        return events_of(self.phases)

    @property
    def stretches(self) -> tuple[tuple[Phase, ...], ...]:
        """The phases in runs between which nothing is carried, each simulated from the initial slosh; () of a case."""
        return stretches(self.phases, [event.carries for event in self.events]) if self.phases else ()

    @property
    def cases(self) -> tuple[Case, ...]:
        """The case, or those of all moments."""
        return tuple(moment.case for moment in self.flight) or (self.case,)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(p.input for p in self.parameters)


def drawn(dispersion: Dispersion, seed: int, first: int, count: int) -> Array:
    """Return the draws of the cases first, first + 1, ...; (count, parameters), factors or SI values."""
    from scipy.special import ndtr, ndtri  # 0.1 s: only when something is drawn

    stream = random_stream if dispersion.sampling == "random" else sobol_stream
    u = {}
    for p in dispersion.parameters:
        once = p.systematic
        found = random_stream(seed, p.input, 0, 1) if once else stream(seed, p.input, first, count)
        u[p.input] = np.broadcast_to(found, count)
    for group in dispersion.correlations:
        scores = [ndtri(u[name]) for name in group.inputs]
        for k, (name, row) in enumerate(zip(group.inputs, group.root, strict=True)):
            # no matrix product: its bits would depend on how many cases are drawn together
            mixed = sum((row[j] * scores[j] for j in range(k + 1)), np.zeros(count))
            u[name] = np.clip(ndtr(mixed), 2.0**-54, 1.0 - 2.0**-53) if np.any(row[:k]) else u[name]
    return np.stack([p.distribution.quantile(u[p.input]) for p in dispersion.parameters], axis=-1)
