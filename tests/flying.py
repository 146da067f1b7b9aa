"""Flights for tests of their simulation: the paper's stage with everything changing that a burn changes."""

import numpy as np

from cases import PAPER_LAW, paper_case
from sloshpy.autopilot import Actuator, Filter
from sloshpy.damping import ConstantDamping, PowerDamping, SumDamping, TableDamping
from sloshpy.flight import Phase
from sloshpy.vehicle import Aerodynamics, FlexibleMode, ModeShape, ModeSlope, SloshMass

LIMITED = Actuator(frequency=20.0, damping=0.7, deflection_limit=1e-3, rate_limit=2e-3, deadband=2e-4)
TABLE = TableDamping(amplitude=np.array([0.0, 0.1, 0.4, 2.0]), ratio=np.array([0.002, 0.01, 0.04, 0.1]))
MIXED = SumDamping(of=(ConstantDamping(ratio=0.004), PowerDamping(slope=0.05, exponent=0.5), TABLE))
SOFT = Filter(numerator=(144.0,), denominator=(1.0, 14.4, 144.0))
WIDE = Filter(numerator=(225.0,), denominator=(1.0, 18.0, 225.0))
AIR = Aerodynamics(normal_force_slope=2e5, center_of_pressure=8.0, speed=400.0)
BENDING = FlexibleMode(
    name="first",
    frequency=9.0,
    damping=0.01,
    generalized_mass=8e3,
    gimbal=ModeShape(deflection=1.0, slope=-0.08),
    gyro=ModeSlope(slope=0.04),
    tank={"LOX": ModeShape(deflection=-0.3, slope=0.02)},
)
SECOND = SloshMass(name="RP", slosh_mass=400.0, station=4.0, frequency=2.9, damping=PowerDamping(slope=0.2), radius=1.0)


def burn(
    start=0.0, end=12.0, count=5, *, name="burn", law=PAPER_LAW, vehicle=None, tank=None, more=(), late=None, **pilot
):
    """A phase in which vehicle, slosh mass and gain change, all from 0 to 24 s; `late`: delays at both ends."""
    time = np.linspace(start, end, count)
    s = time / 24.0
    body = {"mass": 16e3 * (1.0 - 0.4 * s), "inertia": 9e5 * (1.0 - 0.2 * s), "cg": 6.0 + 0.3 * s}
    body["thrust"] = 9e5 * (1.0 + 0.05 * s)
    own = {"frequency": 2.0 * np.sqrt(1.0 + 0.8 * s), "slosh_mass": 1e3 * (1.0 - 0.4 * s), "station": 9.0 - s}
    given = {"attitude_gain": 0.08 * (1.0 - 0.2 * s)} | pilot
    if late is not None:
        given["delay"] = late[0] + (late[1] - late[0]) * s
    case = paper_case(law, vehicle=body | (vehicle or {}), tank=own | (tank or {}), more=more, **given)
    return Phase(name=name, time=time, case=case)


def with_laws(phase, laws):
    """The phase with a law of its own at each time, for its one tank."""
    return Phase(name=phase.name, time=phase.time, case=phase.case, laws=tuple((law,) for law in laws))
