"""A campaign for other tools: NetCDF or Zarr, from proved blocks, with nan for what is missing and a mask."""

import importlib.util
import os
import shutil
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sloshpy.dispersion.campaign import Campaign
from sloshpy.dispersion.dispersion import Dispersion, Parameter
from sloshpy.dispersion.rows import Status
from sloshpy.dispersion.varied import find_input, stands_in
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
        data[f"drawn.{p.input}"] = ("case", draws[:, k], _drawn_attributes(d, p))
    codes = ", ".join(f"{s.value} {s.name.lower()}" for s in Status)
    data["status"] = ("case", np.where(campaign.done, campaign.status, -1).astype(np.int8), {"long_name": codes})
    data["completed"] = ("case", campaign.done.astype(np.int8), {"long_name": "1 where the case is done"})
    done = int(np.sum(campaign.done))
    attributes = {
        "name": d.name,
        "seed": str(campaign.seed),
        "cases": f"{done} of {campaign.count}",
        "digest": campaign.digest,
    }
    return xr.Dataset(data, coords={"case": np.arange(campaign.count)}, attrs=attributes)


def _drawn_attributes(dispersion: Dispersion, parameter: Parameter) -> dict[str, str]:
    """Return unit and meaning of what was drawn for an input: a factor of the case's value, or the value in SI."""
    if parameter.factor:
        return {"units": "1", "long_name": f"factor drawn for {parameter.input}"}
    cases = [case for case in dispersion.cases if stands_in(case, parameter.input)]
    quantity = find_input(cases[0], parameter.input).quantity
    assert quantity is not None  # what has none is varied by a factor only
    unit = "1" if quantity.unit == "dB" else quantity.unit  # an amplitude ratio inside
    return {"units": unit, "long_name": f"value drawn for {parameter.input}"}


SUFFIXES = (".nc", ".zarr")
CHUNK = 1000  # cases, as a block of the store


def write_campaign(campaign: Campaign, path: str | os.PathLike[str]) -> Path:
    """Write a campaign as NetCDF (.nc) or as a folder of Zarr (.zarr); it appears whole or not at all.

    Raises:
        InputError: another suffix, something that is there already, a disk that is full, or no package zarr.
    """
    path = Path(path)
    check_export(path)
    new = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    dataset = campaign_dataset(campaign)
    try:
        (_write_netcdf if path.suffix == ".nc" else _write_zarr)(dataset, new)
        os.rename(new, path)
    except OSError as error:
        raise _refused(path, f"cannot be written ({error.strerror or error})", "make room or name another") from None
    finally:
        shutil.rmtree(new, ignore_errors=True)
        new.unlink(missing_ok=True)
    return path


def check_export(path: Path) -> None:
    """Refuse a name that no campaign can be written to, before it is computed."""
    if path.suffix not in SUFFIXES:
        raise _refused(path, f"must end in {' or '.join(SUFFIXES)}", "name a file of such a format")
    if path.exists() or not path.parent.is_dir():
        raise _refused(path, "is there already" if path.exists() else "has no folder to stand in", "name another")
    if path.suffix == ".zarr" and importlib.util.find_spec("zarr") is None:
        raise _refused(path, "needs the package zarr", "pip install 'sloshpy[zarr]', or write .nc")


def _write_netcdf(dataset: "xr.Dataset", path: Path) -> None:
    floats = [name for name, x in dataset.data_vars.items() if x.dtype.kind == "f"]
    dataset.to_netcdf(path, engine="h5netcdf", encoding={name: {"_FillValue": np.nan} for name in floats})


def _write_zarr(dataset: "xr.Dataset", path: Path) -> None:
    """Write chunks of a block each, checked by CRC-32C; a chunk that gets lost reads as nan, not as zero."""
    from zarr.codecs import Crc32cCodec, ZstdCodec

    empty = {"status": -1, "completed": 0}
    encoding = {
        name: {
            "chunks": (min(CHUNK, dataset.sizes["case"]),),
            "compressors": (ZstdCodec(), Crc32cCodec()),
            "fill_value": empty.get(str(name), np.nan),
        }
        for name in dataset.data_vars
    }
    with warnings.catch_warnings():
        # consolidated, or xarray warns whoever opens it; readers that do not know it read the arrays' own metadata
        warnings.filterwarnings("ignore", "Consolidated metadata is currently not part")
        dataset.to_zarr(path, mode="w-", zarr_format=3, consolidated=True, write_empty_chunks=True, encoding=encoding)


def _refused(path: Path, rule: str, cure: str) -> InputError:
    return InputError(Problem(key="export", value=str(path), rule=rule, cure=cure))
