"""What the points of a contour leave open, against the sphere that they are of."""

import dataclasses

import numpy as np
import pytest
from tanks import tank

from sloshpy.tank import slosh_masses, slosh_masses_history
from sloshpy.tank.contour_doubt import resolution
from sloshpy.tank.shapes import Contour

SPHERE = {"kind": "sphere", "radius": 1.0}


def ball(points, decimals=None):
    t = np.linspace(0.0, np.pi, points)
    z, r = 1.0 - np.cos(t), np.append(np.sin(t)[:-1], 0.0)
    if decimals is not None:
        z, r = np.round(z, decimals), np.round(r, decimals)
    return {"kind": "contour", "z": z.tolist(), "r": r.tolist()}


def errors(found, exact):
    """Return the true and the claimed errors: frequency, slosh mass, rigid-lid and fixed inertia."""
    pairs = [
        (found.frequency[0], exact.frequency[0]),
        (found.slosh_mass[0], exact.slosh_mass[0]),
        (found.rigid_lid_inertia, exact.rigid_lid_inertia),
        (found.fixed_mass_inertia, exact.fixed_mass_inertia),
    ]
    claimed = [found.error_estimate[0]] * 2 + [found.rigid_lid_error, found.fixed_inertia_error]
    return np.array([abs(a / b - 1.0) for a, b in pairs]), np.array(claimed)


@pytest.mark.parametrize(
    ("points", "decimals", "fill"),
    [(8, None, 1.97), (24, None, 1.97), (40, 3, 1.0), (40, 4, 1.9), (100, 4, 1.0), (60, 4, 1.5), (35, 3, 0.5)],
)
def test_the_error_of_a_contour_covers_what_its_points_lack_of_the_sphere(points, decimals, fill):
    found = slosh_masses(tank(ball(points, decimals), fill))
    true, claimed = errors(found, slosh_masses(tank(SPHERE, fill)))
    assert np.all(claimed >= true)
    assert any("good to" in reason for reason in found.reasons)


@pytest.mark.parametrize(("points", "most"), [(50, 1e-5), (200, 1e-7)])
def test_exact_and_dense_points_are_not_slandered(points, most):
    found = slosh_masses(tank(ball(points), 1.0))
    true, claimed = errors(found, slosh_masses(tank(SPHERE, 1.0)))
    assert np.all(claimed[:3] >= true[:3])
    assert np.all(claimed[:3] < most)  # 50 and 200 points: (pi/n)^4 falls by 256


@pytest.mark.parametrize(("step", "unit"), [(1e-3, 1.0), (1e-4, 1.0), (0.1, 0.0254), (0.01, 0.3048)])
def test_the_digits_of_a_drawing_are_found_in_its_unit(step, unit):
    t = np.linspace(0.0, np.pi, 40)
    z, r = (step * np.round(x / step / unit) * unit for x in (3.0 - 3.0 * np.cos(t), 3.0 * np.sin(t)))
    assert resolution(Contour(z=z, r=r)) == pytest.approx(step * unit)
    assert resolution(Contour(z=z + 1e-3 * np.sqrt(2.0), r=r)) == 0.0


def test_a_resolution_given_is_taken():
    shape = ball(60)
    fine, coarse = (slosh_masses(tank(shape | {"resolution": step}, 1.0)) for step in (1e-4, 1e-3))
    assert coarse.error_estimate[0] == pytest.approx(10.0 * fine.error_estimate[0], rel=0.3)  # of first order


def test_straight_walls_of_a_drawing_are_taken_at_their_word():
    drawn = slosh_masses(tank({"kind": "contour", "z": [0.0, 0.0, 9.0], "r": [0.0, 2.0, 2.0]}, 1.7))
    assert drawn.error_estimate[0] < 1e-6
    assert drawn.fixed_inertia_error < 1e-4


def test_a_history_doubts_a_contour_no_less_than_its_single_fills():
    filled = tank(ball(40, 4), 1.0)
    fill = np.linspace(0.3, 1.9, 17)
    history = slosh_masses_history(filled, fill)
    for k in (0, 5, 9, 16):
        alone = slosh_masses(tank(ball(40, 4), float(fill[k])))
        assert history.rows[k] is not None
        assert history.rows[k].error_estimate[0] > 0.5 * alone.error_estimate[0]
        assert history.rows[k].kappa[0] == pytest.approx(alone.kappa[0], rel=alone.error_estimate[0])


def test_errors_of_the_inertias_are_in_the_output():
    found = slosh_masses(tank(ball(40, 3), 1.0))
    assert found.to_dict()["rigid_lid_error"] == found.rigid_lid_error
    assert found.to_dict()["fixed_inertia_error"] == found.fixed_inertia_error
    assert f"(error {found.fixed_inertia_error:.0e})" in str(found)
    assert {"rigid_lid_error", "fixed_inertia_error"} <= {field.name for field in dataclasses.fields(found)}


def even_heights(points, decimals=None):
    z = np.linspace(0.0, 2.0, points)
    r = np.sqrt(np.maximum(z * (2.0 - z), 0.0))
    if decimals is not None:
        z, r = np.round(z, decimals), np.round(r, decimals)
    return {"kind": "contour", "z": z.tolist(), "r": r.tolist()}


# shallow and nearly full, where few points are wetted or dry; rounded points, and tables at even heights
@pytest.mark.parametrize("fill", [0.1, 1.9])
@pytest.mark.parametrize(
    "shape",
    [
        even_heights(40),
        even_heights(40, 5),
        even_heights(60, 4),
        even_heights(12),
        ball(12, 3),
        ball(60, 4),
        ball(60, 5),
    ],
)
def test_the_error_holds_for_every_mode_where_few_points_are_wetted(shape, fill):
    found = slosh_masses(tank(shape, fill, modes=2))
    exact = slosh_masses(tank(SPHERE, fill, modes=2))
    true = [
        np.abs(found.frequency / exact.frequency - 1.0),
        np.abs(found.slosh_mass / exact.slosh_mass - 1.0),
        np.abs(found.spring_height - exact.spring_height) / exact.section.radius,
    ]
    assert np.all(np.max(true, axis=0) <= found.error_estimate)
    assert abs(found.rigid_lid_inertia / exact.rigid_lid_inertia - 1.0) <= found.rigid_lid_error


@pytest.mark.parametrize("points", [14, 20, 30])
def test_the_error_holds_for_domes_at_even_radii_where_the_wall_turns_upright(points):
    """Near 20 points the errors of axis and equator cancel between all points and half of them, not in themselves."""
    r = np.linspace(0.0, 1.6, points)
    rise = 1.1 * (1.0 - np.sqrt(np.maximum(1.0 - (r / 1.6) ** 2, 0.0)))
    z, r = np.concatenate([rise, 4.7 - rise[::-1]]), np.concatenate([r, r[::-1]])
    for fill in (0.6, 1.0, 1.5, 3.0, 4.2):
        found = slosh_masses(tank({"kind": "contour", "z": z.tolist(), "r": r.tolist()}, fill))
        exact = slosh_masses(tank({"kind": "capsule", "radius": 1.6, "barrel": 2.5, "dome": 1.1}, fill))
        true, claimed = errors(found, exact)
        assert np.all(true <= claimed)


def test_a_dome_crosses_the_axis_level():
    wall = Contour(**{k: np.array(v) for k, v in even_heights(20).items() if k != "kind"}).outer
    assert len(wall) == 1
    for end in (0.0, 1.0):
        assert wall[0].tangent(end)[1] == pytest.approx(0.0, abs=1e-12)
    found, exact = (slosh_masses(tank(shape, 0.3)) for shape in (even_heights(40), SPHERE))
    assert found.frequency[0] == pytest.approx(exact.frequency[0], rel=2e-4)


def test_a_tip_stays_a_tip():
    t = np.linspace(0.0, 1.0, 20)
    wall = Contour(z=2.0 * np.sin(t), r=2.0 * (1.0 - np.cos(t))).outer  # its mirror image meets it upright
    assert wall[0].tangent(0.0)[0] < 0.1 * wall[0].tangent(0.0)[1]


FEW = np.linspace(0.0, np.pi, 6)
DOME = np.array([0.0, 0.4, 0.8, 1.2, 1.6])
RISE = 1.1 * (1.0 - np.sqrt(1.0 - (DOME / 1.6) ** 2))


@pytest.mark.parametrize(
    ("r", "z", "like", "fills"),
    [
        (np.append(np.sin(FEW)[:-1], 0.0), 1.0 - np.cos(FEW), SPHERE, [0.4, 1.0, 1.7]),
        (
            np.concatenate([DOME, DOME[::-1]]),
            np.concatenate([RISE, 4.7 - RISE[::-1]]),
            {"kind": "capsule", "radius": 1.6, "barrel": 2.5, "dome": 1.1},
            [0.5, 1.0, 3.8],
        ),
        *[(np.array(even_heights(n)["r"]), np.array(even_heights(n)["z"]), SPHERE, [0.3, 1.0]) for n in (7, 8, 9)],
    ],
)
def test_a_round_wall_of_few_points_is_asked_for_more_and_its_error_holds(r, z, like, fills):
    for fill in fills:
        found = slosh_masses(tank({"kind": "contour", "z": z.tolist(), "r": r.tolist()}, fill))
        exact = slosh_masses(tank(like, fill))
        assert any("the wall may be round where few points make edges" in reason for reason in found.reasons)
        assert abs(found.frequency[0] / exact.frequency[0] - 1.0) <= found.error_estimate[0]
        assert abs(found.slosh_mass[0] / exact.slosh_mass[0] - 1.0) <= found.error_estimate[0]
        assert abs(found.rigid_lid_inertia / exact.rigid_lid_inertia - 1.0) <= found.rigid_lid_error


def test_straight_parts_are_not_taken_for_round_ones():
    r, z = np.array([0.0, 1.0, 1.6, 1.6]), np.array([0.0, 0.5, 1.3, 2.3])  # a bottom of two cones and a barrel
    for more, cautions in (({}, 1), ({"straight": True}, 0)):
        found = slosh_masses(tank({"kind": "contour", "z": z.tolist(), "r": r.tolist()} | more, 1.2))
        assert sum("may be round" in reason for reason in found.reasons) == cautions
        assert (found.error_estimate[0] < 1e-6) == (cautions == 0)
    # a third point on each says the same
    between = [x[[0, 1]] @ [0.5, 0.5] for x in (r, z)], [x[[1, 2]] @ [0.5, 0.5] for x in (r, z)]
    r, z = (np.insert(x, [1, 2], [b[k] for b in between]) for k, x in enumerate((r, z)))
    found = slosh_masses(tank({"kind": "contour", "z": z.tolist(), "r": r.tolist()}, 1.2))
    assert not any("may be round" in reason for reason in found.reasons)
    assert found.error_estimate[0] < 1e-6


def test_cones_through_which_a_curve_is_laid_leave_room_for_the_cones():
    slope = np.radians([20.0, 35.0, 50.0, 65.0, 80.0, 90.0])
    r, z = (np.append(0.0, np.cumsum(0.6 * f(slope))) for f in (np.cos, np.sin))
    points = {"kind": "contour", "z": z.tolist(), "r": r.tolist()}
    round_, cones = (slosh_masses(tank(points | {"straight": s}, 1.29)) for s in (False, True))
    assert abs(round_.slosh_mass[0] / cones.slosh_mass[0] - 1.0) > 0.02
    assert abs(round_.slosh_mass[0] / cones.slosh_mass[0] - 1.0) < round_.error_estimate[0]
