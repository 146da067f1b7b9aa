"""Checks against the second implementation that several tests make, each of vehicles of its own."""

import numpy as np
import pytest

import oracle_flexible as second
from sloshpy.damping import PowerDamping
from sloshpy.dynamics import open_loop
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.poles import closed_loop_eigenvalues, unstable_count
from sloshpy.simulation import simulate
from sloshpy.stability.nichols import loop_zeros


def hold_poles(case, p, loop):
    """Hold growth, verdict, count of unstable poles and each pole's own equation; return the poles."""
    values = closed_loop_eigenvalues(loop)
    values = values[np.isfinite(values)]
    growth = values.real.max()
    assert abs(growth) > 1e-9
    assert growth == pytest.approx(float(greatest_growth(loop)), rel=1e-9, abs=1e-11)
    assert (growth < 0) == second.stable(p, case.autopilot)
    count = unstable_count(loop)
    assert count == second.unstable_poles(p, case.autopilot)
    if count < 12:  # a loud accelerometer and a delay make hundreds: the chain of Pade parts holds the first of them
        assert np.sum(values.real > 0) == count
    assert second.backward_error(p, case.autopilot, values).max() < 1e-9
    return values


def hold_zeros(vehicles):
    """Hold that the loop vanishes at its zeros, for cases with their dampings."""
    for case, damping in vehicles:
        zeros = loop_zeros(open_loop(case, damping=damping))
        p = second.second_order(case.vehicle, damping)
        beside = np.abs(second.solved(p, case.autopilot, zeros * 1.01 + 1e-3)[0])
        # 1e-4: a zero is an eigenvalue, its residual that of rounding times the slope of L there
        assert np.all(np.abs(second.solved(p, case.autopilot, zeros)[0]) < 1e-4 * beside)


def hold_history(rng, case, damping, duration, step=0.03):
    """Hold a history under square laws of damping; duration in radians of the first slosh, step of the fastest pole.

    At 0.03 of the fastest radian fourth-order Runge-Kutta loses 2e-7 in each.
    """
    v = case.vehicle
    laws = [PowerDamping(slope=0.2 + 0.1 * j, exponent=1.0) for j in range(len(v.tanks))]
    prompt = case.autopilot.model_copy(update={"delay": 0.0})
    fastest = np.abs(second.poles(second.second_order(v, damping), prompt)).max()
    tanks = tuple(t.model_copy(update={"damping": law}) for t, law in zip(v.tanks, laws, strict=True))
    case = case.model_copy(update={"vehicle": v.model_copy(update={"tanks": tanks})})
    z0 = rng.uniform(0.1, 0.3, len(laws))
    run = simulate(case, duration=duration / v.tanks[0].frequency, initial_slosh=z0, step=step / fastest)
    # xi = k A is the force acc = -(3 pi k / 4) |v| v
    forces = [lambda x, b=3 * np.pi * law.slope / 4: -b * x * abs(x) for law in laws]
    z, beta, phi = second.history(case.vehicle, case.autopilot, forces, z0, run.time)
    for ours, theirs in ((run.slosh, z), (run.tvc, beta), (run.attitude, phi)):
        assert np.abs(ours - theirs).max() < 1e-5 * np.abs(theirs).max()
