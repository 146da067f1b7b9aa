"""W2 by heyoka and diffrax, where they are installed: the same equations, per run, compilation apart.

    OPENBLAS_NUM_THREADS=1 python benchmarks/campaign_peers.py

Both are explicit integrators that know no kink of |v| v. heyoka's Taylor step is limited, since it steps over the kink
else; its runs are one after another (its batches may be some times as fast). diffrax (Tsit5, rtol 1e-6) has 64 runs
side by side in double precision; XLA_FLAGS="--xla_cpu_multi_thread_eigen=false" keeps it to one thread. Of both the
integration alone is timed, of sloshpy all. Neither is a dependency.
"""

import importlib.util
import time

import numpy as np
from campaign import DELAY, DURATION, GAIN, START, single_case, uncertain, with_scipy

from sloshpy.dispersion import Nonlinear
from sloshpy.dispersion.answers import answered
from sloshpy.dynamics import open_loop
from sloshpy.dynamics.states import system_matrix
from sloshpy.simulation.envelope import settled_envelope
from sloshpy.simulation.state_rows import slosh_rows

GRID = np.arange(0.0, DURATION, 0.05)
FEW = 4  # runs of heyoka; diffrax has 64


def system(number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return A, the push of the damping times b, the rows of velocity and displacement, and the start of one draw."""
    d = uncertain(Nonlinear(duration=DURATION, initial_slosh=START, gain=GAIN, delay=DELAY))
    case, b = single_case(d, number)
    loop = open_loop(case, 0.0)
    A, _ = system_matrix(loop)
    rows = slosh_rows(loop, len(A))
    start = np.zeros(len(A))
    start[loop.plant.slosh_states.start] = START
    return A, b * rows.push[0], rows.velocity[0], rows.displacement[0], start


def with_heyoka(step: float, tolerance: float) -> tuple[float, np.ndarray]:
    """Return CPU seconds a run and settled slosh amplitudes of a few draws in turn, with steps of at most `step` s."""
    import heyoka as hy

    systems = [system(k) for k in range(FEW)]
    N = len(systems[0][0])
    x = [hy.expression(f"x{k}") for k in range(N)]
    place = int(np.argmax(systems[0][2]))
    used = np.any([s[0] != 0.0 for s in systems], axis=0)
    v = x[place]
    drag = v * (hy.relu(v) + hy.relu(-v))
    rate = []
    for i in range(N):
        terms = [hy.par[i * N + j] * x[j] for j in range(N) if used[i, j]]
        rate.append((x[i], hy.sum([*terms, -hy.par[N * N + i] * drag])))
    pars = [0.0] * (N * N + N)
    one = hy.taylor_adaptive(rate, systems[0][4].tolist(), pars=pars, tol=tolerance)
    found, spent = [], 0.0
    for A, push, _, row, start in systems:
        one.time, one.state[:] = 0.0, start
        one.pars[:] = np.concatenate([A.ravel(), push])
        begin = time.process_time()
        run = one.propagate_grid(GRID.tolist(), max_delta_t=step)[-1]
        spent += time.process_time() - begin
        found.append(settled_envelope(GRID, run @ row).amplitude)
    return spent / FEW, np.array(found)


def with_diffrax(count: int = 64) -> tuple[float, np.ndarray]:
    """Return CPU seconds a run and settled slosh amplitudes, all runs side by side."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    systems = [system(k) for k in range(count)]
    velocity, row, start = (jnp.asarray(x) for x in systems[0][2:])
    A, push = (jnp.asarray(np.stack([s[k] for s in systems])) for k in (0, 1))

    def rate(_, x, given):
        own, moved = given
        v = velocity @ x
        return own @ x - moved * jnp.abs(v) * v

    def solved(given):
        steps = diffrax.PIDController(rtol=1e-6, atol=1e-9)
        saved, term = diffrax.SaveAt(ts=jnp.asarray(GRID)), diffrax.ODETerm(rate)
        run = diffrax.diffeqsolve(
            term,
            diffrax.Tsit5(),
            0.0,
            DURATION,
            0.01,
            start,
            given,
            saveat=saved,
            stepsize_controller=steps,
            max_steps=None,
        )
        return run.ys @ row

    work = jax.jit(jax.vmap(solved))
    work((A[:1].repeat(count, 0), push[:1].repeat(count, 0))).block_until_ready()  # compiled
    begin = time.process_time()
    found = np.asarray(work((A, push)).block_until_ready())
    spent = time.process_time() - begin
    return spent / count, np.array([settled_envelope(GRID, x).amplitude for x in found])


def main() -> None:
    """Print one line for each that is installed, with its accuracy against DOP853."""
    truth = np.array([with_scipy(uncertain_run(), k, "DOP853", 1e-10) for k in range(FEW)])
    answered(uncertain_run(), 1, 0, 8)
    begin = time.process_time()
    ours = answered(uncertain_run(), 1, 0, 1000).values[:FEW, 0]
    own = (time.process_time() - begin) / 1000
    lines = [("sloshpy", own, ours)]
    if importlib.util.find_spec("heyoka"):
        lines += [(f"heyoka, tolerance {tol:g}", *with_heyoka(0.2, tol)) for tol in (1e-12, 1e-5)]
    if importlib.util.find_spec("diffrax"):
        lines.append(("diffrax", *with_diffrax()))
    for name, spent, found in lines:
        error = np.nanmax(np.abs(found[:FEW] / truth - 1.0))
        print(f"{name:26s} {spent:10.2e} CPU s a run   error {error:.1e}   {spent / own:.0f}x")


def uncertain_run() -> object:
    """Return the campaign of W2."""
    return uncertain(Nonlinear(duration=DURATION, initial_slosh=START, gain=GAIN, delay=DELAY))


if __name__ == "__main__":
    main()
