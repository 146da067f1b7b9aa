"""A sound case file that the tests of files spoil in one place at a time."""

from collections.abc import Callable

from sloshpy.errors import Problem

GOOD = """\
name = "A stage"

[vehicle]
mass = "16000 kg"
inertia = "9e5 kg*m^2"
cg = "6 m"
thrust = "900 kN"

[[tank]]
name = "LOX"
slosh_mass = "1000 kg"
station = "9 m"
frequency = "2 rad/s"
damping = { law = "power", slope = "0.1 1/m", exponent = 1 }

[[tank]]
name = "LH2"
slosh_mass = "100 kg"
station = "12 m"
frequency = "0.5 Hz"

[tank.damping]
law = "constant"
ratio = 0.01

[autopilot]
attitude_gain = 0.08
rate_gain = "0.14 s"

[[autopilot.filter]]
numerator = [1.0]
denominator = [
  0.02,
  1.0,
]

[criteria]
gain_margin = "6 dB"
"""
POWER = '{ law = "power", slope = "0.1 1/m", exponent = 1 }'

Refuse = Callable[..., list[Problem]]
