"""Poles of the loop: finite eigenvalues, polished on the exact characteristic function, named by participation."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.autopilot import PADE_ORDER, series_blocks
from sloshpy.autopilot.transfer import forward_fraction
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.plant import slosh_damping, without_drift
from sloshpy.dynamics.response import transfer
from sloshpy.dynamics.sampled import sampled_loop
from sloshpy.dynamics.sensed import bordering_row, fed
from sloshpy.units import Array, BoolArray, ComplexArray, IntArray

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


DelayModel = tuple[int, int]  # parts, and the order of the Pade approximation of each


def controller(loop: Loop, delay: DelayModel | None = None) -> tuple[Array, Array, Array, Array, list[str]]:
    """Return A, B, C, D of the forward path from what it is fed to beta, and the group of each state."""
    parts, order = delay or (int(np.max(delay_parts(loop))), PADE_ORDER)
    batch = loop.batch
    A, B, C = np.zeros((*batch, 0, 0)), np.zeros((*batch, 0)), np.zeros((*batch, 0))
    D = np.broadcast_to(np.asarray(loop.autopilot.gain, dtype=float), batch)
    groups: list[str] = []
    for i, block in enumerate(series_blocks(loop.autopilot, parts, order)):
        k, old = block.B.shape[-1], A.shape[-1]
        grown = np.zeros((*batch, old + k, old + k))
        grown[..., :old, :old] = A
        grown[..., old:, :old] = block.B[..., :, None] * C[..., None, :]
        grown[..., old:, old:] = block.A
        B = np.concatenate([B, block.B * D[..., None]], axis=-1)
        C = np.concatenate([block.D[..., None] * C, np.broadcast_to(block.C, (*batch, k))], axis=-1)
        A, D = grown, block.D * D
        groups += [f"{block.kind} {i + 1}" if block.kind == "filter" else block.kind] * k
    return A, B, C, D, groups


PART = 8.0  # rad of phase lag that one Pade approximation of order 8 carries with a phase error below 1e-3 rad
MOST_PARTS = 12  # 96 states; a delay longer still, at a gain that no loop survives, is left to the encirclement count
NEUTRAL = 1e-9  # growth below this part of the frequency is rounding
HEARD = 0.5  # loop gain below which 1 + L does not come near zero, whatever the delay


def _without_delay(loop: Loop) -> Loop:
    return replace(loop, autopilot=loop.autopilot.prompt)


def _reach(loop: Loop) -> Array:
    """Return the highest frequency at which the loop gain is above `HEARD`, rad/s, shape of the batch.

    On a grid that holds the natural frequencies of the broken loop, where a resonance is near its peak. In the right
    half-plane a delay only lessens the gain, so that no unstable pole lies beyond.
    """
    prompt = _without_delay(loop)
    own = np.abs(np.linalg.eigvals(system_matrix(prompt, closed=False)[0]))
    top, bottom = np.max(own, axis=-1, keepdims=True), np.min(np.where(own > 0.0, own, np.inf), axis=-1, keepdims=True)
    wide = bottom * (1e3 * top / bottom) ** np.linspace(0.0, 1.0, 60)
    omega = np.concatenate([np.where(own > 0.0, own, top), wide], axis=-1)
    gain = np.abs(transfer(prompt.along(), 1j * omega).loop)
    return np.asarray(np.max(np.where(gain < HEARD, 0.0, omega), axis=-1))


def delay_parts(loop: Loop) -> IntArray:
    """Return how many parts the delay of each loop by itself is approximated in, shape of the batch."""
    if np.all(quiet_within(loop, PART)):
        return np.ones(loop.batch, dtype=int)
    return np.clip(np.ceil(_reach(loop) * loop.autopilot.dead_time / PART), 1, MOST_PARTS).astype(int)


def quiet_within(loop: Loop, lag: float) -> BoolArray:
    """Return whether each loop's gain is below `HEARD` where its delay turns by more than `lag` rad, as in `_reach`.

    By vehicle and autopilot alone, every tank undamped, where peaks are highest: many dampings of a plant cost nothing,
    and the answer for a loop does not depend on its neighbours.
    """
    tau = np.asarray(loop.autopilot.dead_time, dtype=float)
    late = tau > 0.0
    if not np.any(late):
        return np.ones(loop.batch, dtype=bool)
    bare = replace(_without_delay(loop), damping=np.zeros(loop.damping.shape[-1]))
    own = np.abs(np.linalg.eigvals(system_matrix(bare, closed=False)[0]))
    top = np.max(own, axis=-1, keepdims=True)
    limit = np.where(late, lag / np.where(late, tau, 1.0), np.inf)[..., None]
    limit = np.where(np.isfinite(limit), limit, 1e3 * top)
    wide = limit * np.maximum(1e3 * top / limit, 10.0) ** np.linspace(0.0, 1.0, 30)
    omega = np.concatenate([np.broadcast_to(np.maximum(own, limit), (*wide.shape[:-1], own.shape[-1])), wide], axis=-1)
    gain = np.abs(transfer(bare.along(), 1j * omega).loop)
    return np.broadcast_to(np.all(gain < HEARD, axis=-1) | ~late, loop.batch)


def system_matrix(loop: Loop, closed: bool = True, delay: DelayModel | None = None) -> tuple[Array, list[str]]:
    """Return the state matrix of the loop, shape (..., N, N), closed or broken at the engine, and its state groups.

    delay: how it is approximated; left out, as well as the worst of the batch needs.
    """
    p = fed(loop)
    A_c, B_c, C_c, D_c, groups = controller(loop, delay)
    batch, n, k = loop.batch, p.A.shape[-1], A_c.shape[-1]
    sensed = np.broadcast_to(p.c, (*batch, n))
    A = np.zeros((*batch, n + k, n + k))
    A[..., :n, :n] = p.A
    A[..., n:, n:] = A_c
    A[..., n:, :n] = B_c[..., :, None] * sensed[..., None, :]
    if closed:
        direct, through = p.B * D_c[..., None], p.B[..., :, None] * C_c[..., None, :]
        felt = p.d[..., None] * C_c
        if np.any(p.B2) or np.any(p.d2):  # beta'' = C A^2 x + C A B u: the actuator lets beta and beta' see no u
            CA = np.einsum("...i,...ij->...j", C_c, A_c)
            CAA = np.einsum("...i,...ij->...j", CA, A_c)
            direct = direct + p.B2 * np.sum(CA * B_c, axis=-1)[..., None]
            through = through + p.B2[..., :, None] * CAA[..., None, :]
            felt = felt + p.d2[..., None] * CAA
        A[..., :n, :n] += direct[..., :, None] * sensed[..., None, :]
        A[..., :n, n:] = through
        if p.acceleration is not None:  # with the lag that it asks for nothing of u comes back to u at once
            A[..., n:, n:] += B_c[..., :, None] * felt[..., None, :]
    own = list(loop.plant.groups)
    return A, own[1 if loop.plant.velocity_only else 0 :] + own + groups


def characteristic_matrix(loop: Loop, s: ComplexArray, closed: bool = True) -> tuple[ComplexArray, ComplexArray]:
    """Return T(s) with det T(s) = 0 at the loop's exact poles, delay included, and dT/ds.

    T is the dynamic stiffness of the plant bordered by the forward path n(s)/d(s):

        [ D(s)          -b - s^2 b2          ] [q   ]
        [ -n(s) row(s)   d(s) - n(s) felt(s) ] [beta] = 0

    with what the autopilot is fed, row(s) q + felt(s) beta, from `sensed`.

    It is entire in s, so that no pole of the broken loop needs care. Where Z enters by its velocity alone, Z' is the
    unknown in its place. `s` broadcasts with the loop's batch.
    """
    p = loop.plant
    n = p.mass.shape[-1]
    s = np.asarray(s, dtype=complex)
    S = s[..., None, None]
    diagonal = np.arange(n)[p.slosh]
    slosh = slosh_damping(p, loop.damping)
    top, bottom, dtop, dbottom = forward_fraction(loop.autopilot, s)
    shape = np.broadcast_shapes(s.shape, loop.batch)
    T, dT = np.zeros((*shape, n + 1, n + 1), dtype=complex), np.zeros((*shape, n + 1, n + 1), dtype=complex)
    T[..., :n, :n] = S * S * p.mass + S * p.damping + p.stiffness
    dT[..., :n, :n] = 2.0 * S * p.mass + p.damping
    if p.velocity_only:
        T[..., :n, 0], dT[..., :n, 0] = s[..., None] * p.mass[..., :, 0] + p.damping[..., :, 0], p.mass[..., :, 0]
    T[..., diagonal, diagonal] += s[..., None] * slosh
    dT[..., diagonal, diagonal] += slosh
    T[..., n, n], dT[..., n, n] = bottom, dbottom
    if closed:
        row, by_s = bordering_row(loop, s)
        T[..., :n, n], dT[..., :n, n] = -p.engine_force(s), -2.0 * s[..., None] * p.inertial_force
        T[..., n, :] -= top[..., None] * row
        dT[..., n, :] -= dtop[..., None] * row + top[..., None] * by_s
    return T, dT


def polish(loop: Loop, s: ComplexArray, closed: bool = True) -> ComplexArray:
    """Return roots of det T(s) = 0 near the given ones by Newton's method; nan where it does not converge.

    The Newton step of a determinant is 1 / trace(T^-1 dT/ds).
    """
    s = np.array(s, dtype=complex)
    converged = np.zeros(s.shape, dtype=bool)
    scale = np.maximum(np.abs(s), 1e-3)  # rad/s: a pole closer to the origin than this is judged absolutely
    for _ in range(30):
        with np.errstate(all="ignore"):  # far left exp(-s tau) overflows: no root there is ours, and nan says so
            T, dT = characteristic_matrix(loop, s, closed)
            try:
                trace = np.trace(np.linalg.solve(T, dT), axis1=-2, axis2=-1)
            except np.linalg.LinAlgError:  # some stand exactly on a root: they are done, the rest goes on
                on = np.linalg.det(T) == 0.0
                converged |= on
                trace = np.trace(
                    np.linalg.solve(np.where(on[..., None, None], np.eye(T.shape[-1]), T), dT), axis1=-2, axis2=-1
                )
            step = np.where(converged, 0.0, 1.0 / trace)
        step = np.where(np.isfinite(step), step, np.nan)
        size = np.abs(step) / scale
        s = s - step * np.minimum(1.0, 0.3 / np.maximum(size, 1e-300))
        converged |= size < 1e-13
        if np.all(converged | np.isnan(s)):
            break
        converged |= size < 1e-12
    return np.where(converged | (size < 1e-9), s, np.nan)


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
    scale = np.abs(np.linalg.eigvals(system_matrix(_without_delay(loop), closed=False)[0]))  # a delay has no poles
    scale = scale[scale > 1e-4 * np.min(loop.plant.tank_frequency, initial=1e-2 * np.max(scale))]
    if loop.plant.guided:  # slow poles that leave the origin only in the closed loop
        scale = np.append(scale, np.abs(np.linalg.eigvals(system_matrix(_without_delay(loop))[0])))
    degree = 2 * loop.plant.mass.shape[-1] + sum(len(f.denominator) - 1 for f in loop.autopilot.filter)
    degree -= loop.plant.velocity_only
    if loop.autopilot.actuator is not None:
        degree += len(loop.autopilot.actuator.fraction[1]) - 1
    centre = float(np.exp(np.mean(np.log(scale))))
    low, high = np.min(scale) * 10.0**-decades, np.max(scale) * 10.0**decades
    line = loop.along()

    def turned(omega: Array) -> ComplexArray:
        sign, _ = np.linalg.slogdet(characteristic_matrix(line, 1j * omega)[0])
        reference = (1j * omega + centre) / np.abs(1j * omega + centre)
        return np.asarray(sign / reference**degree)

    omega = np.concatenate([[low], np.geomspace(low, high, 400), [high]])[1:-1]
    tau = float(loop.autopilot.delay)
    turns = np.arange(low, float(_reach(loop)), 0.5 / tau) if tau else scale  # the delay turns L between samples
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
    """Return the poles that polishing moved onto another one: they are the Pade approximation's, not the loop's."""
    copies: set[int] = set()
    for k in np.argsort(moved):
        same = np.abs(values - values[k]) < 1e-9 * np.abs(values[k])
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
