"""Limit cycles of the loop as given, all tanks coupled: the zeros of the growth curves, and which of them attract.

Near a cycle V_j e^{jWt} of the slosh velocities, a disturbance with the two frequencies W + mu/j and W - mu/j meets

    N (1 + p/2) of the damper directly and N p/2 of it by way of the other frequency,

N(V) the describing function and p = d ln N / d ln V its exponent: for the odd square law 1.5 and 0.5 times. So a small
oscillation of another mode is damped 1 + p/2 times as much as the cycle itself. The disturbances' growth rates mu are
the roots of a 2n x 2n determinant in the exact S(s); one of them is 0, the phase of the cycle.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sloshpy.autopilot import forward_transfer
from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.damping import ratios
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.plant import slosh_damping
from sloshpy.dynamics.poles import NEUTRAL, closed_loop_eigenvalues, closed_loop_poles
from sloshpy.errors import NoAttractor, OutsideValidity
from sloshpy.limit_cycle.branch import RELATIVE, Follower, Mode, slosh_stiffness
from sloshpy.limit_cycle.cycle import Cycle
from sloshpy.limit_cycle.engine_cycles import engine_cycles
from sloshpy.limit_cycle.engine_limits import POINTS, LimitedMode, actuator_factor, limited_mode, limited_modes
from sloshpy.limit_cycle.growth import amplitude_range, follow
from sloshpy.units import Array, ComplexArray

Stiffness = Callable[[complex], tuple[ComplexArray, ComplexArray]]
DEAD_BAND_GAINS = (1e-9, *np.geomspace(1e-3, 1.0, 13)[:-1])  # parts of the loop gain that a dead band may leave
DIPS = 2000  # amplitudes at which a law is read for the least it gives
PHASE = 1e-7  # of the frequency: a root nearer to zero is the cycle's phase


def limit_cycles(case: Case) -> tuple[Cycle, ...]:
    """Return the limit cycles of the loop as given: those of slosh, and those of an engine at its limits.

    Raises:
        OutsideValidity, NoAttractor: see `slosh_cycles`.
    """
    found = slosh_cycles(case)
    return found + tuple(one for one in engine_cycles(case) if not any(_near(one, other) for other in found))


def slosh_cycles(case: Case) -> tuple[Cycle, ...]:
    """Return every limit cycle on the branches of slosh from small amplitude, all tanks coupled.

    Raises:
        OutsideValidity: two modes grow at small amplitude or where damping laws dip, or one that is no slosh grows
            within the engine's dead band: no sinusoid describes that.
        NoAttractor: slosh grows and no cycle that attracts is found within the damping data.
    """
    single(case, "limit_cycles")
    actuator = case.autopilot.actuator
    dead = actuator is not None and bool(actuator.deadband)
    varies = any(_varies(case, j) for j in range(len(case.vehicle.tanks)))
    if not (dead or varies):
        return ()
    loop = open_loop(case)
    growing = _growing(loop)
    if len(growing) > 1:
        raise OutsideValidity(f"{len(growing)} modes grow at once: one sinusoid predicts no limit cycle; simulate it")
    _check_dips(case, loop)
    if dead:
        _check_dead_band(loop)
    found = _limited(case) if actuator is not None and actuator.limited else one_sinusoid_cycles(case)
    if varies and growing == ["slosh"] and not any(cycle.stable for cycle in found):
        raise NoAttractor(
            "slosh grows from small amplitude, and no limit cycle that attracts is found as far as the damping data "
            "reach; simulate it"
        )
    return found


def _growing(loop: Loop) -> list[str]:
    """Return of what kind the oscillating modes are that grow."""
    poles = closed_loop_poles(loop)
    return [kind for p, kind in zip(poles.value, poles.kind, strict=True) if p.real > NEUTRAL * abs(p) and p.imag > 0.0]


def _check_dips(case: Case, loop: Loop) -> None:
    """Raise where several modes grow with each tank at the least damping of its law, which dips below the start.

    A motion of several frequencies may attract there, beside rest and beside every single sinusoid.
    """
    laws = [tank.damping for tank in case.vehicle.tanks]
    ranges = [amplitude_range(law) for law in laws]
    least = np.array(
        [np.min(law.ratio(np.clip(np.geomspace(*r, DIPS), *r))) for law, r in zip(laws, ranges, strict=True)]
    )
    dips = [t.name for t, a, b in zip(case.vehicle.tanks, least, loop.damping, strict=True) if a < b * (1.0 - 1e-9)]
    if not dips:
        return
    count = len(_growing(replace(loop, damping=np.minimum(least, loop.damping))))
    if count > 1:
        raise OutsideValidity(
            f"{count} modes grow at once where the damping of {', '.join(dips)} dips: a motion of several frequencies "
            "may attract beside what one sinusoid predicts; simulate it from several amplitudes"
        )


def _check_dead_band(loop: Loop) -> None:
    """Raise where a mode that is no slosh grows with the gain that a dead band leaves of the loop's.

    The engine then stands still until the command leaves the band, and kicks: no sinusoid describes that.
    """
    for share in DEAD_BAND_GAINS:
        part = loop.autopilot.model_copy(update={"gain": loop.autopilot.gain * share})
        poles = closed_loop_poles(replace(loop, autopilot=part))
        for p, name, kind in zip(poles.value, poles.name, poles.kind, strict=True):
            if kind != "slosh" and p.real > NEUTRAL * float(np.max(loop.plant.tank_frequency)):
                left = "no gain" if share == DEAD_BAND_GAINS[0] else f"{100.0 * share:.3g} % of the gain"
                raise OutsideValidity(
                    f"the engine's dead band leaves {left}, with which {name} grows at {p.real:.3g} 1/s: it cycles "
                    "about the band, and no sinusoid describes that; simulate it"
                )


def one_sinusoid_cycles(case: Case) -> tuple[Cycle, ...]:
    """Return where each slosh mode neither grows nor decays, as if it were alone: a start, not yet a prediction."""
    loop = open_loop(case)
    found: list[Cycle] = []
    for j in range(len(case.vehicle.tanks)):
        follower = Follower(loop=loop, laws=[t.damping for t in case.vehicle.tanks], tank=j)
        for mode in _zeros(follower, follow(case, j)):
            cycle = _cycle(case, follower, mode)
            if not any(_same(cycle, other) for other in found):
                found.append(cycle)
    return tuple(found)


def _limited(case: Case) -> tuple[Cycle, ...]:
    """Return the cycles of a loop whose actuator has limits or a dead band; its linear loop says little of them."""
    from scipy.optimize import brentq  # 0.3 s: only where a limit cycle may be

    # where the engine stays within its limits the loop without them has the cycle: its branch may turn back in
    # amplitude, which the steps in amplitude below cannot follow
    found = [cycle for cycle in one_sinusoid_cycles(case) if _within_limits(case, cycle)]
    loop = open_loop(case)
    for j, tank in enumerate(case.vehicle.tanks):
        low, high = amplitude_range(tank.damping)
        amplitude = np.geomspace(low, high, max(POINTS, int(POINTS * np.log(high / low) / np.log(1e7))))
        modes = limited_modes(case, j, amplitude)
        for k in range(len(amplitude) - 1):
            one, other = modes[k], modes[k + 1]
            if one is None or other is None or one.mode.pole.real * other.mode.pole.real >= 0.0:
                continue
            if one.kappa == other.kappa == 1.0:
                continue

            def at(a: float, j: int = j, near: LimitedMode = one) -> LimitedMode:
                solved = limited_mode(case, loop, j, a, near.mode, near.kappa)
                if solved is None:
                    raise OutsideValidity(f"the engine at its limits has no settled answer at {a:.3g} m: simulate it")
                return solved

            a = float(brentq(lambda a, at=at: at(a).mode.pole.real, amplitude[k], amplitude[k + 1], xtol=1e-10))
            h = 1e-4
            steep = (at(a * (1.0 + h)).mode.pole.real - at(a * (1.0 - h)).mode.pole.real) / (2.0 * h)
            solved = at(a)
            linear = solved.kappa == 1.0  # within its limits: the engine plays no part in how a disturbance dies out
            laws = [t.damping for t in case.vehicle.tanks] if linear else []
            cycle = _cycle(case, Follower(loop=loop, laws=laws, tank=j), solved.mode)
            if not linear:
                cycle = replace(cycle, tvc_amplitude=solved.peak, disturbance=steep)
            if not any(_same(cycle, seen) for seen in found):
                found.append(cycle)
    return tuple(found)


def _within_limits(case: Case, cycle: Cycle) -> bool:
    """Whether the engine moves in a cycle as if it had no limits and no dead band."""
    actuator = case.autopilot.actuator
    assert actuator is not None
    linear = abs(complex(forward_transfer(case.autopilot.actuator_alone, np.array(1j * cycle.omega))))
    return actuator_factor(actuator, cycle.tvc_amplitude / linear, cycle.omega)[0] == 1.0


def _zeros(follower: Follower, modes: tuple[Mode, ...]) -> list[Mode]:
    """Return the modes of a branch that neither grow nor decay, two close ones told apart."""
    from scipy.optimize import brentq, minimize_scalar  # 0.3 s: only where a limit cycle may be

    def growth(share: float, k: int) -> float:
        mode = follower.between(modes[k], modes[k + 1], share)
        return np.nan if mode is None else mode.pole.real

    found = []
    sigma = np.array([mode.pole.real for mode in modes])
    for k in range(len(modes) - 1):
        brackets = []
        if sigma[k] * sigma[k + 1] < 0.0:
            brackets = [(0.0, 1.0)]
        elif 0 < k < len(modes) - 2:
            sign = np.sign(sigma[k])
            # toward zero before, away from it after: it may touch or cross the axis twice between two points
            if sign * (sigma[k] - sigma[k - 1]) < 0.0 < sign * (sigma[k + 2] - sigma[k + 1]):
                least = minimize_scalar(
                    lambda x, k=k, sign=sign: sign * growth(x, k), bounds=(0.0, 1.0), method="bounded"
                )
                brackets = [(0.0, float(least.x)), (float(least.x), 1.0)] if least.fun < 0.0 else []
        for ends in brackets:
            share = float(brentq(growth, *ends, args=(k,), xtol=1e-14))
            mode = follower.between(modes[k], modes[k + 1], share)
            if mode is not None:
                found.append(mode)
    return found


def _cycle(case: Case, follower: Follower, mode: Mode) -> Cycle:
    return Cycle(
        tank=case.vehicle.tanks[follower.tank].name,
        omega=mode.pole.imag,
        slosh_amplitude={t.name: float(A) for t, A in zip(case.vehicle.tanks, mode.slosh, strict=True)},
        tvc_amplitude=mode.tvc,
        disturbance=disturbance_growth(follower, mode) if follower.laws else np.nan,
    )


def disturbance_growth(follower: Follower, mode: Mode) -> float:
    """Return the greatest growth rate of a small disturbance of a cycle, 1/s, its phase apart."""
    loop, W, xi = follower.loop, mode.pole.imag, mode.damping
    A = W * mode.slosh / loop.plant.tank_frequency
    above, below = (ratios(follower.laws, A * (1.0 + h)) for h in (RELATIVE, -RELATIVE))
    with np.errstate(invalid="ignore", divide="ignore"):
        p = np.log(above / below) / np.log((1.0 + RELATIVE) / (1.0 - RELATIVE))
    p = np.where(np.isfinite(p), p, 0.0)  # at rest, or at an end of the data
    direct = np.diag(slosh_damping(loop.plant, xi * (1.0 + 0.5 * p)))
    across = np.diag(slosh_damping(loop.plant, xi * 0.5 * p) * np.exp(2j * np.angle(mode.shape)))
    others = closed_loop_eigenvalues(replace(loop, damping=xi * (1.0 + 0.5 * p)))
    return greatest_disturbance(lambda s: slosh_stiffness(loop, s)[:2], W, direct, across, others)


def greatest_disturbance(
    stiffness: Stiffness, W: float, direct: Array, across: ComplexArray, others: ComplexArray, phase: float = PHASE
) -> float:
    """Return the greatest real part of mu, 1/s, that leaves a disturbance at W + mu/j and W - mu/j in balance.

    Args:
        stiffness: S(s) and dS/ds without slosh damping, (N, N).
        W: frequency of the cycle, rad/s.
        direct: what the dampers set against a velocity at its own frequency, kg/s, (N, N).
        across: and by way of the other frequency, for the part at W + mu/j; its conjugate for the other.
        others: closed-loop poles near which disturbances are sought, rad/s.
        phase: a root this near to zero, as a part of W, is the cycle's own phase.
    """
    M, dM = _disturbed(stiffness, W, direct, across, 0.0)
    near = -np.linalg.eigvals(np.linalg.solve(dM, M))  # first order in mu: the cycle's own amplitude and phase
    starts = np.concatenate([near, others[np.isfinite(others) & (others.imag >= 0.0)] - 1j * W])
    found = np.array([_root(stiffness, W, direct, across, complex(start)) for start in starts])
    found = found[np.isfinite(found) & (np.abs(found) > phase * W)]
    return float(np.max(found.real, initial=-np.inf))


def _disturbed(
    stiffness: Stiffness, W: float, direct: Array, across: ComplexArray, mu: complex
) -> tuple[ComplexArray, ComplexArray]:
    """Return the matrix of the disturbances at W + mu/j and W - mu/j, (2N, 2N), and its derivative by mu."""
    n = len(direct)
    one, other = slice(0, n), slice(n, 2 * n)
    M, dM = np.zeros((2 * n, 2 * n), dtype=complex), np.zeros((2 * n, 2 * n), dtype=complex)
    up, down = mu + 1j * W, mu - 1j * W
    for rows, columns, s, image, coupling in ((one, other, up, down, across), (other, one, down, up, np.conj(across))):
        S, dS = stiffness(s)
        M[rows, rows], dM[rows, rows] = S + s * direct, dS + direct
        M[rows, columns], dM[rows, columns] = image * coupling, coupling
    return M, dM


def _root(stiffness: Stiffness, W: float, direct: Array, across: ComplexArray, mu: complex) -> complex:
    """Return a root of the disturbances' determinant by Newton's method; nan where none is found."""
    for _ in range(40):
        try:
            M, dM = _disturbed(stiffness, W, direct, across, mu)
        except np.linalg.LinAlgError:  # exactly on a pole of the rest of the loop: go beside it
            mu += 1e-9 * W * (1.0 + 1.0j)
            continue
        try:
            step = 1.0 / np.trace(np.linalg.solve(M, dM))
        except np.linalg.LinAlgError:  # exactly on a root
            return mu
        mu -= step * min(1.0, 0.1 * W / max(abs(step), 1e-300))
        if abs(step) < 1e-12 * W:
            return mu
    return complex(np.nan, np.nan)


def _varies(case: Case, tank: int) -> bool:
    law = case.vehicle.tanks[tank].damping
    return not np.isinf(law.amplitude(0.3)) and float(law.amplitude(0.3)) != 0.0


def _near(one: Cycle, other: Cycle) -> bool:
    """Whether two ways to one cycle, of which one sees the engine's greatest angle by the other's, ended in it."""
    return abs(one.omega - other.omega) < 1e-4 * one.omega and abs(one.tvc_amplitude - other.tvc_amplitude) < (
        1e-2 * one.tvc_amplitude
    )


def _same(one: Cycle, other: Cycle) -> bool:
    return abs(one.omega - other.omega) < 1e-6 * one.omega and np.allclose(
        list(one.slosh_amplitude.values()), list(other.slosh_amplitude.values()), rtol=1e-4
    )
