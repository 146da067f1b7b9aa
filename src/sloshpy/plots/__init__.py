"""One function per figure: a finished result and Axes in, Axes out."""

from sloshpy.plots.against_time import plot_against_time
from sloshpy.plots.bode import plot_bode
from sloshpy.plots.damping_law import plot_damping_law
from sloshpy.plots.damping_sweep import plot_damping_sweep
from sloshpy.plots.danger_zone import plot_danger_zone
from sloshpy.plots.danger_zones import plot_danger_zones
from sloshpy.plots.degradation_map import plot_degradation_map
from sloshpy.plots.flight_check import plot_growth_check
from sloshpy.plots.flight_growth import plot_flight_growth
from sloshpy.plots.flight_loop import plot_flight_frequencies, plot_flight_margins
from sloshpy.plots.flight_tanks import plot_flight_cycles, plot_flight_damping, plot_flight_danger_zone
from sloshpy.plots.free_decay import plot_free_decay
from sloshpy.plots.growth import plot_growth
from sloshpy.plots.limit_cycle import plot_limit_cycle
from sloshpy.plots.mode_tracks import plot_mode_tracks
from sloshpy.plots.nichols import plot_nichols
from sloshpy.plots.root_locus import plot_root_locus
from sloshpy.plots.save import figure_bytes, save_figure
from sloshpy.plots.tank import plot_fill_history, plot_tank
from sloshpy.plots.tank_damping import plot_tank_damping
from sloshpy.plots.time_history import plot_time_history
from sloshpy.plots.tvc_gain import plot_tvc_gain

__all__ = [
    "figure_bytes",
    "plot_against_time",
    "plot_bode",
    "plot_damping_law",
    "plot_damping_sweep",
    "plot_danger_zone",
    "plot_danger_zones",
    "plot_degradation_map",
    "plot_fill_history",
    "plot_flight_cycles",
    "plot_flight_damping",
    "plot_flight_danger_zone",
    "plot_flight_frequencies",
    "plot_flight_growth",
    "plot_flight_margins",
    "plot_free_decay",
    "plot_growth",
    "plot_growth_check",
    "plot_limit_cycle",
    "plot_mode_tracks",
    "plot_nichols",
    "plot_root_locus",
    "plot_tank",
    "plot_tank_damping",
    "plot_time_history",
    "plot_tvc_gain",
    "save_figure",
]
