"""Wall and baffle damping against the given numbers, their limits, and the law that a case takes."""

import numpy as np
import pytest
from tanks import BULKHEAD, CAPSULE, CYLINDER, SPHERE, tank

from sloshpy.errors import OutsideValidity
from sloshpy.tank import baffle_damping, slosh_masses, tank_damping, wall_damping
from sloshpy.tank.ring_baffles import ring_coefficient
from sloshpy.tank.tank import Tank
from sloshpy.tank.wall_damping import mikishev_cylinder, mikishev_sphere, stephens_cylinder, sumner_toroid

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
    with pytest.raises(OutsideValidity, match="layer is not thin"):
        wall_damping(slosh_masses(_viscous(CAPSULE, "50 %", nu=0.5)))


def test_a_shape_without_tests_has_the_calibrated_boundary_layer_and_says_so():
    """The wave number, friction and factor by hand: a deep barrel is a deep cylinder."""
    found = wall_damping(slosh_masses(_viscous({"kind": "capsule", "radius": 0.5, "barrel": 9.0, "dome": 0.3}, 6.0)))
    assert found.ratio == pytest.approx(mikishev_cylinder(1e-6, 0.5, 9.81, 6.0), rel=2e-3)
    assert found.formula == "boundary layer x 1.42, calibrated on cylinders"
    assert found.ratio == pytest.approx(1.42 * found.layer)
    assert "no test of such a tank" in str(found)


def test_a_sphere_takes_the_lesser_of_its_formula_and_the_boundary_layer():
    """At R = 1 m the fit of small spheres lies far above what theory bears out; both are named."""
    found = wall_damping(slosh_masses(_viscous({"kind": "sphere", "radius": 1.0}, 1.0)))
    assert found.others == {"Mikishev and Dorozhkin": pytest.approx(1.824e-3, rel=1e-3)}
    assert found.ratio < found.others["Mikishev and Dorozhkin"]
    more = found.others["Mikishev and Dorozhkin"] / found.ratio
    assert f"gives {more:.3g} times as much; the lower of the two was chosen, to be safe" in str(found)


def test_cones_take_the_published_formula_to_20_degrees():
    narrow, wide = (
        wall_damping(slosh_masses(_viscous({"kind": "cone", "half_angle": a, "height": 4.0}, 1.0))) for a in (0.2, 0.4)
    )
    assert narrow.formula == "SP-106, cone"
    assert wide.formula.startswith("boundary layer")
    R, a = np.tan(0.2), np.degrees(0.2)
    by_hand = 0.79004 * (1.0037 + 0.0126 * a) / np.sqrt(1.001 - 0.0031 * a - 0.0003 * a**2)
    assert narrow.ratio == pytest.approx(by_hand * 1e-3 * R**-0.75 * 9.81**-0.25, rel=1e-4)


@pytest.mark.parametrize(("ring", "tested"), [(0.094, False), (0.0951, True), (0.2219, True), (0.223, False)])
def test_toroids_take_the_fit_of_tests_within_their_geometry_only(ring, tested):
    """The fit at half full: 0.10393 - 0.47444 + 0.88958 - 0.83795 + 0.3865 = 0.06762 of decrement."""
    found = wall_damping(slosh_masses(_viscous(_toroid(ring), 0.0635, nu=3.3e-6)))
    given = {found.formula: found.ratio} | found.others
    assert ("Sumner, toroid" in given) is tested
    if tested:
        assert given["Sumner, toroid"] == pytest.approx(0.06762 / (2.0 * np.pi), rel=2e-4)
    assert found.ratio == min(given.values())


def test_the_fit_of_toroids_scales_with_the_root_of_the_layer():
    one = sumner_toroid(3.3e-6, 0.0635, 9.81, 0.03)
    assert sumner_toroid(4.0 * 3.3e-6, 0.0635, 9.81, 0.03) == pytest.approx(2.0 * one)
    assert sumner_toroid(3.3e-6, 16.0 * 0.0635, 9.81, 16.0 * 0.03) == pytest.approx(one / 8.0)


def _toroid(ring):
    return {"kind": "toroid", "ring_radius": ring, "tube_radius": 0.0635}


def test_a_higher_mode_has_the_boundary_layer_alone():
    modes = slosh_masses(_viscous(CYLINDER, 5.0, modes=2, baffle=[{"height": 4.5, "width": 0.2}], damping_floor=0.01))
    second = tank_damping(modes, 2)
    assert second.baffles is None
    assert second.floor is None
    assert second.wall is not None
    assert second.wall.formula.startswith("boundary layer")
    k = 5.331442773525033 / 2.0  # S/V of a deep mode, and w = (9.81 k)^(1/2)
    deep = 1.42 * np.sqrt(1e-6 / (2.0 * np.sqrt(9.81 * k))) * 0.5 / 2.0 * (4 * k**2 + 1) / (4 * k**2 - 1)
    assert second.wall.ratio == pytest.approx(deep, rel=1e-4)
    assert any("of the first mode" in reason for reason in second.reasons)


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


WAISTED = {
    "kind": "contour",
    "z": [0, 0, 1, 2, 3],
    "r": [0, 1, 0.5, 1, 1],
}  # the barrel ends 0.2 m below the ring, 0.3 m deep
BULGED = {"kind": "contour", "z": [0, 0, 2.25, 2.35, 2.45, 3], "r": [0, 1, 1, 0.9, 1, 1], "straight": True}


@pytest.mark.parametrize(
    ("modes", "why"),
    [
        (lambda: _ringed(), "no ring baffle is wet"),
        (lambda: _ringed(6.0), "no ring baffle is wet"),
        (lambda: _ringed(4.5, width=0.5), "wider than 0.2"),
        (lambda: _ringed(0.6, fill=0.9, shape=CAPSULE), "formula is of a cylinder"),
        (lambda: _ringed(0.8, width=0.1, fill=1.2, shape=SPHERE | {"radius": 1.0}), "radius is 0.* m at 0.7 m"),
        (
            lambda: _ringed(2.0, fill=4.0, shape={"kind": "spheroid", "radius": 2.0, "half_height": 3.0}),
            "of a cylinder",
        ),
        (lambda: _ringed(2.2, width=0.1, fill=2.5, shape=WAISTED), "formula is of a cylinder"),
        (lambda: _ringed(2.2, width=0.1, fill=2.5, shape=BULGED), "radius is 0.9 m at 2.35 m"),
        (lambda: _ringed(0.6, width=0.2, fill=2.0, shape=BULKHEAD), "an inner wall rises to 0.5 m"),
    ],
)
def test_baffle_damping_is_refused_outside_its_formula(modes, why):
    with pytest.raises(OutsideValidity, match=why):
        baffle_damping(modes())


def test_a_ring_in_the_barrel_of_a_capsule_counts_as_in_a_cylinder_and_is_left_out_near_its_end():
    """Barrel from 1.2 to 4.2 m."""
    high, both = (baffle_damping(_ringed(*z, fill=4.0, shape=CAPSULE)) for z in ((3.0,), (3.0, 2.0)))
    assert high.coefficient == pytest.approx(ring_coefficient(0.1, 0.5, "coogan-green"))
    assert not any("less than the ring's depth" in reason for reason in high.reasons)
    assert both.coefficient == high.coefficient
    assert any("below the ring of 2 m: left out" in reason for reason in both.reasons)
    with pytest.raises(OutsideValidity, match=r"by the ring of 2 m"):
        baffle_damping(_ringed(2.0, fill=4.0, shape=CAPSULE))
    with pytest.raises(OutsideValidity, match=r"by the ring of 1.3 m"):
        baffle_damping(_ringed(1.3, fill=4.0, shape=CAPSULE))


def test_what_strains_the_formula_is_told():
    alone, beside, deep = (baffle_damping(_ringed(*z)) for z in ((4.95,), (4.95, 4.0), (4.0,)))
    assert any("comes out" in reason for reason in alone.reasons)
    assert alone.largest_amplitude * alone.wave_per_displacement == pytest.approx(0.05)  # the ring's depth
    assert beside.coefficient == deep.coefficient
    assert beside.largest_amplitude == deep.largest_amplitude
    assert any("left out" in reason for reason in beside.reasons)
    with pytest.raises(OutsideValidity, match="every wave lays dry"):
        baffle_damping(_ringed(5.0))
    assert any("below the lowest ring" in reason for reason in baffle_damping(_ringed(1.5)).reasons)


@pytest.mark.parametrize("depth", [0.5, 0.7, 1.3])
def test_a_ring_a_tenth_of_the_radius_deep_counts_and_is_not_said_to_be_left_out(depth):
    shape = {"kind": "cylinder", "radius": 1.0, "height": 3.0}
    found = baffle_damping(_ringed(depth - 0.1, width=0.1, fill=depth, shape=shape))
    assert len(found.rings) == 1
    assert not any("left out" in reason or "comes out" in reason for reason in found.reasons)
    lower = baffle_damping(_ringed(depth - 0.1, 0.2, width=0.05, fill=depth, shape=shape))
    assert len(lower.rings) == 2
    assert not any("left out" in reason for reason in lower.reasons)


def test_every_ring_that_a_wave_lays_dry_is_told_once():
    two = baffle_damping(_ringed(4.95, 4.9, 4.0, width=0.04))
    assert [reason for reason in two.reasons if "left out" in reason] == [
        "rings 0.05 and 0.1 m below the surface left out: they come out of a wave higher than that"
    ]
    at_surface = baffle_damping(_ringed(5.0, 4.9, width=0.04))
    assert any(reason.startswith("a ring 0 m below the surface left out") for reason in at_surface.reasons)
    assert any(reason.startswith("a ring 0.1 m below the surface comes out") for reason in at_surface.reasons)


def test_wall_and_rings_work_together_and_what_is_refused_is_told():
    shape = {"kind": "cylinder", "radius": 2.0, "height": 9.0}
    both = tank_damping(slosh_masses(_viscous(shape, 5.0, baffle=[{"height": 4.5, "width": 0.2}])))
    assert both.wall is not None
    assert both.baffles is not None
    A = 0.05
    assert float(both.law.ratio(A)) == pytest.approx(both.wall.ratio + float(both.baffles.ratio(A)))
    assert both.to_dict()["baffle_damping"]["coefficient"] * A**0.5 == pytest.approx(float(both.baffles.ratio(A)))
    none = tank_damping(slosh_masses(_viscous(CAPSULE, "50 %", nu=0.5)))
    assert none.to_dict()["wall_damping"] is None
    assert not none.known
    with pytest.raises(OutsideValidity, match="not thin"):
        none.law  # noqa: B018
    bare = tank_damping(slosh_masses(tank(CAPSULE, "50 %")))
    with pytest.raises(OutsideValidity, match="neither a viscosity nor a ring baffle nor a damping_floor"):
        bare.law  # noqa: B018


@pytest.mark.parametrize(("floor", "taken"), [(1e-6, False), (0.004, True)])
def test_a_floor_is_a_level_under_the_wall_and_no_addend(floor, taken):
    given = _viscous(CYLINDER, 5.0, baffle=[{"height": 4.5, "width": 0.2}], damping_floor=floor)
    found = tank_damping(slosh_masses(given))
    assert found.wall is not None
    assert found.baffles is not None
    least = floor if taken else found.wall.ratio
    assert float(found.law.ratio(0.0)) == least
    assert float(found.law.ratio(0.05)) == pytest.approx(least + float(found.baffles.ratio(0.05)))
    assert any("damping_floor given" in line for line in found.sources) is taken
    assert found.to_dict()["damping_floor"] == floor
    assert ("not taken" in str(found)) is not taken
    alone = tank_damping(slosh_masses(tank(CAPSULE, "50 %", damping_floor=floor)))
    assert float(alone.law.ratio(0.3)) == floor


def test_the_law_of_a_ringed_tank_ends_where_the_formula_does():
    """At a wave of a tenth of the radius, 0.2 m; 1.541 m of wave for each m of slosh mass."""
    law = tank_damping(slosh_masses(_viscous(CYLINDER, 5.0, baffle=[{"height": 4.5, "width": 0.2}]))).law
    assert law.largest_amplitude == pytest.approx(0.2 / 1.541, rel=1e-3)
    assert np.isfinite(law.ratio(0.129))
    assert np.isnan(law.ratio(0.131))
    assert np.isnan(law.acceleration(0.131 * 3.0, 3.0))


def test_a_ring_written_twice_is_refused():
    """Two rings in one place damp as one, not twice as much."""
    ring = {"height": 5.0, "width": 0.2}
    with pytest.raises(ValueError, match="together they damp as one"):
        tank(CYLINDER, 6.0, baffle=(ring, ring))
    with pytest.raises(ValueError, match="together they damp as one"):
        tank(CYLINDER, 6.0, baffle=(ring, ring | {"height": 5.1}))
    assert len(tank(CYLINDER, 6.0, baffle=(ring, ring | {"height": 5.5})).baffle) == 2
