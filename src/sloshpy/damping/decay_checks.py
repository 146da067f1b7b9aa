"""What a record must have before its damping may be believed; each check refuses with its figures."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sloshpy.damping.decay_fit import DecayFit
from sloshpy.damping.decay_model import wave
from sloshpy.damping.decay_record import MOST_SAMPLES, DecayRecord

LARGEST = 100.0  # m of slosh-mass displacement, peak
LEAST_CYCLES = 5.0
LEAST_SAMPLES_PER_CYCLE = 10.0
_SLOWEST, _FASTEST = 0.005, 50.0  # Hz: of slosh, from a stage coasting at a thousandth of g to a beaker
_STEPS = 4.0  # of the sensor: noise of one or two of them flattens a crest by as much
_FLAT = 0.08  # of a cycle: a crest held for longer is no crest
FALSE_ALARM = 1e-4  # of the whiteness test: a thousand white records pass
_SLOW = 2.0  # Hz: sampled more slowly, a wave of 1 Hz and more hides behind one of any lower frequency
_GATHERED = 3.0  # times the power beside the line; white noise reaches it once in 100 000 records
_LEFT = 0.003  # of the signal: third-order terms of the averaging stay below it
_COARSE = 0.5  # of the mean step: a scatter of the time stamps beyond it is a fault of the clock


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """How a record was sampled: median step, s, its scatter over the step, and the widest step, s."""

    step: float
    jitter: float
    widest: float


def sampling_of(record: DecayRecord, hint: float | None) -> Sampling:
    """Return how a record is sampled; refuse one that is too short or too coarse for the hinted frequency, rad/s."""
    if len(record.time) < 30:
        raise record.refused(f"{len(record.time)} samples", "are too few to fit a decay", "give at least five cycles")
    if len(record.time) > MOST_SAMPLES:
        rule = f"are more than the {MOST_SAMPLES} that are fitted at once"
        raise record.refused(f"{len(record.time)} samples", rule, "name a part by its start and end, or thin it out")
    steps = np.diff(record.time)
    step = float(np.median(steps))
    usual = steps[steps < 2.5 * step]
    found = Sampling(step=step, jitter=float(np.std(usual) / step), widest=float(np.max(steps)))
    if found.jitter > _COARSE:
        value = f"steps scatter by {100.0 * found.jitter:.3g} % of {step:.4g} s"
        raise record.refused(value, "the time stamps are not those of a clock", "mend the time column", None, "time")
    if hint is None and 1.0 / step < _SLOW:
        value = f"sampled at {1.0 / step:.4g} Hz"
        rule = "is too slow to exclude that a faster wave is aliased"
        raise record.refused(value, rule, "give the expected frequency as --frequency-hint", None, "time")
    if hint is not None:
        _enough_samples(record, step, hint, "hinted")
    return found


def check_size(record: DecayRecord, per_displacement: float | None) -> None:
    """Refuse a swing that is no slosh-mass displacement in any tank."""
    if per_displacement is None:
        return
    swing = 0.5 * float(np.ptp(record.value)) / per_displacement
    if swing > LARGEST:
        rule = f"is no slosh-mass displacement: at most {LARGEST:g} m"
        raise record.refused(f"a swing of {swing:.4g} m", rule, f"check the unit of {record.column} and the scale")


def check_line(record: DecayRecord, sampling: Sampling, w: float) -> None:
    """Refuse a line, rad/s, that is no slosh, has too few cycles or samples, or has a gap in it."""
    f_hz = w / (2.0 * np.pi)
    span = record.time[-1] - record.time[0]
    cycles = f_hz * span
    if cycles < LEAST_CYCLES:
        value = f"{cycles:.3g} cycles of {f_hz:.4g} Hz in {span:.4g} s"
        raise record.refused(value, f"must be at least {LEAST_CYCLES:g} cycles", "record for longer")
    _enough_samples(record, sampling.step, w, "found")
    if not _SLOWEST <= f_hz <= _FASTEST:
        rule = f"is no slosh, which is from {_SLOWEST:g} to {_FASTEST:g} Hz"
        raise record.refused(f"{f_hz:.4g} Hz", rule, "check the unit of the time: s, ms or a date?", None, "time")
    gap = sampling.widest
    if gap > max(2.5 * sampling.step, 0.25 / f_hz):
        k = int(np.argmax(np.diff(record.time))) + 1
        value = f"gap of {gap:.4g} s, {gap * f_hz:.3g} cycles"
        raise record.refused(value, "must be less than a quarter cycle", "fit a part without a gap", k, "time")


def _enough_samples(record: DecayRecord, step: float, w: float, what: str) -> None:
    per_cycle = 2.0 * np.pi / (w * step)
    if per_cycle < LEAST_SAMPLES_PER_CYCLE:
        value = f"{per_cycle:.3g} samples per cycle of the {w / 2.0 / np.pi:.4g} Hz {what}"
        rule = f"must be at least {LEAST_SAMPLES_PER_CYCLE:g}: the wave may be aliased"
        raise record.refused(value, rule, "sample faster", None, "time")


def check_constant(record: DecayRecord) -> None:
    """Refuse a record without any motion."""
    reach = float(np.ptp(record.value))
    if reach <= 1e-12 * float(np.max(np.abs(record.value))):
        raise record.refused(
            f"{record.value[0]:.6g} {record.unit} throughout", "has no decay to fit", "name a column that moves"
        )


def check_clipping(record: DecayRecord, w: float, step: float) -> None:
    """Refuse crests held flat at the record's highest or lowest value.

    One crest is flat beyond a twelfth of a cycle only where the sensor's steps are coarser than a fourteenth of the
    amplitude; two crests of a decay share their height only where something holds it.
    """
    per_cycle = 2.0 * np.pi / (w * step)
    reach = float(np.ptp(record.value))
    for extreme, word in ((np.max(record.value), "above"), (np.min(record.value), "below")):
        held = np.abs(record.value - extreme) <= 1e-9 * reach
        edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(int)))
        runs = list(zip(edges[::2], edges[1::2], strict=True))
        longest = max(high - low for low, high in runs)
        long = [run for run in runs if run[1] - run[0] >= 2]
        crests = 1 + sum(b[0] - a[1] > 0.5 * per_cycle for a, b in pairwise(long))
        flat = any(_too_flat(run, record, per_cycle, extreme) for run in runs)
        if flat or longest >= max(3.0, _FLAT * per_cycle) or (len(long) > 1 and crests > 1):
            value = f"{longest} samples held at {extreme:.6g} {record.unit}"
            k = int(next(low for low, high in runs if high - low == longest))
            rule = f"is clipped {word}, or read in steps too coarse for it"
            raise record.refused(value, rule, "widen the sensor's range, or start after the clipped crests", k)


def _too_flat(run: tuple[int, int], record: DecayRecord, per_cycle: float, extreme: float) -> bool:
    """Whether samples held at the extreme value span more of a crest than the sensor's steps explain.

    Over n samples a crest falls by A (1 - cos(pi (n - 1)/per_cycle)) at least. Two equal samples may lie on both sides
    of a crest, unless the record starts or ends there.
    """
    n = run[1] - run[0]
    at_an_end = run[0] == 0 or run[1] == len(record.value)
    if n < (2 if at_an_end else 3):
        return False
    steps = np.diff(np.unique(record.value))
    fall = abs(extreme - float(np.median(record.value))) * (1.0 - np.cos(np.pi * min((n - 1) / per_cycle, 1.0)))
    return bool(fall > _STEPS * np.min(steps))


def check_decay(record: DecayRecord, fit: DecayFit, excess: float) -> None:
    """Refuse a record that does not decay, by the fit of a constant ratio."""
    covariance = np.linalg.pinv(fit.jacobian.T @ fit.jacobian) * fit.noise**2 * excess
    xi, error = fit.values[0, 1], float(np.sqrt(covariance[1, 1]))
    if xi <= 4.0 * error:
        value = f"damping {100.0 * xi:.3g} % +- {100.0 * error:.2g} %"
        rule = "has no decay to fit: damping must exceed four standard errors"
        raise record.refused(value, rule, "record for longer, or start after the excitation ends")


def check_strength(record: DecayRecord, fit: DecayFit, step: float, excess: float) -> float:
    """Return the amplitude below which a cycle is lost in the noise; refuse a record with too few cycles above it."""
    w = fit.values[0, 0]
    per_cycle = 2.0 * np.pi / (w * step)
    floor = 3.0 * fit.noise * float(np.sqrt(2.0 * excess / per_cycle))
    amplitude = fit.amplitude()
    above = fit.time[amplitude >= floor]
    cycles = 0.0 if not len(above) else float(w * above[-1] / (2.0 * np.pi))
    if cycles < LEAST_CYCLES:
        value = f"{cycles:.3g} cycles of {w / 2.0 / np.pi:.4g} Hz above the noise of {fit.noise:.3g} {record.unit}"
        raise record.refused(value, f"must be at least {LEAST_CYCLES:g} cycles", "lower the noise or excite more")
    return max(floor, float(amplitude[-1]))


def white(fit: DecayFit) -> bool:
    """Whether white noise may be as correlated over 20 samples as the residual (Ljung and Box 1978)."""
    from scipy.special import chdtrc  # 0.1 s: only when a record is fitted

    n = len(fit.residual)
    r = fit.residual - np.mean(fit.residual)
    lags = np.arange(1, min(20, n // 5) + 1)
    if fit.exact:
        return True
    correlation = np.array([r[lag:] @ r[:-lag] for lag in lags]) / float(r @ r)
    return float(chdtrc(len(lags), n * (n + 2.0) * np.sum(correlation**2 / (n - lags)))) > FALSE_ALARM


def noise_excess(fit: DecayFit, mode: int = 0) -> float:
    """Return the residual's power within half a mode's frequency of it, over its mean; 1 for white residuals."""
    if white(fit):
        return 1.0
    n = len(fit.residual)
    power = np.abs(np.fft.rfft(fit.residual)) ** 2
    f = np.fft.rfftfreq(n, fit.time[-1] / (n - 1))
    near = np.abs(2.0 * np.pi * f / fit.values[mode, 0] - 1.0) < 0.5
    return max(float(np.mean(power[near]) / np.mean(power[1:])), 1.0) if np.any(near) else 1.0


def check_misfit(record: DecayRecord, fit: DecayFit) -> None:
    """Refuse where what no law explains stands at the line itself: noise does not gather within its resolution.

    A law bends to a kick or a drive that goes on before it leaves much of them, so that little left is much amiss.
    """
    n = len(fit.residual)
    power = np.abs(np.fft.rfft(fit.residual)) ** 2
    f, f_hz = np.fft.rfftfreq(n, fit.time[-1] / (n - 1)), fit.values[0, 0] / (2.0 * np.pi)
    at = np.abs(f - f_hz) * fit.time[-1] < 4.0
    beside = (np.abs(f / f_hz - 1.0) < 0.6) & ~at
    usual = float(np.mean(power[beside])) if np.count_nonzero(beside) > 4 else float(np.mean(power[1:]))
    left = float(np.sqrt(2.0 * np.sum(power[at])) / n / np.sqrt(np.mean(fit.amplitude() ** 2) / 2.0))
    if np.mean(power[at]) > _GATHERED * usual and left > _LEFT:
        value = f"{100.0 * left:.3g} % of the signal is left at {f_hz:.4g} Hz"
        cure = "start after the excitation ends, rotate to the tank's axes, or look for a disturbance or friction"
        raise record.refused(value, "no law of damping fits", cure)


def check_halves(record: DecayRecord, fit: DecayFit, excess: float) -> float:
    """Return how far the damping of both halves differs, in standard errors; refuse where they disagree.

    Each half's residual is regressed on a change of its own amplitude, phase, damping and frequency, so that a law's
    own course over the amplitude counts as agreement.
    """
    mode = wave(fit.values[0], fit.time) * (fit.coefficient[0] - 1j * fit.coefficient[1])
    middle = len(fit.time) // 2
    changes, errors = [], []
    for half in (slice(None, middle), slice(middle, None)):
        t, m = fit.time[half], mode[half]
        t = t - np.mean(t)
        X = np.stack([m.real, m.imag, t * m.real, t * m.imag, np.ones_like(t)], axis=1)
        size = np.linalg.norm(X, axis=0)
        inverse = np.linalg.pinv(X / size, rcond=1e-10)
        changes.append(-float(inverse[2] @ fit.residual[half]) / size[2] / fit.values[0, 0])
        errors.append(float(np.linalg.norm(inverse[2])) * fit.noise * np.sqrt(excess) / size[2] / fit.values[0, 0])
    difference, error = changes[0] - changes[1], float(np.hypot(*errors))
    log_decay = float(np.log(fit.amplitude()[0] / fit.amplitude()[-1]))
    mean = log_decay / (fit.values[0, 0] * fit.time[-1])
    if abs(difference) > max(4.0 * error, 0.05 * mean):
        value = f"damping of the halves differs by {100.0 * difference:.3g} % +- {100.0 * error:.2g} %"
        raise record.refused(value, "no law of damping holds in both", "look for a disturbance in the record")
    return difference / error if error > 0.0 else 0.0
