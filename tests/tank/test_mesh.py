"""The mesh covers the liquid, and refining it converges as fast as quartics can."""

import numpy as np
import pytest
from tanks import BULKHEAD, CAPSULE, SPHERE, SUMP, TOROID, tank

from sloshpy.tank.mesh import first_mesh
from sloshpy.tank.potential import potentials


@pytest.mark.parametrize(
    ("shape", "fill"),
    [(SPHERE, "50 %"), (CAPSULE, "96 %"), (TOROID, "70 %"), (BULKHEAD, 0.3), (BULKHEAD, 0.51), (SUMP, 0.5)],
)
def test_the_mesh_covers_the_section_once(shape, fill):
    """Its volume by quadrature is that of the contour integrals."""
    from skfem import Functional

    from sloshpy.tank.potential import _curved_basis

    section = tank(shape, fill).section
    mesh = first_mesh(section)
    volume = Functional(lambda w: 2.0 * np.pi * w.x[0]).assemble(_curved_basis(mesh)) * mesh.scale**3
    assert volume == pytest.approx(section.volume, rel=1e-6)
    finer = mesh.refined(np.arange(mesh.mesh.t.shape[1]))
    volume = Functional(lambda w: 2.0 * np.pi * w.x[0]).assemble(_curved_basis(finer)) * mesh.scale**3
    assert volume == pytest.approx(section.volume, rel=2e-8)


def _uniform(shape, fill, count, modes=4):
    section = tank(shape, fill).section
    mesh = first_mesh(section)
    found = []
    for _ in range(count):
        found.append(potentials(mesh, modes, 0.0))
        mesh = mesh.refined(np.arange(mesh.mesh.t.shape[1]))
    return section, found


def test_a_straight_tank_converges_with_the_eighth_power_of_the_mesh():
    from scipy.special import jnp_zeros

    _, found = _uniform({"kind": "cylinder", "radius": 1.0, "height": 3.0}, 1.0, 3)
    xi = jnp_zeros(1, 4)[3]
    errors = np.array([p.kappa[3] / (xi * np.tanh(xi)) - 1.0 for p in found])
    assert np.all(errors > 0.0)  # the energy of a trial function is never less than the true one
    order = np.log2(errors[:-1] / errors[1:])
    assert order[-1] == pytest.approx(8.0, abs=0.7)


def test_a_curved_tank_converges_with_a_high_power_of_the_mesh():
    _, found = _uniform(SPHERE, "50 %", 4, 5)
    errors = np.array([p.kappa[4] / found[-1].kappa[4] - 1.0 for p in found[:-1]])  # the last is 100 times better
    assert np.all(errors > 0.0)
    assert np.log2(errors[-2] / errors[-1]) > 6.5


@pytest.mark.parametrize("shape", [SPHERE, TOROID], ids=lambda s: s["kind"])
def test_the_answer_does_not_depend_on_the_first_mesh(shape, monkeypatch):
    import sloshpy.tank.mesh
    from sloshpy.tank import slosh_masses

    one = slosh_masses(tank(shape, "60 %"))
    monkeypatch.setattr(sloshpy.tank.mesh, "_EDGES", 4.1)
    other = slosh_masses(tank(shape, "60 %"))
    assert one.method != other.method
    for name in ("kappa", "slosh_mass", "spring_height", "wave_per_displacement"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-6)
