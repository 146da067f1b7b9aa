"""The paper's example and random vehicles, for all tests."""

import numpy as np
from pydantic import ValidationError

from sloshpy.autopilot import Actuator, Autopilot, Filter
from sloshpy.case import Case, Criteria
from sloshpy.damping import ConstantDamping, PowerDamping
from sloshpy.vehicle import Aerodynamics, Engine, FlexibleMode, ModeShape, ModeSlope, SloshMass, Vehicle

PAPER_VEHICLE = {"mass": 1.6e4, "inertia": 9e5, "cg": 6.0, "thrust": 9e5}
PAPER_TANK = {"name": "LOX", "slosh_mass": 1e3, "station": 9.0, "frequency": 2.0}
PAPER_LAW = PowerDamping(slope=0.1, exponent=1.0)


def paper_case(law=PAPER_LAW, *, vehicle=None, tank=None, criteria=None, more=(), **autopilot):
    """Table 1 with the errata; any field can be replaced."""
    return Case(
        name="paper",
        vehicle=Vehicle(
            **PAPER_VEHICLE | (vehicle or {}),
            tanks=(SloshMass(**PAPER_TANK | (tank or {}), damping=law), *more),
        ),
        autopilot=Autopilot(**{"attitude_gain": 0.08, "rate_gain": 0.14} | autopilot),
        criteria=criteria or Criteria(),
    )


def xi(ratio):
    return ConstantDamping(ratio=ratio)


def random_case(rng, tanks=None, *, delay=None, actuator=None, filters=None, least=1e-4, most=0.1):
    """A vehicle of any proportions whose rigid crossover lies near its slosh; every part may be absent."""
    n = tanks or int(rng.integers(1, 5))
    M, r, cg, a = 10 ** rng.uniform(3, 6), rng.uniform(3, 12), rng.uniform(4, 15), rng.uniform(3, 30)
    I = M * r**2
    w = rng.uniform(1.0, 5.0) * np.exp(rng.uniform(-0.35, 0.35, n))
    masses, levers = [], []
    for _ in range(n):
        m = M * 10 ** rng.uniform(-2.5, -0.8) / n
        reach = min(1.5 * r, np.sqrt(0.5 * I / (n * m)))
        masses.append(m)
        levers.append(rng.uniform(-reach, reach))
    F = M * a
    share, drag = (rng.uniform(0.3, 1.0), rng.uniform(0, 0.2) * F) if rng.random() < 0.5 else (1.0, 0.0)
    c2 = share * F * cg / I
    wc, zc = w.mean() * rng.uniform(0.15, 1.2), rng.uniform(0.3, 1.2)
    delayed = rng.random() < 0.5 if delay is None else delay
    acted = rng.random() < 0.4 if actuator is None else actuator
    filtered = rng.random() < 0.4 if filters is None else filters
    chosen = []
    if filtered:
        wf, z = wc * rng.uniform(2, 20), rng.uniform(0.3, 1)
        chosen.append(Filter(numerator=(wf**2,), denominator=(1.0, 2 * z * wf, wf**2)))
        if rng.random() < 0.5:
            wn = wc * rng.uniform(4, 15)
            chosen.append(Filter(numerator=(1.0, 0.02 * wn, wn**2), denominator=(1.0, wn, wn**2)))
        if rng.random() < 0.3:
            chosen.append(Filter(numerator=(1.0, rng.uniform(0.5, 2) * wc), denominator=(1.0, rng.uniform(2, 9) * wc)))
    damping = 10 ** rng.uniform(np.log10(least), np.log10(most), n)
    return Case(
        name="random",
        vehicle=Vehicle(
            mass=M,
            inertia=I,
            cg=cg,
            thrust=F,
            vectored_thrust=share * F,
            drag=drag,
            tanks=tuple(
                SloshMass(
                    name=f"tank {j + 1}", slosh_mass=masses[j], station=cg - levers[j], frequency=w[j], damping=xi(x)
                )
                for j, x in enumerate(damping)
            ),
        ),
        autopilot=Autopilot(
            attitude_gain=wc**2 / c2,
            rate_gain=2 * zc * wc / c2,
            gain=10 ** rng.uniform(-0.2, 0.2),
            delay=rng.uniform(0.01, 0.5) / wc if delayed else 0.0,
            actuator=Actuator(frequency=wc * rng.uniform(3, 30), damping=rng.uniform(0.4, 1.2)) if acted else None,
            filter=tuple(chosen),
        ),
    ), damping


def real_case(rng, tanks=None, modes=None, engine=None, air=None, **parts):
    """A random case that may also bend, swing heavy engines and fly through air, statically stable or not."""
    while True:
        heavy = rng.random() < 0.5 if engine is None else engine
        actuator = True if heavy else parts.get("actuator")
        case, damping = random_case(rng, tanks, **parts | {"actuator": actuator})
        v = case.vehicle
        r = np.sqrt(v.inertia / v.mass)
        fastest = max(t.frequency for t in v.tanks)

        def shape(most, r=r):
            return ModeShape(deflection=rng.uniform(-most, most), slope=rng.uniform(-1, 1) / r)

        count = int(rng.integers(0, 4)) if modes is None else modes
        bending = tuple(
            FlexibleMode(
                name=f"bending {i + 1}",
                frequency=fastest * rng.uniform(1.3, 4) * (1 + i),
                damping=10 ** rng.uniform(-2.7, -1.5),
                generalized_mass=v.mass * 10 ** rng.uniform(-1, 0.5),
                gimbal=ModeShape(deflection=rng.uniform(-1, 1), slope=rng.uniform(-0.5, 0.5) / r),
                gyro=ModeSlope(slope=rng.uniform(-0.5, 0.5) / r),
                rate_gyro=ModeSlope(slope=rng.uniform(-0.5, 0.5) / r) if rng.random() < 0.5 else None,
                tank={t.name: shape(0.8) for t in v.tanks},
            )
            for i in range(count)
        )
        flies = rng.random() < 0.5 if air is None else air
        given = {k: getattr(v, k) for k in type(v).model_fields}
        S = v.mass * 10 ** rng.uniform(-3, -1.3)  # kg m: a metre of engine with up to a twentieth of the mass
        given |= {
            "flexible_modes": bending,
            "engine": Engine(first_moment=S, inertia=S * rng.uniform(0.5, 3)) if heavy else None,
            "aerodynamics": Aerodynamics(
                normal_force_slope=v.thrust * 10 ** rng.uniform(-2, 0),
                center_of_pressure=v.cg + rng.uniform(-0.7, 1.2) * r,
                speed=rng.uniform(50, 1500),
            )
            if flies
            else None,
        }
        try:
            return case.model_copy(update={"vehicle": Vehicle(**given)}), damping
        except ValidationError:  # the mass matrix is indefinite: another one
            continue


def sensed_case(rng, **parts):
    """A random case as `real_case` whose autopilot also feeds a lateral accelerometer back, with the lag it needs."""
    case, damping = real_case(rng, **parts)
    v, pilot = case.vehicle, case.autopilot
    r = np.sqrt(v.inertia / v.mass)
    station = v.cg + rng.uniform(-1.2, 1.5) * r
    modes = tuple(
        f.model_copy(
            update={"accelerometer": ModeShape(deflection=rng.uniform(-0.5, 0.5), slope=rng.uniform(-0.5, 0.5) / r)}
        )
        for f in v.flexible_modes
    )
    at_once = abs(v.vectored_thrust / v.mass - (station - v.cg) * v.vectored_thrust * v.cg / v.inertia)
    crossover = 2 * np.sqrt(pilot.attitude_gain * v.vectored_thrust * v.cg / v.inertia)
    lags = list(pilot.filter)
    wanted = 3 if v.engine else 1
    while pilot.model_copy(update={"filter": tuple(lags)}).lag_order < wanted:
        lags.append(Filter(numerator=(1.0,), denominator=(1.0 / (crossover * rng.uniform(2, 15)), 1.0)))
    given = {k: getattr(v, k) for k in type(v).model_fields}
    given |= {"flexible_modes": modes, "accelerometer_station": station}
    control = {k: getattr(pilot, k) for k in type(pilot).model_fields}
    control |= {"filter": tuple(lags), "accelerometer_gain": rng.uniform(-0.6, 0.8) / at_once}
    return Case(name="sensed", vehicle=Vehicle(**given), autopilot=Autopilot(**control)), damping


def guided_case(rng, *, kind=None, felt=None, **parts):
    """A random case whose autopilot also holds the drift: by Z and Z' ("both"), by either, at times the wrong way."""
    case, damping = (
        sensed_case(rng, **parts) if (rng.random() < 0.4 if felt is None else felt) else real_case(rng, **parts)
    )
    v, pilot = case.vehicle, case.autopilot
    crossover = np.sqrt(pilot.attitude_gain * v.vectored_thrust * v.cg / v.inertia)
    slow, a = crossover * 10 ** rng.uniform(-2, -0.5), v.acceleration
    sign = -1.0 if rng.random() < 0.15 else 1.0
    gains = {
        "drift_gain": sign * slow**2 * pilot.attitude_gain / a,
        "drift_rate_gain": 2 * rng.uniform(0.3, 1.0) * slow * pilot.attitude_gain / a,
    }
    kind = kind or rng.choice(["both", "both", "rate", "position"])
    if kind != "both":
        del gains["drift_gain" if kind == "rate" else "drift_rate_gain"]
    given = {k: getattr(pilot, k) for k in type(pilot).model_fields}
    return case.model_copy(update={"autopilot": Autopilot(**given | gains)}), damping


def lawful_case(seed, number):
    """Vehicle `number` of a fleet with every part, each tank with a power law, and a limit of the engine of its own."""
    rng = np.random.default_rng([seed, number])
    case, _ = real_case(rng)
    laws = [
        PowerDamping(slope=10 ** rng.uniform(-2.0, 0.3), exponent=float(rng.choice([0.5, 1.0, 1.7])))
        for _ in case.vehicle.tanks
    ]
    tanks = tuple(t.model_copy(update={"damping": law}) for t, law in zip(case.vehicle.tanks, laws, strict=True))
    vehicle = case.vehicle.model_copy(update={"tanks": tanks})
    criteria = Criteria(tvc_amplitude=10 ** rng.uniform(-3.5, -1.5))
    return case.model_copy(update={"vehicle": vehicle, "criteria": criteria})
