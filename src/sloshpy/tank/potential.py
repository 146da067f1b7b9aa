"""The potentials of the liquid by finite elements: slosh modes, and the turning tank with a rigid lid.

phi = psi(r, z) cos(theta) with psi = r q; q is smooth on the axis. Quartic triangles with quartic walls.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sloshpy.tank.mesh import SectionMesh
from sloshpy.units import Array, IntArray

if TYPE_CHECKING:
    from skfem import CellBasis

_ORDER = 10  # of the quadrature: quartics squared, curved walls and the weight r^3
_SHORT = 2e-4  # of the surface's radius: an edge left straight; all of them together take 1e-9 off the section
# barycentric coordinates of the three inner nodes of the quartic triangle
_INNER = np.array([[0.5, 0.25, 0.25], [0.25, 0.5, 0.25], [0.25, 0.25, 0.5]])


@dataclass(frozen=True, kw_only=True)
class Potentials:
    """Slosh modes and the rigid-lid potential on one mesh; lengths in units of the mesh's scale.

    kappa: (n,). surface_moment b.q, surface_square q.M.q, lift c.q and wall value: (n,), of each mode. lid: rigid-lid
    inertia about the lowest point over pi rho, and its change with the height of the centre. indicator: (n_triangles,),
    how much of the energy is of the highest degree. q: (n_dofs, n), the modes' nodal values on the basis.
    """

    mesh: SectionMesh
    kappa: Array
    surface_moment: Array
    surface_square: Array
    lift: Array
    wall: Array
    lid: float
    indicator: Array
    surface_radius: Array
    surface_shape: Array
    basis: "CellBasis"
    q: Array


def _energy(basis: "CellBasis") -> Any:
    """Return the matrix of int r (psi_r v_r + psi_z v_z) + psi v / r dr dz for psi = r u, sparse.

    All pairs of an element's functions in one product, five times as fast as form by form.
    """
    from scipy.sparse import coo_matrix

    r = basis.global_coordinates()[0]
    functions = [one[0] for one in basis.basis]
    parts = [[u + r * u.grad[0], r * u.grad[1], np.asarray(u) + 0.0 * r] for u in functions]
    root = np.sqrt(r * basis.dx)
    B = np.moveaxis(np.array(parts) * root, 2, 0).reshape(basis.nelems, len(functions), -1)
    K = B @ np.swapaxes(B, 1, 2)
    dofs = basis.element_dofs.T
    rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    return coo_matrix((K.ravel(), (rows.ravel(), columns.ravel())), shape=(basis.N, basis.N)).tocsc()


def _height(u: Any, v: Any, w: Any) -> Any:
    return w.x[0] ** 3 * u * v


def _moment(v: Any, w: Any) -> Any:
    return w.x[0] ** 3 * v


def _lift(v: Any, w: Any) -> Any:
    return w.x[0] ** 3 * v.grad[1]


def _turning(v: Any, w: Any) -> Any:
    """The wall turning about a centre: its velocity (z, 0, -x) has no divergence, so the work is a volume integral."""
    r, z = w.x[0], w.x[1] - w.centre
    return r * (z * (2.0 * v + r * v.grad[0]) - r**2 * v.grad[1])


def potentials(mesh: SectionMesh, modes: int, centre: float) -> Potentials:
    """Solve for the first slosh modes and for the tank turning about a centre, in units of the mesh's scale."""
    from scipy.linalg import cholesky
    from scipy.sparse.linalg import LinearOperator, eigsh, splu
    from skfem import BilinearForm, ElementTriP4, FacetBasis, LinearForm

    basis = _curved_basis(mesh)
    top = FacetBasis(mesh.mesh, ElementTriP4(), facets=mesh.surface, intorder=_ORDER + 1)

    K = _energy(basis)
    M, b = BilinearForm(_height).assemble(top), LinearForm(_moment).assemble(top)
    c, load = LinearForm(_lift).assemble(basis), LinearForm(_turning).assemble(basis, centre=centre)
    s = np.unique(top.get_dofs(mesh.surface).all())
    if len(s) < 3 * modes:
        raise TooCoarseError(mesh.mesh.f2t[0, mesh.surface])
    # K is symmetric and positive: no pivoting, and an ordering for that
    solve = splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).solve
    M_s = M[s][:, s].toarray()
    L = cholesky(M_s, lower=True)

    def pulled(y: Array) -> Array:
        """Apply L' (K^-1 on the surface) L, whose eigenvalues are 1/kappa."""
        load = np.zeros(K.shape[0])
        load[s] = L @ y
        return np.asarray(L.T @ solve(load)[s])

    operator = LinearOperator((len(s), len(s)), matvec=pulled, dtype=float)
    inverse, y = eigsh(operator, k=modes, which="LA", v0=L.T @ b[s], tol=0.0)
    order = np.argsort(inverse)[::-1]
    kappa = 1.0 / inverse[order]
    q = np.zeros((K.shape[0], modes))
    q[s] = L @ y[:, order]
    q = solve(q) * kappa
    lid = solve(load)
    rim = int(s[np.argmax(basis.doflocs[0, s])])
    along = s[np.argsort(basis.doflocs[0, s])]
    r = basis.doflocs[0]
    return Potentials(
        mesh=mesh,
        kappa=kappa,
        surface_moment=b @ q,
        surface_square=np.einsum("in,in->n", q[s], M_s @ q[s]),
        lift=c @ q,
        wall=r[rim] * q[rim],
        lid=float(load @ lid),
        indicator=_indicator(basis, np.column_stack([q, lid]), K),
        surface_radius=r[along],
        surface_shape=(r[:, None] * q)[along].T,
        basis=basis,
        q=q,
    )


def _curved_basis(mesh: SectionMesh) -> "CellBasis":
    """Return the basis of quartics on triangles whose wall edges follow the wall."""
    from skfem import CellBasis, ElementTriP4, MappingIsoparametric
    from skfem.quadrature import get_quadrature

    straight = CellBasis(mesh.mesh, ElementTriP4(), intorder=0)
    shifted = _on_the_wall(mesh, straight)
    grid = _QuarticGrid(straight.doflocs + shifted, straight.dofs)
    mapping = MappingIsoparametric(grid, ElementTriP4())
    X, W = get_quadrature(ElementTriP4.refdom, _ORDER)
    J = [[mapping.J(i, j, X) for j in range(2)] for i in range(2)]
    sign = np.sign(J[0][0] * J[1][1] - J[0][1] * J[1][0])
    folded = np.any((sign != sign[:, :1]) | (sign == 0.0), axis=1)
    if np.any(folded):
        raise TooCoarseError(np.flatnonzero(folded))
    return CellBasis(mesh.mesh, ElementTriP4(), mapping=mapping, quadrature=(X, W))


class TooCoarseError(Exception):
    """These triangles are too coarse: a curved wall folds them, or the surface holds too few modes."""

    def __init__(self, triangles: IntArray) -> None:
        self.triangles = triangles
        super().__init__(f"{len(triangles)} triangles are too coarse")


class _QuarticGrid:
    """What scikit-fem's isoparametric mapping asks of a mesh, which it has up to quadratic triangles only."""

    def __init__(self, doflocs: Array, dofs: Any) -> None:
        self.doflocs, self.dofs = doflocs, dofs

    def dim(self) -> int:
        return 2


def _on_the_wall(mesh: SectionMesh, straight: "CellBasis") -> Array:
    """Return the shifts (2, n_dofs) that bring the nodes of wall edges onto the wall, their triangles' inner nodes
    following."""
    parts = mesh.section.boundary
    facets = mesh.mesh.boundary_facets()
    ends = mesh.mesh.p[:, mesh.mesh.facets[:, facets]]
    facets = facets[np.hypot(*(ends[:, 1] - ends[:, 0])) > _SHORT]
    a, b = mesh.mesh.facets[:, facets]
    first, last = mesh.between(a, b)
    bent = np.array([not part.piece.straight for part in parts])[np.floor(0.5 * (first + last)).astype(int)]
    facets, a, b, first, last = facets[bent], a[bent], b[bent], first[bent], last[bent]
    nodes = straight.dofs.facet_dofs[:, facets]  # from the lower-numbered vertex to the higher
    f = np.array([0.25, 0.5, 0.75])[:, None]
    p_a, p_b = mesh.mesh.p[:, a], mesh.mesh.p[:, b]
    number = np.floor(0.5 * (first + last))
    place = np.clip(first + f * (last - first), number, number + 1.0 - 1e-15)
    off = mesh.point(place) - (p_a[:, None] * (1.0 - f) + p_b[:, None] * f)  # (2, 3, n)
    shift: Array = np.zeros_like(straight.doflocs)
    shift[:, nodes] = off
    triangle = mesh.mesh.f2t[0, facets]
    corners = mesh.mesh.t[:, triangle]
    i, j = np.argmax(corners == a, axis=0), np.argmax(corners == b, axis=0)
    for k, weights in enumerate(_INNER):
        both = weights[i] + weights[j]
        t = weights[j] / both
        # the quartic through the five nodes of the edge, whose ends stay
        along = np.stack(
            [
                t * (1 - t) * (t - y) * (t - x) / (v * (1 - v) * (v - y) * (v - x))
                for v, x, y in ((0.25, 0.5, 0.75), (0.5, 0.25, 0.75), (0.75, 0.25, 0.5))
            ]
        )
        inner = straight.dofs.interior_dofs[k, triangle]
        for d in range(2):
            np.add.at(shift[d], inner, np.einsum("kn,dkn->dn", along, off)[d] * both**2)
    return shift


def _indicator(basis: "CellBasis", q: Array, K: Any) -> Array:
    """Return each triangle's share of the energy that is of the fourth degree, summed over modes and the lid."""
    share = np.zeros(basis.nelems)
    r = basis.doflocs[0, basis.element_dofs].mean(axis=0)
    for column in q.T:
        nodal = column[basis.element_dofs]
        top = _fourth_degree() @ nodal
        share += r**3 * np.sum(top**2, axis=0) / float(column @ (K @ column))
    return share


def _fourth_degree() -> Array:
    """Return what takes 15 nodal values to the five coefficients of degree four, (5, 15)."""
    from skfem import ElementTriP4

    x, y = ElementTriP4.doflocs.T
    powers = [(i, j) for n in range(5) for i in range(n + 1) for j in [n - i]]
    V = np.stack([x**i * y**j for i, j in powers], axis=1)
    return np.asarray(np.linalg.inv(V)[-5:])
