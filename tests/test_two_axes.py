"""Two axes at once: closed-form circular cycles, and which cycle attracts, by simulation."""

import math

import numpy as np
import pytest

from cases import paper_case, xi
from sloshpy.damping import PowerDamping
from sloshpy.errors import NoAttractor, OutsideValidity
from sloshpy.limit_cycle import limit_cycles, two_axis_cycles
from sloshpy.simulation import simulate_two_axes
from sloshpy.stability import required_damping
from sloshpy.vehicle import SloshMass


@pytest.mark.parametrize("p", [0.5, 1.0, 2.0])
def test_the_circular_cycle_of_equal_loops_is_that_of_its_closed_form(p):
    """At equal amplitude a circle is damped 1/g(p) times as much: A_circle = A_plane g^(1/p)."""
    g = 2 / math.sqrt(math.pi) * math.gamma((p + 3) / 2) / math.gamma((p + 4) / 2)
    case = paper_case(PowerDamping(slope=0.1, exponent=p))
    cycles = {c.kind: c for c in two_axis_cycles(case)}
    assert set(cycles) == {"planar in pitch", "planar in yaw", "circular"}
    (planar,) = limit_cycles(case)
    assert cycles["planar in yaw"].axes[0, 0] == pytest.approx(planar.slosh_amplitude["LOX"], rel=1e-6)
    assert cycles["circular"].axes[0] == pytest.approx([planar.slosh_amplitude["LOX"] * g ** (1 / p)] * 2, rel=1e-6)
    assert cycles["circular"].tvc == pytest.approx([planar.tvc_amplitude * g ** (1 / p)] * 2, rel=1e-6)
    if p == 1.0:
        assert cycles["circular"].axes[0, 0] == pytest.approx(0.1905, abs=5e-5)  # theory sheet, section 6
        # a quarter turn behind, yaw is damped by J0 - J2 = 2/pi - 2/(3 pi): half of the neutral 8/(3 pi); sigma = xi w
        lacking = 0.5 * float(required_damping(case).neutral) * 2.0
        assert cycles["planar in pitch"].disturbance == pytest.approx(lacking, rel=0.15)


def test_equal_loops_drift_from_the_planar_into_the_circular_cycle():
    case = paper_case(delay=0.03)
    cycles = {c.kind: c for c in two_axis_cycles(case)}
    assert cycles["circular"].stable
    assert not cycles["planar in pitch"].stable
    a = cycles["planar in pitch"].axes[0, 0]
    run = simulate_two_axes(case, None, 500.0, np.array([[a, 0.0]]), np.array([[0.0, 0.002 * a]]))
    # a circle by its mean radius: what is left of the ellipse is still dying out
    assert np.mean(run.half_axes()) == pytest.approx(cycles["circular"].axes[0, 0], rel=1e-3)
    yaw = np.abs(run.slosh[:, 0, 1])
    marks = [np.max(yaw[(run.time > t) & (run.time < t + 6)]) for t in (20.0, 100.0)]
    assert np.log(marks[1] / marks[0]) / 80 == pytest.approx(cycles["planar in pitch"].disturbance, rel=0.05)


def test_unequal_loops_settle_in_the_ellipse_that_is_predicted():
    pitch, yaw = paper_case(), paper_case(gain=0.9)
    (attractor,) = [c for c in two_axis_cycles(pitch, yaw) if c.stable]
    assert attractor.kind == "elliptic"
    run = simulate_two_axes(pitch, yaw, 500.0, np.array([[0.15, 0.0]]), np.array([[0.0, 0.3]]))
    assert run.half_axes() == pytest.approx(attractor.axes[0], rel=5e-3)
    for k, value in enumerate((attractor.pitch, attractor.yaw)):
        assert run.slosh_envelope(0, k).amplitude == pytest.approx(abs(value[0]), rel=1e-3)
        assert np.max(np.abs(run.tvc[-400:, k])) == pytest.approx(attractor.tvc[k], rel=2e-3)


def test_a_stable_yaw_loop_leaves_planar_motion_in_pitch():
    """Far enough apart the yaw axis needs no energy from pitch: the planar cycle attracts."""
    calm = paper_case(vehicle={"inertia": 3e6})
    cycles = two_axis_cycles(paper_case(), calm)
    (attractor,) = [c for c in cycles if c.stable]
    assert attractor.kind == "planar in pitch"
    run = simulate_two_axes(paper_case(), calm, 500.0, np.array([[0.2, 0.0]]), np.array([[0.0, 0.2]]))
    assert run.half_axes() == pytest.approx(attractor.axes[0], rel=1e-2, abs=5e-3)


def test_two_coupled_tanks_circle_together():
    other = SloshMass(name="b", slosh_mass=500.0, station=4.0, frequency=2.1, damping=PowerDamping(slope=0.2))
    (attractor,) = [c for c in two_axis_cycles(paper_case(more=(other,))) if c.stable]
    assert attractor.kind == "circular"
    z = np.stack([attractor.pitch, attractor.yaw], axis=-1)
    start, rate = 0.9 * z.real, (1j * attractor.omega * z).real
    run = simulate_two_axes(paper_case(more=(other,)), None, 300.0, start, rate)
    for j in range(2):
        assert np.mean(run.half_axes(j)) == pytest.approx(attractor.axes[j, 0], rel=5e-3)


def test_two_axes_know_no_motion_beyond_a_formula_that_ends():
    """The circle's radius is 0.1905 m, the planar cycle's amplitude 0.2244 m; both in slosh over slosh frequency."""
    wide, narrow, circle = (PowerDamping(slope=0.1, largest_amplitude=end) for end in (0.3, 0.15, 0.21))
    assert {c.kind for c in two_axis_cycles(paper_case(wide))} == {"planar in pitch", "planar in yaw", "circular"}
    for short in (narrow, circle):  # the planar cycle, from which the circle is sought, lies beyond: it says so
        with pytest.raises(NoAttractor, match="as far as the damping data reach"):
            two_axis_cycles(paper_case(short))
    with pytest.raises(OutsideValidity, match="beyond the damping data"):
        simulate_two_axes(paper_case(narrow), None, 200.0, np.array([[0.1, 0.0]]))


def test_no_damping_law_no_cycle_and_different_tanks_are_refused():
    assert two_axis_cycles(paper_case(xi(0.01))) == ()
    with pytest.raises(ValueError, match="share their tanks"):
        two_axis_cycles(paper_case(), paper_case(tank={"slosh_mass": 900.0}))
