"""Trajectory in, review of the whole flight out: every time assessed, the worst of each criterion with its time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.flight.phase_review import PhaseReview, phase_steps, reviewed
from sloshpy.flight.trajectory import Trajectory
from sloshpy.flight.windows import GrowthChain, GrowthWindow, growth_chains
from sloshpy.flight.workers import answered
from sloshpy.flight.worst import Worst, worst_of

if TYPE_CHECKING:
    import xarray as xr

Progress = Callable[[int, int, str], None]  # steps done, steps in all, what is being done


@dataclass(frozen=True, kw_only=True)
class FlightAssessment:
    """The review of a flight.

    verdict: "pass", "fail", "invalid" where the model supports no verdict at some time and none fails; "linear" where
    limit cycles were not asked for and no linear criterion fails. cycles: limit cycles at every so many times.
    worst: of each criterion, the failed ones first. reviews: one for each phase.
    """

    trajectory: Trajectory
    verdict: str
    cycles: int
    worst: tuple[Worst, ...]
    reviews: tuple[PhaseReview, ...]

    @property
    def windows(self) -> tuple[GrowthWindow, ...]:
        """Windows in which a mode grows at small amplitude, greatest growth factor first."""
        return tuple(sorted((w for r in self.reviews for w in r.windows), key=lambda w: -w.exponent))

    def __str__(self) -> str:
        t = self.trajectory
        said = {"linear": "NO VERDICT, limit cycles decide on slosh and were not asked for; all else is met"}
        lines = [f"{said.get(self.verdict, self.verdict.upper())}  {t.name}"]
        lines.append(
            f"  {t.count} times in {len(t.phases)} phases from {t.phases[0].time[0]:g} to {t.phases[-1].time[-1]:g} s"
            + (f", limit cycles at {self._asked} of them" if self.cycles != 1 else "")
        )
        lines.append(f"  {'worst of':42s} {'value':>22s}  {'limit':>14s}  {'time s':>8s}  phase")
        lines += [f"  {one}" for one in self.worst]
        lines += [f"  - {window}" for window in self.windows[:4]]
        lines += [f"  ({len(self.windows) - 4} further windows of growth)"] if len(self.windows) > 4 else []
        lines += [f"  - {chain}" for chain in self.chains]
        lines += [f"  - {v}" for v in self.exchanges]
        lines += [f"  - {event}" for event in t.crossings]
        lines += [f"  - {phase.name}: {note}" for phase in t for note in phase.notes]
        return "\n".join(lines)

    @property
    def chains(self) -> tuple[GrowthChain, ...]:
        """Windows that go on across the events which an oscillation passes."""
        return growth_chains(self.windows, [event.end for event in self.trajectory.crossings if event.carries])

    @property
    def reasons(self) -> tuple[str, ...]:
        """What the verdict rests on: what fails, or what there is no number for, or that all is met."""
        failed = [
            f"{w.criterion}: {w.shown}{_limited(w)} at {w.time:g} s ({w.phase})" for w in self.worst if w.met is False
        ]
        open_ = [
            f"{w.criterion}: {w.shown}, first at {w.time:g} s ({w.phase}): {w.why}"
            for w in self.worst
            if w.why and w.met is None
        ]
        cautions = [f"caution: {w.criterion}, {w.shown} at {w.time:g} s: {w.caution}" for w in self.worst if w.caution]
        if failed or open_:
            return (*failed, *open_, *cautions)
        if self.verdict == "linear":
            return ("limit cycles decide on slosh and were not asked for; every other criterion is met", *cautions)
        asked = "every time" if self.cycles == 1 else f"{self._asked} of {self.trajectory.count} times"
        return (f"every criterion is met, limit cycles sought at {asked}", *cautions)

    def to_json(self) -> str:
        """Return the review as one JSON object in SI units; null where there is no number."""
        from sloshpy.flight.contract import flight_json  # stands on this module

        return flight_json(self)

    @property
    def _asked(self) -> int:
        return sum(one is not None or bool(why) for r in self.reviews for one, why in _asked_of(r))

    @property
    def exchanges(self) -> list[str]:
        """Modes that trade tanks: the damping of a mode is then another tank's before than after."""
        return [
            f"{v.tanks[0]} and {v.tanks[1]} slosh exchange modes from {v.start:g} to {v.end:g} s ({r.phase.name})"
            for r in self.reviews
            for v in r.tracks.veering
        ]

    def to_dataset(self) -> "xr.Dataset":
        """Return the courses as an xarray Dataset over the points of time; an event has two of them."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        tanks, reviews = self.trajectory.tanks, self.reviews
        modes = tuple(dict.fromkeys(name for r in reviews for name in r.margins.groups))

        def by_tank(name: str) -> Any:
            return np.concatenate([_placed(getattr(r, name), r.phase.tanks, tanks) for r in reviews])

        def by_time(values: list[Any]) -> Any:
            return np.concatenate(values)

        zone = {
            f"danger_zone_{name}": (
                ["point", "tank"],
                np.concatenate(
                    [
                        _placed(np.stack([getattr(z, name) for z in r.zones], axis=-1), r.phase.tanks, tanks)
                        for r in reviews
                    ]
                ),
                {"units": unit},
            )
            for name, unit in (("l", "m"), ("aft", "m"), ("forward", "m"), ("within", "1"))
        }
        margin = np.concatenate([_placed(r.disc_margin, r.margins.groups, modes) for r in reviews])
        available = [_placed(r.phase.available_damping, r.phase.tanks, tanks) for r in reviews]
        amplitude = [_placed(r.phase.reference_amplitude, r.phase.tanks, tanks) for r in reviews]
        fill = [_placed(r.phase.fill, r.phase.tanks, tanks) for r in reviews]
        return xr.Dataset(
            {
                "stable": ("point", by_time([r.margins.stable for r in reviews])),
                "growth": ("point", by_time([r.margins.growth for r in reviews]), {"units": "1/s"}),
                "time_to_double": ("point", by_time([r.time_to_double for r in reviews]), {"units": "s"}),
                "disc_margin": (["point", "mode"], margin, {"units": "1"}),
                "required_damping": (["point", "tank"], by_tank("required_damping"), {"units": "1"}),
                "available_damping": (["point", "tank"], np.concatenate(available), {"units": "1"}),
                "reference_amplitude": (["point", "tank"], np.concatenate(amplitude), {"units": "m"}),
                "fill": (["point", "tank"], np.concatenate(fill), {"units": "1"}),
                "cycle_slosh": (["point", "tank"], by_tank("cycle_slosh"), {"units": "m"}),
                "cycle_tvc": (["point", "tank"], by_tank("cycle_tvc"), {"units": "rad"}),
                **zone,
            },
            coords={
                "time": ("point", by_time([r.time for r in reviews]), {"units": "s"}),
                "phase": ("point", [r.phase.name for r in reviews for _ in r.time]),
                "tank": list(tanks),
                "mode": list(modes),
            },
            attrs={"flight": self.trajectory.name, "verdict": self.verdict},
        )


def assess_flight(
    trajectory: Trajectory, cycles: int = 1, progress: Progress | None = None, workers: int = 0
) -> FlightAssessment:
    """Assess a flight at every time of every phase; an event on both its sides.

    The loop is read at each tank's small amplitude; required damping holds the other tanks where all tanks together
    meet the disc margin (`joint_damping`). The whole review of one case, limit cycles included, takes a second or so.

    Args:
        trajectory: phases with their times.
        cycles: the whole review, limit cycles included, at every so many times and at both ends of each phase; 0 for
            none: then there is no verdict, but a linear criterion may fail.
        progress: hears of every step of the work.
        workers: processes that share the times among them, with the same result bit for bit; 0: this process alone. A
            script that asks for them guards its own work by `if __name__ == "__main__"`.
    """
    steps = [phase_steps(phase, cycles) for phase in trajectory]
    total, done = sum(len(own) for own in steps), 0

    def told(what: str) -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, total, what if done < total else "done")

    if progress is not None:
        progress(0, total, "margins")
    answers = iter(answered([step for own in steps for step in own], workers, told))
    reviews = tuple(reviewed(phase, [next(answers) for _ in own]) for phase, own in zip(trajectory, steps, strict=True))
    worst = worst_of(reviews)
    return FlightAssessment(
        trajectory=trajectory, verdict=_verdict(reviews, worst, cycles), cycles=cycles, worst=worst, reviews=reviews
    )


def _verdict(reviews: tuple[PhaseReview, ...], worst: tuple[Worst, ...], cycles: int) -> str:
    verdicts = [one.verdict for r in reviews for one in r.assessments if one is not None]
    if not all(np.all(r.trusted) for r in reviews):
        return "invalid"
    if "fail" in verdicts or any(one.met is False for one in worst):
        return "fail"
    if cycles == 0:
        return "linear"
    return "invalid" if "invalid" in verdicts or any(any(r.unsupported) for r in reviews) else "pass"


def _limited(one: Worst) -> str:
    return f", limit {one.limit}" if one.limit else ""


def _asked_of(review: PhaseReview) -> list[tuple[Any, str]]:
    return list(zip(review.assessments, review.unsupported, strict=True))


def _placed(values: Any, names: tuple[str, ...], among: tuple[str, ...]) -> Any:
    """Return columns by name among more names, nan where there is none."""
    whole = np.full((len(values), len(among)), np.nan)
    whole[:, [among.index(name) for name in names]] = values
    return whole
