"""Maximum likelihood of a decay under white Gaussian noise: least squares by variable projection.

x(t) = sum over modes of Re(c a(t) exp(i theta(t))) + offset + slow drift, a parabola. The linear coefficients are
projected out (Golub and Pereyra 1973, the Jacobian by Kaufman 1975); SciPy's Levenberg-Marquardt finds the rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sloshpy.damping.decay_model import DecayLaw, log_envelope_and_phase, wave, wave_slopes
from sloshpy.units import Array, ComplexArray

_EXACT = 1e-7  # of the amplitude: noise below it is that of the arithmetic, and tells no law from another


@dataclass(frozen=True, kw_only=True)
class DecayFit:
    """A fitted record.

    laws: of each mode, the main one first. values: (modes, 5), w, xi0, q, p, k of each. coefficient: (2 modes + 3,), of
    cos and sin of each mode, of offset and drift. residual: (n,), in the record's unit.
    """

    laws: tuple[DecayLaw, ...]
    values: Array
    coefficient: Array
    time: Array
    residual: Array

    @property
    def start_amplitude(self) -> Array:
        """Amplitude of each mode at the first sample, (modes,)."""
        return np.hypot(self.coefficient[:-3:2], self.coefficient[1:-3:2])

    @property
    def count(self) -> int:
        """Number of fitted numbers, the noise level left out."""
        return sum(len(law.free) for law in self.laws) + len(self.coefficient)

    @property
    def squares(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residual @ self.residual)

    @property
    def noise(self) -> float:
        """Standard deviation of the noise, free of the bias of the fit."""
        return float(np.sqrt(self.squares / max(len(self.residual) - self.count, 1)))

    @property
    def exact(self) -> bool:
        """Whether nothing is left but the rounding of the arithmetic."""
        return self.noise < _EXACT * float(self.start_amplitude[0])

    def amplitude(self, mode: int = 0) -> Array:
        """Return the amplitude of a mode over the record, (n,)."""
        log_a, _ = log_envelope_and_phase(self.values[mode], self.time)
        return np.asarray(self.start_amplitude[mode] * np.exp(log_a))

    def part(self, mode: int) -> Array:
        """Return what a mode adds to the record, (n,)."""
        cosine, sine = self.coefficient[2 * mode : 2 * mode + 2]
        return np.asarray(np.real(wave(self.values[mode], self.time) * (cosine - 1j * sine)))

    def information(self, excess: float = 1.0) -> float:
        """Return Schwarz's criterion; `excess` is the noise's power at the line over its mean, 1 for white noise."""
        n = len(self.residual) / excess
        least = len(self.residual) * (_EXACT * float(self.start_amplitude[0])) ** 2
        return float(n * np.log((self.squares + least) / len(self.residual)) + (self.count + 1) * np.log(n))

    def akaike(self, excess: float = 1.0) -> float:
        """Return Akaike's criterion as corrected for few samples (Hurvich and Tsai 1989); `excess` as above."""
        n, numbers = len(self.residual), self.count + 1
        schwarz = self.information(excess) - numbers * np.log(n / excess)
        return float(schwarz + 2.0 * numbers * n / max(n - numbers - 1, 1))

    @cached_property
    def jacobian(self) -> Array:
        """Derivative of the model by all free parameters, mode after mode, then by the coefficients: (n, count)."""
        modes = [wave(values, self.time) for values in self.values]
        columns = _changes(self.laws, self.values, self.time, modes, self.coefficient)
        return np.concatenate([columns, _columns(modes, self.time)], axis=1)


def fit_decay(laws: Sequence[DecayLaw], start: Array, time: Array, value: Array) -> DecayFit | None:
    """Fit a record by one or more modes; None where the search does not settle.

    Args:
        laws: of each mode.
        start: first guess of w, xi0, q, p, k of each mode, (modes, 5).
        time: s since the first sample, (n,).
        value: the record, (n,).
    """
    from scipy.optimize import least_squares  # 0.3 s: only when a record is fitted

    sizes = {"w": 1.0 / float(time[-1]), "xi0": 0.01, "q": 0.01, "p": 0.3, "k": 0.001}
    scale = np.array([sizes[name] for law in laws for name in law.free])
    origin = np.concatenate([start[m, law.at] for m, law in enumerate(laws)])

    def full(x: Array) -> Array:
        values, first = np.array(start), 0
        for m, law in enumerate(laws):
            values[m, law.at] = (origin + scale * x)[first : first + len(law.free)]
            first += len(law.free)
        return values

    memory: dict[bytes, tuple[Array, Array, list[ComplexArray], Array, Array]] = {}

    def projected(x: Array) -> tuple[Array, Array, list[ComplexArray], Array, Array]:
        key = x.tobytes()
        if key not in memory:
            memory.clear()  # the solver asks for residual and Jacobian of one point in turn
            values = full(x)
            modes = [wave(v, time) for v in values]
            q, r = np.linalg.qr(_columns(modes, time))
            inside = q.T @ value
            diagonal = np.abs(np.diag(r))
            singular = np.min(diagonal) < 1e-12 * np.max(diagonal)
            coefficient = np.linalg.lstsq(r, inside, rcond=1e-12)[0] if singular else np.linalg.solve(r, inside)
            memory[key] = values, q, modes, coefficient, value - q @ inside
        return memory[key]

    def jacobian(x: Array) -> Array:
        values, q, modes, coefficient, _ = projected(x)
        change = _changes(laws, values, time, modes, coefficient) * scale
        return np.asarray(q @ (q.T @ change) - change)

    try:
        found = least_squares(lambda x: projected(x)[4], np.zeros(len(origin)), jacobian, method="lm", max_nfev=60)
    except (ValueError, np.linalg.LinAlgError):  # a guess without a finite residual
        return None
    values, _, _, coefficient, residual = projected(found.x)
    if found.status <= 0 or not np.all(np.isfinite(residual)):
        return None
    return DecayFit(laws=tuple(laws), values=values, coefficient=coefficient, time=time, residual=residual)


def _columns(modes: Sequence[ComplexArray], time: Array) -> Array:
    x = 2.0 * time / time[-1] - 1.0
    waves = [part for mode in modes for part in (mode.real, mode.imag)]
    return np.stack([*waves, np.ones_like(time), x, 1.5 * x**2 - 0.5], axis=1)


def _changes(
    laws: Sequence[DecayLaw], values: Array, time: Array, modes: Sequence[ComplexArray], coefficient: Array
) -> Array:
    """Return the derivative of the model by each free parameter at fixed coefficients, (n, parameters)."""
    columns = []
    for m, law in enumerate(laws):
        cosine, sine = coefficient[2 * m], coefficient[2 * m + 1]
        for slope in wave_slopes(law, values[m], time):
            change = modes[m] * slope
            columns.append(cosine * change.real + sine * change.imag)
    return np.stack(columns, axis=1)
