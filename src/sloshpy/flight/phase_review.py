"""One phase assessed at all its times: margins and modes in one call each, requirement and cycles time by time."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sloshpy.assess import Assessment, assess
from sloshpy.case import Case
from sloshpy.dynamics import open_loop
from sloshpy.dynamics.poles import unstable_count
from sloshpy.errors import OutsideValidity
from sloshpy.flight.trajectory import Phase
from sloshpy.flight.windows import GrowthWindow, growth_windows
from sloshpy.flight.workers import Step
from sloshpy.stability import (
    DangerZone,
    Margins,
    ModeTracks,
    RequiredDamping,
    danger_zone,
    joint_damping,
    joint_required_damping,
    margins,
    track_modes,
)
from sloshpy.units import Array, BoolArray, ComplexArray

VALID_SHARE = 0.15  # of the tank radius: the largest slosh that the spring-mass describes


@dataclass(frozen=True, kw_only=True)
class PhaseReview:
    """What one phase shows at its times, the loop at small amplitude.

    margins: of the batch. witness: (T,), stability by encirclement count of the exact loop. tracks: closed-loop modes.
    held: (T, n_tanks), damping at which the other tanks are held where one tank's requirement is sought: where all
    tanks together meet the disc margin (of one tank its own). required: for each tank, (T,). zones: for each tank.
    windows: in which a mode grows. assessments: (T,), the whole review at the times asked for, None at the others.
    unsupported: (T,), why there is no review where one was asked for, "" elsewhere.
    """

    phase: Phase
    margins: Margins
    witness: BoolArray
    tracks: ModeTracks
    held: Array
    required: tuple[RequiredDamping, ...]
    zones: tuple[DangerZone, ...]
    windows: tuple[GrowthWindow, ...]
    assessments: tuple[Assessment | None, ...]
    unsupported: tuple[str, ...]

    @property
    def time(self) -> Array:
        """Times of the phase, (T,), s."""
        return self.phase.time

    @property
    def trusted(self) -> BoolArray:
        """Where poles and encirclement count agree, or the loop is neutral so that neither can tell, (T,)."""
        return np.asarray((self.witness == self.margins.stable) | self.margins.neutral)

    @functools.cached_property
    def disc_margin(self) -> Array:
        """Least disc margin of each group of `margins.groups`, negative where unstable, (T, n_groups); inf for none.

        A minimum that follows a tank by half of its greatest share counts for that tank; one that follows no tank
        counts for the mode that it follows most.
        """
        m, n = self.margins, len(self.phase.tanks)
        own = np.stack([m.related(j) for j in range(n)], axis=-1)
        free = ~np.any(own, axis=-1) & np.isfinite(m.minima.value)
        mode = m.mode(m.minima)
        columns = [np.where(own[..., j], m.minima.value, np.inf) for j in range(n)]
        columns += [np.where(free & (mode == g), m.minima.value, np.inf) for g in range(n, len(m.groups))]
        least = np.min(np.stack(columns, axis=-1), axis=-2)
        return np.asarray(np.where(np.isfinite(least), np.where(m.stable[:, None], least, -least), np.inf))

    @property
    def required_damping(self) -> Array:
        """Damping each tank needs, (T, n_tanks); nan where none up to 0.3 suffices."""
        return np.stack([one.required for one in self.required], axis=-1)

    @property
    def cg(self) -> Array:
        """Station of the c.g., (T,), m forward of the gimbal."""
        return np.broadcast_to(np.asarray(self.phase.case.vehicle.cg, dtype=float), self.time.shape)

    @property
    def percussion_station(self) -> Array:
        """Station of the centre of percussion, the forward bound of the danger zone, (T,), m."""
        return np.asarray(self.cg - self.zones[0].forward)

    @property
    def aft_station(self) -> Array:
        """Station of the aft bound of each tank's danger zone, (T, n_tanks), m."""
        return np.stack([self.cg - zone.aft for zone in self.zones], axis=-1)

    @property
    def slosh_station(self) -> Array:
        """Station of each slosh mass, (T, n_tanks), m."""
        return np.stack([self.cg - zone.l for zone in self.zones], axis=-1)

    @property
    def within_zone(self) -> Array:
        """1 where a slosh mass lies in its danger zone, 0 where not, nan where the closed form is refused."""
        return np.stack([zone.within for zone in self.zones], axis=-1)

    @property
    def slosh_limit(self) -> Array:
        """Largest slosh that the model describes, (T, n_tanks), m: 15 % of the radius; nan without one."""
        rows = [
            [np.nan if tank.radius is None else VALID_SHARE * float(tank.radius) for tank in case.vehicle.tanks]
            for case in self.phase.cases
        ]
        return np.array(rows)

    @property
    def tvc_limit(self) -> float:
        """Largest acceptable engine amplitude of a limit cycle, rad."""
        return self.phase.case.criteria.tvc_amplitude

    @functools.cached_property
    def cycle_slosh(self) -> Array:
        """Slosh of each tank's limit cycle under degraded margins, (T, n_tanks), m; 0 for none, nan where unknown."""
        return self._cycles("worst_slosh_amplitude")

    @functools.cached_property
    def cycle_tvc(self) -> Array:
        """Engine amplitude of each tank's limit cycle under degraded margins, (T, n_tanks), rad, likewise."""
        return self._cycles("worst_tvc_amplitude")

    def _cycles(self, name: str) -> Array:
        found = np.full((len(self.time), len(self.phase.tanks)), np.nan)
        for k, one in enumerate(self.assessments):
            for j, tank in enumerate(one.tanks if one is not None else ()):
                cycle = tank.limit_cycle
                none = not cycle.band.size and cycle.acceptable is True
                found[k, j] = 0.0 if none else getattr(cycle, name) if cycle.band.size else np.nan
        return found

    @functools.cached_property
    def growing(self) -> ComplexArray:
        """The fastest growing pole at each time, (T,), rad/s."""
        pole = self.tracks.pole
        first = np.argmax(np.where(np.isnan(pole.real), -np.inf, pole.real), axis=1)
        return np.asarray(pole[np.arange(len(pole)), first])

    @property
    def time_to_double(self) -> Array:
        """ln 2 over the greatest growth of a pole, (T,), s; inf where nothing grows."""
        growth = np.where(self.margins.neutral, 0.0, self.margins.growth)
        return np.asarray(np.where(growth > 0.0, np.log(2.0) / np.where(growth > 0.0, growth, 1.0), np.inf))


def phase_steps(phase: Phase, cycles: int) -> list[Step]:
    """Return the steps of work that `reviewed` wants the answers of: none rests on another.

    Args:
        phase: with at least one tank.
        cycles: limit cycles at every so many times and at both ends; 0 for none.
    """
    wanted = set(cycle_times(len(phase.time), cycles))
    return [
        Step(what="modes", ask=functools.partial(_modes, phase)),
        Step(what="margins", ask=functools.partial(_loop, phase)),
        *(
            Step(
                what="limit cycles" if k in wanted else "required damping",
                ask=functools.partial(_at_time, case, k in wanted),
            )
            for k, case in enumerate(phase.cases)
        ),
    ]


def reviewed(phase: Phase, answers: Sequence[Any]) -> PhaseReview:
    """Return the review of a phase from the answers of its steps."""
    tracks, (found, witness), *rows = answers
    held = np.array([row.held for row in rows])
    return PhaseReview(
        phase=phase,
        margins=found,
        witness=witness,
        tracks=tracks,
        held=held,
        required=tuple(_along(phase, held, [row.required[j] for row in rows]) for j in range(len(phase.tanks))),
        zones=tuple(danger_zone(phase.case, j) for j in range(len(phase.tanks))),
        windows=growth_windows(tracks, phase.name),
        assessments=tuple(row.assessment for row in rows),
        unsupported=tuple(row.unsupported for row in rows),
    )


@dataclass(frozen=True, kw_only=True)
class _AtTime:
    """What one time shows; held: (n_tanks,). required: of each tank."""

    held: Array
    required: tuple[RequiredDamping, ...]
    assessment: Assessment | None
    unsupported: str


def _modes(phase: Phase) -> ModeTracks:
    return track_modes(phase.cases, phase.time, phase.small_damping, "time", "s")


def _loop(phase: Phase) -> tuple[Margins, BoolArray]:
    """Return the margins at all times, and whether the encirclement count says stable."""
    loop = open_loop(phase.case, phase.small_damping)
    witness = [unstable_count(loop.take(np.asarray(k))) == 0 for k in range(len(phase.time))]
    return margins(phase.case, phase.small_damping), np.array(witness)


def _at_time(case: Case, whole: bool) -> _AtTime:
    """Return what one time needs, and the whole review of its case where that is wanted: the five steps need it too."""
    unsupported = ""
    if whole:
        try:
            review = assess(case)
        except OutsideValidity as error:
            unsupported = str(error)
        else:
            required = tuple(tank.limit_cycle.together for tank in review.tanks)
            return _AtTime(held=required[0].source.damping, required=required, assessment=review, unsupported="")
    held = joint_damping(case)
    together, wanted = open_loop(case, held), case.criteria.disc_margin
    required = tuple(joint_required_damping(together, case.criteria, j, wanted) for j in range(len(case.vehicle.tanks)))
    return _AtTime(held=together.damping, required=required, assessment=None, unsupported=unsupported)


def _along(phase: Phase, held: Array, rows: Sequence[RequiredDamping]) -> RequiredDamping:
    """Return the required damping of one tank along a phase."""
    return RequiredDamping(
        tank=rows[0].tank,
        neutral=np.array([float(row.neutral) for row in rows]),
        required=np.array([float(row.required) for row in rows]),
        omega=np.array([float(row.omega) for row in rows]),
        disc_margin=rows[0].disc_margin,
        source=open_loop(phase.case, held),
    )


def cycle_times(count: int, every: int) -> list[int]:
    """Return the times at which limit cycles are sought: every so many and the last; none for 0."""
    return sorted({*range(0, count, every), count - 1}) if every > 0 else []
