"""A second implementation of everything the package computes, written from the equations alone.

It shares no code with the package: Z stays in the equations, each tank's damping is put in directly, the two body
equations are eliminated by hand, stability comes from the full first-order matrix or from the argument principle,
limit cycles from a root solve of the harmonic balance, time histories from DOP853 and the method of steps.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.integrate
import scipy.optimize
import scipy.signal


@dataclass(frozen=True)
class Numbers:
    """The plain numbers of one case; masses, levers and frequencies of the tanks are arrays."""

    M: float
    I: float
    Xcg: float
    k3: float
    R: float
    m: np.ndarray
    l: np.ndarray
    w: np.ndarray
    xi: np.ndarray
    a0: float
    a1: float
    gain: float = 1.0
    delay: float = 0.0
    filters: tuple = ()
    actuator: tuple = ()  # frequency, damping

    @property
    def k4(self):
        return self.R / self.M

    @property
    def c2(self):
        return self.R * self.Xcg / self.I

    def damped(self, xi):
        return replace(self, xi=np.broadcast_to(np.asarray(xi, dtype=float), self.m.shape).copy())


def numbers(case, xi):
    """Read the numbers of a case at given damping ratios."""
    v, p = case.vehicle, case.autopilot
    n = len(v.tanks)
    return Numbers(
        M=float(v.mass),
        I=float(v.inertia),
        Xcg=float(v.cg),
        k3=float((v.thrust - v.drag) / v.mass),
        R=float(v.vectored_thrust),
        m=np.array([t.slosh_mass for t in v.tanks], dtype=float),
        l=np.array([v.cg - t.station for t in v.tanks], dtype=float),
        w=np.array([t.frequency for t in v.tanks], dtype=float),
        xi=np.broadcast_to(np.asarray(xi, dtype=float), (n,)).copy(),
        a0=float(p.attitude_gain),
        a1=float(p.rate_gain),
        gain=float(p.gain),
        delay=float(p.delay),
        filters=tuple((f.numerator, f.denominator) for f in p.filter),
        actuator=(p.actuator.frequency, p.actuator.damping) if p.actuator else (),
    )


# ---------------------------------------------------------------- frequency domain


def forward(c, s):
    """Forward path beta / (a0 phi + a1 phi')."""
    K = c.gain * np.exp(-s * c.delay)
    for num, den in c.filters:
        K = K * np.polyval(num, s) / np.polyval(den, s)
    if c.actuator:
        wa, za = c.actuator
        K = K * wa**2 / (s**2 + 2 * za * wa * s + wa**2)
    return K


def solved(c, s):
    """L and z/beta at complex s, by a full complex solve with Z kept."""
    s = np.asarray(s, dtype=complex)
    n = len(c.m)
    D = np.zeros((*s.shape, n + 2, n + 2), dtype=complex)
    D[..., 0, 0] = s**2
    D[..., 0, 1] = -c.k3
    D[..., 1, 1] = s**2
    for j in range(n):
        D[..., 0, 2 + j] = c.m[j] / c.M * s**2
        D[..., 1, 2 + j] = -c.m[j] / c.I * (c.l[j] * s**2 + c.k3)
        D[..., 2 + j, 0] = s**2
        D[..., 2 + j, 1] = -(c.l[j] * s**2 + c.k3)
        D[..., 2 + j, 2 + j] = s**2 + 2 * c.xi[j] * c.w[j] * s + c.w[j] ** 2
    b = np.zeros((*s.shape, n + 2, 1), dtype=complex)
    b[..., 0, 0] = c.k4
    b[..., 1, 0] = -c.c2
    x = np.linalg.solve(D, b)[..., 0]
    return -forward(c, s) * (c.a0 + c.a1 * s) * x[..., 1], x[..., 2:]


def _pieces(c, s):
    """Entries of the 2 x 2 equations in Z'' and phi after the tanks are eliminated, and prod d_j."""
    s2 = s * s
    a, b, p, e = 1.0, -c.k3, 0.0, s2
    delta = 1.0
    for m, l, w, xi in zip(c.m, c.l, c.w, c.xi, strict=True):
        d = s2 + 2 * xi * w * s + w * w
        q = l * s2 + c.k3
        r, t = 1.0 / d, q / d
        a = a - m / c.M * s2 * r
        b = b + m / c.M * s2 * t
        p = p + m / c.I * t
        e = e - m / c.I * q * t
        delta = delta * d
    return a, b, p, e, delta


def loop(c, s):
    """L by elimination: fast enough for a million frequencies."""
    a, b, p, e, _ = _pieces(c, s)
    return forward(c, s) * (c.a0 + c.a1 * s) * (a * c.c2 + p * c.k4) / (a * e - b * p)


def characteristic(c, s):
    """Entire function whose roots are the closed-loop poles (drift left out), delay exact."""
    a, b, p, e, delta = _pieces(c, s)
    num, den = c.gain * np.exp(-s * c.delay), 1.0
    for f, g in c.filters:
        num, den = num * np.polyval(f, s), den * np.polyval(g, s)
    if c.actuator:
        wa, za = c.actuator
        num, den = num * wa**2, den * (s**2 + 2 * za * wa * s + wa**2)
    plant, control = delta * (a * e - b * p) * den, delta * num * (c.a0 + c.a1 * s) * (a * c.c2 + p * c.k4)
    return plant + control, np.abs(plant) + np.abs(control)


def disc_margin(L, gmd_db=6.0, pmd=np.pi / 6):
    """Eq 24 as printed: floored modulus of the phase."""
    return np.hypot(20 * np.log10(np.abs(L)) / gmd_db, (np.mod(np.angle(L), 2 * np.pi) - np.pi) / pmd)


def one_tank_polynomials(c):
    """Eq 21 with damping: numerator and denominator of -phi/beta in s for one tank, by hand."""
    (m,), (l,), (w,), (xi,) = c.m, c.l, c.w, c.xi
    mu, nu, damp = m / c.M, m / c.I, 2 * xi * w
    num = np.array([c.c2 * (1 - mu) + c.k4 * nu * l, c.c2 * damp, c.c2 * w**2 + c.k4 * nu * c.k3])
    den = np.array([1 - mu - nu * l**2, damp, w**2 - nu * l * c.k3, 0.0, 0.0])
    return num, den


# ---------------------------------------------------------------- poles and stability


def first_order(c):
    """Full first-order closed loop without delay, drift kept: x = [Z, phi, z.., Z', phi', z'.., filters, actuator]."""
    n = len(c.m)
    k = n + 2
    systems = [scipy.signal.tf2ss(*f) for f in c.filters]
    orders = [len(f[1]) - 1 for f in c.filters]
    total = 2 * k + sum(orders) + (2 if c.actuator else 0)
    E, A, b = np.eye(total), np.zeros((total, total)), np.zeros(total)
    A[:k, k : 2 * k] = np.eye(k)
    A[k, 1] = c.k3
    b[k], b[k + 1] = c.k4, -c.c2
    for j in range(n):
        E[k, k + 2 + j] = c.m[j] / c.M
        E[k + 1, k + 2 + j] = -c.m[j] * c.l[j] / c.I
        E[k + 2 + j, k], E[k + 2 + j, k + 1] = 1.0, -c.l[j]
        A[k + 1, 2 + j] = c.m[j] * c.k3 / c.I
        A[k + 2 + j, 1] = c.k3
        A[k + 2 + j, 2 + j] = -(c.w[j] ** 2)
        A[k + 2 + j, k + 2 + j] = -2 * c.xi[j] * c.w[j]
    signal = np.zeros(total)
    signal[1], signal[k + 1] = c.gain * c.a0, c.gain * c.a1
    at = 2 * k
    for (fa, fb, fc, fd), order in zip(systems, orders, strict=True):
        if order:
            rows = slice(at, at + order)
            A[rows] += fb @ signal[None, :]
            A[rows, rows] += fa
        signal = signal * fd[0, 0]
        if order:
            signal[rows] += fc[0]
        at += order
    if c.actuator:
        wa, za = c.actuator
        A[at, at + 1] = 1.0
        A[at + 1] += wa**2 * signal
        A[at + 1, at] -= wa**2
        A[at + 1, at + 1] -= 2 * za * wa
        signal = np.zeros(total)
        signal[at] = 1.0
    A += np.outer(b, signal)
    return np.linalg.solve(E, A)


def poles(c):
    """Closed-loop poles without delay; Z and Z' fall out because nothing depends on them."""
    A = first_order(c)
    k = len(c.m) + 2
    keep = np.delete(np.arange(len(A)), [0, k])
    assert not A[keep][:, [0, k]].any()
    return np.linalg.eigvals(A[np.ix_(keep, keep)])


def unstable_poles(c):
    """Number of poles right of the imaginary axis by the argument principle on the exact characteristic function."""
    order = 2 * len(c.m) + 2 + sum(len(f[1]) - 1 for f in c.filters) + (2 if c.actuator else 0)
    scale = [*c.w, np.sqrt(c.c2 * c.a0 * c.gain), c.c2 * c.a1 * c.gain]
    scale += [abs(r) for f in c.filters for r in np.roots(f[1])] + ([c.actuator[0]] if c.actuator else [])
    high = 1e5 * max(scale)
    near = [w * (1 + np.linspace(-0.5, 0.5, 402)) for w in c.w]
    s = np.unique(np.concatenate([np.geomspace(1e-5 * min(x for x in scale if x), high, 3000), *near]))
    s = 1j * np.concatenate([[0.0], s])
    f = characteristic(c, s)[0]
    for _ in range(60):
        turn = np.abs(np.angle(f[1:] / f[:-1]))
        wide = np.flatnonzero(turn > 0.3)
        if len(wide) == 0:
            break
        mid = 0.5 * (s[wide] + s[wide + 1])
        s, f = np.insert(s, wide + 1, mid), np.insert(f, wide + 1, characteristic(c, mid)[0])
    total = np.sum(np.angle(f[1:] / f[:-1]))
    count = (order * np.pi / 2 - total) / np.pi
    assert abs(count - round(count)) < 0.02, count
    return round(count)


def newton_pole(c, s, steps=50):
    """Root of the exact characteristic function near s by the secant method."""
    s0, s1 = s * (1 + 1e-6), s
    f0, f1 = characteristic(c, s0)[0], characteristic(c, s1)[0]
    for _ in range(steps):
        if f1 == f0:
            break
        s0, s1, f0 = s1, s1 - f1 * (s1 - s0) / (f1 - f0), f1
        f1 = characteristic(c, s1)[0]
        if abs(s1 - s0) < 1e-14 * abs(s1):
            break
    return s1


def stable(c):
    return unstable_poles(c) == 0 if c.delay else bool(np.all(poles(c).real < 0))


# ---------------------------------------------------------------- curves on a grid


def disc_margin_minima(c, grid, gmd_db=6.0, pmd=np.pi / 6, below=4.0):
    """Every local minimum of eq 24 below a value on a grid, refined inside its two grid cells."""
    dm = np.concatenate([disc_margin(loop(c, 1j * part), gmd_db, pmd) for part in np.array_split(grid, 64)])
    at = np.flatnonzero((dm[1:-1] <= dm[:-2]) & (dm[1:-1] < dm[2:]) & (dm[1:-1] < below)) + 1
    found = []
    for k in at:
        low, high = grid[k - 1], grid[k + 1]
        for _ in range(6):
            fine = np.linspace(low, high, 41)
            value = disc_margin(loop(c, 1j * fine), gmd_db, pmd)
            i = int(np.clip(np.argmin(value), 1, 39))
            low, high = fine[i - 1], fine[i + 1]
        found.append((fine[np.argmin(value)], value.min(), dm[k]))
    return found, dm


def crossings(c, grid):
    """Frequencies where |L| = 1, and where -L is real and positive (odd multiples of 180 deg), from signs on a grid."""
    L = np.concatenate([loop(c, 1j * part) for part in np.array_split(grid, 64)])
    gain = np.flatnonzero(np.diff(np.abs(L) > 1.0))
    phase = np.flatnonzero(np.diff(L.imag > 0.0))

    def refine(k, f):
        return scipy.optimize.brentq(f, grid[k], grid[k + 1], xtol=1e-15, rtol=1e-14)

    g = [refine(k, lambda x: np.log(np.abs(loop(c, 1j * x)))) for k in gain]
    p = [refine(k, lambda x: loop(c, 1j * x).imag) for k in phase]
    return np.array(g), np.array([x for x in p if loop(c, 1j * x).real < 0])


def neutral_damping_scan(c, tank, levels):
    """Stability at each damping level of one tank."""
    out = []
    for x in levels:
        xi = c.xi.copy()
        xi[tank] = x
        out.append(stable(c.damped(xi)))
    return np.array(out)


# ---------------------------------------------------------------- limit cycles


def limit_cycle(c, law, a, omega):
    """Amplitude and frequency of one tank with 1 + L(j W; xi = law(W A / w)) = 0, near a start."""

    def balance(x):
        A, W = x
        L = solved(c.damped(law(W * A / c.w[0])), 1j * W)[0]
        return [(1 + L).real, (1 + L).imag]

    found = scipy.optimize.root(balance, [a, omega], tol=1e-13)
    assert np.linalg.norm(found.fun) < 1e-9, found.message
    A, W = found.x
    z = solved(c.damped(law(W * A / c.w[0])), 1j * W)[1][0]
    return A, W, A / abs(z)


def coupled_limit_cycle(c, laws, amplitudes, omega):
    """All tanks at once: 1 + L = 0 and amplitudes in the ratios of z/beta."""

    def balance(x):
        A, W = x[:-1], x[-1]
        L, z = solved(c.damped([f(W * a / w) for f, a, w in zip(laws, A, c.w, strict=True)]), 1j * W)
        ratio = np.abs(z) / np.abs(z[0])
        return [(1 + L).real, (1 + L).imag, *(A[1:] / A[0] - ratio[1:])]

    found = scipy.optimize.root(balance, [*amplitudes, omega], tol=1e-13)
    assert np.linalg.norm(found.fun) < 1e-9, found.message
    return found.x[:-1], found.x[-1]


# ---------------------------------------------------------------- time domain


def _mechanics(c):
    """E, A, b of E x' = A x + b beta + damping with x = [phi, z.., Z', phi', z'..]; nothing depends on Z itself."""
    n = len(c.m)
    N = 2 * n + 3
    E, A, b = np.eye(N), np.zeros((N, N)), np.zeros(N)
    v = n + 1
    for i in range(n + 1):
        A[i, v + 1 + i] = 1.0
    A[v, 0], b[v], b[v + 1] = c.k3, c.k4, -c.c2
    for j in range(n):
        E[v, v + 2 + j], E[v + 1, v + 2 + j] = c.m[j] / c.M, -c.m[j] * c.l[j] / c.I
        E[v + 2 + j, v], E[v + 2 + j, v + 1] = 1.0, -c.l[j]
        A[v + 1, 1 + j] = c.m[j] * c.k3 / c.I
        A[v + 2 + j, 0], A[v + 2 + j, 1 + j] = c.k3, -(c.w[j] ** 2)
    return E, A, b


def history(c, forces, z0, times, rtol=1e-10):
    """Slosh, engine angle and attitude at times; `forces` map z_j' to a damping acceleration. Delay by steps.

    Without an actuator the engine follows the (delayed) command; with one it is a second-order lag. No filters.
    """
    assert not c.filters
    n = len(c.m)
    E, A, b = _mechanics(c)
    inv = np.linalg.inv(E)
    N = len(b)
    v = n + 1
    size = N + (2 if c.actuator else 0)
    command = np.zeros(size)
    command[0], command[v + 1] = c.gain * c.a0, c.gain * c.a1
    past = [lambda t: 0.0]

    def slope(t, x):
        u = past[0](t) if c.delay else command @ x
        beta = x[N] if c.actuator else u
        f = A @ x[:N] + b * beta
        for j in range(n):
            f[v + 2 + j] += forces[j](x[v + 2 + j])
        out = np.empty(size)
        out[:N] = inv @ f
        if c.actuator:
            wa, za = c.actuator
            out[N], out[N + 1] = x[N + 1], wa**2 * (u - x[N]) - 2 * za * wa * x[N + 1]
        return out

    x = np.zeros(size)
    x[1 : 1 + n] = z0
    options = {"method": "DOP853", "rtol": rtol, "atol": 1e-13, "dense_output": True}
    rows = []
    if not c.delay:
        run = scipy.integrate.solve_ivp(slope, (0, times[-1]), x, t_eval=times, **options)
        assert run.success
        states = run.y.T
        engine = states[:, N] if c.actuator else states @ command
    else:
        start, engine = 0.0, []
        while start < times[-1]:
            end = start + c.delay
            run = scipy.integrate.solve_ivp(slope, (start, end), x, **options)
            assert run.success
            here = times[(times >= start) & (times < end)]
            rows.append(run.sol(here).T if len(here) else np.zeros((0, size)))
            engine.append(rows[-1][:, N] if c.actuator else np.array([past[0](t) for t in here]))
            past[0] = lambda t, sol=run.sol: command @ sol(t - c.delay)
            x, start = run.y[:, -1], end
        here = times[times >= start]
        rows.append(run.sol(here).T if len(here) else np.zeros((0, size)))
        engine.append(rows[-1][:, N] if c.actuator else np.array([past[0](t) for t in here]))
        states, engine = np.concatenate(rows), np.concatenate(engine)
    return states[:, 1 : 1 + n], engine, states[:, 0]
