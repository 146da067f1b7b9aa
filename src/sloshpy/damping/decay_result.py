"""What a free decay says: frequency, damping over the amplitude with bands, the law for a case file, and its limits."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.damping.decay_band import KNOWN
from sloshpy.damping.decay_checks import Sampling
from sloshpy.damping.decay_choice import Choice
from sloshpy.damping.decay_model import ratio_at
from sloshpy.damping.decay_record import DecayRecord, Measured
from sloshpy.damping.laws import ConstantDamping, DampingLaw, PowerDamping, SumDamping, TableDamping
from sloshpy.errors import OutsideValidity
from sloshpy.units import Array

if TYPE_CHECKING:
    import xarray as xr

_ROWS = 12  # of the table that stands for a law; PCHIP between them is good to 0.1 %
_DIGITS = 6


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A fitted number with the bounds of its confidence band, in `unit`."""

    name: str
    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class FreeDecay:
    """Damping identified from a free decay.

    record: the part that was fitted. measured: what its column is. per_displacement: record per slosh-mass
    displacement, None where not given; amplitude is then in the record's unit. hint: rad/s or None.
    choice: every law tried, best first. amplitude, ratio, ratio_low, ratio_high: (A,), slosh-mass displacement
    amplitude in m over the tested range, xi by the best law, and the bounds of the `level` band, which holds whichever
    law it is. estimates: frequency, rad/s, and the law's numbers, whose bands hold if it is this law. halves:
    difference of the damping of both halves in standard errors.
    """

    record: DecayRecord
    measured: Measured
    per_displacement: float | None
    hint: float | None
    choice: Choice
    sampling: Sampling
    level: float
    seed: int
    amplitude: Array
    ratio: Array
    ratio_low: Array
    ratio_high: Array
    estimates: tuple[Estimate, ...]
    halves: float

    @property
    def frequency(self) -> float:
        """Undamped natural frequency at small amplitude, rad/s."""
        return self.estimates[0].value

    @property
    def f_hz(self) -> float:
        """The same in Hz."""
        return self.frequency / (2.0 * np.pi)

    @property
    def tested(self) -> tuple[float, float]:
        """Smallest and largest amplitude that the record supports."""
        return float(self.amplitude[0]), float(self.amplitude[-1])

    @property
    def cycles(self) -> float:
        """Cycles in the fitted part."""
        return float(self.f_hz * (self.record.time[-1] - self.record.time[0]))

    @property
    def hidden_hz(self) -> float:
        """How near in Hz a second line may hide: one beat in the record, below which it can look like damping."""
        return float(1.0 / (self.record.time[-1] - self.record.time[0]))

    def drift_ratio(self, drift: float) -> float:
        """Return the damping ratio by which a sensor errs whose gain falls by a share `drift` over the record.

        A'/A of the record is that of the wave and of the gain together, so that it is -ln(1 - drift)/(w T), whatever
        the law; a gain that rises takes as much away.
        """
        return float(-np.log1p(-drift) / (self.frequency * (self.record.time[-1] - self.record.time[0])))

    @property
    def noise(self) -> float:
        """Standard deviation of the noise in the record's unit."""
        return self.choice.best.noise

    @property
    def fitted(self) -> Array:
        """The fitted record, (n,)."""
        return self.record.value - self.choice.best.residual

    @property
    def center(self) -> Array:
        """Offset and drift about which the wave decays, with any second line, (n,)."""
        return self.fitted - self.choice.best.part(0)

    @property
    def envelope(self) -> Array:
        """Amplitude of the wave in the record's unit, (n,)."""
        return self.choice.best.amplitude()

    @property
    def second_line(self) -> tuple[float, float] | None:
        """Frequency, rad/s, and ratio of a well-separated line that was fitted beside; None where there is none."""
        values = self.choice.best.values
        return None if len(values) == 1 else (float(values[1, 0]), float(values[1, 1]))

    def estimate(self, name: str) -> Estimate:
        """Return the estimate of that name: frequency, constant_ratio, slope, exponent or frequency_change."""
        return next(one for one in self.estimates if one.name == name)

    @property
    def law(self) -> DampingLaw:
        """The law within the tested amplitudes: a table that the method never extrapolates.

        Raises:
            OutsideValidity: the law depends on the amplitude, and the record's scale is not known.
        """
        if self.per_displacement is None:
            return self.formula
        A = np.geomspace(*self.tested, _ROWS)
        best, start = self.choice.best, self.choice.best.start_amplitude[0] / self.per_displacement
        xi = ratio_at(best.values[0], A / start)
        return TableDamping(amplitude=_rounded(A), ratio=_rounded(xi))

    @property
    def formula(self) -> DampingLaw:
        """The fitted law as a formula: beyond the tested amplitudes it extrapolates.

        Raises:
            OutsideValidity: the law depends on the amplitude, and the record's scale is not known.
        """
        found = {one.name: one.value for one in self.estimates}
        parts: list[ConstantDamping | PowerDamping] = []
        if "constant_ratio" in found:
            parts.append(ConstantDamping(ratio=float(_rounded(found["constant_ratio"]))))
        if "slope" in found:
            if self.per_displacement is None:
                what = "wave per displacement" if self.measured == "wave" else "force per displacement, N/m"
                raise OutsideValidity(
                    f"the damping depends on the amplitude, and a {self.measured} does not say how far the slosh mass "
                    f"moves. Cure: give the {what}"
                )
            slope, p = float(_rounded(found["slope"])), float(_rounded(self.choice.best.values[0, 3]))
            parts.append(PowerDamping(slope=slope, exponent=p))
        return parts[0] if len(parts) == 1 else SumDamping(of=tuple(parts))

    def coefficient(self, radius: float) -> float:
        """Return alpha R^p of a power law, R in m: the slope over A/R, equal in geometrically similar tanks.

        Raises:
            OutsideValidity: another law. What a smooth wall damps scales with viscosity, not with A/R.
        """
        law = self.formula
        if not isinstance(law, PowerDamping):
            raise OutsideValidity(
                "only damping that is all of a power law scales with A/R; a constant part is the wall's, which scales "
                "with viscosity, radius and acceleration. Cure: take it from `sloshpy tank` of the full tank"
            )
        return float(law.slope * radius**law.exponent)

    def similar(self, radius: float, full_radius: float) -> TableDamping:
        """Return the tested law for a geometrically similar tank: the same xi at the same A/R; radii in m.

        Raises:
            OutsideValidity: as `coefficient`.
        """
        self.coefficient(radius)
        tested = self.law
        assert isinstance(tested, TableDamping)  # a power law without its scale was refused above
        A = _rounded(tested.tested_amplitude * full_radius / radius)
        return TableDamping(amplitude=A, ratio=tested.tested_ratio)

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know before the numbers are used."""
        found, choice = [], self.choice
        if self.hint is None:
            rate = 1.0 / self.sampling.step
            found.append(
                f"no frequency hint: a wave at {rate - self.f_hz:.4g} or {rate + self.f_hz:.4g} Hz, sampled at "
                f"{rate:.4g} Hz, looks the same"
            )
        if self.per_displacement is None:
            found.append(
                f"amplitudes are of the {self.measured}: its scale to the slosh-mass displacement is not given"
            )
        if self.second_line is not None:
            w2, _ = self.second_line
            found.append(f"a second line at {w2 / 2.0 / np.pi:.4g} Hz is fitted beside the first")
        if "k" in choice.best.laws[0].free:
            change = 100.0 * self.estimate("frequency_change").value
            found.append(f"the frequency moves with the amplitude: {change:+.3g} % at the start, as in part of a beat")
        if choice.excess > 1.0:
            found.append(
                f"the residual is not white: {choice.excess:.3g} times its mean power at the line, and so "
                "are the resampled ones"
            )
        others = [  # a wider law is never told from the one chosen, and so not named
            fit.laws[0].words
            for fit, w in zip(choice.fits[1:], choice.weights[1:], strict=True)
            if w > 0.1 and fit.count <= choice.best.count
        ]
        if others:
            found.append(f"the record does not tell the law from {'; '.join(others)}: the band holds whichever it is")
        found += self._about_the_range()
        if self.sampling.jitter > 0.01:
            found.append(f"steps scatter by {100.0 * self.sampling.jitter:.2g} % of {self.sampling.step:.4g} s")
        if self.sampling.widest > 1.5 * self.sampling.step:
            found.append(f"samples are missing: the widest gap is {self.sampling.widest:.4g} s")
        found.append(
            f"not to be seen: a second line within {self.hidden_hz:.2g} Hz; a sensor's gain drift, of which 1 % reads "
            f"as {100.0 * self.drift_ratio(0.01):.2g} % of damping"
        )
        return tuple(found)

    def _about_the_range(self) -> list[str]:
        """What to know of the amplitudes: where the record reaches farther, and where the law leaves its band."""
        scale = self.per_displacement or 1.0
        unit = self.record.unit if self.per_displacement is None else "m"
        (low, high), first, last = self.tested, self.envelope[0] / scale, self.envelope[-1] / scale
        found = []
        if high < 0.98 * first or low > 1.02 * last:
            found.append(
                f"the record reaches from {last:.3g} to {first:.3g} {unit}, but shows the damping to "
                f"{100.0 * KNOWN:g} % only at the amplitudes given here"
            )
        out = (self.ratio < self.ratio_low) | (self.ratio > self.ratio_high)
        if np.any(out):
            at = ", ".join(f"{self.amplitude[k]:.3g}" for k in np.flatnonzero(out)[[0, -1]])
            found.append(
                f"caution: no law here fits everywhere: it leaves the band, which holds without one, at {at} {unit}"
            )
        return found

    def __str__(self) -> str:
        low, high = self.tested
        unit = self.record.unit if self.per_displacement is None else "m"
        of = f"of {self.measured}" if self.per_displacement is None else "of slosh-mass displacement"
        frequency, share = self.estimates[0], 100.0 * self.choice.weights[0]
        lines = [
            f"{self.record.column}: damping {100.0 * np.min(self.ratio):.4g}-{100.0 * np.max(self.ratio):.4g} % "
            f"tested from {low:.4g} to {high:.4g} {unit} {of}; {self.f_hz:.5g} Hz ({self.frequency:.5g} rad/s)",
            *(f"  - {note}" for note in self.notes),
            f"  law: {self.choice.best.laws[0].words} (weight {share:.3g} %)",
            f"    {'frequency':16s} {self.f_hz:.6g} Hz, {100 * self.level:g} % band {frequency.low / 2 / np.pi:.6g} to "
            f"{frequency.high / 2 / np.pi:.6g} Hz ({frequency.value:.6g} rad/s)",
        ]
        for one in self.estimates[1:]:
            shown = ("%", 100.0) if one.name in {"constant_ratio", "frequency_change"} else (one.unit, 1.0)
            of_unit = "" if shown[0] == "1" else f" {shown[0]}"
            numbers = [f"{shown[1] * x:.4g}" for x in (one.value, one.low, one.high)]
            name = one.name.replace("_", " ")
            lines.append(f"    {name:16s} {numbers[0]}{of_unit}, band {numbers[1]} to {numbers[2]}{of_unit}")
        lines.append(f"  {'amplitude ' + unit:>16s} {'damping %':>10s} {'band %':>20s}")
        for k in (len(self.ratio) - 1, len(self.ratio) // 2, 0):
            band = f"{100 * self.ratio_low[k]:.4g} to {100 * self.ratio_high[k]:.4g}"
            lines.append(f"  {self.amplitude[k]:16.5g} {100 * self.ratio[k]:10.4g} {band:>20s}")
        lines.append(
            f"  {self.cycles:.3g} cycles, {2 * np.pi / self.frequency / self.sampling.step:.3g} samples each; noise "
            f"{self.noise:.3g} {self.record.unit} rms, halves agree within {abs(self.halves):.2g} standard errors"
        )
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers in SI units."""
        second = self.second_line
        return {
            "file": str(self.record.file),
            "column": self.record.column,
            "measured": self.measured,
            "per_displacement": self.per_displacement,
            "amplitude_unit": self.record.unit if self.per_displacement is None else "m",
            "frequency_hz": self.f_hz,
            "law": self.choice.best.laws[0].name,
            "weight": float(self.choice.weights[0]),
            "level": self.level,
            "estimates": {
                one.name: {"value": one.value, "low": one.low, "high": one.high, "unit": one.unit}
                for one in self.estimates
            },
            "tested": list(self.tested),
            "amplitude": self.amplitude.tolist(),
            "ratio": self.ratio.tolist(),
            "ratio_low": self.ratio_low.tolist(),
            "ratio_high": self.ratio_high.tolist(),
            "second_line_hz": None if second is None else second[0] / (2.0 * np.pi),
            "hidden_line_within_hz": self.hidden_hz,
            "damping_per_percent_of_gain_drift": self.drift_ratio(0.01),
            "noise": self.noise,
            "cycles": self.cycles,
            "laws": [
                {"law": fit.laws[0].words, "criterion": float(c), "weight": float(w)}
                for fit, c, w in zip(self.choice.fits, self.choice.criteria, self.choice.weights, strict=True)
            ],
            "notes": list(self.notes),
        }

    def to_dataset(self) -> "xr.Dataset":
        """Return xi over the amplitude, and record and fit over time, as an xarray Dataset."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        unit = self.record.unit
        attrs: dict[str, Any] = {
            "law": self.choice.best.laws[0].words,
            "measured": self.measured,
            "level": self.level,
            "seed": self.seed,
        }
        attrs |= {
            f"{one.name}_{part}": getattr(one, part) for one in self.estimates for part in ("value", "low", "high")
        }
        if self.per_displacement is not None:
            attrs["per_displacement"] = self.per_displacement
        amplitude_unit = unit if self.per_displacement is None else "m"
        return xr.Dataset(
            {
                "damping": ("amplitude", self.ratio, {"units": "1"}),
                "damping_low": ("amplitude", self.ratio_low, {"units": "1"}),
                "damping_high": ("amplitude", self.ratio_high, {"units": "1"}),
                "record": ("time", self.record.value, {"units": unit}),
                "fit": ("time", self.fitted, {"units": unit}),
                "envelope": ("time", self.envelope, {"units": unit}),
            },
            coords={
                "amplitude": ("amplitude", self.amplitude, {"units": amplitude_unit}),
                "time": ("time", self.record.time, {"units": "s"}),
            },
            attrs=attrs,
        )


def _rounded(values: Array | float) -> Array:
    """Return numbers with six digits: more would pretend to a precision that no record has."""
    return np.array([float(f"{value:.{_DIGITS}g}") for value in np.atleast_1d(values)]).reshape(np.shape(values))
