"""Slosh modes of any body of revolution: finite elements, refined until frequency and slosh mass stand still."""

from dataclasses import replace

import numpy as np

from sloshpy.errors import OutsideValidity
from sloshpy.tank.friction import wall_friction
from sloshpy.tank.liquid import LiquidSection
from sloshpy.tank.mesh import SectionMesh, first_mesh
from sloshpy.tank.modal import Modal, fixed_part
from sloshpy.tank.potential import Potentials, TooCoarseError, potentials
from sloshpy.units import Array, IntArray

TOLERANCE = 1e-6  # relative, of frequency, slosh mass, heights, wave and inertia
NO_MASS = 1e-9  # of the liquid: a mode that does not push the tank has no height
_REFINED = 0.9  # share of the indicated error that is refined
_LEAST_REFINED = 0.25  # of the triangles: a few bad ones must not pass for the whole
_MOST_TRIANGLES = 4000  # some 32 000 unknowns, a second
_CAUTION = 3.0  # what the rate at which the changes shrink is multiplied by
_LEAST_ERROR = 1e-8  # two meshes may agree by chance


def modes_by_elements(section: LiquidSection, modes: int, wanted: int, tolerance: float = TOLERANCE) -> Modal:
    """Return modes and rigid-lid inertia of a liquid, refining the mesh until two solutions agree to a tolerance.

    Of the modes, the first that are wanted must be so good; the others are as good as they come.
    The error estimate is the greatest relative change of a mode's numbers by the last refinement, times three times
    what the changes shrink by (0.1 at least and 1 at most). Where the mesh may grow no further it is above the
    tolerance and says so.

    Raises:
        OutsideValidity: the section cannot be meshed.
    """
    mesh, before = first_mesh(section, tolerance), None
    error = change = np.full(modes, np.inf)
    fixed = np.inf
    while True:
        found = solved(mesh, modes)
        now = in_metres(found, section)
        if before is not None:
            coarser, earlier = before
            lid = abs(now.lid_volume / earlier.lid_volume - 1.0)
            last, change = change, np.maximum(change_of_modes(earlier, now, section), lid)
            shrinking = np.where(np.isfinite(last), change / np.maximum(last, 1e-300), 1.0)
            caution = np.clip(_CAUTION * shrinking, 0.1, 1.0)
            error = np.maximum(change * caution, _LEAST_ERROR)
            fixed = change_of_fixed(earlier, section, now, section, wanted) * float(np.max(caution[:wanted]))
            if np.all(error[:wanted] < tolerance) or len(found.indicator) > 0.6 * _MOST_TRIANGLES:
                break
        before, mesh = (found, now), found.mesh.refined(_worst(found.indicator))
    friction, floor = _friction(found)
    return replace(
        now,
        error=error,
        friction=friction,
        floor_friction=floor,
        friction_error=np.abs(_friction(coarser)[0] / friction - 1.0),
        fixed_error=max(fixed, _LEAST_ERROR),
        method=f"finite elements: {len(found.indicator)} quartic triangles",
    )


def solved(mesh: SectionMesh, modes: int) -> Potentials:
    """Return the potentials on a mesh, refined no more than they need to exist."""
    for _ in range(20):
        try:
            return potentials(mesh, modes, mesh.section.cg_height / mesh.scale)
        except TooCoarseError as error:
            mesh = mesh.refined(error.triangles)
    raise OutsideValidity("the liquid's section cannot be meshed: its wall bends too sharply")


def _worst(indicator: Array) -> IntArray:
    """Return the triangles that hold most of the indicated error."""
    order = np.argsort(indicator)[::-1]
    total = np.cumsum(indicator[order])
    enough = int(np.searchsorted(total, _REFINED * total[-1])) + 1
    least = int(np.ceil(_LEAST_REFINED * len(order)))
    most = max((_MOST_TRIANGLES - len(order)) // 4, 1)  # each becomes four, and some neighbours two
    return np.asarray(order[: min(max(enough, least), most)])


def _friction(found: Potentials) -> Array:
    """Return the friction integral of wall and floor to the integral over the volume, 1/m, (2, n)."""
    of_volume = found.kappa * found.surface_square  # by Green's theorem
    return wall_friction(found.mesh, found.basis, found.q) / of_volume / found.mesh.scale


def in_metres(found: Potentials, section: LiquidSection) -> Modal:
    """Return the modes' numbers in m, without their errors and the friction on the wall."""
    a, p = found.mesh.scale, found
    wall, nothing = p.surface_shape[:, -1:], np.zeros(len(p.kappa))
    mass = np.pi * a**3 * p.kappa * p.surface_moment**2 / p.surface_square
    felt = mass > NO_MASS * section.volume
    moment = np.where(felt, p.surface_moment, 1.0)
    return Modal(
        kappa=p.kappa / a,
        mass_volume=mass,
        spring_height=np.where(felt, section.depth - 2.0 * a * p.lift / (p.kappa * moment), np.nan),
        wave=p.kappa * p.wall * p.surface_moment / p.surface_square,
        lid_volume=np.pi * a**5 * p.lid,
        error=nothing,
        radius=a * p.surface_radius,
        shape=p.surface_shape / wall,
        friction=nothing,
        floor_friction=nothing,
        friction_error=nothing,
        method="",
        fixed_error=0.0,
    )


def change_of_modes(before: Modal, now: Modal, section: LiquidSection) -> Array:
    """Return the greatest relative change of each mode's numbers; of heights relative to the surface's radius.

    A slosh mass that is nothing against the liquid is compared with a thousandth of it, and has no height.
    """
    mass = np.maximum(now.mass_volume, 1e-3 * section.volume)
    known = np.isfinite(now.spring_height) & np.isfinite(before.spring_height)
    felt = np.where(known, np.minimum(now.mass_volume / (1e-3 * section.volume), 1.0), 0.0)
    height = np.where(felt > 0.0, now.spring_height - before.spring_height, 0.0)
    changes = [
        (now.kappa - before.kappa) / now.kappa,
        (now.mass_volume - before.mass_volume) / mass,
        felt * height / section.radius,
        felt * (now.wave - before.wave) / np.where(felt > 0.0, now.wave, 1.0),
    ]
    return np.asarray(np.max(np.abs(changes), axis=0))


def change_of_fixed(before: Modal, was: LiquidSection, now: Modal, section: LiquidSection, wanted: int) -> float:
    """Return the change of the inertia that the modes wanted leave to the fixed mass, relative to the lesser one."""
    old = fixed_part(before, was.volume, was.cg_height, wanted)[2]
    new = fixed_part(now, section.volume, section.cg_height, wanted)[2]
    return abs(new - old) / min(abs(new), abs(old))
