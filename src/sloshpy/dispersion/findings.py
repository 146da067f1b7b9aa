"""What a campaign says: verdict, violations, percentiles with their confidence, driving inputs, the worst cases."""

import json
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sloshpy.dispersion.campaign import Campaign
from sloshpy.dispersion.flown_columns import flown_notes
from sloshpy.dispersion.rows import Column, Status
from sloshpy.dispersion.statements import (
    Bound,
    Interval,
    marginal,
    probability,
    rank_correlation,
    tolerance_bound,
    unsupported,
    violates,
    worse_allowed,
)
from sloshpy.dispersion.varied import stands_in
from sloshpy.dispersion.verdict import VERDICT
from sloshpy.units import Array, IntArray

PERCENTILES = (0.5, 0.9, 0.99, 0.9973, 0.99865)
WORST = 5  # cases listed for each criterion
LISTED = 10  # cases without a number listed on the screen


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One criterion over all cases: how often it is broken, by which cases, and what drives it.

    column: `VERDICT` is every criterion together, which has its broken cases and no drivers.
    marginal: how many of the broken ones are within its tolerance of the limit, on no sure side of it.
    met: whether the dispersion's coverage is shown at its confidence; None where so few cases can show nothing.
    worst: numbers of the worst cases, worst first. drivers: rank correlation with each input, strongest first.
    """

    column: Column
    broken: int
    marginal: int
    probability: Interval | None
    met: bool | None
    worst: tuple[int, ...]
    drivers: tuple[tuple[str, Interval], ...]


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What a campaign says. percentiles: by column, for each coverage a bound or why there is none."""

    campaign: Campaign
    done: int
    criteria: tuple[Criterion, ...]
    percentiles: dict[str, tuple[Bound | str, ...]]
    notes: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """ "pass", "fail", or "no statement" where no confidence stands behind the numbers."""
        met = [criterion.met for criterion in self.criteria]
        if any(m is False for m in met):
            return "fail"
        return "pass" if all(met) and self.campaign.whole else "no statement"

    @property
    def lost(self) -> dict[str, int]:
        """How many cases are not OK, by what became of them."""
        status = self.campaign.status
        return {s.name.lower(): n for s in Status if s is not Status.OK and (n := int(np.sum(status == s)))}

    def __str__(self) -> str:
        c, d = self.campaign, self.campaign.dispersion
        of = "" if c.whole else f"PARTIAL, {self.done} of {c.count} cases; "
        goal = f"{100 * d.coverage:g} % of cases at {100 * d.confidence:g} % confidence"
        lines = [f"{self.verdict.upper()}  {d.name}: {of}{self.done} cases, seed {c.seed}, {d.sampling}; asked: {goal}"]
        lost = ", ".join(f"{n} {name}" for name, n in self.lost.items())
        lines.append(f"  without a number, counted as worst: {lost or 'none'}")
        lines += [f"    case {k}: {c.reasons[k]}" for k in sorted(c.reasons)[:LISTED]]
        lines += [f"    and {len(c.reasons) - LISTED} more"] if len(c.reasons) > LISTED else []
        for criterion in self.criteria:
            lines += _criterion_lines(criterion, self.done, d.confidence)
        head = f"  {'percentile':32s}" + "".join(f"{100 * p:>14g} %" for p in PERCENTILES)
        lines += [
            "",
            head,
            *(
                line
                for column in c.columns
                if column.name in self.percentiles
                for line in self._percentile_lines(column)
            ),
        ]
        said = dict.fromkeys(x for row in self.percentiles.values() for x in row if isinstance(x, str))
        lines += [f"    - {text}" for text in said]
        lines += ["", *(f"  - {note}" for note in self.notes)]
        return "\n".join(lines).rstrip()

    def _percentile_lines(self, column: Column) -> list[str]:
        """Return the percentiles of the cases, the bound on all cases, and what the cases without a number change."""
        row = [x if isinstance(x, Bound) else None for x in self.percentiles[column.name]]
        confidence = f"all cases, at {100 * self.campaign.dispersion.confidence:g} % confidence"
        rows = [
            (f"{column.name} [{column.unit}]", [None if x is None else x.estimate for x in row]),
            (f"  {confidence}", [None if x is None else x.value for x in row]),
        ]
        if any(x is not None and x.best != x.value for x in row):
            rows.append(("  the same, lost cases as best", [None if x is None else x.best for x in row]))
        return [f"  {t:32s}" + "".join(f"{'-' if x is None else f'{x:.5g}':>16s}" for x in xs) for t, xs in rows]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values in SI units; what is not finite as null or a text."""
        c, d = self.campaign, self.campaign.dispersion
        return {
            "name": d.name,
            "verdict": self.verdict,
            "cases": c.count,
            "done": self.done,
            "seed": str(c.seed),
            "sampling": d.sampling,
            "coverage": d.coverage,
            "confidence": d.confidence,
            "digest": c.digest,
            "lost": self.lost,
            "reasons": {str(k): reason for k, reason in sorted(c.reasons.items())},
            "criteria": [_criterion_dict(criterion) for criterion in self.criteria],
            "percentiles": {
                name: [x if isinstance(x, str) else _plain(vars(x)) for x in row]
                for name, row in self.percentiles.items()
            },
            "notes": list(self.notes),
        }

    def to_json(self) -> str:
        """Return one JSON object in SI units."""
        return json.dumps(self.to_dict(), indent=1, allow_nan=False)


def findings(campaign: Campaign) -> Findings:
    """Return what a campaign says; of a partial one, what the cases that are done say.

    A case without a number is worse than every number. Statements with a confidence rest on independent draws: with
    `sobol` there are none, and with systematic inputs they hold for the one draw of these.
    """
    d, done = campaign.dispersion, campaign.done
    values, count = campaign.values[done], int(np.sum(done))
    if count == 0:
        raise ValueError("no case is done")
    draws = campaign.draws()[done]
    numbers = np.flatnonzero(done)
    criteria = tuple(
        _criterion(campaign, column, values[:, k], draws, numbers)
        for k, column in enumerate(campaign.columns)
        if column.limit is not None
    )
    percentiles = {
        column.name: tuple(bound_of(d.sampling, values[:, k], column.worst, p, d.confidence) for p in PERCENTILES)
        for k, column in enumerate(campaign.columns)
        if column.worst and column is not VERDICT and column.moment is None
    }
    return Findings(
        campaign=campaign, done=count, criteria=criteria, percentiles=percentiles, notes=_notes(campaign, count)
    )


def _criterion(campaign: Campaign, column: Column, values: Array, draws: Array, numbers: IntArray) -> Criterion:
    d, count = campaign.dispersion, len(values)
    assert column.limit is not None
    broken = int(np.sum(violates(values, column.worst, column.limit, column.tolerance)))
    independent = d.sampling == "random"
    allowed = worse_allowed(count, d.coverage, d.confidence) if independent else -1
    signed = np.where(np.isnan(values), np.inf, column.worst * values)
    together = column is VERDICT
    order = np.argsort(-signed, kind="stable")[: min(WORST, broken) if together else WORST]
    drivers = [
        (p.input, _of_draws(rank_correlation(draws[:, k], signed, d.confidence), independent))
        for k, p in enumerate(d.parameters)
        if not p.systematic and not together
    ]
    drivers = [(name, r) for name, r in drivers if np.isfinite(r.estimate)]
    return Criterion(
        column=column,
        broken=broken,
        marginal=int(np.sum(values == 0.0 if together else marginal(values, column.limit, column.tolerance))),
        probability=probability(broken, count, d.confidence) if independent else None,
        met=None if allowed < 0 else broken <= allowed,
        worst=tuple(int(numbers[k]) for k in order),
        drivers=tuple(sorted(drivers, key=lambda pair: -abs(pair[1].estimate))),
    )


def _of_draws(found: Interval, independent: bool) -> Interval:
    """Return an estimate without its interval where the draws are not independent."""
    return found if independent else replace(found, low=np.nan, high=np.nan)


def bound_of(sampling: str, values: Array, worst: int, coverage: float, confidence: float) -> Bound | str:
    """Return the bound of a part of all cases, or why so many, or such, draws support none."""
    if sampling != "random":
        return "evenly spread draws carry no confidence"
    try:
        return tolerance_bound(values, worst, coverage, confidence)
    except ValueError as error:
        return str(error)


def _notes(campaign: Campaign, count: int) -> tuple[str, ...]:
    d, notes = campaign.dispersion, []
    if d.sampling != "random":
        notes.append("evenly spread draws (sobol) are not independent: no interval and no bound is given; use random")
    elif worse_allowed(count, d.coverage, d.confidence) < 0:
        notes.append(unsupported(count, d.coverage, d.confidence))
    if not campaign.whole:
        notes.append(f"{count} of {campaign.count} cases: what is missing may be what is slow, and worse")
    if d.flight:
        if d.phases:
            notes += flown_notes(d)
        else:
            notes.append(
                f"each draw holds for the whole flight: {len(d.flight)} times, the worst of each number decides"
            )
        for name in d.inputs:
            without = dict.fromkeys(m.phase for m in d.flight if not stands_in(m.case, name))
            if without:
                notes.append(f"{name} is not in {', '.join(without)}")
    fixed = [p.input for p in d.parameters if p.systematic]
    if fixed:
        notes.append(f"drawn once for all cases, so that every statement holds for this draw: {', '.join(fixed)}")
    inputs = set(d.inputs)
    if inputs & {"vehicle.thrust", "vehicle.mass", "vehicle.drag"}:
        tanks = dict.fromkeys(t.name for c in d.cases for t in c.vehicle.tanks if t.pendulum_length is None)
        rigid = list(tanks)
        if rigid:
            notes.append(f"the slosh frequency of {', '.join(rigid)} does not follow the acceleration: no pendulum")
    if d.correlations:
        notes.append("inputs that are correlated share their rank correlation with an answer")
    return tuple(notes)


def _criterion_lines(c: Criterion, count: int, confidence: float) -> list[str]:
    sign, met = (">=" if c.column.worst < 0 else "<="), {True: "met", False: "NOT met", None: "not shown"}[c.met]
    how_often = f"broken by {c.broken} of {count}"
    if c.marginal:
        how_often += f", {c.marginal} of them marginal"
    if c.probability is not None:
        p = c.probability
        how_often += f": {100 * p.estimate:.4g} % ({100 * p.low:.4g} to {100 * p.high:.4g} % at {100 * confidence:g} %)"
    what = f"{c.column.name} {sign} {c.column.limit:.6g} {_unit(c.column)}".rstrip()
    if c.column.unit == "rad" and c.column.limit is not None:
        what += f" ({np.degrees(c.column.limit):.4g} deg)"
    lines = ["", f"  {'every criterion together' if c.column is VERDICT else what}: {met}; {how_often}"]
    if c.drivers:
        strongest = ", ".join(f"{n} {_correlation(r)}" for n, r in c.drivers[:3])
        lines.append(f"    gets worse with: {strongest}")
    if c.worst:
        lines.append(f"    worst cases: {', '.join(map(str, c.worst))}")
    return lines


def _correlation(r: Interval) -> str:
    return f"{r.estimate:+.2f}" + ("" if np.isnan(r.low) else f" ({r.low:+.2f} to {r.high:+.2f})")


def _unit(column: Column) -> str:
    return "" if column.unit == "1" else column.unit


def _criterion_dict(c: Criterion) -> dict[str, Any]:
    return {
        "name": c.column.name,
        "unit": c.column.unit,
        "limit": c.column.limit,
        "broken": c.broken,
        "marginal": c.marginal,
        "probability": None if c.probability is None else _plain(vars(c.probability)),
        "met": c.met,
        "worst": list(c.worst),
        "drivers": {n: {k: None if np.isnan(x) else x for k, x in vars(r).items()} for n, r in c.drivers},
    }


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    """Return numbers that JSON can hold: what is not finite as a text."""
    return {k: v if not isinstance(v, float) or np.isfinite(v) else str(v) for k, v in values.items()}
