"""The equations of motion derived once more, by Lagrange with sympy, and compared with the assembled matrices.

The derivation knows nothing of the package. The vehicle is a line of mass that bends, w(X) = sum Y_i(X) eta_i on the
body's lateral axis; its modes are those with slosh masses and engine frozen in place, so they are orthogonal to each
other and to the two rigid motions, and their moments are all that is needed of the line:

    r(X) = (u, Z) + R(phi) (X - Xcg, w(X)) ,   moments of (1, X - Xcg, Y_1, Y_2): diag(M, I, M_1, M_2)

To this line are added the slosh masses displaced by z_j along the local normal, less the same masses in place, and
the engine turned by beta about the gimbal, less the engine in place. The thrust accelerates the vehicle axially by
a = (F - D)/M.

What the model leaves out is left out here by two switches, and the last test of the derivation says what it is: the
thrust's line of action is the rigid axis, so its turning with the slope Y'(0) of the bent axis and its offset by the
deflection Y(0) of the gimbal are not in the equations. The shortening of the bent axis (an axial load's softening of
the bending modes) belongs to the modes' own frequencies. Bending changes no angle of attack, and the air's force does
no work on bending.
"""

from functools import cache

import numpy as np
import pytest
import scipy.linalg
import sympy as sp
from pydantic import ValidationError

from cases import paper_case, real_case
from sloshpy.autopilot import Actuator
from sloshpy.dynamics import frequency_response, open_loop, plant, without_drift
from sloshpy.dynamics.plant import slosh_damping
from sloshpy.vehicle import Engine

TANKS = MODES = 2
NUMBERS = sp.symbols("M I Xcg F R D", positive=True)
TANK = [sp.symbols(f"m{j} X{j} w{j} xi{j}", positive=True) for j in range(TANKS)]
MODE = [sp.symbols(f"M_{i} W{i} zeta{i} Y0_{i} dY0_{i}", positive=True) for i in range(MODES)]
SHAPE = [[sp.symbols(f"Y{i}{j} dY{i}{j}") for j in range(TANKS)] for i in range(MODES)]
ENGINE = sp.symbols("m_e d I_c", positive=True)  # mass, c.g. aft of the gimbal, inertia about its own c.g.
AIR = sp.symbols("N Xcp V", positive=True)
TURN, OFFSET = sp.symbols("turn offset")  # 1: thrust turns with the bent axis; 1: thrust acts at the bent gimbal
EVERY = [*NUMBERS, *(x for part in (*TANK, *MODE) for x in part)]
EVERY += [x for row in SHAPE for pair in row for x in pair] + [*ENGINE, *AIR, TURN, OFFSET]


@cache
def derived():
    """Return functions of the numbers: mass, damping, stiffness, force, inertial force of the linearised equations."""
    M, I, Xcg, F, R, D = NUMBERS
    m_e, d, I_c = ENGINE
    N, Xcp, V = AIR
    names = ["Z", "phi", *(f"z{j}" for j in range(TANKS)), *(f"eta{i}" for i in range(MODES)), "beta", "u"]
    q, v, acc = (list(sp.symbols(" ".join(mark + name for name in names))) for mark in ("", "v_", "a_"))
    Z, phi, *_, beta, u = q
    z, eta = q[2 : 2 + TANKS], q[2 + TANKS : 2 + TANKS + MODES]

    def rate(x):
        return sum(sp.diff(x, a) * b for a, b in zip(q, v, strict=True))

    def at(x, w):
        c, s = sp.cos(phi), sp.sin(phi)
        return sp.Matrix([u + x * c - w * s, Z + x * s + w * c])

    def energy(m, r):
        return m * sum(rate(x) ** 2 for x in r) / 2

    # the line of mass: its kinetic energy is quadratic in (1, x, Y_1, Y_2), each product a known moment
    x, Y = sp.Symbol("x"), sp.symbols(f"Y_0:{MODES}")
    velocity = [rate(c) for c in at(x, sum(a * b for a, b in zip(Y, eta, strict=True)))]
    density = sp.Poly(sp.expand(sum(c**2 for c in velocity) / 2), x, *Y)
    moment = {(0,) * (1 + MODES): M, (2, *[0] * MODES): I}
    moment |= {(0, *[2 * (i == k) for i in range(MODES)]): MODE[k][0] for k in range(MODES)}
    T = sum(moment.get(power, 0) * c for power, c in density.terms())
    U, dissipation = sp.S.Zero, sp.S.Zero
    for j, (m, X, w, xi) in enumerate(TANK):
        bent = sum(SHAPE[i][j][0] * eta[i] for i in range(MODES))
        tilt = phi + sum(SHAPE[i][j][1] * eta[i] for i in range(MODES))
        normal = sp.Matrix([-sp.sin(tilt), sp.cos(tilt)])
        T += energy(m, at(X - Xcg, bent) + z[j] * normal) - energy(m, at(X - Xcg, bent))
        U += m * w**2 * z[j] ** 2 / 2
        dissipation += m * xi * w * v[2 + j] ** 2
    for i, (m, W, zeta, _, _) in enumerate(MODE):
        U += m * W**2 * eta[i] ** 2 / 2
        dissipation += m * zeta * W * v[2 + TANKS + i] ** 2
    gimbal = at(-Xcg, sum(MODE[i][3] * eta[i] for i in range(MODES)))
    slope = sum(MODE[i][4] * eta[i] for i in range(MODES))
    for angle, sign in ((phi + slope + beta, 1), (phi + slope, -1)):
        r = gimbal - d * sp.Matrix([sp.cos(angle), sp.sin(angle)])
        T += sign * (energy(m_e, r) + I_c * rate(angle) ** 2 / 2)

    axis, side = sp.Matrix([sp.cos(phi), sp.sin(phi)]), sp.Matrix([-sp.sin(phi), sp.cos(phi)])
    along = (F - R) * sp.cos(TURN * slope) + R * sp.cos(TURN * slope + beta)
    across = (F - R) * sp.sin(TURN * slope) + R * sp.sin(TURN * slope + beta)
    line = at(-Xcg, OFFSET * sum(MODE[i][3] * eta[i] for i in range(MODES)))
    alpha = phi - v[0] / V
    forces = [
        (along * axis, line),
        (across * side, gimbal),
        (-D * axis, at(0, 0)),
        (N * alpha * side, at(Xcp - Xcg, 0)),
    ]

    rest = dict.fromkeys([*q, *v[:-1], *acc[:-1]], 0) | {acc[-1]: (F - D) / M}
    n, b = len(names) - 2, len(names) - 2
    rows = []
    for k in range(n):
        p = sp.diff(T, v[k])
        row = sum(sp.diff(p, x) * a for x, a in zip(v, acc, strict=True)) + rate(p) - sp.diff(T - U, q[k])
        row += sp.diff(dissipation, v[k]) - sum(f.dot(sp.diff(r, q[k])) for f, r in forces)
        assert sp.expand(row.xreplace(rest)) == 0  # straight flight is a motion
        rows.append(row)

    def linear(by):
        return sp.Matrix([[sp.expand(sp.diff(row, x).xreplace(rest)) for x in by] for row in rows])

    mass, damping, stiffness = linear(acc[:n]), linear(v[:n]), linear(q[:n])
    force, gyroscopic, inertial = -linear([q[b]]), -linear([v[b]]), -linear([acc[b]])
    assert gyroscopic == sp.zeros(n, 1)
    parts = [mass, damping, stiffness, force, inertial]
    assert not any(v[-1] in part.free_symbols for part in parts)  # the speed along the axis plays no part
    return sp.lambdify(EVERY, parts, "numpy"), parts


def vehicles(seed, count):
    """Random vehicles with two tanks, two bending modes, engine inertia and aerodynamics, and slosh damping."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        case, damping = real_case(rng, tanks=TANKS, modes=MODES, engine=True, air=True)
        yield rng, case.vehicle, damping


def numbers_of(v, damping, split=0.5, turn=0, offset=0):
    """Return the numbers of a vehicle in the order of the derivation; the engine's mass is free and does not count."""
    S, I_e = v.engine.first_moment, v.engine.inertia
    # the engine as m_e at d with S = m_e d: a part `split` of its inertia is that of the mass at d
    d = split * I_e / S
    values = [v.mass, v.inertia, v.cg, v.thrust, v.vectored_thrust, v.drag]
    for tank, xi in zip(v.tanks, damping, strict=True):
        values += [tank.slosh_mass, tank.station, tank.frequency, xi]
    for f in v.flexible_modes:
        values += [f.generalized_mass, f.frequency, f.damping, f.gimbal.deflection, f.gimbal.slope]
    for f in v.flexible_modes:
        values += [x for tank in v.tanks for x in (f.tank[tank.name].deflection, f.tank[tank.name].slope)]
    air = v.aerodynamics
    values += [S / d, d, I_e - S * d, air.normal_force_slope, air.center_of_pressure, air.speed, turn, offset]
    return values


def agree(ours, theirs):
    """Entry by entry to 1e-12 of the entry; where terms cancel, of the greatest entry times the rounding of doubles."""
    theirs = np.asarray(theirs, dtype=float).reshape(np.shape(ours))
    np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-15 * np.abs(theirs).max())


def test_every_matrix_of_the_plant_is_the_linearised_lagrange_equations():
    number, _ = derived()
    for rng, v, damping in vehicles(70, 40):
        mass, C, stiffness, force, inertial = number(*numbers_of(v, damping, split=rng.uniform(0.05, 0.95)))
        p = plant(v)
        agree(p.mass, mass)
        agree(p.damping + np.diag([0, 0, *slosh_damping(p, damping), 0, 0]), C)
        agree(p.stiffness, stiffness)
        agree(p.force, force)
        agree(p.inertial_force, inertial)


def test_the_gyros_read_the_rotation_of_the_bent_axis_at_their_stations():
    for _, v, _ in vehicles(71, 10):
        p = plant(v)
        slopes = [f.gyro.slope for f in v.flexible_modes]
        rates = [(f.rate_gyro or f.gyro).slope for f in v.flexible_modes]
        np.testing.assert_array_equal(p.attitude, [0, 1, 0, 0, *slopes])
        np.testing.assert_array_equal(p.rate, [0, 1, 0, 0, *rates])


def test_what_the_thrust_on_the_rigid_axis_leaves_out_is_its_slope_and_offset_at_the_gimbal():
    """A thrust fixed to the bent gimbal adds, to the right-hand sides, sums over the modes of

        Z: F Y_i'(0) eta_i      phi: -F (Xcg Y_i'(0) + Y_i(0)) eta_i      eta_k: F Y_k(0) Y_i'(0) eta_i

    and nothing else: all of it proportional to eta, so that rigid vehicles are exact.
    """
    _, (*_, stiffness, _, _) = derived()
    _, _, Xcg, F, *_ = NUMBERS
    added = -(stiffness.subs({TURN: 1, OFFSET: 1}) - stiffness.subs({TURN: 0, OFFSET: 0}))
    expected = sp.zeros(*added.shape)
    for i, (*_, Y, slope) in enumerate(MODE):
        column = 2 + TANKS + i
        expected[0, column], expected[1, column] = F * slope, -F * (Xcg * slope + Y)
        for k, (*_, Y_k, _) in enumerate(MODE):
            expected[2 + TANKS + k, column] = F * Y_k * slope
    assert (added - expected).applyfunc(sp.simplify) == sp.zeros(*added.shape)


def test_mass_is_symmetric_and_the_stiffness_of_slosh_and_bending_is_too():
    """Reciprocity. The thrust follows the rigid axis and the air is no potential, so row and column Z stay out."""
    for _, v, _ in vehicles(72, 30):
        p = plant(v)
        np.testing.assert_array_equal(p.mass, p.mass.T)
        assert np.linalg.eigvalsh(p.mass / np.sqrt(np.outer(np.diag(p.mass), np.diag(p.mass)))).min() > 0
        np.testing.assert_array_equal(p.stiffness[2:, 2:], p.stiffness[2:, 2:].T)
        still = plant(v.model_copy(update={"aerodynamics": None}))
        np.testing.assert_array_equal(still.stiffness[1:, 1:], still.stiffness[1:, 1:].T)


def test_a_slosh_mass_heavier_than_the_bending_mode_that_holds_it_is_refused():
    """The mode's generalised mass holds the slosh mass: M_i > m Y^2, or the liquid is counted elsewhere."""
    for _, v, _ in vehicles(73, 5):
        tank, mode = v.tanks[0], v.flexible_modes[0]

        def with_mode_mass(share, v=v, tank=tank, mode=mode):
            shape = mode.tank[tank.name].model_copy(update={"deflection": 1.0})
            light = {"tank": {**mode.tank, tank.name: shape}, "generalized_mass": share * tank.slosh_mass}
            given = {k: getattr(v, k) for k in type(v).model_fields}
            given["flexible_modes"] = (mode.model_copy(update=light), *v.flexible_modes[1:])
            return type(v)(**given)

        assert np.linalg.eigvalsh(plant(with_mode_mass(1e3)).mass).min() > 0
        with pytest.raises(ValidationError, match="mass matrix indefinite"):
            with_mode_mass(0.99)


def coasting(v):
    """The vehicle with all but one rounding of its thrust balanced by drag, without structural damping."""
    modes = tuple(f.model_copy(update={"damping": 0.0}) for f in v.flexible_modes)
    update = {"drag": np.nextafter(v.thrust, 0.0), "flexible_modes": modes, "aerodynamics": None}
    return plant(v.model_copy(update=update))


def test_energy_and_momentum_are_conserved_in_free_fall_without_damping():
    for rng, v, _ in vehicles(74, 20):
        p = coasting(v)
        n = len(p.mass)
        assert not p.damping.any()
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(p.mass, p.stiffness), np.zeros((n, n))]])
        x = np.concatenate([rng.normal(size=n), rng.normal(size=n)])

        def energy(s, p=p, n=n):
            return 0.5 * s[n:] @ p.mass @ s[n:] + 0.5 * s[:n] @ p.stiffness @ s[:n]

        slow = min(t.frequency for t in v.tanks)
        for t in (1.0 / slow, 7.3 / slow, 31.0 / slow):
            y = scipy.linalg.expm(A * t) @ x
            assert energy(y) == pytest.approx(energy(x), rel=1e-10)
            before, after = p.mass @ x[n:], p.mass @ y[n:]
            np.testing.assert_allclose(after[:2], before[:2], rtol=1e-10, atol=1e-10 * np.abs(before[:2]).max())


def test_slow_forces_feel_the_whole_mass_and_inertia_locked_or_free():
    """At rest in their springs slosh and bending ride along; far below their frequencies so they do when free."""
    for _, v, _ in vehicles(75, 20):
        p = coasting(v)
        np.testing.assert_array_equal(p.mass[:2, :2], np.diag([v.mass, v.inertia]))
        s = 1e-4j * min(t.frequency for t in v.tanks)  # rad/s; the remainder is of the order of its square, 1e-8
        compliance = np.linalg.inv(s * s * p.mass + p.stiffness)[:2, :2] * s * s
        # 1e-6: a hundred times the square, for bending shapes and levers that weigh a tank more than its mass does
        scale = np.sqrt(np.outer([v.mass, v.inertia], [v.mass, v.inertia]))
        np.testing.assert_allclose(compliance * scale, np.eye(2), atol=1e-6)


def test_tail_wags_dog_zero_lies_at_its_textbook_frequency():
    """Rigid vehicle: attitude ignores the engine where its inertia carries the thrust, w^2 = R' Xcg/(S Xcg + I_e).

    Under axial acceleration the engine's own weight helps the thrust: R' Xcg + a S.
    """
    case = paper_case(actuator=Actuator(frequency=60.0, damping=0.7))
    engine = Engine(first_moment=1500.0, inertia=2500.0)
    case = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"engine": engine, "tanks": ()})})
    zero = np.sqrt((9e5 * 6.0 + 56.25 * 1500.0) / (1500.0 * 6.0 + 2500.0))
    assert zero == pytest.approx(np.sqrt(9e5 * 6.0 / (1500.0 * 6.0 + 2500.0)), rel=0.01)
    p = without_drift(plant(case.vehicle))
    roots = np.roots([p.inertial_force[0], 0.0, p.force[0]])
    np.testing.assert_allclose(np.sort(roots.imag), [-zero, zero], rtol=1e-14)
    w = zero * np.array([0.9, 1.0, 1.1])
    L = frequency_response(open_loop(case), w).loop
    assert abs(L[1]) < 1e-13 * abs(L[0])
    assert (L[0] / L[2]).real < 0  # the sign has turned over
