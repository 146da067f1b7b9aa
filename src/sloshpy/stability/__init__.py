"""Margins, disc margin, root locus, danger zone and required damping, eqs 21-24, figs 4-6."""

from sloshpy.stability.danger_zone import DangerZone, RequiredDampingMap, danger_zone, required_damping_map
from sloshpy.stability.margins import Margins, loop_margins, margins
from sloshpy.stability.nichols import nichols_disc_margin
from sloshpy.stability.required_damping import RequiredDamping, loop_required_damping, required_damping
from sloshpy.stability.root_locus import RootLocus, root_locus

__all__ = [
    "DangerZone",
    "Margins",
    "RequiredDamping",
    "RequiredDampingMap",
    "RootLocus",
    "danger_zone",
    "loop_margins",
    "loop_required_damping",
    "margins",
    "nichols_disc_margin",
    "required_damping",
    "required_damping_map",
    "root_locus",
]
