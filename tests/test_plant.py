"""Equations of motion: the paper's matrices, their symmetry, and the physics that any sign error breaks."""

import numpy as np
import pytest
from pydantic import ValidationError

import oracle
from cases import PAPER_TANK, PAPER_VEHICLE, paper_case, random_case, xi
from sloshpy.dynamics import closed_loop_poles, open_loop, plant, state_space, without_drift
from sloshpy.stability import margins
from sloshpy.vehicle import SloshMass, Vehicle

# Table 1 with the errata, for eqs 9-12
M, I, XCG, F, MS, LS, WS, XI = 1.6e4, 9e5, 6.0, 9e5, 1e3, -3.0, 2.0, 0.03
K3, K4, C2 = 56.25, 56.25, 6.0

E = np.array(
    [
        [1, 0, 0, 0, 0, 0],
        [0, 1, 0, 0, 0, 0],
        [0, 0, 1, 0, 0, 0],
        [0, 0, 0, 1, 0, 0.0625],  # m/M
        [0, 0, 0, 0, 1, 3.0 / 900.0],  # -m l/I with l = -3 m
        [0, 0, 0, 1, 3.0, 1],  # -l
    ]
)
A_PRIME = np.array(
    [
        [0, 0, 0, 1, 0, 0],
        [0, 0, 0, 0, 1, 0],
        [0, 0, 0, 0, 0, 1],
        [0, 56.25, 0, 0, 0, 0],  # the printed 1 in column 4 is a misprint: Z'' does not depend on Z'
        [0, 0, 0.0625, 0, 0, 0],  # m k3/I
        [0, 56.25, -4.0, 0, 0, -0.12],  # -w^2 (printed +), -2 xi w
    ]
)
B_PRIME = np.array([0, 0, 0, 56.25, -6.0, 0])
C_OUT = np.array([[0, 1, 0, 0, 0, 0], [0, 0, 0, 0, 1, 0]])


def test_state_space_of_the_example_is_eqs_9_to_12_with_the_errata():
    A, B, C = state_space(plant(paper_case().vehicle), np.array([XI]))
    np.testing.assert_allclose(A, np.linalg.solve(E, A_PRIME), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(np.ravel(B), np.linalg.solve(E, B_PRIME), rtol=1e-12, atol=1e-13)
    np.testing.assert_array_equal(C, C_OUT)


@pytest.mark.parametrize(
    ("entry", "printed"), [((4, 2), -0.0625), ((5, 2), 4.0), ((3, 3), 1.0)], ids=["eq 1 sum", "w^2 sign", "column 4"]
)
def test_the_printed_matrices_differ_from_ours(entry, printed):
    wrong = A_PRIME.copy()
    wrong[entry] = printed
    A, _, _ = state_space(plant(paper_case().vehicle), np.array([XI]))
    assert not np.allclose(A, np.linalg.solve(E, wrong))


def test_mass_matrix_is_symmetric_and_positive_and_slosh_stiffness_is_symmetric():
    rng = np.random.default_rng(10)
    for _ in range(50):
        p = plant(random_case(rng)[0].vehicle)
        np.testing.assert_array_equal(p.mass, p.mass.T)
        assert np.linalg.eigvalsh(p.mass).min() > 0
        block = p.stiffness[1:, 1:]  # phi and the slosh masses: k3 couples them both ways alike
        np.testing.assert_array_equal(block, block.T)


def test_positive_engine_angle_turns_the_nose_negative_and_pushes_toward_plus_z():
    p = plant(paper_case().vehicle)
    start = np.linalg.solve(p.mass, p.force)
    assert start[1] < 0 < start[0]


def test_a_slosh_mass_pushed_to_plus_z_accelerates_the_nose_by_its_moment():
    """The weight m k3 of a displaced slosh mass turns the vehicle by +m k3 z: eq 1 with the corrected sign."""
    p = plant(paper_case().vehicle)
    assert (-p.stiffness @ np.array([0, 0, 1.0]))[1] == pytest.approx(MS * K3)


def test_without_engine_force_lateral_momentum_changes_only_with_the_tilt_of_the_thrust():
    """d/dt (M Z' + sum m z') = F phi, whatever the slosh does."""
    rng = np.random.default_rng(11)
    for _ in range(20):
        case, damping = random_case(rng)
        v = case.vehicle
        p = plant(v)
        n = len(p.mass)
        A, _, _ = state_space(p, damping)
        x = rng.normal(size=2 * n)
        acceleration = (A @ x)[n:]
        momentum = v.mass * acceleration[0] + sum(
            t.slosh_mass * a for t, a in zip(v.tanks, acceleration[2:], strict=True)
        )
        assert momentum == pytest.approx((v.thrust - v.drag) * x[1], rel=1e-9)


def test_angular_momentum_about_the_cg_changes_only_by_the_moment_of_the_slosh_weight():
    """d/dt (I phi' - sum m l z') = sum m k3 z without engine force."""
    rng = np.random.default_rng(12)
    for _ in range(20):
        case, damping = random_case(rng)
        v = case.vehicle
        A, _, _ = state_space(plant(v), damping)
        n = len(v.tanks) + 2
        x = rng.normal(size=2 * n)
        acc = (A @ x)[n:]
        k3 = (v.thrust - v.drag) / v.mass
        left = v.inertia * acc[1] - sum(
            t.slosh_mass * (v.cg - t.station) * a for t, a in zip(v.tanks, acc[2:], strict=True)
        )
        right = sum(t.slosh_mass * k3 * z for t, z in zip(v.tanks, x[2:n], strict=True))
        assert left == pytest.approx(right, rel=1e-8, abs=1e-8 * v.inertia)


def test_undamped_slosh_neither_gains_nor_loses_without_control():
    """The thrust follows the vehicle, so energy is not conserved as such, but every s^2 of the plant is real."""
    rng = np.random.default_rng(13)
    for _ in range(30):
        p = without_drift(plant(random_case(rng)[0].vehicle))
        np.testing.assert_allclose(p.mass, p.mass.T, rtol=1e-12)
        np.testing.assert_array_equal(p.stiffness[1:, 1:], p.stiffness[1:, 1:].T)
        squared = np.linalg.eigvals(-np.linalg.solve(p.mass, p.stiffness))
        assert np.all(np.abs(squared.imag) < 1e-10 * np.abs(squared).max())


def test_the_attitude_column_of_the_stiffness_without_drift_is_exactly_zero():
    rng = np.random.default_rng(14)
    for _ in range(50):
        p = without_drift(plant(random_case(rng)[0].vehicle))
        phi = int(np.flatnonzero(p.attitude)[0])
        # a tilted vehicle accelerates sideways by k3 phi, and its slosh masses with it: nothing is left of the tilt
        np.testing.assert_array_equal(p.stiffness[:, phi], np.zeros(len(p.mass)))


def test_drift_is_removed_by_structure_and_counted():
    """T07: no tolerance; two neutral poles leave and the rest keep their place."""
    rng = np.random.default_rng(15)
    for _ in range(30):
        case, damping = random_case(rng)
        full, reduced = plant(case.vehicle), without_drift(plant(case.vehicle))
        assert (full.drift_poles, reduced.drift_poles) == (0, 2)
        A6, _, _ = state_space(full, damping)
        A4, _, _ = state_space(reduced, damping)
        assert len(A6) == len(A4) + 2
        c6, c4 = np.poly(A6), np.poly(A4)
        np.testing.assert_allclose(c6, np.append(c4, [0, 0]), rtol=1e-8, atol=1e-10 * abs(c4).max())


def test_state_space_agrees_with_the_oracle_for_several_tanks():
    rng = np.random.default_rng(16)
    for _ in range(30):
        case, damping = random_case(rng, delay=False, actuator=False, filters=False)
        c = oracle.numbers(case, damping)
        A, B, C = state_space(plant(case.vehicle), damping)
        closed = A + np.outer(B, c.gain * (c.a0 * C[0] + c.a1 * C[1]))
        np.testing.assert_allclose(closed, oracle.first_order(c), rtol=1e-8, atol=1e-10 * abs(closed).max())


@pytest.mark.parametrize(
    ("mistake", "least"),
    [("eq1", 1.736), ("column 4", 0.886), ("lever", 0.613)],
)
def test_sign_errors_of_the_printed_equations_are_told_apart_by_the_disc_margin(mistake, least):
    """T18: at 4.8 % the printed forms have margins 1.736, 0.886 and 0.613; the corrected one gives 1.018."""
    e, a = E.copy(), A_PRIME.copy()
    a[5, 5] = -2 * 0.048 * 2.0
    if mistake == "eq1":
        e[4, 5], a[4, 2] = -e[4, 5], -a[4, 2]
    elif mistake == "column 4":
        a[3, 3] = 1.0
    else:
        e[4, 5], e[5, 4] = -e[4, 5], -e[5, 4]
    w = np.geomspace(0.3, 6, 40001)
    A, B = np.linalg.solve(e, a), np.linalg.solve(e, B_PRIME)
    H = np.array([C_OUT @ np.linalg.solve(1j * x * np.eye(6) - A, B) for x in w[::8]])
    L = -(0.08 * H[:, 0] + 0.14 * H[:, 1])
    assert oracle.disc_margin(L).min() == pytest.approx(least, abs=6e-3)
    ours = margins(paper_case(), damping=0.048).nichols_disc_margin
    assert ours == pytest.approx(1.0183, rel=1e-4)


def test_a_slosh_mass_beyond_the_singular_mass_is_refused():
    """T17: 1/(1/M + l^2/I) = 13,793 kg, well below the vehicle's mass."""
    Vehicle(**PAPER_VEHICLE, tanks=(SloshMass(**PAPER_TANK | {"slosh_mass": 13793.0}, damping=xi(0.01)),))
    for mass in (13794.0, 15000.0, 17000.0):
        with pytest.raises(ValidationError, match=r"mass matrix indefinite"):
            Vehicle(**PAPER_VEHICLE, tanks=(SloshMass(**PAPER_TANK | {"slosh_mass": mass}, damping=xi(0.01)),))


def test_the_mass_matrix_margin_is_the_least_scaled_eigenvalue():
    """Scaled by sqrt(m) of each row, with Z and phi eliminated, its least eigenvalue decides."""
    rng = np.random.default_rng(17)
    for _ in range(50):
        v = random_case(rng)[0].vehicle
        a = np.array([np.sqrt(t.slosh_mass / v.mass) for t in v.tanks])
        b = np.array([(v.cg - t.station) * np.sqrt(t.slosh_mass / v.inertia) for t in v.tanks])
        least = np.linalg.eigvalsh(np.eye(len(a)) - np.outer(a, a) - np.outer(b, b)).min()
        assert float(v.mass_matrix_margin) == pytest.approx(least, rel=1e-9)


def test_unit_errors_move_the_answer_far():
    """T20: damping in percent is refused, Hz read as rad/s gives a margin of 1.80 that looks excellent."""
    with pytest.raises(ValidationError):
        xi(4.8)
    assert margins(paper_case(), damping=0.302).nichols_disc_margin == pytest.approx(1.82, abs=6e-3)  # log decrement
    assert margins(paper_case(tank={"frequency": 4 * np.pi}), damping=0.048).nichols_disc_margin == pytest.approx(
        1.80, abs=6e-3
    )
    assert margins(paper_case(), damping=0.048).nichols_disc_margin == pytest.approx(1.018, abs=6e-4)


def test_slosh_mass_just_below_singular_still_gives_finite_poles():
    case = paper_case(tank={"slosh_mass": 13000.0})
    found = closed_loop_poles(open_loop(case, damping=0.048))
    # T17: the open-loop slosh rises to 10.4 rad/s and the closed loop has a root near +0.68
    c = oracle.numbers(case, 0.048)
    assert found.value.real.max() == pytest.approx(oracle.poles(c).real.max(), rel=1e-6)
