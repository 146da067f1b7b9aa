"""The exact limit cycle against simulation, its own equations, energy and brute-force Floquet multipliers."""

import numpy as np
import pytest
import scipy.integrate

import oracle
import oracle_flexible
from cases import PAPER_LAW, paper_case, random_case, real_case, xi
from sloshpy.autopilot import Actuator, Autopilot, Filter
from sloshpy.case import Case
from sloshpy.damping import PowerDamping, TableDamping
from sloshpy.errors import OutsideValidity
from sloshpy.files import read_case, write_example
from sloshpy.limit_cycle import growth_curve, limit_cycles, periodic_orbit
from sloshpy.limit_cycle.cycles import one_sinusoid_cycles
from sloshpy.simulation import simulate
from sloshpy.vehicle import SloshMass, Vehicle

DIP = TableDamping(amplitude=[0.0, 0.07, 0.15, 0.3, 0.5, 0.8], ratio=[0.005, 0.026, 0.029, 0.020, 0.030, 0.045])
DEGRADED = {"gain": 10 ** (4.4 / 20), "delay": 0.17}


def beside(frequency, **parts):
    """The paper's vehicle with a second tank behind the first, of a law of its own."""
    second = SloshMass(
        name="second", slosh_mass=700.0, station=8.0, frequency=frequency, damping=PowerDamping(slope=0.1)
    )
    return paper_case(more=(second,), **parts)


def four_tanks():
    """Four modes grow and lock onto one motion in which a damper works against its own rest for part of each period."""
    numbers = [
        (265.95, -1.293, 2.00462, 0.09117, 0.8943),
        (167.21, 7.5997, 1.22959, 0.53836, 0.8493),
        (1301.26, 3.5669, 1.26666, 0.08736, 1.1542),
        (2164.58, 3.5350, 1.28557, 0.45965, 1.6595),
    ]
    tanks = tuple(
        SloshMass(
            name=f"tank {j + 1}",
            slosh_mass=m,
            station=X,
            frequency=w,
            damping=PowerDamping(slope=alpha, exponent=p),
        )
        for j, (m, X, w, alpha, p) in enumerate(numbers)
    )
    return Case(
        name="four tanks",
        vehicle=Vehicle(
            mass=192169.0,
            inertia=6.5912e6,
            cg=4.1907,
            thrust=4.6297e6,
            vectored_thrust=1.64373e6,
            drag=719773.0,
            tanks=tanks,
        ),
        autopilot=Autopilot(
            attitude_gain=0.40556,
            rate_gain=0.54164,
            gain=1.48365,
            delay=0.38244,
            actuator=Actuator(frequency=4.33725, damping=0.9513),
        ),
    )


def square(slope):
    """The damper whose describing function is slope * A at any frequency: b = 3 pi slope / 4, and its derivative."""
    b = 3 * np.pi * slope / 4
    return lambda v: -b * v * np.abs(v), lambda v: -2 * b * np.abs(v)


# ---------------------------------------------------------------- against simulation


def settled(case, orbit, duration, step):
    history = simulate(case, duration, orbit.time_history(256).slosh[0], step=step)
    return history, [history.slosh_envelope(j) for j in range(len(orbit.slosh_amplitude))]


@pytest.mark.parametrize("degraded", [{}, DEGRADED])
def test_the_shipped_example_agrees_with_a_converged_simulation_to_1e_5(tmp_path, degraded):
    case = read_case(write_example("upper_stage", tmp_path))
    case = case.model_copy(update={"autopilot": case.autopilot.degraded(**degraded)})
    orbit = periodic_orbit(case)
    history, (slosh,) = settled(case, orbit, 500.0, 0.02)
    assert slosh.amplitude == pytest.approx(orbit.slosh_amplitude["LOX"], rel=1e-5)
    assert slosh.omega == pytest.approx(orbit.omega, rel=1e-5)
    assert history.tvc_envelope.amplitude == pytest.approx(orbit.tvc_amplitude, rel=1e-5)
    # what one sinusoid leaves out is no less than ten times that
    (cycle,) = limit_cycles(case)
    assert abs(cycle.slosh_amplitude["LOX"] / orbit.slosh_amplitude["LOX"] - 1.0) > 1e-4


def test_two_tanks_with_actuator_and_delay_agree_with_a_converged_simulation(tmp_path):
    case = read_case(write_example("two_tanks", tmp_path))
    orbit = periodic_orbit(case)
    history, slosh = settled(case, orbit, 390.0, 0.02)
    for found, name in zip(slosh, orbit.slosh_amplitude, strict=True):
        assert found.amplitude == pytest.approx(orbit.slosh_amplitude[name], rel=1e-5)
    assert history.tvc_envelope.amplitude == pytest.approx(orbit.tvc_amplitude, rel=1e-5)


def test_tanks_that_lock_where_one_sinusoid_is_eight_percent_off_agree_with_simulation():
    """T25: several modes grow at once, yet the motion is periodic, attracts, and is no one-sinusoid cycle."""
    case = four_tanks()
    with pytest.raises(OutsideValidity, match="modes grow at once"):
        limit_cycles(case)
    orbit = periodic_orbit(case)
    assert orbit.stable is True
    _, slosh = settled(case, orbit, 850.0, 0.03)
    for found, name in zip(slosh, orbit.slosh_amplitude, strict=True):
        assert found.amplitude == pytest.approx(orbit.slosh_amplitude[name], rel=1e-4)
    assert abs(orbit.start.slosh_amplitude["tank 1"] / orbit.slosh_amplitude["tank 1"] - 1.0) > 0.05


def test_two_growing_modes_that_lock_are_one_attracting_orbit():
    """T25: of two orbits the one that attracts is returned, and the simulation goes there from the other's place."""
    case = beside(2.3)
    orbits = [periodic_orbit(case, cycle) for cycle in one_sinusoid_cycles(case)]
    assert sorted(orbit.stable for orbit in orbits) == [False, True]
    repels, attracts = sorted(orbits, key=lambda orbit: orbit.stable)
    assert periodic_orbit(case).slosh_amplitude == pytest.approx(attracts.slosh_amplitude, rel=1e-9)
    history = simulate(case, 700.0, repels.time_history(256).slosh[0])
    for j, name in enumerate(attracts.slosh_amplitude):
        assert history.slosh_envelope(j).amplitude == pytest.approx(attracts.slosh_amplitude[name], rel=1e-3)


def test_two_growing_modes_with_two_frequencies_have_no_attracting_orbit():
    """T25: the simulation keeps two lines, and every orbit found says so with the other's frequency."""
    case = beside(2.8)
    orbits = [periodic_orbit(case, cycle) for cycle in one_sinusoid_cycles(case)]
    assert [orbit.stable for orbit in orbits] == [False, False]
    assert periodic_orbit(case).stable is False
    history = simulate(case, 900.0, 0.1)
    assert not history.slosh_envelope(0).settled
    last = history.time > 500.0
    z = history.slosh[last, 0] * np.hanning(np.sum(last))
    line = np.abs(np.fft.rfft(z, 2**18))
    omega = 2 * np.pi * np.fft.rfftfreq(2**18, history.step)
    for one, other in (orbits, orbits[::-1]):
        assert "two frequencies" in str(one)
        near = np.abs(omega - one.floquet.omega[0]) < 0.02
        assert line[near].max() > 0.05 * line.max()
        assert one.floquet.omega[0] == pytest.approx(other.omega, rel=0.01)


# ---------------------------------------------------------------- its own equations


def derivative(x, omega, times=1):
    k = np.fft.fftfreq(len(x), 1.0 / len(x))
    spectrum = np.fft.fft(x, axis=0) * ((1j * omega * k) ** times).reshape(-1, *[1] * (x.ndim - 1))
    return np.fft.ifft(spectrum, axis=0).real


def later(x, omega, by):
    k = np.fft.fftfreq(len(x), 1.0 / len(x))
    return np.fft.ifft(np.fft.fft(x) * np.exp(-1j * omega * k * by)).real


def two_tank_loop():
    lead = Filter(numerator=(1.0, 5.0), denominator=(1.0, 6.0))
    return beside(2.3, delay=0.09, actuator=Actuator(frequency=12.0, damping=0.6), filter=(lead,))


def test_the_orbit_satisfies_every_equation_of_motion_in_time():
    case = two_tank_loop()
    orbit = periodic_orbit(case)
    c, W = oracle.numbers(case, 0.0), orbit.omega
    h = orbit.time_history(2048)
    z, beta, phi = h.slosh, h.tvc, h.attitude
    z2, phi2 = derivative(z, W, 2), derivative(phi, W, 2)
    u = np.stack([square(0.1)[0](derivative(z[:, j], W)) for j in range(2)], axis=-1)
    Z2 = c.k4 * beta + c.k3 * phi - z2 @ c.m / c.M
    pitch = phi2 + c.c2 * beta - (z2 @ (c.m * c.l) + c.k3 * z @ c.m) / c.I
    slosh = z2 + c.w**2 * z - u + Z2[:, None] - np.outer(phi2, c.l) - c.k3 * phi[:, None]
    sensed = later(c.gain * (c.a0 * phi + c.a1 * derivative(phi, W)), W, c.delay)
    wa, za = c.actuator
    command = (derivative(beta, W, 2) + 2 * za * wa * derivative(beta, W)) / wa**2 + beta
    lead = derivative(command, W) + 6.0 * command - derivative(sensed, W) - 5.0 * sensed
    # 1e-7: rounding of the derivatives by Fourier transform
    assert np.abs(lead).max() < 1e-7 * np.abs(6.0 * command).max()
    assert np.abs(pitch).max() < 1e-7 * np.abs(c.c2 * beta).max()
    # the force has kinks: what lies beyond 64 harmonics of it, 64^-2.5, is not balanced and moves nothing
    assert np.sqrt(np.mean(slosh**2)) < 64**-2.5 * np.sqrt(np.mean(u**2))


def test_thrust_gives_over_a_cycle_what_the_dampers_take():
    case = two_tank_loop()
    orbit = periodic_orbit(case)
    c, W = oracle.numbers(case, 0.0), orbit.omega
    h = orbit.time_history(4096)
    momentum = c.M * (c.k4 * h.tvc + c.k3 * h.attitude)
    k = np.fft.fftfreq(len(momentum), 1.0 / len(momentum))
    once = np.fft.fft(momentum) / np.where(k == 0, np.inf, 1j * W * k)
    Z1 = (np.fft.ifft(once).real - h.slosh_velocity @ c.m) / c.M
    given = np.mean(momentum * Z1 - c.R * c.Xcg * h.tvc * derivative(h.attitude, W))
    taken = -np.mean(sum(m * square(0.1)[0](v) * v for m, v in zip(c.m, h.slosh_velocity.T, strict=True)))
    assert taken > 0.0
    assert given == pytest.approx(taken, rel=1e-7)


@pytest.mark.parametrize("seed", range(6))
def test_bending_engine_air_filters_and_delay_balance_harmonic_by_harmonic(seed):
    rng = np.random.default_rng([71, seed])
    while True:
        case, _ = real_case(rng, modes=2)
        laws = [PowerDamping(slope=10 ** rng.uniform(-1, 0), exponent=rng.uniform(0.5, 2)) for _ in case.vehicle.tanks]
        tanks = tuple(t.model_copy(update={"damping": x}) for t, x in zip(case.vehicle.tanks, laws, strict=True))
        case = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": tanks})})
        starts = one_sinusoid_cycles(case)
        if starts:
            break
    orbit = periodic_orbit(case, starts[0])
    x, v = orbit.waveform, case.vehicle
    p = oracle_flexible.second_order(v, np.zeros(len(tanks)))
    h = orbit.time_history(8192)
    force = np.stack(
        [-law.coefficient(t.frequency) * np.abs(h.slosh_velocity[:, j]) ** law.exponent * h.slosh_velocity[:, j]
         for j, (law, t) in enumerate(zip(laws, tanks, strict=True))]
    )  # fmt: skip
    U = 2.0 * np.fft.rfft(force, axis=-1)[:, x.number] / h.time.size
    for k, s in enumerate(1j * orbit.omega * x.number):
        right = (p.b0 + s**2 * p.b2) * x.tvc[k]
        right[2 : 2 + len(tanks)] += U[:, k]
        q = np.linalg.solve(s**2 * p.E2 + s * p.E1 + p.E0, right)
        # 1e-8 of the fundamental: aliasing of the kinked force in 8192 and in 2048 samples
        assert np.abs(q[2 : 2 + len(tanks)] - x.slosh[:, k]).max() < 1e-8 * np.abs(x.slosh).max()
        sensed = (case.autopilot.attitude_gain * p.attitude + s * case.autopilot.rate_gain * p.rate) @ q
        top, bottom = oracle_flexible.forward(case.autopilot, s)
        engine = top / bottom * sensed
        assert abs(engine - x.tvc[k]) < 1e-7 * np.abs(x.tvc).max()


def test_harmonics_die_out_and_the_amplitude_converges():
    orbit = periodic_orbit(paper_case())
    assert orbit.change < 1e-8
    assert orbit.residual < 1e-7
    assert 1e-4 < orbit.harmonics < 1e-2
    few = periodic_orbit(paper_case(), harmonics=2)
    assert "NOT converged" in str(few)
    assert few.change > 1e-8
    assert few.slosh_amplitude["LOX"] == pytest.approx(orbit.slosh_amplitude["LOX"], rel=1e-4)


# ---------------------------------------------------------------- Floquet multipliers


def variational(case, orbit, slopes):
    """Multipliers by integrating the variational equations over the orbit, delay by 16 Chebyshev points if any."""
    c = oracle.numbers(case, 0.0)
    n = len(c.m)
    E, A, b = oracle._mechanics(c)
    inverse = np.linalg.inv(E)
    size, v = len(b), n + 1
    keep = [i for i in range(size) if i != v]  # nothing depends on Z'
    read = np.zeros(size)
    read[0], read[v + 1] = c.gain * c.a0, c.gain * c.a1
    M = 16 if c.delay else 0
    total = size + M
    J = np.zeros((total, total))
    J[:size, :size] = inverse @ A
    if M:
        theta = np.cos(np.pi * np.arange(M + 1) / M)
        weight = np.where((np.arange(M + 1) % M) == 0, 2.0, 1.0) * (-1.0) ** np.arange(M + 1)
        D = np.outer(weight, 1 / weight) / (theta[:, None] - theta[None, :] + np.eye(M + 1))
        D = (D - np.diag(D.sum(axis=1))) * 2.0 / c.delay  # d/dtheta on [-delay, 0], first point is now
        J[size:, size:] = D[1:, 1:]
        J[size:, :size] = np.outer(D[1:, 0], read)
        J[:size, -1] = inverse @ b  # the engine follows the oldest command
    else:
        J[:size, :size] += np.outer(inverse @ b, read)
    keep += list(range(size, total))
    J = J[np.ix_(keep, keep)]
    columns = [keep.index(v + 2 + j) for j in range(n)]
    pushes = [inverse[keep[:size - 1], v + 2 + j] for j in range(n)]  # fmt: skip
    harmonics = 1j * orbit.omega * orbit.waveform.number

    def slope(t, y):
        Y = y.reshape(len(keep), len(keep))
        out = J @ Y
        velocity = ((harmonics * orbit.waveform.slosh) @ np.exp(harmonics * t)).real
        for j in range(n):
            out[: size - 1] += np.outer(slopes[j](velocity[j]) * pushes[j], Y[columns[j]])
        return out.ravel()

    run = scipy.integrate.solve_ivp(
        slope, (0.0, orbit.period), np.eye(len(keep)).ravel(), method="DOP853", rtol=1e-10, atol=1e-13
    )
    assert run.success
    found = np.linalg.eigvals(run.y[:, -1].reshape(len(keep), len(keep)))
    return found[np.argsort(-np.abs(found))]


@pytest.mark.parametrize(
    ("case", "slopes"),
    [
        (paper_case(), [square(0.1)[1]]),
        (paper_case(**DEGRADED), [square(0.1)[1]]),
        (beside(2.3), [square(0.1)[1]] * 2),
        (beside(2.8, delay=0.1), [square(0.1)[1]] * 2),
    ],
    ids=["one tank", "one tank with delay", "two tanks", "two tanks with delay"],
)
def test_multipliers_are_those_of_the_brute_force_monodromy_matrix(case, slopes):
    for cycle in one_sinusoid_cycles(case):
        orbit = periodic_orbit(case, cycle)
        wanted = variational(case, orbit, slopes)
        assert abs(orbit.floquet.trivial - 1.0) < 1e-6
        found = np.append(orbit.multipliers, orbit.floquet.trivial)
        wanted = wanted[np.abs(wanted) > 1e-3]
        assert len(wanted) == np.sum(np.abs(found) > 1e-3)
        for rho in wanted:
            assert np.abs(found - rho).min() < 1e-6


def test_a_disturbed_simulation_returns_at_the_rate_of_the_largest_multiplier():
    case = paper_case(**DEGRADED)
    orbit = periodic_orbit(case)
    run = simulate(case, 160.0, orbit.time_history(256).slosh[0], step=0.01, rtol=1e-10)
    z, t = run.slosh[:, 0], run.time
    k = np.flatnonzero((z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])) + 1
    peaks = z[k] - (z[k + 1] - z[k - 1]) ** 2 / (8 * (z[k - 1] - 2 * z[k] + z[k + 1]))
    away = np.abs(peaks / orbit.slosh_amplitude["LOX"] - 1.0)
    chosen = (away < 3e-3) & (away > 1e-6)  # linear, and rounding not yet in sight
    assert np.sum(chosen) > 10
    rate = np.polyfit(t[k][chosen], np.log(away[chosen]), 1)[0]
    # 5e-3: the return is linear only as far as the disturbance is small
    assert rate == pytest.approx(orbit.growth, rel=5e-3)


def test_the_unstable_cycle_of_a_dipping_law_has_one_multiplier_beyond_the_circle():
    """T26: small and large cycles attract, the middle one repels at the rate that the growth curve's slope gives."""
    case = paper_case(DIP)
    small, middle, large = sorted(limit_cycles(case), key=lambda cycle: cycle.slosh_amplitude["LOX"])
    assert periodic_orbit(case, small).stable is True
    assert periodic_orbit(case, large).stable is True
    orbit = periodic_orbit(case, middle)
    assert orbit.stable is False
    assert np.sum(np.abs(orbit.multipliers) > 1.0) == 1
    assert abs(orbit.multipliers[0].imag) < 1e-9
    a = orbit.slosh_amplitude["LOX"]
    curve = growth_curve(case, amplitude=a * np.array([0.999, 1.001]))
    # a' = sigma(a) a, so a disturbance grows at a dsigma/da; 2 %: averaging is first order in the damping
    assert orbit.growth == pytest.approx(np.diff(curve.growth)[0] / 0.002, rel=0.02)
    # of a case with several cycles the attracting one with the greatest engine angle is returned
    assert periodic_orbit(case).slosh_amplitude["LOX"] == pytest.approx(large.slosh_amplitude["LOX"], rel=1e-3)


def test_multipliers_and_winding_agree_on_random_vehicles():
    rng = np.random.default_rng(72)
    count = 0
    while count < 6:
        case, _ = random_case(rng)
        law = PowerDamping(slope=10 ** rng.uniform(-1.5, 0), exponent=rng.uniform(0.5, 2))
        tanks = tuple(t.model_copy(update={"damping": law}) for t in case.vehicle.tanks)
        case = case.model_copy(update={"vehicle": case.vehicle.model_copy(update={"tanks": tanks})})
        for cycle in one_sinusoid_cycles(case):
            orbit = periodic_orbit(case, cycle)
            assert orbit.stable is not None, orbit
            assert abs(orbit.floquet.trivial - 1.0) < 1e-6
            count += 1


# ---------------------------------------------------------------- refusals


def test_what_the_balance_does_not_know_is_refused():
    late = TableDamping(amplitude=[0.01, 0.9], ratio=[0.001, 0.09])
    with pytest.raises(OutsideValidity, match=r"starts at 0\.01 m"):
        periodic_orbit(paper_case(late))
    with pytest.raises(OutsideValidity, match="no one-sinusoid limit cycle"):
        periodic_orbit(paper_case(xi(0.2)))
    (cycle,) = limit_cycles(paper_case())
    top = cycle.omega * cycle.slosh_amplitude["LOX"] / 2.0
    ends = TableDamping(amplitude=[0.0, 0.1, top], ratio=[0.0, 0.01, 0.1 * top])
    with pytest.raises(OutsideValidity, match="damping data"):
        periodic_orbit(paper_case(ends), cycle)
    formula = PowerDamping(slope=0.1, largest_amplitude=top)
    with pytest.raises(OutsideValidity, match="damping data"):
        periodic_orbit(paper_case(formula), cycle)
    wide = paper_case(PowerDamping(slope=0.1, largest_amplitude=1.1 * top))
    assert periodic_orbit(wide, cycle).omega == periodic_orbit(paper_case(), cycle).omega
    with pytest.raises(ValueError, match="one case"):
        periodic_orbit(paper_case(vehicle={"mass": np.array([15000.0, 16000.0])}))


@pytest.mark.parametrize(
    ("limit", "words"), [({"deflection_limit": 1e-3}, "engine command"), ({"rate_limit": 2e-3}, "engine rate")]
)
def test_an_engine_at_its_limit_is_refused(limit, words):
    """T31: beyond a limit of the actuator only a simulation tells."""
    actuator = {"frequency": 100.0, "damping": 0.7}
    with pytest.raises(OutsideValidity, match=words):
        periodic_orbit(paper_case(actuator=Actuator(**actuator | limit)))
    free = periodic_orbit(paper_case(actuator=Actuator(**actuator | {k: 10 * x for k, x in limit.items()})))
    assert free.tvc_amplitude > 1e-3


def test_rest_is_not_taken_for_an_orbit():
    (cycle,) = limit_cycles(paper_case(PAPER_LAW))
    with pytest.raises(OutsideValidity, match="no periodic motion"):
        periodic_orbit(paper_case(xi(0.05)), cycle)
