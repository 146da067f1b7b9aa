"""Two close lines in the place of one: a beat, seen whole, in part, or only nearly."""

from dataclasses import dataclass

import numpy as np

from sloshpy.damping.decay_checks import noise_excess
from sloshpy.damping.decay_fit import DecayFit, fit_decay
from sloshpy.damping.decay_model import CONSTANT
from sloshpy.damping.decay_record import DecayRecord
from sloshpy.damping.decay_start import Line, two_lines_of
from sloshpy.units import Array

APART = 0.25  # of the frequency: two lines farther apart do not beat slowly
_STRONG = 10.0  # by which Schwarz's criterion must fall for another line or a frequency that moves: "very strong"
_BEHIND = 6.0  # by which it must rise from a law to two lines; what good records leave below it is in docs/decay.md
_ONE, _UNLIKE = 0.2, 3.0  # beats in the record, ratio of dampings: two decays at one frequency are a law, not a beat
_WHOLE = 1.25  # beats: farther apart, lines are told from noise by the strong criterion alone
_STARTS = (1.0, 0.25)  # beats within the record


def strong(excess: float) -> float:
    """Return the fall of Schwarz's criterion that leaves no doubt; thrice as much where noise has peaks of its own."""
    return _STRONG if excess == 1.0 else 3.0 * _STRONG


def far_better(fit: DecayFit, other: DecayFit, excess: float) -> bool:
    """Whether a fit beats another beyond doubt."""
    return fit.information(excess) < other.information(excess) - strong(excess)


@dataclass(frozen=True, kw_only=True)
class Beat:
    """Two constant lines in place of one law: their fit, and by how much Schwarz's criterion puts it behind the law."""

    pair: DecayFit
    behind: float
    excess: float


def beat_of(record: DecayRecord, time: Array, line: Line, best: DecayFit) -> Beat | None:
    """Return the best fit of two close lines beside that of the best law, None where none is found.

    Args:
        record: without any line well apart.
        time: s since its first sample, (n,).
        line: its first guess.
        best: the best law's fit.
    """
    pair = _close_lines(record, time, line, best)
    if pair is None:
        return None
    excess = noise_excess(pair)
    return Beat(pair=pair, behind=pair.information(excess) - best.information(excess), excess=excess)


def check_beat(record: DecayRecord, line: Line, beat: Beat) -> None:
    """Refuse two close lines that explain a record beyond doubt better than any law does."""
    if beat.behind >= -strong(beat.excess):
        return
    f1, f2 = sorted(beat.pair.values[:, 0] / 2.0 / np.pi)
    if (f2 - f1) * beat.pair.time[-1] < 0.5:  # half a beat: not told apart
        value = f"the line at {line.frequency / 2.0 / np.pi:.4g} Hz"
        cure = "look for friction, a disturbance or excitation within the record, clipping, or two close lines"
        raise record.refused(value, "no law of damping describes its amplitude and phase", cure)
    cure = "rotate x and y to the tank's axes, excite one mode alone, or look for a disturbance in the record"
    raise record.refused(f"two lines {f1:.4g} / {f2:.4g} Hz", "single-mode damping refused", cure)


def check_near_beat(record: DecayRecord, best: DecayFit, beat: Beat | None) -> None:
    """Refuse a record that two close lines explain nearly as well as the best law does.

    Less than a whole beat bends amplitude and phase as a law of damping would, or a frequency that moves. Where two
    constant lines, four numbers more, come that near by Schwarz's criterion, the record does not say which it is, and
    the damping of the lines may be twice the law's, or half of it. A frequency that moves must beat them beyond doubt.
    """
    if beat is None or beat.excess > 1.0:  # coloured noise raises peaks of its own
        return
    moving = "k" in best.laws[0].free
    least = _STRONG if moving else _BEHIND
    if beat.behind < least and (moving or _near(beat.pair)):
        law = "a frequency that moves with the amplitude" if moving else "a law of damping"
        value = f"the line at {best.values[0, 0] / 2.0 / np.pi:.4g} Hz"
        rule = f"two close lines, less than a beat or little more, explain it nearly as well as {law}"
        cure = "record for longer, so that a beat shows, rotate x and y to the tank's axes, or excite one mode alone"
        raise record.refused(value, rule, cure)


def _near(pair: DecayFit) -> bool:
    """Whether two lines make a beat or little more, and do not differ in damping alone, as a power law's terms do."""
    (w1, slow, *_), (w2, fast, *_) = sorted(pair.values, key=lambda values: float(values[1]))
    beats = abs(w2 - w1) * pair.time[-1] / (2.0 * np.pi)
    return bool(beats < _WHOLE and not (beats < _ONE and 0.0 < _UNLIKE * slow < fast))


def _close_lines(record: DecayRecord, time: Array, line: Line, best: DecayFit) -> DecayFit | None:
    """Return the best fit of two close lines, None where none is found."""
    w = best.values[0, 0]
    guesses = [two_lines_of(line)]
    for beats in _STARTS:
        half = np.pi * beats / time[-1]
        guesses.append([(w - half, max(line.ratio, 1e-3)), (w + half, max(line.ratio, 1e-3))])
    found = []
    for guess in guesses:
        if guess is None:
            continue
        start = np.array([[frequency, ratio, 0.0, 1.0, 0.0] for frequency, ratio in guess])
        fit = fit_decay([CONSTANT, CONSTANT], start, time, record.value)
        if fit is not None and np.all(np.abs(fit.values[:, 0] / w - 1.0) < APART):
            found.append(fit)
    return min(found, key=DecayFit.information, default=None)
