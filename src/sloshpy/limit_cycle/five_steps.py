"""The paper's five steps: threshold damping, slosh amplitude, slosh-related band, engine amplitude, verdict.

Degrade the loop by any gain and phase inside the DM = 1 ellipse: at the threshold damping the loop is at worst neutral.
So the amplitude at which the law gives this damping bounds every such limit cycle, and |z/beta| of the plant, which
no degradation outside it changes, turns it into an engine angle.
"""

from dataclasses import dataclass, replace

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case, Criteria
from sloshpy.damping.validity import NO_RADIUS, words_on_radius
from sloshpy.dynamics.growth import greatest_growth, is_stable
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import closed_loop_poles
from sloshpy.dynamics.response import transfer
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle.band import engine_per_slosh, inner_peak, slosh_band
from sloshpy.limit_cycle.cycle import Cycle
from sloshpy.limit_cycle.cycles import slosh_cycles
from sloshpy.limit_cycle.limit_cycle import LimitCycle
from sloshpy.stability.damping_search import LEVELS, MOST_RATIO, damping_levels
from sloshpy.stability.joint_damping import falls_short, joint_damping, joint_required_damping
from sloshpy.stability.margins import Margins, loop_margins
from sloshpy.stability.required_damping import RequiredDamping
from sloshpy.stability.touching import with_ratio
from sloshpy.units import Array


def predict_limit_cycle(case: Case, tank: int | str = 0, others: Array | None = None) -> LimitCycle:
    """Return the limit cycle of a tank under degraded margins, by the paper's five steps (sec C.3).

    The criteria of the case hold the thresholds of steps 1 to 3.

    Args:
        case: one vehicle and autopilot.
        tank: name or number of the tank.
        others: damping ratios at which the other tanks are held, (n_tanks,); default: where all tanks together meet
            the disc margin, see `joint_damping`.
    """
    single(case, "predict_limit_cycle")
    tank = case.tank_index(tank)
    criteria = case.criteria
    loop = open_loop(case, joint_damping(case) if others is None else others)
    together = joint_required_damping(loop, criteria, tank, criteria.disc_margin)
    required, threshold, ends = _step_two(together, criteria)
    mass = case.vehicle.tanks[tank]
    nothing = _nothing_to_find(case, tank, required, together, ends)
    if nothing is not None:
        return nothing
    band = slosh_band(threshold, criteria, *required.counted)  # step 3
    if ends or not band.size:
        own = required if together.own is None else together.own
        asked = f"; {_asked(together)}" if together.shared_with else ""
        return _without(case, tank, own, None, _why_no_band(own, criteria) + asked, together)
    xi = float(required.required)
    amplitude = float(mass.damping.amplitude(xi))  # at the slosh frequency
    omega = float(required.omega)
    w = float(mass.frequency)
    samples, per_slosh = engine_per_slosh(threshold, tank, band)
    paper_tvc, tvc = amplitude * per_slosh, amplitude * w / samples * per_slosh  # step 4
    extremes, paper_extremes = (np.array([np.min(x), np.max(x)]) for x in (tvc, paper_tvc))
    consistent = amplitude * w / omega
    neutral = _degraded(case, threshold, omega)
    stable = [cycle for cycle in neutral.coupled if cycle.stable]
    worst = max([float(extremes[1]), *(cycle.tvc_amplitude for cycle in stable)])
    largest = max([consistent, *(cycle.slosh_amplitude[mass.name] for cycle in stable)])
    unsupported = _unsupported(case, tank, xi, largest, float(np.max(samples)), worst) + neutral.reasons
    acceptable: bool | None = bool(worst <= criteria.tvc_amplitude)  # step 5
    return LimitCycle(
        case=case,
        tank=mass.name,
        required=required,
        together=together,
        band=band,
        omega=omega,
        slosh_amplitude=consistent,
        paper_slosh_amplitude=amplitude,
        tvc_amplitude=extremes,
        paper_tvc_amplitude=paper_extremes,
        gain=neutral.gain,
        delay=neutral.delay,
        degraded_growth=neutral.growth,
        coupled=neutral.coupled,
        tvc_limit=criteria.tvc_amplitude,
        acceptable=None if unsupported and (acceptable or np.isnan(extremes[1])) else acceptable,
        reasons=tuple(
            unsupported
            + _told_of_sharing(required, together)
            + _cautions(case, tank, amplitude, largest)
            + _caution_of_zero(mass.name, samples, tvc, band)
        ),
        band_omega=samples,
        band_tvc=tvc,
        paper_band_tvc=paper_tvc,
    )


@dataclass(frozen=True, kw_only=True)
class _Degraded:
    """The loop that a gain and a delay, ratio and s, make neutral at the threshold damping and omega in rad/s.

    unpredicted: why its coupled cycles are not known, empty where they are.
    """

    omega: float
    gain: float
    delay: float
    growth: float = np.nan
    coupled: tuple[Cycle, ...] = ()
    unpredicted: str = ""

    @property
    def reasons(self) -> list[str]:
        """Why its oscillation is not bounded by the five steps; none where it is."""
        if not (self.growth > 1e-9 * self.omega or self.unpredicted):
            return []
        why = self.unpredicted or f"another mode grows at {self.growth:.3g} 1/s"
        text = "degraded by its whole margin the loop is no single oscillation, which the five steps do not bound"
        return [f"{text}: {why}"]


def _degraded(case: Case, threshold: Loop, omega: float) -> _Degraded:
    """Return what a loop does when it is degraded until it is neutral at a frequency, rad/s."""
    L = complex(transfer(threshold, np.array(1j * omega)).loop)
    gain, delay = 1.0 / abs(L), float(np.angle(-L)) / omega
    if delay + float(case.autopilot.delay) < 0.0:  # a phase advance: no loop can be given one
        return _Degraded(omega=omega, gain=gain, delay=delay)
    autopilot = case.autopilot.degraded(gain, delay)
    growth = float(greatest_growth(replace(threshold, autopilot=autopilot)))
    coupled, unpredicted = _coupled(case.model_copy(update={"autopilot": autopilot}))
    return _Degraded(omega=omega, gain=gain, delay=delay, growth=growth, coupled=coupled, unpredicted=unpredicted)


def _step_two(together: RequiredDamping, criteria: Criteria) -> tuple[RequiredDamping, Loop, bool]:
    """Return the requirement that the steps rest on, the loop at it, and whether its minimum ends there.

    That of the tank's own minima; where they become another tank's before the disc margin, that of both.
    """
    own = together if together.own is None else together.own
    threshold, ends = _threshold(own, criteria)
    if ends and _hands_over(own, together, criteria):
        of_both, ends_too = _threshold(together, criteria)
        if not ends_too:
            return together, of_both, False
    return own, threshold, ends


def _hands_over(own: RequiredDamping, together: RequiredDamping, criteria: Criteria) -> bool:
    """Whether the minimum that ends at a tank's own requirement becomes that of a tank which asks for more."""
    tank, *others = together.counted
    if not (others and own.required > 0.0):
        return False
    found = _just_below(own, criteria)
    omega = found.slosh_disc_margin(tank)[1]
    return bool(np.any(found.related(*others) & (found.minima.omega == omega)))


def _nothing_to_find(
    case: Case, tank: int, required: RequiredDamping, together: RequiredDamping, ends: bool
) -> LimitCycle | None:
    """Return the answer where no amplitude gives the required damping, or none has to; else None."""
    xi, mass = float(required.required), case.vehicle.tanks[tank]

    def answer(acceptable: bool | None, reason: str) -> LimitCycle:
        return _without(case, tank, required, acceptable, reason, together)

    if np.isnan(xi):
        return answer(False, _why_none(case, required.source, tank))
    amplitude = float(mass.damping.amplitude(xi)) if xi > 0.0 else 0.0  # at the slosh frequency
    if np.isinf(amplitude):
        why = f"; {_why_no_band(required, case.criteria)}" if ends else ""
        return answer(False, f"its damping stays below the required {100 * xi:.4g} % at every amplitude{why}")
    if amplitude != 0.0:
        return None
    if xi == 0.0:
        rest = [t.name for t in case.vehicle.tanks if t.name != mass.name]
        beside = f" of its own, with {', '.join(rest)} damped as all together need" if rest else ""
        enough = f"no slosh damping is needed{beside}: no limit cycle to find"
    else:
        enough = f"its damping is at least the required {100 * xi:.4g} % at every amplitude"
    if not together.shared_with or required is together:
        return answer(True, enough)
    asked = _asked(together)
    if not np.isfinite(mass.damping.amplitude(float(together.required))):
        return answer(None, f"{enough}; but {asked}, which its damping never reaches")
    return answer(True, f"{enough}; {asked}, and cycles with it")


def _asked(together: RequiredDamping) -> str:
    return f"{', '.join(together.shared_with)} asks for {100 * float(together.required):.4g} %"


def _threshold(required: RequiredDamping, criteria: Criteria) -> tuple[Loop, bool]:
    """Return the loop at a required damping, and whether the minimum that sets it ends there."""
    threshold = with_ratio(required.source, np.asarray(0), required.counted[0], required.required)
    return threshold, bool(falls_short(threshold, required.omega, criteria, required.disc_margin))


def _just_below(required: RequiredDamping, criteria: Criteria) -> Margins:
    below = with_ratio(required.source, np.asarray(0), required.counted[0], required.required * (1.0 - 1e-6))
    return loop_margins(below, criteria, crossings=False)


def _coupled(degraded: Case) -> tuple[tuple[Cycle, ...], str]:
    """Return the cycles of a degraded loop of several tanks, and why there are none to tell."""
    if len(degraded.vehicle.tanks) < 2:
        return (), ""  # one tank: the five steps say it all
    try:
        return slosh_cycles(degraded), ""
    except OutsideValidity as error:
        return (), str(error)


def _why_no_band(required: RequiredDamping, criteria: Criteria) -> str:
    """Return what sets a required damping at which no minimum near the disc margin is the tank's."""
    xi = float(required.required)
    found = _just_below(required, criteria)
    margin, omega = (float(x) for x in found.slosh_disc_margin(*required.counted))
    if not found.stable or np.isinf(margin):
        return f"its {100 * xi:.4g} % is set by the stability of another mode: it has no band of its own to cycle in"
    where = f"its minimum of {margin:.3f} at {omega / 2.0 / np.pi:.4f} Hz"
    return (
        f"its {100 * xi:.4g} % is where {where} ends or becomes another mode's, not where the disc margin is reached: "
        "the loop still passes as near, and no band there is the tank's own"
    )


def _why_none(case: Case, loop: Loop, tank: int) -> str:
    """Return what keeps the loop from its disc margin however much a tank is damped."""
    levels = np.append(damping_levels(LEVELS), loop.damping[tank])
    family = with_ratio(loop, np.zeros(len(levels), dtype=int), tank, levels)
    stable = levels[is_stable(family)]
    most = f"{100.0 * MOST_RATIO:g} %"
    poles = closed_loop_poles(with_ratio(loop, np.asarray(0), tank, np.asarray(MOST_RATIO)))
    unstable = [name for name, p in zip(poles.name, poles.value, strict=True) if not p.real < 0.0]
    if not unstable:
        return f"no damping of this tank up to {most} gives it a disc margin of {case.criteria.disc_margin:g}"
    grows = f"{', '.join(unstable)} {'are' if len(unstable) > 1 else 'is'} unstable"
    if len(stable):
        return f"the loop is stable with {100.0 * np.max(stable):.3g} % damping of this tank, but with {most} {grows}"
    return f"no damping of this tank makes the loop stable: with {most} {grows}"


def _unsupported(case: Case, tank: int, xi: float, amplitude: float, omega: float, tvc: float) -> list[str]:
    """Return why the model supports no number here."""
    mass = case.vehicle.tanks[tank]
    if np.isnan(amplitude):
        last = mass.damping.largest_amplitude
        ends = f"data or formula end with {100 * float(mass.damping.ratio(last)):.4g} % at {last:.4g} m"
        return [f"outside the damping data: {100 * xi:.4g} % is required, {ends}"]
    reasons = []
    words, beyond = ("", False) if mass.radius is None else words_on_radius(amplitude, float(mass.radius))
    if beyond:
        reasons.append(words)
    actuator, degrees = case.autopilot.actuator, np.degrees(tvc)
    if actuator is not None and actuator.deflection_limit is not None and tvc > actuator.deflection_limit:
        limit = np.degrees(actuator.deflection_limit)
        reasons.append(
            f"an engine amplitude of {degrees:.3g} deg is beyond the actuator's {limit:.3g} deg: simulate it"
        )
    if actuator is not None and actuator.rate_limit is not None and omega * tvc > actuator.rate_limit:
        limit = np.degrees(actuator.rate_limit)
        rate = omega * degrees
        reasons.append(f"an engine rate of {rate:.3g} deg/s is beyond the actuator's {limit:.3g} deg/s: simulate it")
    return reasons


def _cautions(case: Case, tank: int, amplitude: float, consistent: float) -> list[str]:
    """Return what a reader of the amplitude must know; `amplitude` is the law's own."""
    mass = case.vehicle.tanks[tank]
    cautions = []
    if amplitude <= mass.damping.smallest_amplitude:
        cautions.append(f"caution: an upper bound, since the damping data start at {amplitude:g} m and suffice there")
    if mass.radius is None and np.isfinite(consistent):
        cautions.append(NO_RADIUS)
    elif mass.radius is not None:
        words, beyond = words_on_radius(consistent, float(mass.radius))
        if words and not beyond:
            cautions.append(f"caution: {words}")
    return cautions


def _told_of_sharing(required: RequiredDamping, together: RequiredDamping) -> list[str]:
    """Return what a reader must know where other tanks ask something of a tank's damping."""
    if not together.shared_with:
        return []
    others = ", ".join(together.shared_with)
    if required is together:
        return [
            f"its minimum becomes that of {others} before it reaches the disc margin: required damping and band count "
            f"the minima of {others} too"
        ]
    return [
        f"caution: its own minima require {100 * float(required.required):.4g} %, but {others} asks for "
        f"{100 * float(together.required):.4g} % of it"
    ]


def _caution_of_zero(tank: str, omega: Array, tvc: Array, band: Array) -> list[str]:
    """Return what a reader must know where a zero of the plant inside the band sets the engine amplitude."""
    at = inner_peak(omega, tvc, band)
    if at is None:
        return []
    return [
        f"caution: its greatest engine angle is near a zero of the plant, at {at / (2.0 * np.pi):.4f} Hz, where {tank} "
        "hardly moves whatever the engine does: a bound that no cycle need come near"
    ]


def _without(
    case: Case, tank: int, required: RequiredDamping, acceptable: bool | None, reason: str, together: RequiredDamping
) -> LimitCycle:
    """Return the answer where there is no limit cycle to compute, with its reason."""
    nothing = np.full(2, np.nan)
    return LimitCycle(
        case=case,
        tank=case.vehicle.tanks[tank].name,
        required=required,
        together=together,
        band=np.zeros((0, 2)),
        omega=np.nan,
        slosh_amplitude=np.nan,
        paper_slosh_amplitude=np.nan,
        tvc_amplitude=nothing,
        paper_tvc_amplitude=nothing,
        gain=np.nan,
        delay=np.nan,
        degraded_growth=np.nan,
        coupled=(),
        tvc_limit=case.criteria.tvc_amplitude,
        acceptable=acceptable,
        reasons=(reason,),
        band_omega=np.zeros(0),
        band_tvc=np.zeros(0),
        paper_band_tvc=np.zeros(0),
    )
