"""Margins, disc margin, root locus, danger zone and required damping, eqs 21-24, figs 4-6."""

from sloshpy.stability.damping_law import DampingLawCurve, damping_law_curve
from sloshpy.stability.damping_sensitivity import DampingSensitivity, damping_sensitivity
from sloshpy.stability.danger_zone import DangerZone, RequiredDampingMap, danger_zone, required_damping_map
from sloshpy.stability.grid import GridSweep, grid_sweep
from sloshpy.stability.joint_damping import falls_short, joint_damping, joint_required_damping
from sloshpy.stability.margin_table import MarginTable, margin_table
from sloshpy.stability.margins import Margins, loop_margins, margins
from sloshpy.stability.mode_margins import ModeMargins, Reading
from sloshpy.stability.mode_tracks import ModeTracks, track_modes
from sloshpy.stability.nichols import nichols_disc_margin
from sloshpy.stability.required_damping import RequiredDamping, loop_required_damping, required_damping
from sloshpy.stability.required_scale import RequiredScale, required_scale
from sloshpy.stability.root_locus import RootLocus, root_locus
from sloshpy.stability.sweep import DampingSweep, DiscMarginCurve, damping_sweep, disc_margin_curve, telling_dampings
from sloshpy.stability.veering import Veering

__all__ = [
    "DampingLawCurve",
    "DampingSensitivity",
    "DampingSweep",
    "DangerZone",
    "DiscMarginCurve",
    "GridSweep",
    "MarginTable",
    "Margins",
    "ModeMargins",
    "ModeTracks",
    "Reading",
    "RequiredDamping",
    "RequiredDampingMap",
    "RequiredScale",
    "RootLocus",
    "Veering",
    "damping_law_curve",
    "damping_sensitivity",
    "damping_sweep",
    "danger_zone",
    "disc_margin_curve",
    "falls_short",
    "grid_sweep",
    "joint_damping",
    "joint_required_damping",
    "loop_margins",
    "loop_required_damping",
    "margin_table",
    "margins",
    "nichols_disc_margin",
    "required_damping",
    "required_damping_map",
    "required_scale",
    "root_locus",
    "telling_dampings",
    "track_modes",
]
