"""The best law for a record by Akaike's criterion, and the second line that would make any of them wrong."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sloshpy.damping.decay_beat import APART, Beat, beat_of, check_beat, far_better
from sloshpy.damping.decay_checks import FALSE_ALARM, noise_excess, white
from sloshpy.damping.decay_fit import DecayFit, fit_decay
from sloshpy.damping.decay_model import CONSTANT, FLATTEST, LAWS, STEEPEST, DecayLaw
from sloshpy.damping.decay_record import DecayRecord
from sloshpy.damping.decay_start import Line, spectrum
from sloshpy.errors import InputError
from sloshpy.units import Array

_STEADY = 0.02  # of the amplitude, over the whole record: no decay worth the name
_STRONG = 10.0  # by which Schwarz's criterion must fall: "very strong"
_FLATTENED = 0.01  # of the amplitude: third harmonic; damping makes one itself, of about a tenth of its ratio
_DRIFT = 1.5  # cycles within the record: what is slower is drift
_GROWN = 0.5  # of its logarithm: by how much a second line may seem to grow, one that is driven on and noisy
_BESIDE = 0.3  # of the main line's amplitude: a greater second line changes the damper's force on the first


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Every law that a record allows, best first, with its criterion.

    constant: the fit of a constant ratio, with any second line taken out of the record. excess: of the noise at the
    line. falling: whether damping that falls with the amplitude would fit far better. beat: two close lines instead.
    """

    fits: tuple[DecayFit, ...]
    constant: DecayFit
    criteria: Array
    excess: float
    falling: bool
    beat: Beat | None

    @property
    def best(self) -> DecayFit:
        """The fit of the law chosen."""
        return self.fits[0]

    @property
    def weights(self) -> Array:
        """Each law's share of belief, exp(-AIC/2) over the sum (Akaike's weights)."""
        share = np.exp(-0.5 * np.maximum(self.criteria - np.min(self.criteria), 0.0))
        return np.asarray(share / np.sum(share))


def choose_law(record: DecayRecord, line: Line) -> Choice:
    """Fit every law, look for a moving frequency and a second line, and put the laws in order.

    Raises:
        InputError: two close lines, or a second line too strong to stand beside the first.
    """
    time = record.time - record.time[0]
    fits = _fit_laws(record, time, line, LAWS)
    if not fits:
        raise record.refused(f"{line.frequency / 2.0 / np.pi:.4g} Hz", "no decay can be fitted", "look at the record")
    best = min(fits, key=DecayFit.information)
    best = _moving(best, time, record) or best
    laws = LAWS if "k" not in best.laws[0].free else tuple(replace(law, free=(*law.free, "k")) for law in LAWS)
    both = _separate_line(record, time, best)
    alone = record if both is None else replace(record, value=record.value - both.part(1))
    if alone is not record or laws is not LAWS:
        fits = _fit_laws(alone, time, line, laws)
        best = min(fits, key=DecayFit.information)
    beat = beat_of(alone, time, line, best)
    if beat is not None:
        try:
            check_beat(record, line, beat)
        except InputError:
            _check_steady(record, fits, time)
            raise
    constant = next((fit for fit in fits if fit.laws[0].name == "constant"), best)
    if both is not None:
        fits = _fit_beside(record, time, fits, both.values[1]) or [both]
    return _in_order(fits, constant, beat)


def _check_steady(record: DecayRecord, fits: list[DecayFit], time: Array) -> None:
    """Refuse a wave that keeps its amplitude, by the fit of a constant ratio."""
    constant = next((fit for fit in fits if fit.laws[0].name == "constant"), None)
    if constant is None:
        return
    w, xi = constant.values[0, :2]
    change = abs(float(np.expm1(-xi * w * time[-1])))
    if change < _STEADY:
        value = f"an amplitude kept to {max(100.0 * change, 1e-4):.2g} % over {time[-1]:.4g} s"
        cure = "start after the excitation ends, or record for longer"
        raise record.refused(value, "does not decay", cure)


def _fit_laws(record: DecayRecord, time: Array, line: Line, laws: Sequence[DecayLaw]) -> list[DecayFit]:
    """Fit each law; a free exponent starts from the better of the fixed ones."""
    fits: list[DecayFit] = []
    ratio = max(line.ratio, 1e-4)
    for law in laws:
        start = law.full
        start[0] = line.frequency
        if law.name != "power":
            start[1] = line.ratio if law.name == "constant" else 0.5 * ratio
        if "q" in law.free:
            start[2] = ratio
        if law.name == "sum" and "p" in law.free and not any(map(_possible, fits[-2:])):
            continue  # neither fixed exponent leaves a place for both parts
        same = [fit for fit in fits if fit.laws[0].name == law.name]
        if "p" in law.free and same:
            start = min(same, key=lambda fit: fit.squares).values[0].copy()
        fit = fit_decay([law], start[None], time, record.value)
        if fit is not None:
            fits.append(fit)
    return fits


def _fit_beside(record: DecayRecord, time: Array, fits: list[DecayFit], beside: Array) -> list[DecayFit]:
    """Fit each law again together with the second line, from where it was fitted without it."""
    again = [fit_decay([fit.laws[0], CONSTANT], np.stack([fit.values[0], beside]), time, record.value) for fit in fits]
    return [fit for fit in again if fit is not None and _apart(fit)]


def _in_order(fits: list[DecayFit], constant: DecayFit, beat: Beat | None) -> Choice:
    """Put the laws in order by Akaike's criterion.

    Schwarz's would keep to one number longer, and bias the damping of a law between those tried by a standard error.
    """
    excess = noise_excess(min(fits, key=lambda fit: fit.squares))
    allowed = [fit for fit in fits if _possible(fit)] or [fit for fit in fits if fit.laws[0].name == "constant"]
    ordered = sorted(allowed, key=lambda fit: fit.akaike(excess))
    top = min(fit.information(excess) for fit in allowed)
    lowest = min(fits, key=lambda fit: fit.information(excess))
    falling = lowest.laws[0].name == "sum" and lowest.values[0, 2] < 0.0 and top - lowest.information(excess) > _STRONG
    return Choice(
        fits=tuple(ordered),
        constant=constant,
        criteria=np.array([fit.akaike(excess) for fit in ordered]),
        excess=excess,
        falling=falling,
        beat=beat,
    )


def _possible(fit: DecayFit) -> bool:
    """Whether a fitted law is one of the package's: no negative part, an exponent within its range."""
    _, xi0, q, p, _ = fit.values[0]
    if "p" in fit.laws[0].free and not 1.01 * FLATTEST < p < 0.99 * STEEPEST:
        return False
    return bool(("xi0" not in fit.laws[0].free or fit.laws[0].name == "constant" or xi0 > 0.0) and (
        "q" not in fit.laws[0].free or q > 0.0
    ))  # fmt: skip


def _apart(fit: DecayFit) -> bool:
    """Whether the second line of a fit is one: it has not wandered to the first, nor does it die at once or grow."""
    (w1, *_), (w2, ratio, *_) = fit.values
    return bool(abs(w2 / w1 - 1.0) >= APART and ratio < 0.3 and ratio * w2 * fit.time[-1] > -_GROWN)


def _moving(best: DecayFit, time: Array, record: DecayRecord) -> DecayFit | None:
    """Return the best law with a frequency that moves with the amplitude, where the record asks for one."""
    if white(best):
        return None
    law = replace(best.laws[0], free=(*best.laws[0].free, "k"))
    fit = fit_decay([law], best.values, time, record.value)
    return fit if fit is not None and far_better(fit, best, noise_excess(fit)) else None


def _separate_line(record: DecayRecord, time: Array, best: DecayFit) -> DecayFit | None:
    """Return the fit with a second line well apart from the first, None where the residual has none.

    Raises:
        InputError: the line stands too near the first or is too strong.
    """
    if white(best):
        return None
    f, power = spectrum(time, best.residual)
    allowed = f * time[-1] > 2.0
    share = np.where(allowed, power, 0.0) / np.mean(power[allowed])
    k = int(np.argmax(share))
    if share[k] < np.log(len(f) / 4.0 / FALSE_ALARM):  # Fisher: an exponential variable among n/2 of them
        return None
    w1, w2 = best.values[0, 0], 2.0 * np.pi * float(f[k])
    if abs(w2 / w1 - 1.0) < APART:
        return None  # a misfit of the law, or two lines that the fit of two has not told apart
    second = np.array([w2, max(float(best.values[0, 1]), 0.002), 0.0, 1.0, 0.0])
    fit = fit_decay([best.laws[0], CONSTANT], np.stack([best.values[0], second]), time, record.value)
    if fit is None or not _apart(fit) or not far_better(fit, best, noise_excess(fit, mode=1)):
        return None
    if fit.values[1, 0] * time[-1] < _DRIFT * 2.0 * np.pi:
        raise record.refused("drift", "is no straight line or parabola", "take the slow part out of the record")
    harmonic = fit.values[1, 0] / fit.values[0, 0]
    share = float(fit.start_amplitude[1] / fit.start_amplitude[0])
    if abs(harmonic - 3.0) < 0.05 and share > max(_FLATTENED, 0.2 * float(fit.values[0, 1] + fit.values[0, 2])):
        value = f"third harmonic of {100.0 * share:.3g} % of the amplitude"
        cure = "look for a clipped or limited sensor, or start at a smaller amplitude"
        raise record.refused(value, "the crests are flattened or sharpened", cure)
    sizes = [float(np.sqrt(np.mean(fit.amplitude(m) ** 2))) for m in (0, 1)]
    if sizes[1] > _BESIDE * sizes[0]:
        value = f"two lines {w1 / 2.0 / np.pi:.4g} / {fit.values[1, 0] / 2.0 / np.pi:.4g} Hz"
        rule = (
            f"the second has {100.0 * sizes[1] / sizes[0]:.3g} % of the first's amplitude: single-mode damping refused"
        )
        raise record.refused(value, rule, "excite one mode alone, or filter the other out of the record")
    return fit
