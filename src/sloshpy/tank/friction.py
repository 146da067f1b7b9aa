"""What a liquid's motion does along the wetted wall: the integral that boundary-layer theory asks for."""

from typing import TYPE_CHECKING

import numpy as np

from sloshpy.tank.liquid import WALL
from sloshpy.tank.mesh import SectionMesh
from sloshpy.units import Array

if TYPE_CHECKING:
    from skfem import CellBasis

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)  # along an edge: quartics squared on a curved wall
_CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])  # of the reference triangle
_STEEPER = 1.0 - 1e-6  # a wall of exactly 45 degrees is no floor


def wall_friction(mesh: SectionMesh, basis: "CellBasis", q: Array) -> Array:
    """Return int (psi_s^2 + psi^2/r^2) r ds of potentials psi = r q, along the whole wetted wall and along its floor.

    That is int |grad phi|^2 dS over pi, with the slope psi_s along the wall; the one across it is zero. Floor is what
    of the wall lies below the liquid and rises by less than 45 degrees. Where the wall turns into the liquid the
    integrand grows as d^(2 pi/angle - 2) with the distance d, which can be integrated; at the surface it is bounded.

    Args:
        mesh, basis: of the finite elements. q: (n_dofs, n), nodal values.

    Returns:
        (2, n), in units of the mesh.
    """
    from skfem import CellBasis, ElementTriP4

    facets = mesh.facets_of(WALL)
    a, b = mesh.mesh.facets[:, facets]
    triangle = mesh.mesh.f2t[0, facets]
    corners = mesh.mesh.t[:, triangle]
    first, last = np.argmax(corners == a, axis=0), np.argmax(corners == b, axis=0)
    found = np.zeros((2, q.shape[1]))
    for i, j in np.unique(np.stack([first, last]), axis=1).T:
        here = triangle[(first == i) & (last == j)]
        along, inward = _CORNERS[j] - _CORNERS[i], _CORNERS[3 - i - j] - _CORNERS[i]
        X = _CORNERS[i][:, None] + np.outer(along, 0.5 * (_NODES + 1.0))
        edge = CellBasis(
            mesh.mesh, ElementTriP4(), mapping=basis.mapping, elements=here, quadrature=(X, 0.5 * _WEIGHTS)
        )
        J = basis.mapping.DF(X, tind=here)
        tangent, up = np.einsum("abeq,b->aeq", J, along), np.einsum("beq,b->eq", J[1], inward) > 0.0
        length = np.hypot(*tangent)
        floor = up & (np.abs(tangent[1]) < _STEEPER * np.abs(tangent[0]))
        r = basis.mapping.F(X, tind=here)[0]
        for n, column in enumerate(q.T):
            field = edge.interpolate(column)
            value, slope = np.asarray(field), field.grad
            psi_s = ((value + r * slope[0]) * tangent[0] + r * slope[1] * tangent[1]) / length
            share = (psi_s**2 + value**2) * r * length * 0.5 * _WEIGHTS
            found[:, n] += np.sum(share), np.sum(share * floor)
    return found
