"""Uncertain cases: inputs that vary, campaigns of many draws, what they show and with which confidence."""

from sloshpy.dispersion.campaign import Campaign, read_campaign, rerun, run_campaign
from sloshpy.dispersion.cluster import Cluster
from sloshpy.dispersion.dispersion import Correlation, Dispersion, Linear, Nonlinear, Parameter, drawn
from sloshpy.dispersion.distribution import Triangular, TruncatedNormal, Uniform
from sloshpy.dispersion.export import campaign_dataset, write_campaign
from sloshpy.dispersion.findings import Findings, findings

__all__ = [
    "Campaign",
    "Cluster",
    "Correlation",
    "Dispersion",
    "Findings",
    "Linear",
    "Nonlinear",
    "Parameter",
    "Triangular",
    "TruncatedNormal",
    "Uniform",
    "campaign_dataset",
    "drawn",
    "findings",
    "read_campaign",
    "rerun",
    "run_campaign",
    "write_campaign",
]
