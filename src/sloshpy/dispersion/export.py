"""A campaign as one file for other tools: NetCDF, from proved blocks, with nan for what is missing and a mask."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.dispersion.campaign import Campaign
from sloshpy.dispersion.rows import Status
from sloshpy.errors import InputError, Problem

if TYPE_CHECKING:
    import xarray as xr


def campaign_dataset(campaign: Campaign) -> "xr.Dataset":
    """Return draws and answers over the case number, units in the attributes, `completed` true where a case is done."""
    import xarray as xr  # 1 s: only when a dataset is wanted

    d = campaign.dispersion
    data: dict[str, object] = {
        c.name: ("case", campaign.values[:, k], {"units": c.unit, "long_name": c.meaning})
        for k, c in enumerate(campaign.columns)
    }
    draws = campaign.draws()
    for k, p in enumerate(d.parameters):
        data[f"drawn.{p.input}"] = ("case", draws[:, k], {"long_name": "factor" if p.factor else "value, SI"})
    codes = ", ".join(f"{s.value} {s.name.lower()}" for s in Status)
    data["status"] = ("case", np.where(campaign.done, campaign.status, -1).astype(np.int8), {"long_name": codes})
    data["completed"] = ("case", campaign.done.astype(np.int8))
    done = int(np.sum(campaign.done))
    attributes = {
        "name": d.name,
        "seed": str(campaign.seed),
        "cases": f"{done} of {campaign.count}",
        "digest": campaign.digest,
    }
    return xr.Dataset(data, coords={"case": np.arange(campaign.count)}, attrs=attributes)


def write_campaign(campaign: Campaign, path: str | os.PathLike[str]) -> Path:
    """Write a campaign as NetCDF (.nc); it appears whole or not at all.

    Raises:
        InputError: another suffix, a file that is there already, or a disk that is full.
    """
    path = Path(path)

    def refused(rule: str, cure: str) -> InputError:
        return InputError(Problem(key="export", value=str(path), rule=rule, cure=cure))

    if path.suffix != ".nc":
        raise refused("must end in .nc", "name a file of that format")
    if path.exists() or not path.parent.is_dir():
        raise refused("is there already" if path.exists() else "has no folder to stand in", "name another file")
    new = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    dataset = campaign_dataset(campaign)
    floats = [name for name, x in dataset.data_vars.items() if x.dtype.kind == "f"]
    try:
        dataset.to_netcdf(new, engine="h5netcdf", encoding={name: {"_FillValue": np.nan} for name in floats})
        os.replace(new, path)
    except OSError as error:
        new.unlink(missing_ok=True)
        raise refused(f"cannot be written ({error.strerror or error})", "make room or name another folder") from None
    return path
