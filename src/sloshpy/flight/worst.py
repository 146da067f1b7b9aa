"""The worst of each criterion along a flight, with its time and phase."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sloshpy.dynamics.poles import NEUTRAL
from sloshpy.flight.phase_review import PhaseReview
from sloshpy.units import Array

SHALLOW = "more than 15 % of the tank radius, where a spring-mass describes slosh less and less"


@dataclass(frozen=True, kw_only=True)
class Worst:
    """The worst value of one criterion.

    criterion: in words. value: in SI, nan where no number is supported. unit: its unit. shown: value in words.
    bound: in the same unit, nan for none. limit: bound in words, "" for none. met: None where the criterion decides
    nothing by itself. time: s. phase: its name. why: what the review says there, "" where it has no more to say.
    caution: what the value puts in doubt, "" for nothing.
    """

    criterion: str
    value: float
    unit: str
    shown: str
    bound: float
    limit: str
    met: bool | None
    time: float
    phase: str
    why: str = ""
    caution: str = ""

    def __str__(self) -> str:
        mark = "FAILS" if self.met is False else f"caution: {self.caution}" if self.caution else ""
        place = f"{self.time:8.2f}  {self.phase}" + (f", first: {self.why}" if self.why else "")
        return f"{self.criterion:42s} {self.shown:>22s}  {self.limit:>14s}  {place}  {mark}".rstrip()


def worst_of(reviews: Sequence[PhaseReview]) -> tuple[Worst, ...]:
    """Return the worst of each criterion, the failed ones first."""
    found = [*_verdicts(reviews), *_witness(reviews), *_margins(reviews), *_growth(reviews)]
    for tank in dict.fromkeys(name for r in reviews for name in r.phase.tanks):
        with_it = [(r, r.phase.tanks.index(tank)) for r in reviews if tank in r.phase.tanks]
        found += [_requirement(tank, with_it), *_zone(tank, with_it), *_cycle(tank, with_it)]
    return tuple(sorted(found, key=lambda one: one.met is not False))


def _at(reviews: Sequence[PhaseReview], badness: Sequence[Array]) -> tuple[PhaseReview, int]:
    """Return the review and the index of the time at which a badness is greatest; nan is worse than any number."""
    flat = np.concatenate([np.where(np.isnan(one), np.inf, one) for one in badness])
    at = int(np.argmax(flat))
    for review in reviews:
        if at < len(review.time):
            return review, at
        at -= len(review.time)
    raise AssertionError("the badness is longer than the flight")


def _verdicts(reviews: Sequence[PhaseReview]) -> list[Worst]:
    """Return the first time at which the review of one case fails, and the first at which it supports no verdict."""
    found = []
    asked = sum(one is not None for r in reviews for one in r.assessments)
    for verdict in ("fail", "invalid"):
        times = [
            (r, k, one.reasons[0])
            for r in reviews
            for k, one in enumerate(r.assessments)
            if one is not None and one.verdict == verdict
        ]
        times += [(r, k, why) for r in reviews for k, why in enumerate(r.unsupported) if why and verdict == "invalid"]
        if times:
            r, k, why = times[0]
            words = {"fail": "review of one case fails", "invalid": "no verdict supported"}[verdict]
            found.append(
                Worst(
                    criterion=words,
                    value=float(len(times)),
                    unit="1",
                    shown=f"{len(times)} of {asked} times",
                    bound=0.0,
                    limit="none",
                    met=False if verdict == "fail" else None,
                    time=float(r.time[k]),
                    phase=r.phase.name,
                    why=why,
                )
            )
    return found


def _witness(reviews: Sequence[PhaseReview]) -> list[Worst]:
    wrong = [~r.trusted for r in reviews]
    count = int(sum(np.sum(one) for one in wrong))
    if not count:
        return []
    r, k = _at(reviews, [one.astype(float) for one in wrong])
    return [
        Worst(
            criterion="poles and encirclements disagree",
            value=float(count),
            unit="1",
            shown=f"{count} times",
            bound=0.0,
            limit="none",
            met=False,
            time=float(r.time[k]),
            phase=r.phase.name,
        )
    ]


def _margins(reviews: Sequence[PhaseReview]) -> list[Worst]:
    """Return the least disc margin of each mode; a tank's decides nothing by itself, its limit cycle does."""
    found = []
    for mode in dict.fromkeys(name for r in reviews for name in r.margins.groups):
        own = [r for r in reviews if mode in r.margins.groups]
        course = [r.disc_margin[:, r.margins.groups.index(mode)] for r in own]
        slosh = mode in {f"{tank} slosh" for tank in own[0].phase.tanks}
        unstable = any(np.any(c < 0.0) for c in course)
        if slosh and unstable:  # a distance from the unstable side is no margin: the fastest growth is the worst
            r, k = _at(
                own, [np.where(c < 0.0, one.margins.growth, -np.inf) for c, one in zip(course, own, strict=True)]
            )
        else:
            r, k = _at(own, [-np.abs(c) for c in course])
        value, limit = float(r.disc_margin[k, r.margins.groups.index(mode)]), r.phase.case.criteria.disc_margin
        if np.isposinf(value):
            continue
        # with growing slosh the margin of another mode is negative too; its distance is what counts here
        near = any(
            bool(np.any(np.abs(c) < one.phase.case.criteria.disc_margin)) for c, one in zip(course, own, strict=True)
        )
        found.append(
            Worst(
                criterion=f"disc margin, {mode}",
                value=value if slosh else abs(value),
                unit="1",
                shown="loop UNSTABLE" if slosh and unstable else f"{abs(value):.4f}",
                bound=limit,
                limit=f">= {limit:g}",
                met=None if slosh else not near,
                time=float(r.time[k]),
                phase=r.phase.name,
            )
        )
    return found


def _growth(reviews: Sequence[PhaseReview]) -> list[Worst]:
    """Return where a mode grows fastest, and where one that is no slosh does, which no limit cycle excuses."""
    found = []
    for every in (True, False):
        growth = [np.max(_growing(r, every), axis=1) for r in reviews]
        r, k = _at(reviews, growth)
        row = _growing(r, every)[k]
        n = int(np.argmax(row))
        value = float(row[n])
        if not every and value <= 0.0:
            continue
        found.append(
            Worst(
                criterion=f"growth at small amplitude, {r.tracks.label[k][n]}" if every else "growth of no slosh mode",
                value=value,
                unit="1/s",
                shown=f"doubles in {np.log(2.0) / value:.3g} s" if value > 0.0 else "nothing grows",
                bound=np.nan if every else 0.0,
                limit="" if every else "none",
                met=None if every else False,
                time=float(r.time[k]),
                phase=r.phase.name,
            )
        )
    return found


def _growing(review: PhaseReview, every: bool) -> Array:
    """Return the growth of every branch or of those that are no slosh, (T, N), -inf for the rest; 0 where neutral."""
    tracks = review.tracks
    own = {f"{tank} slosh" for tank in review.phase.tanks}
    wanted = np.array([[bool(name) and (every or name not in own) for name in row] for row in tracks.label])
    real = tracks.pole.real
    neutral = np.abs(real) <= NEUTRAL * np.abs(tracks.pole)
    return np.where(wanted & np.isfinite(real), np.where(neutral, 0.0, real), -np.inf)


def _requirement(tank: str, with_it: Sequence[tuple[PhaseReview, int]]) -> Worst:
    """Return where required less available damping is greatest."""
    reviews = [r for r, _ in with_it]
    r, k = _at(reviews, [one.required_damping[:, j] - one.phase.available_damping[:, j] for one, j in with_it])
    j = r.phase.tanks.index(tank)
    need, have, at = (
        float(x[k, j]) for x in (r.required_damping, r.phase.available_damping, r.phase.reference_amplitude)
    )
    where = f" at {at:.3g} m" if np.isfinite(at) else " at 0 m"
    return Worst(
        criterion=f"{tank}: required damping",
        value=need,
        unit="1",
        shown="none suffices" if np.isnan(need) else f"{100.0 * need:.4g} %",
        bound=have,
        limit=f"{100.0 * have:.3g} %{where}",
        met=None,
        time=float(r.time[k]),
        phase=r.phase.name,
    )


def _zone(tank: str, with_it: Sequence[tuple[PhaseReview, int]]) -> list[Worst]:
    reviews = [r for r, _ in with_it]
    within = [np.asarray(r.zones[j].within) for r, j in with_it]
    count = int(sum(np.nansum(one) for one in within))
    refused = int(sum(np.sum(np.isnan(one)) for one in within))
    if not count and not refused:
        return []
    depth = []
    for r, j in with_it:
        zone = r.zones[j]
        inside = np.minimum(np.asarray(zone.aft) - zone.l, zone.l - np.asarray(zone.forward))
        depth.append(np.asarray(np.where(np.isnan(zone.within), -np.inf, inside)))
    r, k = _at(reviews, depth)
    unknown = f", {refused} refused" if refused else ""
    return [
        Worst(
            criterion=f"{tank}: times in the danger zone",
            value=float(count),
            unit="1",
            bound=np.nan,
            shown=f"{count} of {sum(len(one) for one in within)}{unknown}",
            limit="",
            met=None,
            time=float(r.time[k]),
            phase=r.phase.name,
        )
    ]


def _cycle(tank: str, with_it: Sequence[tuple[PhaseReview, int]]) -> list[Worst]:
    """Return the greatest limit cycle of a tank under degraded margins, slosh and engine, where one was sought."""
    reviews = [r for r, _ in with_it]
    asked = [np.array([one is not None for one in r.assessments]) for r in reviews]
    if not any(np.any(one) for one in asked):
        return []
    found = []
    for what, name, unit, scale in (("slosh", "cycle_slosh", "m", 1.0), ("engine", "cycle_tvc", "deg", np.pi / 180.0)):
        course = [getattr(r, name)[:, j] for r, j in with_it]
        r, k = _at(reviews, [np.where(known, c, -np.inf) for c, known in zip(course, asked, strict=True)])
        j = r.phase.tanks.index(tank)
        value = float(getattr(r, name)[k, j])
        limit = float(r.slosh_limit[k, j]) if what == "slosh" else r.tvc_limit
        unknown = int(sum(np.sum(known & np.isnan(c)) for c, known in zip(course, asked, strict=True)))
        found.append(
            Worst(
                criterion=f"{tank}: limit cycle, {what}",
                value=value,
                unit="m" if what == "slosh" else "rad",
                bound=limit,
                shown=f"no number at {unknown} times" if np.isnan(value) else f"{value / scale:.4g} {unit}",
                limit="" if np.isnan(limit) else f"<= {limit / scale:.3g} {unit}",
                met=None if what == "slosh" or np.isnan(value) else bool(value <= limit),
                time=float(r.time[k]),
                phase=r.phase.name,
                caution=SHALLOW if what == "slosh" and value > limit else "",
            )
        )
    return found
