"""Limit cycles of an engine at its limits, whatever mode carries them: the balance kappa(B, W) L(jW) = -1.

Beyond its limits an engine gives less than it is told, and later. A loop that needs its gain, as that of a vehicle in
the air or with guidance does, or that has no lag to spare, then has a large cycle which repels: inside it motion dies
out, outside it grows without end. Slosh need not take part, so that no branch of slosh leads there.

At each frequency the command B is found at which |kappa| = 1/|L|, the tanks damped as their slosh there asks; where the
phases agree too there is a cycle. Small dead bands are left out: what they do is small.
"""

from dataclasses import dataclass, replace

import numpy as np

from sloshpy.autopilot import Actuator, Autopilot, forward_transfer
from sloshpy.case import Case
from sloshpy.damping import DampingLaw, ratios
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.response import transfer
from sloshpy.limit_cycle.cycle import Cycle
from sloshpy.limit_cycle.engine_limits import actuator_factor
from sloshpy.stability.nichols import sampled
from sloshpy.units import Array, BoolArray

LARGEST = 1.0  # rad of command: beyond it no angle is small
LAG = np.radians(100.0)  # of the fundamental of an engine that only follows its fastest rate: 90 deg and some
LEAD = np.radians(5.0)
TRIED = 24  # frequencies of an interval in which a cycle may be
PASSES = 30  # at most, until damping and slosh agree
SETTLED = 1e-8


def engine_cycles(case: Case) -> tuple[Cycle, ...]:
    """Return the cycles of a loop whose engine is at a deflection or rate limit, up to 1 rad of command.

    The slosh amplitudes may lie beyond a tank's damping data: the damping is then read at their end.
    """
    from scipy.optimize import brentq  # 0.3 s: only where a limit cycle may be

    actuator = case.autopilot.actuator
    if actuator is None or (actuator.deflection_limit is None and actuator.rate_limit is None):
        return ()
    balance = _Balance(
        loop=open_loop(case),
        laws=[tank.damping for tank in case.vehicle.tanks],
        actuator=actuator.model_copy(update={"deadband": None}),
        linear=case.autopilot.actuator_alone,
    )
    curves = sampled(balance.loop, case.criteria.gain_margin, case.criteria.phase_margin)
    lag = np.angle(-curves.loop)  # what kappa must lag for a cycle
    open_ = (np.abs(curves.loop) >= 1.0) & (lag < LAG) & (lag > -LEAD)
    found: list[Cycle | None] = []
    for first, last in _intervals(open_):
        ends = curves.omega[max(first - 1, 0)], curves.omega[min(last + 1, len(open_) - 1)]
        inside = curves.omega[np.unique(np.linspace(first, last, min(last - first + 1, TRIED)).astype(int))]
        omega = np.unique([ends[0], *inside, ends[1]])
        apart = np.array([balance.apart(w) for w in omega])
        for k in np.flatnonzero(apart[1:] * apart[:-1] < 0.0):
            if abs(apart[k + 1] - apart[k]) < np.pi:
                found.append(balance.cycle(float(brentq(balance.apart, omega[k], omega[k + 1], rtol=1e-10))))
    return tuple(cycle for cycle in found if cycle is not None)


def _intervals(chosen: BoolArray) -> list[tuple[int, int]]:
    """Return first and last position of each run of true entries."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(int)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


@dataclass(frozen=True, kw_only=True)
class _Balanced:
    """What balances in gain at one frequency in rad/s: command in rad, kappa, L, slosh in m, greatest engine angle."""

    command: float
    kappa: complex
    loop: complex
    damping: Array
    slosh: Array
    peak: float


@dataclass(frozen=True, kw_only=True)
class _Balance:
    """A loop with an engine at its limits, one frequency at a time."""

    loop: Loop
    laws: list[DampingLaw]
    actuator: Actuator
    linear: Autopilot

    def response(self, omega: float, damping: Array) -> tuple[complex, Array]:
        """Return L and |z_j/beta| at a frequency, rad/s."""
        found = transfer(replace(self.loop, damping=damping), np.array(1j * omega))
        return complex(found.loop), np.abs(found.slosh)

    def command(self, gain: float, omega: float) -> float:
        """Return the command in rad at which the engine gives so little of it; nan where none up to `LARGEST` does."""
        from scipy.optimize import brentq  # as above

        def surplus(log_b: float) -> float:
            return float(abs(actuator_factor(self.actuator, np.exp(log_b), omega)[0]) - gain)

        stop, fastest = self.actuator.deflection_limit, self.actuator.rate_limit
        limits = [stop, None if fastest is None else fastest / omega]
        onset = min(float(x) for x in limits if x is not None) / max(self.engine(omega), 1.0)
        low, high = np.log(0.9 * onset), np.log(LARGEST)
        if not (low < high and surplus(low) >= 0.0 > surplus(high)):
            return np.nan
        return float(np.exp(brentq(surplus, low, high, xtol=1e-10)))

    def engine(self, omega: float) -> float:
        """Return the linear actuator's engine angle per command."""
        return abs(complex(forward_transfer(self.linear, np.array(1j * omega))))

    def settled(self, omega: float) -> _Balanced | None:
        """Return what balances in gain at a frequency with damping and slosh in agreement; None where nothing does."""
        damping = self.loop.damping
        for _ in range(PASSES):
            L, per_engine = self.response(omega, damping)
            command = self.command(1.0 / abs(L), omega) if abs(L) > 1.0 else np.nan
            if np.isnan(command):
                return None
            kappa, peak = actuator_factor(self.actuator, command, omega)
            slosh = command * abs(kappa) * self.engine(omega) * per_engine
            wanted = self.damped(slosh * omega / self.loop.plant.tank_frequency)
            if np.max(np.abs(wanted - damping), initial=0.0) < SETTLED:
                return _Balanced(command=command, kappa=kappa, loop=L, damping=damping, slosh=slosh, peak=peak)
            damping = 0.5 * (wanted + damping)
        return None

    def damped(self, amplitude: Array) -> Array:
        """Return the tanks' damping at amplitudes in m, at the end of their data beyond it."""
        inside = [
            np.clip(a, law.smallest_amplitude, law.largest_amplitude)
            for law, a in zip(self.laws, amplitude, strict=True)
        ]
        return np.minimum(ratios(self.laws, np.array(inside)), 1.0)

    def apart(self, omega: float) -> float:
        """Return the angle of -kappa L where their gains balance, rad; nan where they do not."""
        found = self.settled(omega)
        return np.nan if found is None else float(np.angle(-found.kappa * found.loop))

    def cycle(self, omega: float) -> Cycle | None:
        """Return the cycle at a frequency; it attracts where more command makes it decay.

        Beside it s = jW + ds with ds = -(d ln kappa / d ln B) / (d ln L / ds) per part of the command.
        """
        found = self.settled(omega)
        if found is None:
            return None
        h = 1e-3
        more, less = (actuator_factor(self.actuator, found.command * (1.0 + d), omega)[0] for d in (h, -h))
        step = 1e-6 * omega
        above, below = (self.response(omega + d, found.damping)[0] for d in (step, -step))
        growth = -(more - less) / (2.0 * h * found.kappa) * found.loop * 2j * step / (above - below)
        return Cycle(
            tank="",
            omega=omega,
            slosh_amplitude=dict(zip(self.loop.plant.tanks, map(float, found.slosh), strict=True)),
            tvc_amplitude=found.peak,
            disturbance=float(growth.real),
        )
