"""Slosh masses against closed forms, exact families, conservation and published values."""

from typing import Any

import numpy as np
import pytest
from tanks import (
    ANNULUS,
    BULKHEAD,
    CAPSULE,
    CONE_30,
    CONE_45,
    CYLINDER,
    DENSITY,
    SPHERE,
    SPHEROID,
    SUMP,
    TOROID,
    hyperboloid,
    tank,
)

from sloshpy.tank import slosh_masses, slosh_masses_history
from sloshpy.tank.closed_form import flat_bottom
from sloshpy.tank.eigen import modes_by_elements

# h/R: kappa R, m1/mT, H_s/R, hinge/R, m2/mT of the flat-bottomed cylinder: SP-106's formulas
CYLINDER_VALUES = {
    0.5: (1.337026, 0.660108, 0.032556, 0.780484, 0.027094),
    1.0: (1.750798, 0.432197, 0.211184, 0.782353, 0.013678),
    2.0: (1.838854, 0.226967, 0.967068, 1.510885, 0.006839),
    3.0: (1.841125, 0.151498, 1.922380, 2.465526, 0.004560),
}
# rigid-lid inertia over that of the same liquid frozen
LID = {0.5: 0.74432, 1.0: 0.34955, 1.5: 0.16105, 2.0: 0.16366, 3.0: 0.35613, 4.0: 0.53825, 6.0: 0.74753}


@pytest.mark.parametrize(("depth", "values"), CYLINDER_VALUES.items())
def test_a_cylinder_has_the_published_values(depth, values):
    found = slosh_masses(tank({"kind": "cylinder", "radius": 1.0, "height": 9.0}, depth, 2))
    assert found.method == "closed form"
    share = found.slosh_mass / found.liquid_mass
    said = (found.kappa[0], share[0], found.spring_height[0], found.hinge_height[0], share[1])
    assert said == pytest.approx(values, abs=6e-7)
    assert found.liquid_mass == pytest.approx(DENSITY * np.pi * depth)
    assert found.wave_per_displacement[0] == pytest.approx(2 * 1.841184 / (1.841184**2 - 1) * np.tanh(1.841184 * depth))
    assert found.frequency[0] == pytest.approx(np.sqrt(12.1 * values[0]), rel=1e-6)


@pytest.mark.parametrize(("depth", "ratio"), LID.items())
def test_a_lid_on_a_cylinder_leaves_a_part_of_the_frozen_inertia(depth, ratio):
    found = slosh_masses(tank({"kind": "cylinder", "radius": 1.0, "height": 9.0}, depth))
    frozen = found.liquid_mass * (0.25 + depth**2 / 12.0)
    assert found.rigid_lid_inertia / frozen == pytest.approx(ratio, abs=6e-6)


@pytest.mark.parametrize("shape", [CYLINDER, ANNULUS], ids=lambda s: s["kind"])
@pytest.mark.parametrize("depth", [0.1, 1.0, 4.0])
def test_finite_elements_agree_with_bessel_functions_within_their_estimate(shape, depth):
    section = tank(shape, depth).section
    exact, found = flat_bottom(section, 3), modes_by_elements(section, 3, 2)
    n = slice(0, 2)
    errors = [
        found.kappa / exact.kappa - 1.0,
        (found.mass_volume - exact.mass_volume) / np.maximum(exact.mass_volume, 1e-3 * section.volume),
        (found.spring_height - exact.spring_height) / section.radius,
        np.minimum(exact.mass_volume / (1e-3 * section.volume), 1.0) * (found.wave / exact.wave - 1.0),
        np.full(3, found.lid_volume / exact.lid_volume - 1.0),
    ]
    worst = np.max(np.abs(errors), axis=0)[n]
    assert np.all(worst < 1e-6)
    assert np.all(worst < 3.0 * found.error[n])


@pytest.mark.parametrize(("ratio", "xi"), [(0.5, 1.35467), (0.3, 1.58206)])
def test_an_annulus_has_the_published_wave_number(ratio, xi):
    shape = {"kind": "annulus", "radius": 1.0, "inner_radius": ratio, "height": 30.0}
    assert slosh_masses(tank(shape, 20.0)).kappa[0] == pytest.approx(xi, abs=6e-6)  # deep: kappa = xi / R


def test_a_45_degree_cone_is_exact():
    found = slosh_masses(tank(CONE_45, 2.0, 3))
    assert found.kappa[0] * 2.0 == pytest.approx(1.0, abs=1e-9)
    assert found.slosh_mass[0] / found.liquid_mass == pytest.approx(0.75, abs=1e-9)
    assert np.all(found.slosh_mass[1:] / found.liquid_mass < 1e-9)
    assert found.spring_height[0] / 2.0 == pytest.approx(0.6, abs=1e-8)
    assert found.hinge_height[0] / 2.0 == pytest.approx(1.6, abs=1e-8)


@pytest.mark.parametrize("b", [0.4, 1.5])
@pytest.mark.parametrize("depth", [0.05, 0.9])
def test_the_hyperboloids_of_a_contour_have_one_exact_slosh_mass(b, depth):
    found = slosh_masses(tank(hyperboloid(b, b), depth, 2))
    a = np.sqrt((depth + b) ** 2 - b**2)
    errors = [
        found.kappa[0] * (depth + b) - 1.0,
        found.slosh_mass[0] / (DENSITY * np.pi * a**4 * found.kappa[0] / 4.0) - 1.0,
        found.slosh_mass[1] / found.slosh_mass[0],
    ]
    assert np.max(np.abs(errors)) < 3.0 * found.error_estimate[0]
    assert found.error_estimate[0] < 2e-5  # what 80 points of a contour leave open


@pytest.mark.parametrize("fill", ["1 %", "30 %", "50 %", "80 %", "99 %"])
def test_the_hinge_of_a_sphere_is_its_centre(fill):
    found = slosh_masses(tank(SPHERE, fill, 3))
    np.testing.assert_allclose(found.hinge_height, 2.0, atol=2e-6 * 2.0)


@pytest.mark.parametrize(("depth", "kappa"), [(0.2, 1.072325), (1.0, 1.560157), (1.6, 2.686348)])
def test_a_sphere_has_the_given_frequencies(depth, kappa):
    found = slosh_masses(tank({"kind": "sphere", "radius": 1.0}, depth))
    assert found.kappa[0] == pytest.approx(kappa, abs=6e-7)
    if depth == 1.0:
        assert found.slosh_mass[0] / found.liquid_mass == pytest.approx(0.579693, abs=6e-7)
        assert found.spring_height[0] == pytest.approx(0.359039, abs=1.1e-6)  # 1 - 1/1.560157 = 0.359039


def test_a_30_degree_cone_has_the_given_values():
    found = slosh_masses(tank(CONE_30, 1.0))
    assert found.kappa[0] == pytest.approx(2.259278, abs=6e-7)
    assert found.slosh_mass[0] / found.liquid_mass == pytest.approx(0.564203, abs=6e-7)


SUM_RULE = {
    "cylinder": (CYLINDER, "40 %"),
    "annulus": (ANNULUS, "40 %"),
    "capsule, surface in the lower dome": (CAPSULE, "5 %"),
    "capsule, surface in the barrel": (CAPSULE, "60 %"),
    "capsule, surface in the upper dome": (CAPSULE, "96 %"),
    "sphere": (SPHERE, "50 %"),
    "spheroid": (SPHEROID, "30 %"),
    "cone": (CONE_30, "50 %"),
    "toroid": (TOROID, "50 %"),
    "bulkhead, surface below its top": (BULKHEAD, 0.3),
    "bulkhead, surface above its top": (BULKHEAD, 0.8),
    "sump": (SUMP, 0.5),
}


@pytest.mark.parametrize("name", SUM_RULE)
def test_the_slosh_masses_tilt_the_surface_as_statics_wants(name):
    """Sum of m_n L_n = rho I_surface, from below: every mode adds, and the rest shrinks."""
    found = slosh_masses(tank(*SUM_RULE[name], modes=10), tolerance=1e-5)
    rest = 1.0 - np.cumsum(found.slosh_mass * found.pendulum_length) / (DENSITY * found.section.surface_inertia)
    assert np.all(np.diff(rest) < 1e-7)
    assert np.all(rest > -1e-5)
    assert rest[-1] < 2e-3


@pytest.mark.parametrize("name", SUM_RULE)
def test_slosh_and_fixed_masses_add_up_to_the_liquid(name):
    found = slosh_masses(tank(*SUM_RULE[name], modes=2))
    m, H = np.append(found.slosh_mass, found.fixed_mass), np.append(found.spring_height, found.fixed_mass_height)
    H_cg = found.liquid_cg_height
    assert np.sum(m) == pytest.approx(found.liquid_mass)
    assert m @ H == pytest.approx(found.liquid_mass * H_cg)
    assert found.fixed_mass_inertia + m @ (H - H_cg) ** 2 == pytest.approx(found.rigid_lid_inertia)


def test_a_liquid_in_a_full_sphere_does_not_turn_with_it():
    nearly = slosh_masses(tank(SPHERE, "99.999 %"))
    frozen = 0.4 * nearly.liquid_mass * 2.0**2
    assert nearly.rigid_lid_inertia < 1e-4 * frozen


def test_a_toroid_needs_two_slosh_masses_and_says_so():
    one, two = (slosh_masses(tank(TOROID, "50 %", n)) for n in (1, 2))
    assert two.slosh_mass[1] > 0.1 * two.slosh_mass[0]
    assert "mode 2 holds" in one.reasons[0]
    assert "mode 2 holds" in str(one)
    assert two.reasons == ()


@pytest.mark.parametrize("shape", [SPHERE, CAPSULE, SPHEROID, TOROID], ids=lambda s: s["kind"])
@pytest.mark.parametrize("fill", ["1 %", "99 %"])
def test_nearly_empty_and_nearly_full_tanks_converge(shape, fill):
    found = slosh_masses(tank(shape, fill))
    assert found.error_estimate[0] < 1e-6
    assert 0.0 < found.slosh_mass[0] < found.liquid_mass


@pytest.mark.parametrize("above", [1e-12, 1e-7, 1e-4, 1e-3, 2.7e-3, 1e-2])
@pytest.mark.parametrize("edge", [1.2, 4.2])
def test_a_surface_just_above_an_edge_of_the_wall_differs_little_from_one_just_below(edge, above):
    """The dome leads smoothly into the barrel: nothing jumps where the surface passes from one to the other."""
    over, under = (slosh_masses(tank(CAPSULE, edge + e)) for e in (above, -above))
    near = 2.0 * 2.0 * above + 2e-5  # none of them changes by more than a factor e in half a metre of depth
    assert over.kappa[0] == pytest.approx(under.kappa[0], rel=near)
    assert over.slosh_mass[0] == pytest.approx(under.slosh_mass[0], rel=near)
    assert over.wall_friction[0] == pytest.approx(under.wall_friction[0], rel=near)


def test_a_capsule_is_filled_through_its_joints_without_a_gap():
    course = slosh_masses_history(tank(CAPSULE, "50 %"), [f"{x} %" for x in np.linspace(82.0, 83.3, 14)])
    assert course.reason == ("",) * 14
    assert np.all(np.diff(np.diff(course.of_modes("slosh_mass")[:, 0])) < 1e-3 * course.of_modes("slosh_mass")[0, 0])


@pytest.mark.parametrize(("shape", "curvature"), [(SPHERE, 2.0), (CAPSULE, 2.0**2 / 1.2), (SPHEROID, 2.0**2 / 1.3)])
def test_a_small_fill_swings_as_a_pendulum_of_the_bottoms_radius_of_curvature(shape, curvature):
    found = slosh_masses(tank(shape, "1e-5 %"))
    assert found.pendulum_length[0] == pytest.approx(curvature, rel=1e-3)
    assert found.slosh_mass[0] / found.liquid_mass == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("shape", [CAPSULE, TOROID], ids=lambda s: s["kind"])
def test_frequencies_scale_with_size_and_acceleration(shape):
    larger = {key: 3.0 * value if key != "kind" else value for key, value in shape.items()}
    one, other = slosh_masses(tank(shape, "70 %")), slosh_masses(tank(larger, "70 %", acceleration=3.0))
    assert other.kappa[0] * 3.0 == pytest.approx(one.kappa[0], rel=1e-8)
    assert other.slosh_mass[0] / 27.0 == pytest.approx(one.slosh_mass[0], rel=1e-8)
    assert other.rigid_lid_inertia / 3.0**5 == pytest.approx(one.rigid_lid_inertia, rel=1e-8)
    assert other.frequency[0] / one.frequency[0] == pytest.approx(np.sqrt(3.0 / 12.1 / 3.0), rel=1e-8)


def test_a_deep_capsule_is_as_good_as_a_deep_cylinder():
    deep = {"kind": "capsule", "radius": 2.0, "barrel": 30.0, "dome": 1.2}
    found = slosh_masses(tank(deep, 20.0))
    m = DENSITY * np.pi * 2.0**3 * 2.0 / 1.8411837813 / (1.8411837813**2 - 1.0)
    assert found.kappa[0] == pytest.approx(1.8411837813 / 2.0, rel=1e-7)
    assert found.slosh_mass[0] == pytest.approx(m, rel=1e-7)
    assert found.spring_height[0] == pytest.approx(20.0 - 2.0 * 2.0 / 1.8411837813, rel=1e-7)


@pytest.mark.parametrize(
    ("shape", "contour"),
    [
        (CYLINDER, {"kind": "contour", "z": [0.0, 0.0, 9.0], "r": [0.0, 2.0, 2.0]}),
        (ANNULUS, {"kind": "contour", "z": [0, 9], "r": [2, 2], "z_inner": [0, 9], "r_inner": [0.6, 0.6]}),
        (CONE_45, {"kind": "contour", "z": [0.0, 4.0], "r": [0.0, 4.0]}),
    ],
    ids=["cylinder", "annulus", "cone"],
)
def test_a_contour_of_a_known_shape_gives_its_values(shape, contour):
    one, other = slosh_masses(tank(shape, 1.7, 2)), slosh_masses(tank(contour, 1.7, 2))
    np.testing.assert_allclose(other.kappa, one.kappa, rtol=1e-6)
    np.testing.assert_allclose(other.slosh_mass[0], one.slosh_mass[0], rtol=1e-6)
    np.testing.assert_allclose(other.spring_height[0], one.spring_height[0], atol=2e-6)


@pytest.mark.parametrize("decimals", [3, 4])
def test_a_contour_rounded_as_drawings_are_stays_near_the_tank_and_is_quick(decimals):
    t = np.linspace(0.0, np.pi, 400)
    z, r = np.round(1.0 - np.cos(t), decimals), np.round(np.sin(t), decimals)
    new = np.append(True, (np.diff(z) != 0.0) | (np.diff(r) != 0.0))
    found = slosh_masses(tank({"kind": "contour", "z": z[new].tolist(), "r": r[new].tolist()}, 0.7))
    exact = slosh_masses(tank({"kind": "sphere", "radius": 1.0}, 0.7))
    assert found.kappa[0] == pytest.approx(exact.kappa[0], rel=10.0**-decimals)
    assert found.slosh_mass[0] == pytest.approx(exact.slosh_mass[0], rel=10.0**-decimals)


def test_a_contour_may_be_straight_between_its_points():
    t = np.linspace(0.0, 0.5 * np.pi, 7)
    bowl = {"kind": "contour", "z": (1.0 - np.cos(t)).tolist(), "r": np.sin(t).tolist()}
    curved, straight = tank(bowl, 0.8), tank(bowl | {"straight": True}, 0.8)
    sphere = np.pi * 0.8**2 * (1.0 - 0.8 / 3.0)
    assert curved.section.volume == pytest.approx(sphere, rel=2e-4)
    assert straight.section.volume < 0.985 * sphere
    assert slosh_masses(straight).error_estimate[0] < 1e-6  # of the frusta as given
    assert slosh_masses(curved).error_estimate[0] > abs(curved.section.volume / sphere - 1.0) / 3.0


def test_the_second_mode_left_out_is_told_only_where_it_matters():
    assert slosh_masses(tank(CYLINDER, 4.0)).reasons == ()
    assert "is left out" in slosh_masses(tank(CYLINDER, 0.2)).reasons[0]


def test_the_result_goes_to_netcdf_and_back_and_remembers_its_tank(tmp_path):
    import xarray as xr

    given = tank(CAPSULE, "60 %", 2, bottom_station=4.0)
    found = slosh_masses(given)
    assert found.tank is given
    found.to_dataset().to_netcdf(tmp_path / "tank.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "tank.nc", engine="h5netcdf") as back:
        np.testing.assert_array_equal(back["station"].values, 4.0 + found.spring_height)
        assert back["rigid_lid_inertia"].attrs["units"] == "kg m^2"
        assert all("units" in v.attrs for v in back.data_vars.values())


def test_a_changed_fill_is_not_answered_by_the_old_depth():
    full = tank(SPHERE, "50 %")
    assert full.depth == pytest.approx(2.0)
    less = full.model_copy(update={"fill": tank(SPHERE, "10 %").fill})
    assert less.depth < 1.0
    assert less.section.depth == less.depth


def _around(*tip: tuple[float, float]) -> dict[str, Any]:
    """Return a cylinder around an inner wall that ends at a height of 0.5 m."""
    r, z = zip(*tip, strict=True)
    return {"kind": "contour", "z": [0, 0, 3], "r": [0, 1, 1], "z_inner": z, "r_inner": r}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "shape", [_around((0.4, 0.0), (0.0, 0.5)), _around((0.7, 0.0), (0.3, 0.3), (0.0, 0.5)), BULKHEAD]
)
@pytest.mark.parametrize("off", [-1e-10, 0.0, 1e-15, 1e-13, 1e-10, 4e-9])
def test_a_surface_at_the_apex_of_an_inner_wall_is_between_those_just_below_and_above(shape, off):
    at = slosh_masses(tank(shape, 0.5 + off))
    low, high = (slosh_masses(tank(shape, 0.5 + d)) for d in (-1e-4, 1e-4))
    assert np.all(at.error_estimate < 1e-3)
    for name in ("kappa", "slosh_mass", "spring_height", "rigid_lid_inertia"):
        below, value, above = (float(np.ravel(getattr(one, name))[0]) for one in (low, at, high))
        assert below < value < above


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("points", [9, 13])
def test_a_surface_at_the_apex_of_a_rounded_dome_is_hardly_more_in_doubt_than_below_it(points):
    t = np.linspace(0.0, 0.5 * np.pi, points)
    z, r = np.round(0.3 * np.sin(t), 4), np.round(np.cos(t), 4)
    shape = {"kind": "contour", "z": [0, 3], "r": [1, 1], "z_inner": z.tolist(), "r_inner": r.tolist()}
    at, below = slosh_masses(tank(shape, 0.3)), slosh_masses(tank(shape, 0.299))
    assert at.error_estimate[0] < 3.0 * below.error_estimate[0] < 0.2
    assert at.kappa[0] == pytest.approx(below.kappa[0], rel=0.05)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("shape", "step", "below", "above"),
    [
        ({"kind": "contour", "z": [0, 0, 1, 1, 3], "r": [0, 1, 1, 0.6, 0.6]}, 1.0, 1.0, 0.6),
        (SUMP, 0.2, 0.3, 1.0),
        (_around((0.4, 0.0), (0.4, 0.5), (0.0, 0.5)), 0.5, 0.4, 0.0),
    ],
)
def test_a_surface_at_a_step_of_the_wall_is_the_one_below_and_says_so(shape, step, below, above):
    at, lower = slosh_masses(tank(shape, step)), slosh_masses(tank(shape, step - 1e-6))
    (said,) = [reason for reason in at.reasons if "step of the wall" in reason]
    assert f"from r = {below:g} m to {above:g} m at z = {step:g} m: the one below it was taken" in said
    assert not any("step of the wall" in reason for reason in lower.reasons)
    assert at.kappa[0] == pytest.approx(lower.kappa[0], rel=1e-4)
    assert at.slosh_mass[0] == pytest.approx(lower.slosh_mass[0], rel=1e-4)


def test_the_surface_around_a_stand_pipe_that_ends_in_it_is_that_of_the_annulus():
    pipe = tank(_around((0.4, 0.0), (0.4, 0.5), (0.0, 0.5)), 0.5)
    annulus = tank({"kind": "annulus", "radius": 1.0, "inner_radius": 0.4, "height": 3.0}, 0.5)
    at, exact = slosh_masses(pipe), slosh_masses(annulus)
    assert at.kappa[0] == pytest.approx(exact.kappa[0], rel=1e-6)
    assert at.slosh_mass[0] == pytest.approx(exact.slosh_mass[0], rel=1e-6)
