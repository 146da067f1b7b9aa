"""The greatest stable cycle of every loop of a grid of degradations: cycles followed from cell to cell."""

from dataclasses import replace

import numpy as np

from sloshpy.case import Case
from sloshpy.dynamics.growth import greatest_growth
from sloshpy.dynamics.loop import Loop, open_loop
from sloshpy.dynamics.poles import NEUTRAL, closed_loop_eigenvalues
from sloshpy.errors import NoAttractor, OutsideValidity
from sloshpy.limit_cycle.cycle import Cycle
from sloshpy.limit_cycle.cycles import slosh_cycles
from sloshpy.limit_cycle.neutral import neutral_cycles
from sloshpy.units import Array, BoolArray, IntArray

# what stands in a cell
CYCLE, REST, UNSUPPORTED, SEVERAL, DIVERGES = range(5)
OPEN = -1  # not yet decided
LARGEST_RATIO = 0.3  # damping at which the growth curve ends
FARTHEST = 0.3  # relative change of frequency from a cell to its neighbour that is still the same cycle


class DegradedCycles:
    """A grid of degradations that fills itself, flattened: cell g D + d has gain g and delay d.

    tvc: (C,), rad. slosh: (C,), m, of the tank. omega: (C,), rad/s. reason: (C,), codes above.
    """

    def __init__(self, case: Case, tank: int, gain: Array, delay: Array) -> None:
        self._case, self._tank = case, tank
        self._shape = len(gain), len(delay)
        self._gain, self._delay = (x.ravel() for x in np.meshgrid(gain, delay, indexing="ij"))
        self._laws = [t.damping for t in case.vehicle.tanks]
        loop = open_loop(case.model_copy(update={"autopilot": case.autopilot.degraded(self._gain, self._delay)}))  # type: ignore[arg-type]
        self._loop = self._damped(loop, loop.damping)
        count = len(self._gain)
        self.tvc, self.slosh, self.omega = np.zeros(count), np.zeros(count), np.full(count, np.nan)
        self._all_slosh, self._leader = np.zeros((count, len(self._laws))), np.zeros(count, dtype=int)
        self.reason: IntArray = self._at_small_amplitude()

    def fill(self) -> None:
        """Decide every cell: cycles from a few cells are followed, what they do not reach is looked at by itself."""
        G, D = self._shape
        spread = {(0, 0), (G // 2, D // 2), (G - 1, D - 1)}  # several cycles of one cell are each followed
        for g, d in sorted(spread):
            if self.reason[g * D + d] in (OPEN, REST):
                self._seed(g * D + d)
        self._without_end()
        for cell in range(G * D):
            if self.reason[cell] == OPEN:
                self._seed(cell)
                if self.reason[cell] == OPEN:
                    self.reason[cell] = UNSUPPORTED if self._data_end() else DIVERGES
        for code, value in ((UNSUPPORTED, np.nan), (SEVERAL, np.nan), (DIVERGES, np.inf)):
            self.tvc[self.reason == code] = self.slosh[self.reason == code] = value

    def _damped(self, loop: Loop, damping: Array) -> Loop:
        return replace(loop, damping=np.broadcast_to(damping, (len(self._gain), len(self._laws))))

    def _at_small_amplitude(self) -> IntArray:
        """Return what small oscillations say: several modes grow, one without oscillation, none, or one (open)."""
        poles = closed_loop_eigenvalues(self._loop)
        grows = poles.real > NEUTRAL * np.abs(poles)
        swings, drifts = np.sum(grows & (poles.imag > 0.0), axis=-1), np.sum(grows & (poles.imag == 0.0), axis=-1)
        reason = np.full(len(swings), OPEN)
        reason[swings + drifts == 0] = REST
        reason[drifts > 0] = DIVERGES
        reason[swings > 1] = SEVERAL
        late = np.array([law.smallest_amplitude > 0.0 for law in self._laws])
        if np.any(late):  # rest lies outside the data, unless it is stable without any damping there
            bare = greatest_growth(self._damped(self._loop, np.where(late, 0.0, self._loop.damping[0])))
            reason[(reason == REST) & ~(bare < 0.0)] = UNSUPPORTED
        return reason

    def _data_end(self) -> bool:
        return any(np.isfinite(law.largest_amplitude) for law in self._laws)

    def _without_end(self) -> None:
        """Decide open cells that grow even at the most damping that the laws give."""
        most = np.array(
            [
                LARGEST_RATIO if np.isinf(law.largest_amplitude) else float(law.ratio(law.largest_amplitude))
                for law in self._laws
            ]
        )
        constant = np.array([float(law.amplitude(LARGEST_RATIO)) == np.inf for law in self._laws])
        most = np.where(constant, self._loop.damping[0], most)
        grows = greatest_growth(self._damped(self._loop, most)) > 0.0
        self.reason[(self.reason == OPEN) & grows] = UNSUPPORTED if self._data_end() else DIVERGES

    def _seed(self, cell: int) -> None:
        """Look for every cycle of one cell by the growth curve and follow each over the grid."""
        pilot = self._case.autopilot.degraded(float(self._gain[cell]), float(self._delay[cell]))
        try:
            found = slosh_cycles(self._case.model_copy(update={"autopilot": pilot}))
        except NoAttractor:
            return
        except OutsideValidity:
            self.reason[cell] = SEVERAL
            return
        for cycle in found:
            if cycle.stable:
                self._follow(cell, cycle)

    def along(self, gain: Array, delay: Array) -> tuple[Array, Array, Array]:
        """Return tvc, slosh and omega at other degradations (P,), followed from the nearest cells.

        What a cell without a cycle holds stands for the points nearest to it; nan where a cycle is lost on the way.
        """
        away = np.hypot(
            np.log(gain[:, None] / self._gain) / (np.ptp(np.log(self._gain)) or 1.0),
            (delay[:, None] - self._delay) / (np.ptp(self._delay) or 1.0),
        )
        cell = np.argmin(away, axis=-1)
        tvc, slosh, omega = self.tvc[cell], self.slosh[cell], self.omega[cell]
        pilot = self._case.autopilot.degraded(gain, delay)  # type: ignore[arg-type]
        for leader in np.unique(self._leader[cell]):
            at = np.flatnonzero((self.reason[cell] == CYCLE) & (self._leader[cell] == leader))
            if len(at):
                part = replace(self._loop, autopilot=pilot, damping=self._loop.damping[:1]).take(at)
                part = replace(part, damping=self._loop.damping[cell[at]])
                there = neutral_cycles(part, self._laws, int(leader), self._all_slosh[cell[at]], omega[at])
                found = there.attracts
                tvc[at], omega[at] = np.where(found, there.tvc, np.nan), np.where(found, there.omega, np.nan)
                slosh[at] = np.where(found, there.slosh[:, self._tank], np.nan)
        return tvc, slosh, omega

    def _keep(self, cells: IntArray, leader: int, slosh: Array, omega: Array, tvc: Array) -> None:
        larger = (self.reason[cells] != CYCLE) | (tvc > self.tvc[cells])
        at = cells[larger]
        self.reason[at] = CYCLE
        self.slosh[at], self.omega[at], self.tvc[at] = slosh[larger, self._tank], omega[larger], tvc[larger]
        self._all_slosh[at], self._leader[at] = slosh[larger], leader

    def _follow(self, cell: int, cycle: Cycle) -> None:
        """Follow one cycle from its cell to all that it reaches, a ring of neighbours at a time."""
        names = list(cycle.slosh_amplitude)
        leader = names.index(cycle.tank)
        slosh, omega = np.full((len(self._gain), len(names)), np.nan), np.full(len(self._gain), np.nan)
        slosh[cell], omega[cell] = list(cycle.slosh_amplitude.values()), cycle.omega
        self._keep(np.array([cell]), leader, slosh[[cell]], omega[[cell]], np.array([cycle.tvc_amplitude]))
        tried = np.isin(self.reason, (SEVERAL, DIVERGES, UNSUPPORTED))
        tried[cell] = True
        while True:
            cells, origin = self._ring(np.isfinite(omega), tried)
            if len(cells) == 0:
                return
            tried[cells] = True
            part = self._loop.take(cells)
            there = neutral_cycles(part, self._laws, leader, slosh[origin], omega[origin])
            same = there.attracts & (np.abs(np.log(there.omega / omega[origin])) < FARTHEST)
            slosh[cells[same]], omega[cells[same]] = there.slosh[same], there.omega[same]
            self._keep(cells[same], leader, there.slosh[same], there.omega[same], there.tvc[same])

    def _ring(self, solved: BoolArray, tried: BoolArray) -> tuple[IntArray, IntArray]:
        """Return cells not yet tried beside solved ones, and for each the solved neighbour to start from."""
        G, D = self._shape
        number = np.arange(G * D).reshape(G, D)
        origin = np.full((G, D), -1)
        known = np.where(solved.reshape(G, D), number, -1)
        for axis in (0, 1):
            for way in (1, -1):
                moved = np.roll(known, way, axis)
                edge = 0 if way == 1 else -1
                moved[(edge, slice(None)) if axis == 0 else (slice(None), edge)] = -1
                origin = np.where(origin < 0, moved, origin)
        cells = np.flatnonzero((origin.ravel() >= 0) & ~tried)
        return cells, origin.ravel()[cells]
