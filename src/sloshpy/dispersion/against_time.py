"""Percentiles of a flight's numbers against time, each with what so many flights can show of all of them."""

from dataclasses import dataclass

import numpy as np

from sloshpy.dispersion.campaign import Campaign
from sloshpy.dispersion.findings import PERCENTILES, bound_of
from sloshpy.dispersion.rows import Column
from sloshpy.dispersion.statements import Bound
from sloshpy.units import Array


@dataclass(frozen=True, kw_only=True)
class AgainstTime:
    """One number of a flight's draws at T times that have it, worst side first.

    column: what it is, with its limit. phase: (T,) names. time: (T,), s. coverage: (P,), parts of all flights.
    percentile: (P, T), of the flights drawn. bound: (P, T), no worse than which is at least that part of all flights at
    the confidence; nan where so few flights, or evenly spread ones, show nothing.
    """

    campaign: Campaign
    column: Column
    phase: tuple[str, ...]
    time: Array
    coverage: tuple[float, ...]
    percentile: Array
    bound: Array

    @property
    def message(self) -> str:
        """What the worst time is of the greatest part of all flights that so many show."""
        name, worst = self.column.name.replace("_", " "), self.column.worst
        shown = [k for k in range(len(self.coverage)) if not np.any(np.isnan(self.bound[k]))]
        rows, of = (self.bound, "of all flights") if shown else (self.percentile, "of the flights drawn")
        k = shown[-1] if shown else 0
        at = int(np.argmax(worst * rows[k]))
        sign = ">=" if worst < 0 else "<="
        part = f"{100 * self.coverage[k]:g} % {of}"
        sure = f", at {100 * self.campaign.dispersion.confidence:g} % confidence" if shown else ""
        return f"{part}{sure}: {name} {sign} {rows[k, at]:.4g} at the worst time, {self.time[at]:g} s"

    def columns(self) -> dict[str, object]:
        """Return the columns of a table, units in their names."""
        confidence = f"{100 * self.campaign.dispersion.confidence:g} % confidence"
        found: dict[str, object] = {"phase": self.phase, "time [s]": self.time}
        for k, part in enumerate(self.coverage):
            found[f"{self.column.name} {100 * part:g} % of the flights drawn [{self.column.unit}]"] = self.percentile[k]
            found[f"{self.column.name} {100 * part:g} % of all at {confidence} [{self.column.unit}]"] = self.bound[k]
        return found


def time_columns(campaign: Campaign) -> tuple[Column, ...]:
    """Return the numbers of a flight that have percentiles against time; none of a single case."""
    timed = {c.name.partition("[")[0] for c in campaign.columns if c.moment is not None}
    return tuple(c for c in campaign.columns if c.moment is None and c.worst and c.name in timed)


def against_time(campaign: Campaign, name: str) -> AgainstTime:
    """Return the percentiles of one number of a flight, such as "disc_margin", against time.

    Raises:
        ValueError: no such number, or the campaign is of one case.
    """
    column = next((c for c in time_columns(campaign) if c.name == name), None)
    if column is None:
        known = ", ".join(c.name for c in time_columns(campaign)) or "the campaign is of one case, not of a flight"
        raise ValueError(f"{name} is no number against time: {known}")
    d, done = campaign.dispersion, campaign.done
    places = [
        (k, c) for k, c in enumerate(campaign.columns) if c.moment is not None and c.name == f"{name}[{c.moment}]"
    ]
    moments = [d.flight[c.moment] for _, c in places if c.moment is not None]
    percentile, bound = (np.full((len(PERCENTILES), len(places)), np.nan) for _ in range(2))
    for j, (k, one) in enumerate(places):
        for i, part in enumerate(PERCENTILES):
            values = campaign.values[done, k]
            signed = np.sort(np.where(np.isnan(values), np.inf, one.worst * values))  # without a number: the worst
            percentile[i, j] = (
                one.worst * signed[min(int(np.ceil(part * len(signed) * (1.0 - 1e-12))), len(signed)) - 1]
            )
            found = bound_of(d.sampling, values, one.worst, part, d.confidence)
            if isinstance(found, Bound):
                bound[i, j] = found.value
            if len(signed) * (1.0 - part) < 1.0 - 1e-9:
                percentile[i, j] = np.nan  # of so few flights it is their extreme, no percentile
    return AgainstTime(
        campaign=campaign,
        column=column,
        phase=tuple(m.phase for m in moments),
        time=np.array([m.time for m in moments]),
        coverage=PERCENTILES,
        percentile=percentile,
        bound=bound,
    )
