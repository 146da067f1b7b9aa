"""Slosh of the flat-bottomed cylinder and annulus in closed form, by Bessel functions (NASA SP-106, ch. 2)."""

from collections.abc import Callable

import numpy as np

from sloshpy.tank.liquid import LiquidSection
from sloshpy.tank.modal import Modal
from sloshpy.units import Array

_TERMS = 120  # of the rigid-lid series, whose terms fall with the fifth power: 1e-11 of the sum


def flat_bottom(section: LiquidSection, modes: int) -> Modal:
    """Return modes and rigid-lid inertia of liquid between upright circular walls and a flat bottom.

    phi = f(r) cosh(k z) / cosh(k h) cos(theta), f' = 0 at both walls: kappa = k tanh(k h).
    """
    a, b, h = section.radius, section.inner_radius, section.depth
    k, f = (_cylinder if b == 0.0 else _annulus)(a, b, max(modes, _TERMS))
    f_a, f_b = f(k, np.asarray(a)), (f(k, np.asarray(b)) if b > 0.0 else np.zeros(len(k)))
    walls = [(a, f_a), (b, f_b)] if b > 0.0 else [(a, f_a)]
    moment = (a * f_a - b * f_b) / k**2  # of r^2 f dr, by Bessel's equation
    square = 0.5 * ((a**2 - k**-2.0) * f_a**2 - (b**2 - k**-2.0) * f_b**2)  # of r f^2 dr
    tanh = np.tanh(k * h)
    # theta-averaged: phi = x z + Psi about the mid-height, Psi' = -2 x on floor and lid
    disc = np.pi * (a**2 - b**2)
    lid = disc * h**3 / 12.0 - 3.0 * h * section.surface_inertia
    lid += 8.0 * np.pi * float(np.sum(moment**2 / square * np.tanh(0.5 * k * h) / k))
    still = h / (
        2.0 * np.cosh(np.minimum(k * h, 300.0)) ** 2
    )  # with tanh / 2 k: int cosh^2 and sinh^2 over cosh^2(k h)
    moving = tanh / (2.0 * k)
    sides = sum(c * f_c**2 * ((moving + still) / c**2 + k**2 * (moving - still)) for c, f_c in walls)
    volume = k * tanh * square
    floor = k**2 * square / np.cosh(np.minimum(k * h, 300.0)) ** 2 / volume
    n = slice(0, modes)
    radius = np.linspace(b, a, 201)
    kappa = k * tanh
    return Modal(
        kappa=kappa[n],
        mass_volume=(np.pi * kappa * moment**2 / square)[n],
        spring_height=(h - 2.0 / k * np.tanh(0.5 * k * h))[n],
        wave=(kappa * f_a * moment / square)[n],
        lid_volume=lid,
        error=np.full(modes, 1e-10),
        radius=radius,
        shape=np.stack([f(k[j], radius) / f_a[j] for j in range(modes)]),
        friction=(sides / volume + floor)[n],
        floor_friction=floor[n],
        friction_error=np.full(modes, 1e-10),
        method="closed form",
        fixed_error=1e-8,  # a difference of greater numbers
    )


def _cylinder(a: float, b: float, count: int) -> tuple[Array, Callable[..., Array]]:
    from scipy.special import j1, jnp_zeros

    return jnp_zeros(1, count) / a, lambda k, r: np.asarray(j1(k * r))


def _annulus(a: float, b: float, count: int) -> tuple[Array, Callable[..., Array]]:
    """Return the wave numbers and J1(k r) Y1'(k a) - Y1(k r) J1'(k a)."""
    from scipy.optimize import brentq
    from scipy.special import j1, jvp, y1, yvp

    def slope(k: Array) -> Array:
        return np.asarray(jvp(1, k * b) * yvp(1, k * a) - yvp(1, k * b) * jvp(1, k * a))

    apart = np.pi / (a - b)  # what the roots come to differ by; the first lies near 2 / (a + b)
    k = np.concatenate([np.linspace(0.5, 1.5, 9) * 2.0 / (a + b), np.arange(0.5, count + 1.0, 0.125) * apart])
    k = np.unique(k)
    value = slope(k)
    change = np.flatnonzero(value[1:] * value[:-1] < 0.0)[:count]
    roots = np.array([brentq(slope, k[i], k[i + 1], xtol=1e-15 * k[i], rtol=1e-14) for i in change])
    return roots, lambda q, r: np.asarray(j1(q * r) * yvp(1, q * a) - y1(q * r) * jvp(1, q * a))
