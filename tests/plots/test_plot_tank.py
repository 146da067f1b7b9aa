"""The figure of a tank shows the result: section, liquid, slosh mass, hinge, fixed mass, wave."""

import numpy as np
import pytest

from sloshpy import plots
from sloshpy.plots.style import SMALL
from sloshpy.tank import Tank, slosh_masses, slosh_masses_history

SHAPES = {
    "capsule": {"kind": "capsule", "radius": 2.0, "barrel": 3.0, "dome": 1.2},
    "toroid": {"kind": "toroid", "ring_radius": 2.0, "tube_radius": 0.8},
    "cylinder": {"kind": "cylinder", "radius": 1.0, "height": 3.0},
}


def tank(name: str) -> Tank:
    shape = SHAPES[name]
    return Tank(name="LOX", fill="60 %", acceleration=12.0, modes=2, liquid={"density": 1141.0}, shape=shape)


@pytest.mark.parametrize("name", SHAPES)
def test_the_section_is_to_scale_and_says_what_is_in_it(name):
    found = slosh_masses(tank(name))
    ax = plots.plot_tank(found)
    ax.figure.canvas.draw()
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


def test_the_history_is_drawn_as_computed():
    course = slosh_masses_history(tank("cylinder"), ["10 %", "50 %", "90 %"])
    frequency, mass, place = plots.plot_fill_history(course)
    np.testing.assert_allclose(frequency.lines[0].get_ydata() * 2.0 * np.pi, course.of_modes("frequency")[:, 0])
    np.testing.assert_allclose(mass.lines[0].get_ydata(), course.of_modes("slosh_mass")[:, 0])
    np.testing.assert_allclose(place.lines[0].get_ydata(), course.of_modes("spring_height")[:, 0])
    assert "%" in place.get_xlabel()
