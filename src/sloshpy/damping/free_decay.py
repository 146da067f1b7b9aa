"""A record of one dying oscillation to frequency and xi(A) with bands, or the reason why not."""

from dataclasses import replace

import numpy as np

from sloshpy.damping import decay_checks as checks
from sloshpy.damping.decay_band import Draws, bootstrap, check_law, interval, known_range
from sloshpy.damping.decay_beat import check_near_beat
from sloshpy.damping.decay_choice import Choice, choose_law
from sloshpy.damping.decay_fit import DecayFit
from sloshpy.damping.decay_kick import check_kick
from sloshpy.damping.decay_model import ratio_at
from sloshpy.damping.decay_noise import Noise, noise_of
from sloshpy.damping.decay_record import UNIT_OF, DecayRecord, Measured
from sloshpy.damping.decay_result import Estimate, FreeDecay
from sloshpy.damping.decay_spikes import without_spikes
from sloshpy.damping.decay_start import Line, main_line, strongest_line
from sloshpy.damping.decay_tangent import Tangent, tangent
from sloshpy.errors import InputError, Problem
from sloshpy.units import Array

LEVEL = 0.95
_GRID = 25  # amplitudes of the band, evenly spaced in their logarithm
_MOST_RATIO = 0.15  # first-order averaging is good to 1 % of xi up to here


def free_decay(
    record: DecayRecord,
    measured: Measured = "displacement",
    *,
    per_displacement: float | None = None,
    frequency_hint: float | None = None,
    start: float | None = None,
    end: float | None = None,
    draws: int = 2000,
    seed: int = 0,
) -> FreeDecay:
    """Identify slosh frequency and damping from a free decay: x = offset + drift t + A(t) cos theta(t) + white noise.

    Maximum likelihood of a constant, a power and a sum law, the best by Akaike's criterion; bands by bootstrap, wide
    enough for any of the laws, whichever was chosen. Amplitudes at which the damping is not known to 8 % are left out.

    Args:
        record: one decay, sampled at known times.
        measured: what its column is: slosh-mass "displacement", "wave" height at the wall or lateral "force"; peak
            amplitudes, never peak to peak.
        per_displacement: record per slosh-mass displacement: m/m for a wave, N/m for a force (m_s w^2). Without it only
            a constant ratio becomes a law.
        frequency_hint: expected slosh frequency, rad/s; without it aliasing cannot be excluded.
        start, end: part of the record, s of its own time.
        draws: of the bootstrap.
        seed: of the bootstrap.

    Raises:
        InputError: the record does not identify a damping; the text says why.
    """
    scale = _scale(record, measured, per_displacement)
    part = record.between(start, end)
    checks.check_constant(part)
    checks.check_size(part, scale)
    sampling = checks.sampling_of(part, frequency_hint)
    rest, spikes = without_spikes(part)
    if spikes:
        _check_spikes(part, rest, spikes, sampling, frequency_hint)
    line = main_line(part, strongest_line(part, frequency_hint))
    checks.check_line(part, sampling, line.frequency)
    checks.check_clipping(part, line.frequency, sampling.step)
    choice, floor, halves, about, noise = _identified(part, line, sampling)
    best = choice.best
    amplitude = np.geomspace(*known_range(part, about, noise, floor), _GRID)
    ratio = ratio_at(best.values[0], amplitude / best.start_amplitude[0])
    found = bootstrap(about, noise, amplitude, draws, seed)
    low, high = interval(found.ratio, LEVEL)
    check_law(part, amplitude, ratio, low, high)
    return FreeDecay(
        record=part,
        measured=measured,
        per_displacement=scale,
        hint=frequency_hint,
        choice=choice,
        sampling=sampling,
        level=LEVEL,
        seed=seed,
        amplitude=amplitude / (scale or 1.0),
        ratio=ratio,
        ratio_low=np.maximum(low, 0.0),
        ratio_high=high,
        estimates=_estimates(best, found, scale or 1.0),
        halves=halves,
    )


def _identified(
    part: DecayRecord, line: Line, sampling: checks.Sampling
) -> tuple[Choice, float, float, Tangent, Noise]:
    """Return the laws in order, the amplitude lost in noise, the halves' difference, the tangent and its noise."""
    choice = choose_law(part, line)
    best = choice.best
    checks.check_line(part, sampling, float(best.values[0, 0]))
    _check_fits(part, choice)
    floor = checks.check_strength(part, best, sampling.step, choice.excess)
    halves = checks.check_halves(part, best, choice.excess)
    about = tangent(best)
    noise = noise_of(about)
    check_kick(part, about, noise)
    check_near_beat(part, best, choice.beat)
    return choice, floor, halves, about, noise


def _check_spikes(
    part: DecayRecord, rest: DecayRecord, spikes: tuple[int, ...], sampling: checks.Sampling, hint: float | None
) -> None:
    """Refuse spikes in an otherwise good record; where the rest is no decay either, its own check tells."""
    try:
        _identified(rest, main_line(rest, strongest_line(rest, hint)), sampling)
    except InputError:
        return
    k = spikes[0]
    others = f", and {len(spikes) - 1} more" if len(spikes) > 1 else ""
    raise part.refused(
        f"{part.value[k]:.6g} {part.unit} at {part.time[k]:.6g} s{others}",
        f"stands apart from its neighbours, which lead to {rest.value[k]:.6g} {part.unit}",
        "drop the row, if the sensor is to blame, or fit a part without it by --start and --end",
        k,
    )


def _scale(record: DecayRecord, measured: Measured, per_displacement: float | None) -> float | None:
    """Return the record's unit per m of slosh-mass displacement, None where it is not known."""
    if measured not in UNIT_OF:
        problem = Problem(
            key="measured",
            value=str(measured),
            rule="must be displacement, wave or force",
            cure="say what the column is",
        )
        raise InputError(problem)
    if record.unit != UNIT_OF[measured]:
        rule = f"is no {measured}, which is in {UNIT_OF[measured]}"
        raise record.refused(f"[{record.unit}]", rule, "say what the column is, or name another")
    if measured == "displacement":
        if per_displacement not in (None, 1.0):
            raise record.refused(f"factor {per_displacement}", "a displacement needs no factor", "leave it out")
        return 1.0
    if per_displacement is not None and not 0.0 < per_displacement < np.inf:
        raise record.refused(
            f"factor {per_displacement}", "must be > 0 and finite", f"give the {measured} per displacement"
        )
    return per_displacement


def _check_fits(record: DecayRecord, choice: Choice) -> None:
    """Refuse what no law explains, what does not decay, and damping beyond the theory."""
    best = choice.best
    checks.check_decay(record, choice.constant, choice.excess)
    if choice.falling:
        cure = "look for a limited or clipped sensor, or contact-line friction, which only a table by hand can hold"
        raise record.refused("damping that falls with the amplitude", "fits better than any law of damping", cure)
    checks.check_misfit(record, best)
    most = float(ratio_at(best.values[0], np.ones(1))[0])
    if most > _MOST_RATIO:
        rule = f"is beyond the {100.0 * _MOST_RATIO:g} % up to which a decay has an envelope"
        raise record.refused(f"damping {100.0 * most:.3g} %", rule, "start at a smaller amplitude")


def _estimates(fit: DecayFit, found: Draws, scale: float) -> tuple[Estimate, ...]:
    """Return frequency and the law's numbers with their bands; those of the numbers hold if this is the law."""
    law = fit.laws[0]
    w, xi0, q, p, k = fit.values[0]
    A0 = fit.start_amplitude[0] / scale

    def estimate(name: str, value: float, samples: Array, unit: str) -> Estimate:
        low, high = interval(samples, LEVEL)
        return Estimate(name=name, value=float(value), low=float(low), high=float(high), unit=unit)

    rows = [estimate("frequency", w, found.values[:, 0], "rad/s")]
    values, start = found.values, found.start_amplitude / scale
    if "xi0" in law.free:
        rows.append(estimate("constant_ratio", xi0, values[:, 1], "1"))
    if "q" in law.free:
        exponent = np.clip(values[:, 3], 0.05, 4.0)
        slopes = values[:, 2] / start**exponent
        rows.append(estimate("slope", q / A0**p, slopes, "1/m" if p == 1.0 else f"1/m^{p:.6g}"))
        if "p" in law.free:
            rows.append(estimate("exponent", p, exponent, "1"))
    if "k" in law.free:
        rows.append(estimate("frequency_change", k, values[:, 4], "1"))
    return tuple(replace(row, low=min(row.low, row.value), high=max(row.high, row.value)) for row in rows)
