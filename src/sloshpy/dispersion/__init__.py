"""Uncertain cases: inputs that vary, campaigns of many draws, what they show and with which confidence."""

from sloshpy.dispersion.against_time import AgainstTime, against_time
from sloshpy.dispersion.campaign import Campaign, read_campaign, rerun, run_campaign
from sloshpy.dispersion.cluster import Cluster
from sloshpy.dispersion.dispersion import (
    Correlation,
    Dispersion,
    Linear,
    Moment,
    Nonlinear,
    Parameter,
    drawn,
    moments_of,
)
from sloshpy.dispersion.distribution import Triangular, TruncatedNormal, Uniform
from sloshpy.dispersion.export import campaign_dataset, write_campaign
from sloshpy.dispersion.findings import Findings, findings
from sloshpy.dispersion.flown import fly_case

__all__ = [
    "AgainstTime",
    "Campaign",
    "Cluster",
    "Correlation",
    "Dispersion",
    "Findings",
    "Linear",
    "Moment",
    "Nonlinear",
    "Parameter",
    "Triangular",
    "TruncatedNormal",
    "Uniform",
    "against_time",
    "campaign_dataset",
    "drawn",
    "findings",
    "fly_case",
    "moments_of",
    "read_campaign",
    "rerun",
    "run_campaign",
    "write_campaign",
]
