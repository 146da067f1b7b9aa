"""Poles of the loop: finite eigenvalues, polished on the exact characteristic function, named by participation."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.dynamics.characteristic import characteristic_matrix, polish
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.plant import without_drift
from sloshpy.dynamics.sampled import sampled_loop
from sloshpy.dynamics.states import reach, system_matrix, without_delay
from sloshpy.units import Array, ComplexArray

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, kw_only=True)
class Poles:
    """Poles of one loop, least damped first; of a conjugate pair the upper one stands for both.

    value: rad/s. name, kind, tank: what takes part most in each: "LOX slosh", "slosh", "LOX".
    participation: shares of the groups named in `groups` in each mode, rows sum to 1.
    source: the loop they belong to. drift_poles: neutral poles at the origin that were removed by structure.
    """

    value: ComplexArray
    name: tuple[str, ...]
    kind: tuple[str, ...]
    tank: tuple[str | None, ...]
    groups: tuple[str, ...]
    participation: Array
    source: Loop
    drift_poles: int

    @property
    def stable(self) -> bool:
        """Whether every pole that is not drift lies in the left half-plane."""
        return bool(np.all(np.isfinite(self.value)) and np.all(self.value.real < 0.0))

    @property
    def damping_ratio(self) -> Array:
        """-Re s / |s| of each pole; 0 at the origin."""
        size = np.abs(self.value)
        return np.asarray(np.where(size > 0.0, -self.value.real / np.where(size > 0.0, size, 1.0), 0.0))

    @property
    def time_to_double(self) -> Array:
        """ln 2 / Re s in s; inf where the mode does not grow."""
        grows = self.value.real > NEUTRAL * np.abs(self.value)  # rounding of a neutral pole is no growth
        return np.asarray(np.where(grows, np.log(2.0) / np.where(grows, self.value.real, 1.0), np.inf))

    def __str__(self) -> str:
        lines = [f"  {'mode':20s} {'Hz':>9s} {'rad/s':>9s} {'damping':>10s} {'growth 1/s':>11s}"]
        for p, name, ratio, double in zip(self.value, self.name, self.damping_ratio, self.time_to_double, strict=True):
            grows = f"  doubles in {double:.2f} s" if np.isfinite(double) else ""
            hertz = p.imag / (2.0 * np.pi)
            lines.append(f"  {name:20s} {hertz:9.4f} {p.imag:9.4f} {100 * ratio:8.3f} % {p.real:+11.5f}{grows}")
        if self.drift_poles:
            poles = "poles" if self.drift_poles > 1 else "pole"
            lines.append(f"  {self.drift_poles} neutral drift {poles} removed by structure")
        return "\n".join(lines)

    def to_dataset(self) -> "xr.Dataset":
        """Return the poles as an xarray Dataset with units in the attributes."""
        import xarray as xr  # 1 s: only when a dataset is wanted

        return xr.Dataset(
            {
                "growth": ("mode", self.value.real, {"units": "1/s"}),
                "omega": ("mode", self.value.imag, {"units": "rad/s"}),
                "damping_ratio": ("mode", self.damping_ratio, {"units": "1"}),
                "kind": ("mode", list(self.kind)),
                "participation": (["mode", "group"], self.participation, {"units": "1"}),
            },
            coords={"mode": list(self.name), "group": list(self.groups)},
        )


NEUTRAL = 1e-9  # growth below this part of the frequency is rounding
STOOD = 1e-6  # of a pole: what Newton's method moves a double pole at most, whose derivative is zero there


def closed_loop_eigenvalues(loop: Loop) -> ComplexArray:
    """Return every closed-loop pole, shape (..., N): exact without delay, else polished from a Pade start.

    Where a delay is present the list also holds the delay's own poles nearest the origin; one that does not converge,
    or that converges onto another, is left out as nan (it belongs to the approximation, not to the loop).
    """
    A, groups = system_matrix(loop)
    values = np.linalg.eigvals(A).astype(complex)
    if "delay" not in groups:
        return values
    values = polish(loop.along(), values)
    order = np.argsort(-values.real, axis=-1)
    values = np.take_along_axis(values, order, axis=-1)
    apart = np.abs(values[..., :, None] - values[..., None, :])
    twice = np.tril(apart < 1e-9 * np.abs(values[..., None, :]), k=-1).any(axis=-1)
    return np.where(twice, np.nan, values)


def unstable_count(loop: Loop, decades: float = 4.0) -> int:
    """Count closed-loop poles in the right half-plane by encirclement, without an eigenvalue.

    Of a digital autopilot the poles outside the unit circle, of the sampled loop without approximation.

    The winding of det T(j omega), which is 1 + L cleared of its denominators, against a polynomial of the same degree
    whose roots all lie left (argument principle on the exact loop, delay included). The path is halved until no
    piece turns by more than half a radian.

    Args:
        loop: one loop, no batch.
        decades: reach of the path beyond the loop's own frequencies; the winding there is checked to have died out.
    """
    if loop.autopilot.sample_time is not None:
        return int(np.sum(np.abs(sampled_loop(loop).poles) > 1.0))
    scale = np.abs(np.linalg.eigvals(system_matrix(without_delay(loop), closed=False)[0]))  # a delay has no poles
    scale = scale[scale > 1e-4 * np.min(loop.plant.tank_frequency, initial=1e-2 * np.max(scale))]
    if loop.plant.guided:  # slow poles that leave the origin only in the closed loop
        scale = np.append(scale, np.abs(np.linalg.eigvals(system_matrix(without_delay(loop))[0])))
    degree = 2 * loop.plant.mass.shape[-1] + sum(len(f.denominator) - 1 for f in loop.autopilot.filter)
    degree -= loop.plant.velocity_only
    if loop.autopilot.actuator is not None:
        degree += len(loop.autopilot.actuator.fraction[1]) - 1
    centre = float(np.exp(np.mean(np.log(scale))))
    low, high = np.min(scale) * 10.0**-decades, np.max(scale) * 10.0**decades
    line = loop.along()

    def turned(omega: Array) -> ComplexArray:
        with np.errstate(invalid="ignore"):
            sign, _ = np.linalg.slogdet(characteristic_matrix(line, 1j * omega)[0])
        on = ~np.isfinite(sign) | (sign == 0.0)  # exactly on a neutral pole: the path passes beside it
        if np.any(on):
            sign[on] = np.linalg.slogdet(characteristic_matrix(line, 1j * omega[on] * (1.0 + 1e-9))[0])[0]
        reference = (1j * omega + centre) / np.abs(1j * omega + centre)
        return np.asarray(sign / reference**degree)

    omega = np.concatenate([[low], np.geomspace(low, high, 400), [high]])[1:-1]
    tau = float(loop.autopilot.delay)
    turns = np.arange(low, float(reach(loop)), 0.5 / tau) if tau else scale  # the delay turns L between samples
    omega = np.unique(np.concatenate([omega, scale, turns]))
    value = turned(omega)
    for _ in range(60):
        step = np.angle(value[1:] / value[:-1])
        wide = np.flatnonzero(np.abs(step) > 0.5)
        if len(wide) == 0:
            break
        middle = 0.5 * (omega[wide] + omega[wide + 1])
        omega = np.insert(omega, wide + 1, middle)
        value = np.insert(value, wide + 1, turned(middle))
    # from the real axis at omega -> 0 to the real axis at infinity: whole half turns
    ends = np.angle(value[0] ** 2) / 2.0, np.angle(value[-1] ** 2) / 2.0
    half_turns = (np.sum(np.angle(value[1:] / value[:-1])) + ends[0] - ends[1]) / np.pi
    return int(np.round(-half_turns))


def closed_loop_poles(loop: Loop) -> Poles:
    """Return the closed-loop poles of one loop with their names, least damped first."""
    return _named(loop, closed=True)


def open_loop_poles(loop: Loop) -> Poles:
    """Return the poles of one loop broken at the engine, with their names, least damped first."""
    if not loop.plant.guided:
        return _named(loop, closed=False)
    # at rest in the broken loop guidance holds nothing: its poles stand at the origin by structure, not by eigenvalue
    full = replace(loop.plant, guided=False, velocity_only=False, drift_poles=0)
    unheld = loop.autopilot.model_copy(update={"drift_gain": 0.0, "drift_rate_gain": 0.0})
    found = _named(replace(loop, plant=without_drift(full), autopilot=unheld), closed=False)
    count = found.drift_poles - loop.plant.drift_poles
    share = np.zeros((count + len(found.name), 1 + len(found.groups)))
    share[:count, -1], share[count:, :-1] = 1.0, found.participation
    return replace(
        found,
        value=np.concatenate([np.zeros(count), found.value]),
        name=("drift",) * count + found.name,
        kind=("rigid",) * count + found.kind,
        tank=(None,) * count + found.tank,
        groups=(*found.groups, "drift"),
        participation=share,
        source=loop,
        drift_poles=loop.plant.drift_poles,
    )


def _named(loop: Loop, closed: bool) -> Poles:
    A, groups = system_matrix(loop, closed)
    if A.ndim != 2:
        raise ValueError("poles are named for one loop; take one from the batch first")
    values, right = np.linalg.eig(A)
    values = values.astype(complex)
    left = np.linalg.pinv(right, rcond=1e-14)
    shares = np.abs(right * left.T)  # |participation| of each state (row) in each mode (column)
    names = tuple(dict.fromkeys(groups))
    by_group = np.array([[shares[[g == name for g in groups], k].sum() for name in names] for k in range(len(values))])
    by_group /= by_group.sum(axis=1, keepdims=True)
    copies: set[int] = set()
    if "delay" in groups:
        start, values = values, polish(loop.along(), values, closed)
        # a pair of the approximation's that falls on one real pole: the rounding's sign is no reason to drop it
        values = np.where(np.abs(values.imag) < 1e-12 * np.abs(values), values.real, values)
        copies = _copies(values, np.abs(values - start))
    upper = [k for k in range(len(values)) if (values[k].imag >= 0.0 or np.isnan(values[k])) and k not in copies]
    room = {name: groups.count(name) for name in names}
    chosen = _assign(values, by_group, upper, names, room)
    listed = [k for k in upper if chosen.get(k) != "delay" or values[k].real >= 0.0]
    listed.sort(key=lambda k: float(-values[k].real) / max(float(np.abs(values[k])), 1e-300))
    label = {k: _label(chosen[k], by_group[k], names) for k in listed}
    tanks = {f"{tank} slosh": tank for tank in loop.plant.tanks}
    return Poles(
        value=values[listed],
        name=tuple(label[k] for k in listed),
        kind=tuple(_kind(label[k], tanks, loop.plant.modes) for k in listed),
        tank=tuple(tanks.get(label[k]) for k in listed),
        groups=names,
        participation=by_group[listed],
        source=loop,
        drift_poles=loop.plant.drift_poles,
    )


def _copies(values: ComplexArray, moved: Array) -> set[int]:
    """Return the poles that polishing moved onto another one: they are the Pade approximation's, not the loop's.

    One that hardly moved stood there before: three equal tanks have a double pole that no engine moves.
    """
    copies: set[int] = set()
    strayed = moved > STOOD * np.abs(values)
    for k in np.argsort(moved):
        same = (np.abs(values - values[k]) < 1e-9 * np.abs(values[k])) & strayed
        if k not in copies:
            copies |= {int(i) for i in np.flatnonzero(same) if i != k}
    return copies


def _assign(
    values: ComplexArray, by_group: Array, modes: list[int], names: Any, room: dict[str, int]
) -> dict[int, str]:
    """Give each mode the group that takes part most in it, no group more poles than it has states."""
    room = dict(room)
    size = {k: 1 if values[k].imag == 0.0 else 2 for k in modes}
    chosen: dict[int, str] = {}
    for _, k, g in sorted(((by_group[k, g], k, g) for k in modes for g in range(len(names))), reverse=True):
        if k not in chosen and room[names[g]] >= size[k]:
            chosen[k] = names[g]
            room[names[g]] -= size[k]
    for k in modes:
        chosen.setdefault(k, names[int(np.argmax(by_group[k]))])
    return chosen


def _label(group: str, shares: Array, names: tuple[str, ...]) -> str:
    """Return the group, or for an unstable pole of the delay the vehicle's group that takes part most."""
    if group != "delay":
        return group
    return max((share, name) for share, name in zip(shares, names, strict=True) if name != "delay")[1]


def _kind(name: str, tanks: dict[str, str], modes: tuple[str, ...]) -> str:
    if name in tanks:
        return "slosh"
    if name in modes:
        return "flexible"
    return {"rigid body": "rigid", "drift": "rigid", "actuator": "actuator"}.get(name, "filter")
