"""W1, the linear sweep: dispersed flight points x 40 slosh dampings x 2000 frequencies, against named peers.

Small: 200 points of the paper's stage. Large: 50 points of the flexible launcher (4 tanks, 3 bending modes, actuator,
filter, delay), all tanks at the same damping; its delay is exact in sloshpy and multiplied onto the peers' response.

Everyone computes, for each point and damping: the loop L on all frequencies, eq 24 on all of them and its least value,
closed-loop stability, and the gain from engine to slosh. Run with one thread:

    OPENBLAS_NUM_THREADS=1 python benchmarks/sweep.py

The peers work one system at a time; they are timed on every 40th system, spread over all points and dampings, and the
time is scaled to all of them. sloshpy is timed on the whole job. Best of three, CPU seconds of this process.
"""

import importlib.util
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files

import control
import numpy as np
import scipy.signal

import sloshpy
from sloshpy.autopilot import Autopilot
from sloshpy.case import Case, Criteria
from sloshpy.damping import ConstantDamping
from sloshpy.dynamics import frequency_response, open_loop
from sloshpy.dynamics.loop import Loop
from sloshpy.dynamics.states import system_matrix
from sloshpy.files import read_case, to_control
from sloshpy.stability import margins
from sloshpy.stability.grid import GridSweep, grid_sweep
from sloshpy.vehicle import SloshMass, Vehicle

POINTS, DAMPINGS, FREQUENCIES = 200, 40, 2000
GM, PM = 10.0**0.3, np.pi / 6.0  # 6 dB, 30 deg
A0, A1 = 0.08, 0.14
TABLE_1 = {"mass": 16000.0, "inertia": 9e5, "cg": 6.0, "thrust": 9e5, "m": 1000.0, "X": 9.0, "w": 2.0}
XI = np.geomspace(0.002, 0.1, DAMPINGS)
OMEGA = np.geomspace(0.1, 20.0, FREQUENCIES)  # rad/s
EVERY = 40


def flight_points() -> list[dict[str, float]]:
    """Return table 1 dispersed by +-20 % in every entry."""
    rng = np.random.default_rng(20)
    return [{k: v * rng.uniform(0.8, 1.2) for k, v in TABLE_1.items()} for _ in range(POINTS)]


def case_of(p: dict[str, float | np.ndarray]) -> Case:
    """Return a flight point, or a batch of them, as a case."""
    tank = SloshMass(
        name="LOX", slosh_mass=p["m"], station=p["X"], frequency=p["w"], damping=ConstantDamping(ratio=0.01)
    )
    vehicle = Vehicle(mass=p["mass"], inertia=p["inertia"], cg=p["cg"], thrust=p["thrust"], tanks=(tank,))
    return Case(name="point", vehicle=vehicle, autopilot=Autopilot(attitude_gain=A0, rate_gain=A1))


def with_sloshpy(points: list[dict[str, float]]) -> GridSweep:
    """Survey every point and damping in one call: points on the first axis, dampings on the second."""
    batch = case_of({k: np.array([[p[k]] for p in points]) for k in points[0]})
    return grid_sweep(open_loop(batch, XI[:, None]), OMEGA, Criteria())


def matrices(p: dict[str, float], xi: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the peers' state space from eqs 9-12, errata corrected; outputs -(a0 phi + a1 phi') and z."""
    M, I, m, w, l = p["mass"], p["inertia"], p["m"], p["w"], p["cg"] - p["X"]
    k3, c2 = p["thrust"] / M, p["thrust"] * p["cg"] / I
    E, A = np.eye(6), np.zeros((6, 6))
    E[3, 5], E[4, 5], E[5, 3], E[5, 4] = m / M, -m * l / I, 1.0, -l
    A[0, 3] = A[1, 4] = A[2, 5] = 1.0
    A[3, 1], A[4, 2], A[5, 1], A[5, 2], A[5, 5] = k3, m * k3 / I, k3, -(w**2), -2.0 * xi * w
    B = np.array([0.0, 0.0, 0.0, k3, -c2, 0.0])
    C = np.array([[0.0, -A0, 0.0, 0.0, -A1, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])
    return np.linalg.solve(E, A), np.linalg.solve(E, B)[:, None], C


def formula_24(L: np.ndarray) -> np.ndarray:
    """Return eq 24 as a user would write it."""
    return np.hypot(20.0 * np.log10(np.abs(L)) / 6.0, np.angle(-L) / PM)


def stable_by_poles(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> bool:
    """Return closed-loop stability without the two drift poles."""
    kept = [1, 2, 4, 5]
    closed = A - B @ C[:1]
    return bool(np.all(np.linalg.eigvals(closed[np.ix_(kept, kept)]).real < 0.0))


def with_control(p: dict[str, float], xi: float) -> tuple[float, np.ndarray]:
    """Return the least DM and L by python-control."""
    A, B, C = matrices(p, xi)
    response = control.ss(A, B, C, 0)(1j * OMEGA)
    stable_by_poles(A, B, C)
    np.max(np.abs(response[1, 0]))
    return float(np.min(formula_24(response[0, 0]))), response[0, 0]


def with_scipy(p: dict[str, float], xi: float) -> tuple[float, np.ndarray]:
    """Return the least DM and L by scipy.signal.freqresp (one output at a time, which is all it does)."""
    A, B, C = matrices(p, xi)
    L = scipy.signal.freqresp((A, B, C[:1], np.zeros((1, 1))), OMEGA)[1]
    z = scipy.signal.freqresp((A, B, C[1:], np.zeros((1, 1))), OMEGA)[1]
    stable_by_poles(A, B, C)
    np.max(np.abs(z))
    return float(np.min(formula_24(L))), L


def exact(p: dict[str, float], xi: float) -> np.ndarray:
    """Return L of eq 21 with damping, in extended precision."""
    M, I, m, w, l = (np.longdouble(p[k]) for k in ("mass", "inertia", "m", "w", "cg"))
    l = l - np.longdouble(p["X"])
    k3 = np.longdouble(p["thrust"]) / M
    c2 = np.longdouble(p["thrust"]) * np.longdouble(p["cg"]) / I
    s = 1j * OMEGA.astype(np.clongdouble)
    q = 2 * np.longdouble(xi) * w * s + w**2
    # rows phi and z after Z: s^2 phi - (m/I)(l s^2 + k3) z = -c2 ; -l s^2 phi + ((1 - m/M) s^2 + q) z = -k3
    determinant = s**2 * ((1 - m / M) * s**2 + q) - (m / I) * (l * s**2 + k3) * l * s**2
    phi = (-c2 * ((1 - m / M) * s**2 + q) - (m / I) * (l * s**2 + k3) * k3) / determinant
    return -(A0 + A1 * s) * phi


def timed(work: Callable[[], None], runs: int = 3) -> float:
    """Return the least CPU seconds of some runs."""
    seconds = []
    for _ in range(runs):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    return min(seconds)


LAUNCHER_POINTS = 50
LAUNCHER_OMEGA = np.geomspace(0.3, 100.0, FREQUENCIES)  # rad/s


def launchers() -> Case:
    """Return the flexible launcher dispersed by +-10 %, points on the first of two batch axes."""
    rng = np.random.default_rng(21)

    def spread(x: float) -> np.ndarray:
        return x * rng.uniform(0.9, 1.1, (LAUNCHER_POINTS, 1))

    case = read_case(str(files("sloshpy") / "data" / "flexible_launcher.toml"))
    v = case.vehicle
    tanks = tuple(
        t.model_copy(update={"frequency": spread(t.frequency), "slosh_mass": spread(t.slosh_mass)}) for t in v.tanks
    )
    update = {"tanks": tanks, "mass": spread(v.mass), "inertia": spread(v.inertia)}
    return case.model_copy(update={"vehicle": v.model_copy(update=update)})


def launcher_system(loop: Loop, k: int) -> tuple[np.ndarray, ...]:
    """Return the peers' A, B, C of one system without its delay, and its closed state matrix; outputs L and each z."""
    one = loop.take(np.array(k))
    prompt = replace(one, autopilot=one.autopilot.prompt)
    closed, _ = system_matrix(one)
    p = to_control(prompt)
    states = p.A.shape[0]
    z = np.zeros((len(one.plant.tanks), states))
    return p.A, p.B, np.vstack([p.C, z]), closed


def large() -> list[str]:
    """Time the large job and print it; return the peers against which less than wanted was reached."""
    batch = launchers()
    tanks = len(batch.vehicle.tanks)
    damping = XI[:, None] * np.ones(tanks)
    result: list[GridSweep] = []
    run = lambda: result.append(grid_sweep(open_loop(batch, damping), LAUNCHER_OMEGA, Criteria()))  # noqa: E731
    run()
    own = timed(run)
    loop = open_loop(batch, damping)
    chosen = range(0, LAUNCHER_POINTS * DAMPINGS, 4 * EVERY + 1)
    systems = [launcher_system(loop, k) for k in chosen]
    late = np.exp(-1j * LAUNCHER_OMEGA * float(batch.autopilot.delay))
    values = LAUNCHER_POINTS * DAMPINGS * FREQUENCIES

    def by_control(A: np.ndarray, B: np.ndarray, C: np.ndarray, closed: np.ndarray) -> float:
        response = control.ss(A, B, C, 0)(1j * LAUNCHER_OMEGA)
        np.linalg.eigvals(closed)
        np.max(np.abs(response[1:, 0]))
        return float(np.min(formula_24(response[0, 0] * late)))

    def by_scipy(A: np.ndarray, B: np.ndarray, C: np.ndarray, closed: np.ndarray) -> float:
        rows = [scipy.signal.freqresp((A, B, C[k : k + 1], np.zeros((1, 1))), LAUNCHER_OMEGA)[1] for k in range(len(C))]
        np.linalg.eigvals(closed)
        np.max(np.abs(rows[1:]))
        return float(np.min(formula_24(rows[0] * late)))

    print(f"\nW1 large: {LAUNCHER_POINTS} points x {DAMPINGS} dampings x {FREQUENCIES} frequencies, CPU seconds")
    print(f"{'sloshpy':34s} {own:9.3f} {1e9 * own / values:9.1f}")
    laub = control.StateSpace.slycot_laub
    peers = [("python-control with slycot", by_control, laub, 100)] if has_slycot() else []
    peers += [
        ("python-control without slycot", by_control, without_slycot, 250),
        ("scipy.signal.freqresp", by_scipy, laub, 15),
    ]
    short = []
    for name, peer, method, wanted in peers:
        control.StateSpace.slycot_laub = method
        found: list[float] = []
        seconds = (
            timed(lambda p=peer, f=found: f.extend(p(*x) for x in systems), 1) * values / FREQUENCIES / len(systems)
        )
        error = max(abs(dm - result[0].least.flat[k]) for dm, k in zip(found, chosen, strict=True))
        print(
            f"{name:34s} {seconds:9.1f} {1e9 * seconds / values:9.0f} {seconds / own:19.0f}x  {wanted}x; "
            f"least DM differs by {error:.0e}"
        )
        if seconds / own < wanted:
            short.append(f"large, {name}")
    control.StateSpace.slycot_laub = laub
    return short


def has_slycot() -> bool:
    """Return whether slycot is installed."""
    return importlib.util.find_spec("slycot") is not None


def without_slycot(*_: object) -> None:
    """Stand in python-control's place for slycot, as if it were not installed."""
    raise ImportError


def main() -> None:
    """Time everyone in one run and print time, accuracy and ratio."""
    points = flight_points()
    systems = [(i, d) for i in range(POINTS) for d in range(DAMPINGS)]
    sample = systems[:: EVERY + 1]  # 41 and 40 have no common factor: every damping comes in turn
    with_sloshpy(points)  # warm up
    result: list[GridSweep] = []
    own = timed(lambda: result.append(with_sloshpy(points)))
    least = result[0].least

    def error_of(responses: list[np.ndarray]) -> float:
        truth = [exact(points[i], XI[d]) for i, d in sample]
        return max(float(np.max(np.abs(a / b - 1.0))) for a, b in zip(responses, truth, strict=True))

    ours = [frequency_response(open_loop(case_of(points[i]), XI[d]), OMEGA).loop for i, d in sample]
    print(f"W1 small: {POINTS} points x {DAMPINGS} dampings x {FREQUENCIES} frequencies, CPU seconds")
    print(f"{'':34s} {'time':>9s} {'ns/value':>9s} {'error of L':>11s} {'ratio':>8s}  to reach")
    values = POINTS * DAMPINGS * FREQUENCIES
    name = f"sloshpy {sloshpy.__version__}, NumPy {np.__version__}"
    print(f"{name:34s} {own:9.3f} {1e9 * own / values:9.1f} {error_of(ours):11.1e}")
    laub = control.StateSpace.slycot_laub

    peers = [("python-control with slycot", with_control, laub, 300)] if has_slycot() else []
    if not peers:
        print("slycot is not installed: its row is missing")
    peers += [
        ("python-control without slycot", with_control, without_slycot, 600),
        ("scipy.signal.freqresp", with_scipy, laub, 20),
    ]
    short = []
    for name, peer, method, wanted in peers:
        control.StateSpace.slycot_laub = method
        found: list[tuple[float, np.ndarray]] = []
        seconds = (
            timed(lambda p=peer, f=found: f.extend(p(points[i], XI[d]) for i, d in sample)) * len(systems) / len(sample)
        )
        ratio = seconds / own
        error = error_of([L for _, L in found[: len(sample)]])
        print(f"{name:34s} {seconds:9.1f} {1e9 * seconds / values:9.0f} {error:11.1e} {ratio:7.0f}x  {wanted}x")
        if ratio < wanted:
            short.append(name)
        worst = max(abs(dm - least[i, d]) for (dm, _), (i, d) in zip(found, sample, strict=False))
        if worst > 1e-6:
            short.append(f"{name}: least DM differs by {worst:.1e}")
    control.StateSpace.slycot_laub = laub
    refined = np.array([margins(case_of(points[i]), XI[d]).minima.value[0] for i, d in sample])
    grid = np.array([least[i, d] for i, d in sample])
    print(f"grid of {FREQUENCIES}: least DM too great by up to {np.max(grid - refined):.2g}; margins() refines it")
    short += large()
    if short:
        sys.exit(f"not reached: {', '.join(short)}")


if __name__ == "__main__":
    main()
