"""A decaying oscillation whose damping depends on its amplitude: envelope and phase in closed form.

To first order of averaging, dA/dt = -w A xi(A). With xi = xi0 + q (A/A0)^p, q the amplitude-dependent part at the first
sample, this is a Bernoulli equation, solved by a(t) = A/A0 =

    exp(-xi0 w t) (1 + q p w t phi(p w xi0 t))^(-1/p),   phi(k) = (1 - exp(-k))/k                     (a)

q = 0 is the exponential, xi0 = 0 and p = 1 the hyperbola 1/(1 + q w t) of the odd square law. The phase is carried to
second order, so that w is the undamped natural frequency that a case file wants. With y = q a^p,

    theta' = w (1 - xi^2/2 - (K - 1/2) y^2),  and the wave lags by y/2 more than at rest               (b)

    K = (p/(p+2) (M (2p+3)/(2p+4) - m^2) + M/(2p+4))/m^2,  m = <|sin|^(p+2)>,  M = <|sin|^(2p+2)>

K(0) = 1/2 is the linear damper's sqrt(1 - xi^2), K(1) = 0.592. The integral is again closed, since xi w dt = -dA/A. A
wave that softens or stiffens with its height adds w k int a^2 dt, k being the relative change at the first sample.
Neither (a) nor (b) depends on the amplitude's size, so that amplitude and phase at the start, offset and drift enter
linearly and can be projected out.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sloshpy.units import Array, ComplexArray

STEEPEST, FLATTEST = 4.0, 0.05  # exponents that are told apart from others; PowerDamping ends at 4
PARAMETERS = ("w", "xi0", "q", "p", "k")
_STEP = {"xi0": 1e-8, "q": 1e-8, "p": 1e-6}  # of the derivatives by differences


@dataclass(frozen=True, kw_only=True)
class DecayLaw:
    """One law to be tried: which of w, xi0, q, p, k are free; the others keep the value written here."""

    name: str
    free: tuple[str, ...]
    exponent: float = 1.0

    @property
    def full(self) -> Array:
        """Return w, xi0, q, p, k before anything is fitted."""
        return np.array([0.0, 0.0, 0.0, self.exponent, 0.0])

    @property
    def at(self) -> list[int]:
        """Return the places of the free parameters among w, xi0, q, p, k."""
        return [PARAMETERS.index(name) for name in self.free]

    @property
    def words(self) -> str:
        """Return the law as a reader would say it: "power, exponent 1"."""
        if self.name == "constant":
            return "constant"
        return f"{self.name}, exponent {'free' if 'p' in self.free else f'{self.exponent:g}'}"


CONSTANT = DecayLaw(name="constant", free=("w", "xi0"))
# the odd square law and a ring baffle's exponent before a free one
LAWS = (
    CONSTANT,
    DecayLaw(name="power", free=("w", "q"), exponent=1.0),
    DecayLaw(name="power", free=("w", "q"), exponent=0.5),
    DecayLaw(name="power", free=("w", "q", "p")),
    DecayLaw(name="sum", free=("w", "xi0", "q"), exponent=1.0),
    DecayLaw(name="sum", free=("w", "xi0", "q"), exponent=0.5),
    DecayLaw(name="sum", free=("w", "xi0", "q", "p")),
)


@lru_cache(maxsize=64)
def second_order(p: float) -> float:
    """Return K of (b) at an exponent."""

    def mean(s: float) -> float:  # of |sin|^s
        return math.gamma(0.5 * (s + 1.0)) / (math.sqrt(math.pi) * math.gamma(0.5 * s + 1.0))

    m, M = mean(p + 2.0), mean(2.0 * p + 2.0)
    return (p / (p + 2.0) * (M * (2.0 * p + 3.0) / (2.0 * p + 4.0) - m**2) + M / (2.0 * p + 4.0)) / m**2


def log_envelope_and_phase(values: Array, time: Array) -> tuple[Array, Array]:
    """Return ln a(t) and theta(t), (a) and (b).

    Args:
        values: w in rad/s, xi0, q, p, k.
        time: s since the first sample, increasing, (n,).
    """
    w, xi0, q, p, softening = values
    p = min(max(p, FLATTEST), STEEPEST)
    k = p * w * xi0 * time
    small = np.abs(k) < 1e-8
    with np.errstate(over="ignore", invalid="ignore"):
        phi = np.where(small, 1.0 - 0.5 * k, -np.expm1(-k) / np.where(small, 1.0, k))
        growth = np.maximum(q * p * w * time * phi, -0.999999)  # a fit that strays into a blow-up is led back
        log_a = -xi0 * w * time - np.log1p(growth) / p
        log_a = np.minimum(np.maximum(log_a, -700.0), 50.0)  # a fit that strays, again
        fall = q * np.expm1(p * log_a)  # of y since the first sample
        least = np.maximum([xi0 + q], 1e-12), np.maximum(xi0 + q + fall, 1e-12)
        more = (second_order(p) - 0.5) / p * (fall + xi0 * np.log(least[0] / least[1]))
        theta = w * time + 0.5 * (xi0 * log_a + fall / p - fall) + more
    if softening != 0.0:
        theta += w * softening * _energy(log_a, time)
    return log_a, theta


def wave(values: Array, time: Array) -> ComplexArray:
    """Return a(t) exp(i theta(t)), of which a record shows a real combination."""
    log_a, theta = log_envelope_and_phase(values, time)
    return np.asarray(np.exp(log_a + 1j * theta))


def wave_slopes(law: DecayLaw, values: Array, time: Array) -> list[ComplexArray]:
    """Return the derivatives of ln a + i theta by the free parameters: exact for w and k, else by differences."""
    log_a, theta = log_envelope_and_phase(values, time)
    w, xi0, q, p, k = values
    slopes: list[ComplexArray] = []
    for name, at in zip(law.free, law.at, strict=True):
        if name == "w":  # both are functions of w t
            exponent = min(max(p, FLATTEST), STEEPEST)
            y = q * np.exp(exponent * log_a)
            xi = xi0 + y
            rate = 1.0 - 0.5 * xi**2 - (second_order(exponent) - 0.5) * y**2 + 0.5 * exponent * xi * y
            slopes.append(np.asarray(time * (-xi + 1j * (rate + k * np.exp(2.0 * log_a)))))
        elif name == "k":
            slopes.append(np.asarray(1j * w * _energy(log_a, time)))
        else:
            there = values.copy()
            there[at] += _STEP[name]
            log_there, theta_there = log_envelope_and_phase(there, time)
            slopes.append(np.asarray((log_there - log_a + 1j * (theta_there - theta)) / _STEP[name]))
    return slopes


def _energy(log_a: Array, time: Array) -> Array:
    """Return int a^2 dt, by the trapezoidal rule: a^2 changes little from sample to sample."""
    energy = np.exp(2.0 * log_a)
    return np.concatenate([[0.0], np.cumsum(0.5 * (energy[1:] + energy[:-1]) * np.diff(time))])


def ratio_at(values: Array, relative_amplitude: Array) -> Array:
    """Return xi at amplitudes A/A0, shape (..., amplitudes) for values of shape (..., 5)."""
    v = np.asarray(values)[..., None, :]
    p = np.clip(v[..., 3], FLATTEST, STEEPEST)
    return np.asarray(v[..., 1] + v[..., 2] * relative_amplitude**p)
