"""Percentiles of a dispersed flight over time, a figure and a table of each number, written into a folder."""

import os
from pathlib import Path

from sloshpy.dispersion import Campaign, against_time
from sloshpy.dispersion.against_time import time_columns
from sloshpy.files.write import write_whole
from sloshpy.plots import plot_against_time, save_figure


def write_campaign_figures(campaign: Campaign, folder: str | os.PathLike[str], suffix: str = "png") -> list[Path]:
    """Write a figure and a CSV of each number of a dispersed flight into a folder, made where it is not there.

    Args:
        campaign: of a flight. folder: for the files. suffix: of the figures, "png", "svg" or "pdf".
    """
    import pandas as pd  # 1 s: only when a table is written

    target, written = Path(folder), []
    target.mkdir(parents=True, exist_ok=True)
    for column in time_columns(campaign):
        found, stem = against_time(campaign, column.name), f"dispersed_{column.name.replace(' ', '_')}"
        text = pd.DataFrame(found.columns()).to_csv(index=False, na_rep="nan")
        write_whole(target / f"{stem}.csv", text.encode())
        drawn = plot_against_time(found)
        written += [target / f"{stem}.csv", save_figure(drawn, target / f"{stem}.{suffix}")]
    return written
