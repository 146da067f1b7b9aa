"""The bridge between a damping force and its equivalent linear damping, eqs 14-20.

A damper decelerates the slosh mass by h(|v|) v. Under v = V sin(t) its sinusoidal describing function is

    N(V) = (4/pi) int_0^{pi/2} h(V sin t) sin^2 t dt                                             (a)

and a linear damper of ratio xi has N = 2 xi w (eq 17). Equation (a) is an Abel integral; its inverse is

    h(u) = (1/2) int_0^{pi/2} sin^3 t (3 N(u sin t) + u sin t N'(u sin t)) dt                     (b)

so that a measured xi(A) gives the force law exactly; eq 20 of the paper is its local approximation.
"""

import math
from collections.abc import Callable

import numpy as np

from sloshpy.units import Array

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_ANGLE = 0.25 * math.pi * (_NODES + 1.0)
_WEIGHT = 0.25 * math.pi * _WEIGHTS


def describing_function_factor(exponent: float) -> float:
    """Return g(p), the describing function of |v|^p v at unit amplitude.

    g(p) = (2/sqrt(pi)) Gamma((p+3)/2) / Gamma((p+4)/2); g(1) = 8/(3 pi), eq 15.
    """
    return 2.0 / math.sqrt(math.pi) * math.gamma((exponent + 3.0) / 2.0) / math.gamma((exponent + 4.0) / 2.0)


def describing_function_integral(acceleration: Callable[[Array], Array], amplitude: Array) -> Array:
    """Return N(V), 1/s, of any odd damping acceleration by quadrature of (a).

    Args:
        acceleration: damping acceleration in m/s^2 at a velocity in m/s, opposing the velocity.
        amplitude: velocity amplitudes V in m/s, > 0, any shape.
    """
    V = np.asarray(amplitude, dtype=float)[..., None]
    return np.asarray(4.0 / math.pi * np.sum(-acceleration(V * np.sin(_ANGLE)) / V * np.sin(_ANGLE) * _WEIGHT, axis=-1))


def invert_describing_function(
    N: Callable[[Array], Array], slope: Callable[[Array], Array], speed: Array, knots: Array
) -> Array:
    """Return h(u), 1/s, of the damper whose describing function is N(V), by quadrature of (b).

    Args:
        N: describing function, 1/s, at velocity amplitudes in m/s.
        slope: its derivative dN/dV, 1/m.
        speed: speeds u in m/s, > 0, shape (...).
        knots: speeds in m/s, increasing, where N has a kink in its derivatives; the quadrature is split there.
    """
    u = np.asarray(speed, dtype=float)[..., None]
    edges = np.concatenate([0.0 * u, np.arcsin(np.clip(knots / u, 0.0, 1.0)), 0.0 * u + 0.5 * math.pi], axis=-1)
    low, width = edges[..., :-1, None], np.diff(edges, axis=-1)[..., None]
    nodes, weights = np.polynomial.legendre.leggauss(16)
    t = low + 0.5 * width * (nodes + 1.0)
    x = u[..., None] * np.sin(t)
    integrand = np.sin(t) ** 3 * (3.0 * N(x) + x * slope(x))
    return np.asarray(0.5 * np.sum(integrand * 0.5 * width * weights, axis=(-1, -2)))
