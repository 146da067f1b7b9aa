"""Growth of an oscillation against its amplitude: sigma(a) of one slosh mode, every tank damped by its own law.

sigma(a) = Re lambda of the closed-loop pole whose damping every tank's law gives at the amplitude that the mode itself
gives that tank (see `branch`). Limit cycles are its zeros (see `cycles`).
"""

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.batch import single
from sloshpy.case import Case
from sloshpy.damping import DampingLaw
from sloshpy.dynamics.loop import open_loop
from sloshpy.dynamics.poles import Poles, closed_loop_poles
from sloshpy.errors import OutsideValidity
from sloshpy.limit_cycle.branch import Follower, Mode
from sloshpy.units import Array, ComplexArray

if TYPE_CHECKING:
    import xarray as xr

RELATED = 1e-3  # relative: how far beyond two points of a curve a limit cycle is still between them
SMALL = 1e-7  # of the greatest amplitude: where a branch starts, or farther down:
NOTHING = 1e-6  # of damping ratio, more than which no law may have given there
TINIEST = 1e-120  # of the greatest amplitude: what has not fallen there is a constant under another name


@dataclass(frozen=True, kw_only=True)
class GrowthCurve:
    """One slosh mode followed over its amplitude.

    amplitude: (A,), m, of the mode's own tank; with several tanks the branch may turn back in it, where another tank
    takes the mode over. pole: (A,), rad/s, sigma + j W; nan where a law has no data. damping: (A, n_tanks), ratios by
    each tank's law. slosh: (A, n_tanks), m, amplitudes of all tanks. tvc: (A,), rad.
    """

    case: Case
    tank: str
    amplitude: Array
    pole: ComplexArray
    damping: Array
    slosh: Array
    tvc: Array

    @property
    def growth(self) -> Array:
        """sigma(a) in 1/s."""
        return np.asarray(self.pole.real)

    @property
    def time_to_double(self) -> float:
        """ln 2 / sigma at the smallest amplitude in s; inf where the mode does not grow."""
        return float(np.log(2.0) / self.growth[0]) if len(self.growth) and self.growth[0] > 0.0 else np.inf

    @property
    def folded(self) -> bool:
        """Whether the branch turns back in the amplitude of its own tank."""
        return bool(np.any(np.diff(self.amplitude) < 0.0))

    def vanishes_at(self, amplitude: float, omega: float) -> bool:
        """Whether the growth changes sign at an amplitude in m and a frequency in rad/s: a limit cycle of this mode."""
        for a, pole in zip(itertools.pairwise(self.amplitude), itertools.pairwise(self.pole), strict=True):
            W = [p.imag for p in pole]
            changes = pole[0].real * pole[1].real <= 0.0
            near = min(W) * (1.0 - RELATED) <= omega <= max(W) * (1.0 + RELATED)
            if changes and near and min(a) * (1.0 - RELATED) <= amplitude <= max(a) * (1.0 + RELATED):
                return True
        return False

    def time_between(self, start: float, end: float) -> float:
        """Return the time in s that the mode takes from one amplitude in m to another, int da / (a sigma(a)).

        inf where it does not get there: it moves the other way, or a limit cycle lies between. nan where the curve does
        not reach, or turns back before.
        """
        from scipy.integrate import quad  # 0.3 s: only where a time is wanted
        from scipy.interpolate import PchipInterpolator

        if not (start > 0.0 and end > 0.0):
            raise ValueError(f"amplitudes must be > 0 m, are {start:g} m and {end:g} m")
        rising = int(np.argmax(np.append(np.diff(self.amplitude) <= 0.0, True))) + 1  # points before it turns back
        a, sigma = self.amplitude[:rising], self.growth[:rising]
        known = np.isfinite(sigma)
        if not np.any(known) or min(start, end) < a[known][0] or max(start, end) > a[known][-1]:
            return np.nan
        growth = PchipInterpolator(np.log(a[known]), sigma[known])
        low, high = np.log(start), np.log(end)
        inner = np.log(a[known][(a[known] > min(start, end)) & (a[known] < max(start, end))])
        way = np.sort(np.concatenate([[low, high], inner]))
        if np.any(growth(way) * (high - low) <= 0.0):
            return 0.0 if start == end else np.inf
        pieces = [quad(lambda x: 1.0 / float(growth(x)), x, y)[0] for x, y in itertools.pairwise(way)]
        return float(abs(sum(pieces)))

    def __str__(self) -> str:
        if not len(self.growth):
            return f"{self.tank} slosh: no growth curve, its damping data do not reach the start"
        grows = f"doubles in {self.time_to_double:.2f} s" if np.isfinite(self.time_to_double) else "does not grow"
        return f"{self.tank} slosh at small amplitude: {grows} ({self.growth[0]:+.5f} 1/s)"

    def to_dataset(self) -> "xr.Dataset":
        """Return the curve as an xarray Dataset over its points."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "growth": ("amplitude", self.growth, {"units": "1/s"}),
                "omega": ("amplitude", self.pole.imag, {"units": "rad/s"}),
                "slosh": (["amplitude", "tank"], self.slosh, {"units": "m"}),
                "tvc": ("amplitude", self.tvc, {"units": "rad"}),
            },
            coords={
                "amplitude": ("amplitude", self.amplitude, {"units": "m"}),
                "tank": [t.name for t in self.case.vehicle.tanks],
            },
        )


def growth_curve(case: Case, tank: int | str = 0, amplitude: Array | None = None) -> GrowthCurve:
    """Return how a tank's slosh mode grows against its amplitude.

    Args:
        case: one vehicle and autopilot.
        tank: name or number of the tank whose mode and amplitude are meant.
        amplitude: amplitudes in m, > 0, at which the branch from small amplitude is wanted, nan where it does not
            reach; default: along the branch to where the law gives 0.3 or its data end.
    """
    single(case, "growth_curve")
    tank = case.tank_index(tank)
    laws = [t.damping for t in case.vehicle.tanks]
    if amplitude is None:
        return _curve(case, tank, follow(case, tank))
    wanted = np.asarray(amplitude, dtype=float)
    if not np.all(wanted > 0.0):
        raise ValueError("amplitudes must be > 0 m")
    modes = follow(case, tank, float(np.max(wanted)), float(np.min(wanted)))
    follower = Follower(loop=open_loop(case), laws=laws, tank=tank)
    along = np.array([mode.amplitude for mode in modes])
    found = []
    for a in wanted:
        k = int(np.argmax(along >= a * (1.0 - 1e-12))) if np.any(along >= a * (1.0 - 1e-12)) else -1
        mode = follower.at(float(a), modes[k]) if k >= 0 else None
        found.append(_nothing(float(a), len(laws)) if mode is None else mode)
    return _curve(case, tank, tuple(found))


def liveliest_tank(case: Case) -> int:
    """Return the number of the tank whose slosh mode grows fastest, or dies out slowest, at small amplitude."""
    single(case, "liveliest_tank")
    poles = closed_loop_poles(open_loop(case))
    known = [(p.real, name) for p, name in zip(poles.value, poles.tank, strict=True) if name is not None]
    return case.tank_index(max(known)[1]) if known else 0


def follow(case: Case, tank: int, high: float | None = None, low: float | None = None) -> tuple[Mode, ...]:
    """Return the modes of a tank's branch from small amplitude on.

    Args:
        case: one vehicle and autopilot.
        tank: number of the tank.
        high: last amplitude in m; default: where the tank's law gives 0.3 or its data end.
        low: amplitude in m that lies on the branch for sure; default: none.
    """
    loop, laws = open_loop(case), [t.damping for t in case.vehicle.tanks]
    law = laws[tank]
    high = amplitude_range(law)[1] if high is None else high
    start = min(SMALL * high, high if low is None else low, *(_fallen(other, high, NOTHING) for other in laws))
    if start == 0.0:
        raise OutsideValidity(
            "a tank's damping hardly falls with the amplitude: what the loop does at small amplitude is not reached; "
            "give a constant, or an exponent of 0.05 and more"
        )
    pole = slosh_pole(closed_loop_poles(loop), loop.plant.tanks[tank])
    follower = Follower(loop=loop, laws=laws, tank=tank)
    return follower.along(pole, max(start, law.smallest_amplitude), high)


def slosh_pole(poles: Poles, tank: str) -> complex:
    """Return the pole in rad/s that is a tank's slosh."""
    if tank not in poles.tank:
        raise OutsideValidity(f"no pole of the loop is the slosh of {tank}: its growth cannot be followed; simulate it")
    return complex(poles.value[poles.tank.index(tank)])


def _fallen(law: DampingLaw, most: float, rest: float) -> float:
    """Return the amplitude in m, of those below the greatest, up to which a law adds no more than a ratio to that at 0.

    0 where it always adds more. A law whose data start later is read from there, and says nothing here.
    """
    if law.smallest_amplitude > 0.0:
        return most
    below = most * np.geomspace(TINIEST, 1.0, 481)
    little = law.ratio(below) - law.ratio(0.0) <= rest
    return float(below[np.argmin(little) - 1]) if little[0] and not np.all(little) else most if little[0] else 0.0


def amplitude_range(law: DampingLaw) -> tuple[float, float]:
    """Return least and greatest amplitude in m worth following: to where the law gives 0.3 or its data end."""
    most = law.largest_amplitude if np.isfinite(law.largest_amplitude) else float(law.amplitude(0.3))
    if not (np.isfinite(most) and most > 0.0):
        most = 1.0  # m: a constant law has no scale of its own
    return max(min(SMALL * most, _fallen(law, most, 100.0 * NOTHING)), TINIEST * most, law.smallest_amplitude), most


def _curve(case: Case, tank: int, modes: tuple[Mode, ...]) -> GrowthCurve:
    n = len(case.vehicle.tanks)
    return GrowthCurve(
        case=case,
        tank=case.vehicle.tanks[tank].name,
        amplitude=np.array([mode.amplitude for mode in modes]),
        pole=np.array([mode.pole for mode in modes], dtype=complex),
        damping=np.array([mode.damping for mode in modes]).reshape(-1, n),
        slosh=np.array([mode.slosh for mode in modes]).reshape(-1, n),
        tvc=np.array([mode.tvc for mode in modes]),
    )


def _nothing(amplitude: float, n: int) -> Mode:
    blank = np.full(n, np.nan)
    return Mode(amplitude=amplitude, pole=complex(np.nan, np.nan), damping=blank, shape=blank + 0j, tvc=np.nan)
