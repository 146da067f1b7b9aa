"""A second implementation for vehicles that bend, swing heavy engines and fly through air.

Written from the equations alone, in full coordinates [Z, phi, z_j, eta_i, beta], each row divided by its own mass:

    Z'' + sum m_j/M z_j''                 = k3 phi + k4 beta + S/M beta'' + N/M alpha ,   alpha = phi - Z'/V
    phi'' - sum m_j/I (l_j z_j'' + k3 z_j) = -(R' Xcg + a S)/I beta - (S Xcg + I_e)/I beta'' + N (Xcp - Xcg)/I alpha
    z_j'' + 2 xi w z_j' + w^2 z_j         = -Z'' + l_j phi'' + k3 phi - sum Y_ij eta_i'' + a sum Y'_ij eta_i
    eta_i'' + 2 zeta W eta_i' + W^2 eta_i = -sum m_j/M_i (Y_ij z_j'' - a Y'_ij z_j) + (R' Y_i0 - a S Y'_i0)/M_i beta
                                            + (S Y_i0 - I_e Y'_i0)/M_i beta''

Nothing is shared with the package. Z stays in; stability without a delay comes from the generalised eigenvalues of the
first-order descriptor form, with a delay from the argument principle on the exact bordered determinant.
"""

from dataclasses import dataclass

import numpy as np
import scipy.integrate
import scipy.interpolate
import scipy.linalg
import scipy.signal


@dataclass(frozen=True)
class Second:
    """E2 q'' + E1 q' + E0 q = b0 beta + b2 beta'', q = [Z, phi, z.., eta..], and the sensor rows."""

    E2: np.ndarray
    E1: np.ndarray
    E0: np.ndarray
    b0: np.ndarray
    b2: np.ndarray
    attitude: np.ndarray
    rate: np.ndarray
    felt0: np.ndarray  # accelerometer: felt2 q'' + felt0 q
    felt2: np.ndarray
    tanks: int
    drift: int  # how often s divides the column of Z


def second_order(v, xi):
    """The equations above as matrices, at slosh damping ratios xi (tanks only)."""
    M, I, Xcg, R = v.mass, v.inertia, v.cg, v.vectored_thrust
    k3 = (v.thrust - v.drag) / M
    nt, nf = len(v.tanks), len(v.flexible_modes)
    n = 2 + nt + nf
    E2, E1, E0 = np.eye(n), np.zeros((n, n)), np.zeros((n, n))
    b0, b2, attitude, rate = (np.zeros(n) for _ in range(4))
    S, Ie = (v.engine.first_moment, v.engine.inertia) if v.engine else (0.0, 0.0)
    E0[0, 1] = -k3
    b0[0], b0[1] = R / M, -(R * Xcg + k3 * S) / I
    b2[0], b2[1] = S / M, -(S * Xcg + Ie) / I
    attitude[1] = rate[1] = 1.0
    for j, t in enumerate(v.tanks):
        c, m, l, w = 2 + j, t.slosh_mass, v.cg - t.station, t.frequency
        E2[0, c], E2[1, c], E0[1, c] = m / M, -m * l / I, -m * k3 / I
        E2[c, 0], E2[c, 1], E0[c, 1] = 1.0, -l, -k3
        E1[c, c], E0[c, c] = 2 * xi[j] * w, w * w
        for i, f in enumerate(v.flexible_modes):
            r, Y = 2 + nt + i, f.tank[t.name]
            E2[c, r], E0[c, r] = Y.deflection, -k3 * Y.slope
            E2[r, c], E0[r, c] = m / f.generalized_mass * Y.deflection, -m / f.generalized_mass * k3 * Y.slope
    for i, f in enumerate(v.flexible_modes):
        r, G = 2 + nt + i, f.generalized_mass
        E1[r, r], E0[r, r] = 2 * f.damping * f.frequency, f.frequency**2
        b0[r] = (R * f.gimbal.deflection - k3 * S * f.gimbal.slope) / G
        b2[r] = (S * f.gimbal.deflection - Ie * f.gimbal.slope) / G
        attitude[r] = f.gyro.slope
        rate[r] = f.rate_gyro.slope if f.rate_gyro else f.gyro.slope
    if v.aerodynamics:
        N, V = v.aerodynamics.normal_force_slope, v.aerodynamics.speed
        for row, share in ((0, N / M), (1, N * (v.aerodynamics.center_of_pressure - Xcg) / I)):
            E0[row, 1] -= share
            E1[row, 0] += share / V
    felt0, felt2 = np.zeros(n), np.zeros(n)
    if v.accelerometer_station is not None:
        # acceleration of the point along Z less that of falling with the axial acceleration along the local normal
        felt2[0], felt2[1], felt0[1] = 1.0, v.accelerometer_station - Xcg, -k3
        for i, f in enumerate(v.flexible_modes):
            felt2[2 + nt + i], felt0[2 + nt + i] = f.accelerometer.deflection, -k3 * f.accelerometer.slope
    return Second(E2, E1, E0, b0, b2, attitude, rate, felt0, felt2, nt, 1 if v.aerodynamics else 2)


def actuator(pilot):
    """Numerator and denominator of the engine's actuator, 1/1 for none."""
    a = pilot.actuator
    if a is None:
        return [1.0], [1.0]
    if a.numerator is not None:
        return list(a.numerator), list(a.denominator)
    return [a.frequency**2], [1.0, 2 * a.damping * a.frequency, a.frequency**2]


def forward(pilot, s):
    """Numerator (delay in it) and denominator of beta / (a0 phi + a1 phi')."""
    num, den = pilot.gain * np.exp(-s * pilot.delay), np.ones_like(s)
    for f in pilot.filter:
        num, den = num * np.polyval(f.numerator, s), den * np.polyval(f.denominator, s)
    top, bottom = actuator(pilot)
    return num * np.polyval(top, s), den * np.polyval(bottom, s)


def divided(p, pilot):
    """How often s divides the column of Z once guidance may hold it."""
    return 0 if pilot.drift_gain else min(p.drift, 1) if pilot.drift_rate_gain else p.drift


def _stiffness(p, s):
    S = np.asarray(s, dtype=complex)[..., None, None]
    return S * S * p.E2 + S * p.E1 + p.E0


def _measured(p, pilot, s):
    s = s[..., None]
    body = pilot.attitude_gain * p.attitude + s * pilot.rate_gain * p.rate
    body = body + (pilot.drift_gain + s * pilot.drift_rate_gain) * np.eye(len(p.b0))[0]
    return body + pilot.accelerometer_gain * (p.felt0 + s * s * p.felt2)


def solved(p, pilot, s):
    """L and z_j/beta at complex s by one full solve; also sum |terms| / |L|, the digits that L itself cancels."""
    s = np.asarray(s, dtype=complex)
    q = np.linalg.solve(_stiffness(p, s), (p.b0 + s[..., None] ** 2 * p.b2)[..., None])[..., 0]
    num, den = forward(pilot, s)
    terms = _measured(p, pilot, s) * q
    y = np.sum(terms, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):  # exactly on a zero nothing is left
        cancelled = np.sum(np.abs(terms), axis=-1) / np.abs(y)
    return -num / den * y, q[..., 2 : 2 + p.tanks], cancelled


def bordered(p, pilot, s):
    """The matrix in [Z, phi, z.., eta.., beta] that is singular at the closed-loop poles; drift divided out of it."""
    s = np.asarray(s, dtype=complex)
    n = len(p.b0)
    num, den = forward(pilot, s)
    T = np.zeros((*s.shape, n + 1, n + 1), dtype=complex)
    T[..., :n, :n] = _stiffness(p, s)
    # the column of Z is s^2 E2 + s E1 (+ 0): without air s^2 divides it, with air s, with guidance less
    T[..., :n, 0] = {
        2: lambda: p.E2[:, 0],
        1: lambda: s[..., None] * p.E2[:, 0] + p.E1[:, 0],
        0: lambda: s[..., None] ** 2 * p.E2[:, 0] + s[..., None] * p.E1[:, 0],
    }[divided(p, pilot)]()
    T[..., :n, n] = -(p.b0 + s[..., None] ** 2 * p.b2)
    T[..., n, :n] = -num[..., None] * _measured(p, pilot, s)
    lateral = {
        2: lambda: pilot.accelerometer_gain * p.felt2[0] + 0 * s,
        1: lambda: pilot.drift_rate_gain + s * pilot.accelerometer_gain * p.felt2[0],
        0: lambda: pilot.drift_gain + s * pilot.drift_rate_gain + s * s * pilot.accelerometer_gain * p.felt2[0],
    }
    T[..., n, 0] = -num * lateral[divided(p, pilot)]()
    T[..., n, n] = den
    return T


def backward_error(p, pilot, s):
    """Least change of the bordered matrix, its entries scaled to one, that makes it singular at s."""
    T = bordered(p, pilot, s)
    for _ in range(3):
        T = T / np.abs(T).max(axis=-1, keepdims=True)
        T = T / np.abs(T).max(axis=-2, keepdims=True)
    return np.linalg.svd(T, compute_uv=False)[..., -1]


def descriptor(p, pilot, cut=None):
    """E x' = A x of the closed loop without delay, x = [q, q', filters.., actuator..], Z kept; and the row of beta.

    Given a dictionary `cut`, the command is cut at the delay, before the actuator: "signal" and "moving" get the
    command before, "enters" the column on E x' by which the command after it comes in, "through" its part of beta.

    A signal is a row on x and a row on x'; beta'' is the derivative of beta' = C A x of the actuator's own states. The
    accelerometer is felt2 of q'' = x', so that its loop through the engine is part of E and needs no solving.
    """
    n = len(p.b0)
    chain = [(f.numerator, f.denominator) for f in pilot.filter] + [actuator(pilot)]
    size = 2 * n + sum(len(bottom) - 1 for _, bottom in chain)
    E, A = np.eye(size), np.zeros((size, size))
    A[:n, n : 2 * n] = np.eye(n)
    E[n : 2 * n, n : 2 * n] = p.E2
    A[n : 2 * n, :n], A[n : 2 * n, n : 2 * n] = -p.E0, -p.E1
    signal = np.zeros(size)
    signal[:n] = pilot.gain * pilot.attitude_gain * p.attitude
    signal[n : 2 * n] = pilot.gain * pilot.rate_gain * p.rate
    signal[:n] += pilot.gain * pilot.accelerometer_gain * p.felt0
    signal[0] += pilot.gain * pilot.drift_gain
    signal[n] += pilot.gain * pilot.drift_rate_gain
    moving = np.zeros(size)
    moving[n : 2 * n] = pilot.gain * pilot.accelerometer_gain * p.felt2
    at = 2 * n
    for i, (top, bottom) in enumerate(chain):
        if cut is not None and i == len(chain) - 1:
            cut["signal"], cut["moving"], cut["enters"] = signal, moving, np.zeros(size)
            signal, moving = np.zeros(size), np.zeros(size)
        fa, fb, fc, fd = scipy.signal.tf2ss(top, bottom)
        order = len(bottom) - 1
        rows = slice(at, at + order)
        if order:
            A[rows] += np.outer(fb[:, 0], signal)
            A[rows, rows] += fa
            E[rows] -= np.outer(fb[:, 0], moving)
        signal, moving = fd[0, 0] * signal, fd[0, 0] * moving
        if order:
            signal[rows] += fc[0]
        at += order
    A[n : 2 * n] += np.outer(p.b0, signal)
    E[n : 2 * n] -= np.outer(p.b0, moving)
    assert not moving.any()
    if cut is not None:
        cut["enters"][rows if order else slice(0, 0)] = fb[:, 0] if order else []
        cut["enters"][n : 2 * n] += p.b0 * fd[0, 0]
        cut["through"] = fd[0, 0]
    if p.b2.any():
        assert fd[0, 0] == 0.0
        assert np.abs(fc @ fb).max() == 0.0  # two orders: beta' is a combination of the states
        E[n : 2 * n, rows] -= np.outer(p.b2, (fc @ fa)[0])
    return E, A, signal


def without_drift(p, pilot, E, A):
    """Strike out the states that nothing depends on: Z, and without air Z' too."""
    n = len(p.b0)
    A = np.linalg.solve(E, A)
    gone = [0, n][: divided(p, pilot)]
    keep = np.delete(np.arange(len(A)), gone)
    assert not A[np.ix_(keep, gone)].any()
    return A[np.ix_(keep, keep)], keep


def poles(p, pilot):
    """Closed-loop poles without delay."""
    return np.linalg.eigvals(without_drift(p, pilot, *descriptor(p, pilot)[:2])[0])


def unstable_poles(p, pilot):
    """Number of poles in the right half-plane: turns of the exact bordered determinant along the imaginary axis."""
    order = 2 * len(p.b0) - divided(p, pilot) + sum(len(f.denominator) - 1 for f in pilot.filter)
    order += len(actuator(pilot)[1]) - 1
    prompt = poles(p, pilot.model_copy(update={"delay": 0.0}))
    size = np.abs(prompt)
    spread = np.array([-30, -10, -3, -1, -0.3, 0, 0.3, 1, 3, 10, 30])
    near = np.abs(prompt.imag[:, None] + np.abs(prompt.real)[:, None] * spread).ravel()
    w = np.concatenate([np.geomspace(1e-3 * size.min(), 1e6 * size.max(), 250), near[near > 0]])
    gain = np.abs(solved(p, pilot, 1j * w)[0])
    # where the gain is above 0.3 the delay turns the determinant: a fifth of a radian at a time, none lost
    turns = np.arange(0.0, np.max(w[gain > 0.3], initial=0.0), 0.2 / pilot.delay) if pilot.delay else []
    w = np.unique(np.concatenate([[0.0], w, turns]))

    def turned(w):
        T = bordered(p, pilot, 1j * w)
        sign, _ = np.linalg.slogdet(T / np.abs(T).max(axis=-1, keepdims=True))  # the scaling is real
        return sign

    f = turned(w)
    for _ in range(60):
        wide = np.flatnonzero(np.abs(np.angle(f[1:] / f[:-1])) > 0.5)
        if len(wide) == 0:
            break
        middle = 0.5 * (w[wide] + w[wide + 1])
        w, f = np.insert(w, wide + 1, middle), np.insert(f, wide + 1, turned(middle))
    count = (order * np.pi / 2 - np.sum(np.angle(f[1:] / f[:-1]))) / np.pi
    assert abs(count - round(count)) < 0.02, count
    return round(count)


def stable(p, pilot):
    return unstable_poles(p, pilot) == 0 if pilot.delay else bool(np.all(poles(p, pilot).real < 0))


def history(v, pilot, forces, z0, times):
    """Slosh, engine angle and measured attitude; `forces` map z_j' to a damping acceleration. A delay by steps."""
    p = second_order(v, np.zeros(len(v.tanks)))
    cut = {} if pilot.delay else None
    E, A, engine = descriptor(p, pilot, cut)
    n, nt = len(p.b0), p.tanks
    inverse = np.linalg.inv(E)
    past = [lambda t: 0.0]  # the command of one delay ago

    def slope(t, x):
        f = A @ x
        for j in range(nt):
            f[n + 2 + j] += forces[j](x[n + 2 + j])
        if cut:
            f = f + cut["enters"] * past[0](t)
        return inverse @ f

    x = np.zeros(len(A))
    x[2 : 2 + nt] = z0
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-17}
    if not cut:
        run = scipy.integrate.solve_ivp(slope, (0, times[-1]), x, t_eval=times, **options)
        assert run.success
        y, beta = run.y.T, run.y.T @ engine
        return y[:, 2 : 2 + nt], beta, y[:, :n] @ p.attitude
    rows, beta, start = [], [], 0.0
    nodes = 0.5 - 0.5 * np.cos(np.pi * np.arange(25) / 24)
    while start < times[-1] + 1e-9:
        end = start + pilot.delay
        run = scipy.integrate.solve_ivp(slope, (start, end), x, dense_output=True, **options)
        assert run.success
        here = times[(times >= start - 1e-9) & (times < end - 1e-9)]
        states = run.sol(here).T
        rows.append(states)
        beta.append(states @ engine + cut["through"] * np.array([past[0](t) for t in here]))
        t = start + nodes * pilot.delay
        # the command is sampled with x' as it is in this step, and read by a polynomial in the next
        u = [cut["signal"] @ y + cut["moving"] @ slope(at, y) for at, y in zip(t, run.sol(t).T, strict=True)]
        past[0] = scipy.interpolate.BarycentricInterpolator(t + pilot.delay, u)
        x, start = run.y[:, -1], end
    y = np.concatenate(rows)
    return y[:, 2 : 2 + nt], np.concatenate(beta), y[:, :n] @ p.attitude
