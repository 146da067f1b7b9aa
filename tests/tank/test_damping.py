"""Wall and baffle damping against the given numbers, their limits, and the law that a case takes."""

import numpy as np
import pytest
from tanks import CAPSULE, CYLINDER, tank

from sloshpy.errors import OutsideValidity
from sloshpy.tank import baffle_damping, slosh_masses, tank_damping, wall_damping
from sloshpy.tank.ring_baffles import ring_coefficient
from sloshpy.tank.tank import Tank
from sloshpy.tank.wall_damping import mikishev_cylinder, mikishev_sphere, stephens_cylinder

# nu m^2/s, R m, g m/s^2, h m: Mikishev and Dorozhkin, Stephens and others
CYLINDERS = [
    ((1e-6, 0.5, 9.81, 1.0), 7.647e-4, 7.892e-4),
    ((1e-6, 1.0, 9.81, 2.0), 4.547e-4, 4.693e-4),
    ((1e-6, 0.5, 9.81, 0.25), 1.058e-3, 1.136e-3),
    ((1.7e-7, 5.03, 9.81, 10.0), 5.58e-5, 5.76e-5),
]


@pytest.mark.parametrize(("given", "mikishev", "stephens"), CYLINDERS)
def test_smooth_cylinders_have_the_given_damping(given, mikishev, stephens):
    assert mikishev_cylinder(*given) == pytest.approx(mikishev, rel=1e-3)
    assert stephens_cylinder(*given) == pytest.approx(stephens, rel=1e-3)


@pytest.mark.parametrize(("h", "ratio"), [(0.5, 3.648e-3), (1.0, 1.824e-3), (1.5, 3.073e-3)])
def test_smooth_spheres_have_the_damping_of_the_formula(h, ratio):
    assert mikishev_sphere(1e-6, 1.0, 9.81, h) == pytest.approx(ratio, rel=1e-3)


def _viscous(shape, fill, nu=1e-6, **more) -> Tank:
    liquid = {"density": 1000.0, "kinematic_viscosity": nu}
    return Tank(name="LOX", fill=fill, acceleration=9.81, liquid=liquid, shape=shape, **more)


def test_the_lesser_damping_is_taken_and_named():
    found = wall_damping(slosh_masses(_viscous({"kind": "cylinder", "radius": 0.5, "height": 3.0}, 1.0)))
    assert found.ratio == pytest.approx(7.647e-4, rel=1e-3)
    assert "Mikishev" in str(found)
    assert "Stephens" in str(found)
    assert found.law.ratio(0.1) == found.ratio


def test_wall_damping_is_refused_where_no_formula_holds():
    with pytest.raises(OutsideValidity, match="viscosity"):
        wall_damping(slosh_masses(tank(CYLINDER, 2.0)))
    with pytest.raises(OutsideValidity, match="no formula of wall damping for a capsule"):
        wall_damping(slosh_masses(_viscous(CAPSULE, "50 %")))


@pytest.mark.parametrize(
    ("w", "d", "eta", "ratio"),
    [
        (0.1, 0.1, 0.05, 0.03308),
        (0.1, 0.2, 0.05, 0.02089),
        (0.1, 0, 0.1, 0.07412),
        (0.05, 0.1, 0.02, 0.00769),
        (0.15, 0.1, 0.1, 0.08259),
    ],
)
def test_one_ring_has_miles_damping(w, d, eta, ratio):
    assert ring_coefficient(w, d) * np.sqrt(eta) == pytest.approx(ratio, abs=6e-6)


def _ringed(*heights, width=0.2, fill=5.0, shape=CYLINDER):
    rings = [{"height": z, "width": width} for z in heights]
    return slosh_masses(tank(shape, fill, baffle=rings))


def test_rings_in_series_add_and_dry_ones_count_for_nothing():
    one, other, both = (baffle_damping(_ringed(*z)) for z in ((4.8,), (4.0,), (4.8, 4.0, 6.0)))
    assert both.coefficient == pytest.approx(one.coefficient + other.coefficient)
    assert len(both.rings) == 2
    assert "above the surface" in both.reasons[0]


def test_the_default_decay_is_the_conservative_one_and_named():
    found = _ringed(4.5)
    careful, miles = baffle_damping(found), baffle_damping(found, "miles")
    assert careful.coefficient / miles.coefficient == pytest.approx(np.exp(-4.6 * 0.55 * 0.25))
    assert "Coogan and Green" in str(careful)
    assert "not conservative" in str(miles)


def test_the_law_is_in_slosh_mass_displacement():
    found = baffle_damping(_ringed(4.5), "miles")
    A = 0.05
    eta = 2.0 * 1.841184 / (1.841184**2 - 1.0) * np.tanh(1.841184 * 2.5) * A
    expected = 2.83 * np.exp(-4.6 * 0.25) * (0.1 * 1.9) ** 1.5 * np.sqrt(eta / 2.0)
    assert float(found.law.ratio(A)) == pytest.approx(expected, rel=1e-6)
    assert float(found.ratio(A)) == pytest.approx(expected, rel=1e-6)
    assert np.isnan(found.ratio(0.2))  # a wave of more than a tenth of the radius
    assert found.largest_amplitude == pytest.approx(0.2 / (eta / A))


@pytest.mark.parametrize(
    ("modes", "why"),
    [
        (lambda: _ringed(), "no ring baffle is wet"),
        (lambda: _ringed(6.0), "no ring baffle is wet"),
        (lambda: _ringed(4.5, width=0.5), "wider than 0.2"),
        (lambda: _ringed(0.6, fill=0.9, shape=CAPSULE), "formula is of a cylinder"),
    ],
)
def test_baffle_damping_is_refused_outside_its_formula(modes, why):
    with pytest.raises(OutsideValidity, match=why):
        baffle_damping(modes())


def test_what_strains_the_formula_is_told():
    assert any("comes out" in reason for reason in baffle_damping(_ringed(4.95)).reasons)
    assert any("below the lowest ring" in reason for reason in baffle_damping(_ringed(1.5)).reasons)


def test_wall_and_rings_work_together_and_what_is_refused_is_told():
    shape = {"kind": "cylinder", "radius": 2.0, "height": 9.0}
    both = tank_damping(slosh_masses(_viscous(shape, 5.0, baffle=[{"height": 4.5, "width": 0.2}])))
    assert both.wall is not None
    assert both.baffles is not None
    A = 0.05
    assert float(both.law.ratio(A)) == pytest.approx(both.wall.ratio + float(both.baffles.ratio(A)))
    assert both.to_dict()["baffle_damping"]["coefficient"] * A**0.5 == pytest.approx(float(both.baffles.ratio(A)))
    none = tank_damping(slosh_masses(_viscous(CAPSULE, "50 %")))
    assert none.to_dict()["wall_damping"] is None
    assert "capsule" in str(none)
    with pytest.raises(OutsideValidity, match="capsule"):
        none.law  # noqa: B018
