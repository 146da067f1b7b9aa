"""The figure of a tank shows the result: section, liquid, slosh mass, hinge, fixed mass, wave."""

import numpy as np
import pytest

from sloshpy import plots
from sloshpy.errors import OutsideValidity
from sloshpy.files import read_tank, write_example
from sloshpy.plots.style import SMALL
from sloshpy.tank import Tank, slosh_masses, slosh_masses_history, tank_damping

SHAPES = {
    "capsule": {"kind": "capsule", "radius": 2.0, "barrel": 3.0, "dome": 1.2},
    "toroid": {"kind": "toroid", "ring_radius": 2.0, "tube_radius": 0.8},
    "cylinder": {"kind": "cylinder", "radius": 1.0, "height": 3.0},
    "sphere": {"kind": "sphere", "radius": 2.5},
    "slender": {"kind": "capsule", "radius": 1.0, "barrel": 10.0, "dome": 0.7},
    "dish": {"kind": "cylinder", "radius": 5.0, "height": 1.5},
}


def tank(name: str) -> Tank:
    shape = SHAPES[name]
    return Tank(name="LOX", fill="60 %", acceleration=12.0, modes=2, liquid={"density": 1141.0}, shape=shape)


@pytest.mark.parametrize("name", SHAPES)
def test_the_section_is_to_scale_and_says_what_is_in_it(name):
    found = slosh_masses(tank(name))
    ax = plots.plot_tank(found)
    ax.figure.draw_without_rendering()
    assert ax.get_aspect() == 1.0
    text = " ".join(t.get_text() for t in ax.texts)
    assert f"{found.spring_height[0]:.4g} m" in text
    assert "fixed mass" in text
    assert f"{found.hinge_height[0]:.4g} m" in text
    assert all(t.get_fontsize() >= SMALL for t in ax.texts)
    waves = [line for line in ax.lines if np.shape(line.get_xdata()) == found.surface_radius.shape]
    right, left = (line.get_ydata() - found.section.depth for line in waves)
    np.testing.assert_allclose(right, -np.asarray(left), atol=1e-12)  # psi(r) cos(theta) turns its sign
    for t in ax.texts:
        t.arrow_patch = t.arrowprops = None  # a leader may pass under another text
    boxes = [t.get_window_extent() for t in ax.texts]
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
    boxes.append(ax.xaxis.label.get_window_extent())
    page = ax.figure.bbox
    assert all(page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1 for box in boxes)


def test_the_hinge_is_drawn_whole_with_its_tip_at_its_place(tmp_path):
    found = slosh_masses(read_tank(write_example("lox_tank", tmp_path)))
    ax = plots.plot_tank(found)
    ax.figure.draw_without_rendering()
    (hinge,) = [line for line in ax.lines if line.get_label() == "hinge"]
    assert hinge.get_ydata()[0] == found.hinge_height[0]
    others = [*ax.patches, *(line for line in ax.lines if line is not hinge)]
    assert all(other.get_zorder() < hinge.get_zorder() for other in others)
    box = hinge.get_window_extent()
    tip = ax.transData.transform((0.0, found.hinge_height[0]))[1]
    mark = hinge.get_marker()
    assert max(z for _, z in mark) == 0.0  # it hangs from its tip
    size = hinge.get_markersize() * ax.figure.dpi / 72.0
    second = ax.patches[-1].get_window_extent()  # the disc of slosh mass 2, just above
    assert tip - size < box.y1
    assert second.y0 > tip - 0.25 * size


def test_the_history_is_drawn_as_computed():
    course = slosh_masses_history(tank("cylinder"), ["10 %", "50 %", "90 %"])
    frequency, mass, place = plots.plot_fill_history(course)
    np.testing.assert_allclose(frequency.lines[0].get_ydata() * 2.0 * np.pi, course.of_modes("frequency")[:, 0])
    np.testing.assert_allclose(mass.lines[0].get_ydata(), course.of_modes("slosh_mass")[:, 0])
    np.testing.assert_allclose(place.lines[0].get_ydata(), course.of_modes("spring_height")[:, 0])
    assert "%" in place.get_xlabel()


def _damped(baffle=(), nu=1e-6, **more):
    liquid = {"density": 1e3, "kinematic_viscosity": nu}
    shape = {"kind": "cylinder", "radius": 2.0, "height": 9.0}
    given = Tank(name="LOX", fill=5.0, acceleration=9.81, liquid=liquid, shape=shape, baffle=baffle, **more)
    return tank_damping(slosh_masses(given))


def test_the_damping_of_a_ringed_tank_is_drawn_to_where_its_formula_holds():
    """To a wave of a tenth of the radius, 0.2 m, which is 0.2/1.541 m of slosh."""
    found = _damped(baffle=[{"height": 4.5, "width": 0.2}], damping_floor=0.004)
    ax = plots.plot_tank_damping(found)
    whole, rings, floor = (np.asarray(line.get_xydata()) for line in ax.lines[:2] + ax.lines[3:])
    known = np.isfinite(whole[:, 1])
    assert np.max(whole[known, 0]) == pytest.approx(0.2 / 1.541, rel=1e-3)
    assert np.max(whole[:, 0]) > 1.2 * np.max(whole[known, 0])
    np.testing.assert_allclose(whole[known, 1], 0.4 + rings[known, 1])
    np.testing.assert_allclose(floor[:, 1], 0.4)
    (shaded,) = ax.patches
    assert shaded.get_x() == 0.0
    assert shaded.get_width() == found.law.largest_amplitude
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == [
        "the formulas hold",
        "all together",
        "1 ring after Miles, decay after Coogan and Green",
        "floor given, 0.4 %",
    ]
    assert "Slosh-mass displacement [m]" in ax.get_xlabel()
    ax.figure.draw_without_rendering()
    low, high = ax.child_axes[0].get_xlim()
    assert (low, high) == pytest.approx((0.0, 1.541 * ax.get_xlim()[1]), rel=1e-3)


def test_a_smooth_tank_is_drawn_damped_alike_at_any_amplitude_and_a_bare_one_is_refused():
    ax = plots.plot_tank_damping(_damped())
    (line,) = ax.lines
    assert "at any amplitude" in ax.get_title(loc="left")
    assert line.get_ydata()[0] == line.get_ydata()[1] > 0.0
    with pytest.raises(OutsideValidity):
        plots.plot_tank_damping(tank_damping(slosh_masses(tank("capsule"))))


def test_the_damping_of_a_tank_whose_rings_are_left_out_says_so():
    sphere = Tank(
        name="LOX",
        fill=1.2,
        acceleration=9.81,
        liquid={"density": 1e3, "kinematic_viscosity": 1e-6},
        shape={"kind": "sphere", "radius": 1.0},
        baffle=[{"height": 0.8, "width": 0.1}],
    )
    ringed = plots.plot_tank_damping(tank_damping(slosh_masses(sphere))).get_title(loc="left")
    assert "ring baffles left out" in " ".join(ringed.split())
    bare = plots.plot_tank_damping(tank_damping(slosh_masses(sphere.model_copy(update={"baffle": ()}))))
    assert "ring" not in bare.get_title(loc="left")


def test_a_history_of_one_good_row_shows_its_point_and_one_of_none_is_not_drawn():
    axes = plots.plot_fill_history(slosh_masses_history(tank("cylinder"), ["150 %", "50 %", "160 %"]))
    for ax in axes:
        seen = [line for line in ax.get_lines() if np.any(np.isfinite(line.get_ydata()))]
        assert seen
        markers = [line.get_marker() for line in seen]
        assert "None" not in markers
        assert len(set(markers)) == len(markers)
    assert "nan" not in axes[0].get_title(loc="left") + axes[0].get_title()
    with pytest.raises(OutsideValidity, match="no row"):
        plots.plot_fill_history(slosh_masses_history(tank("cylinder"), ["150 %", "160 %"]))
