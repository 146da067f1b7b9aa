"""What is exported is what the store holds: read back by xarray, by both formats, whole and partial."""

import warnings

import numpy as np
import pytest
import xarray as xr
from uncertain import RUN, stage

from sloshpy.cli import main
from sloshpy.dispersion import Parameter, Uniform, read_campaign, run_campaign, write_campaign
from sloshpy.dispersion import campaign as campaign_room
from sloshpy.dispersion import export as export_room
from sloshpy.dispersion.rows import Status
from sloshpy.errors import InputError
from sloshpy.files import write_example

pytest.importorskip("zarr", reason="the extra sloshpy[zarr] is not installed")


@pytest.fixture
def partial_campaign(tmp_path, monkeypatch):
    """Twenty-five cases in blocks of ten, the second block lost; runs that have and have not settled."""
    monkeypatch.setattr(campaign_room, "BLOCK", 10)
    monkeypatch.setattr(export_room, "CHUNK", 10)
    d = stage(RUN)
    run_campaign(d, 25, 3, store=tmp_path / "s")
    (tmp_path / "s" / "block-00000001.bin").unlink()
    return read_campaign(d, tmp_path / "s", partial=True)


def opened(path):
    return xr.open_dataset(path, engine="h5netcdf") if path.suffix == ".nc" else xr.open_zarr(path, consolidated=False)


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_an_export_is_read_back_bit_for_bit_with_nan_for_what_is_missing(partial_campaign, tmp_path, suffix):
    c, path = partial_campaign, tmp_path / f"c{suffix}"
    assert write_campaign(c, path) == path
    with opened(path) as found:
        done = found["completed"].values.astype(bool)
        assert np.array_equal(done, (np.arange(25) < 10) | (np.arange(25) >= 20))
        for column in c.columns:
            assert np.array_equal(found[column.name].values, c.column(column.name), equal_nan=True)
            assert np.all(np.isnan(found[column.name].values[~done]))
            assert found[column.name].attrs["units"] == column.unit
        assert np.array_equal(found["drawn.vehicle.mass"].values, c.draws()[:, 0])
        assert np.array_equal(found["status"].values[done], c.status[done])
        assert np.all(found["status"].values[~done] == -1)
        assert Status.UNSETTLED in found["status"].values
        assert found.attrs["cases"] == "15 of 25"
    assert [p.name for p in tmp_path.iterdir() if "tmp" in p.name] == []
    with pytest.raises(InputError, match="there already"):
        write_campaign(c, path)


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_every_variable_says_what_it_is_and_nobody_is_warned(partial_campaign, tmp_path, suffix):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        path = write_campaign(partial_campaign, tmp_path / f"c{suffix}")
        found = xr.open_dataset(path, engine="h5netcdf") if suffix == ".nc" else xr.open_zarr(path)
    with found:
        assert all(x.attrs["long_name"] for x in found.data_vars.values())
        units = {str(n): x.attrs["units"] for n, x in found.data_vars.items() if str(n).startswith("drawn.")}
        inputs = partial_campaign.dispersion.inputs
        assert set(units) == {f"drawn.{name}" for name in inputs}
        assert found["drawn.vehicle.mass"].attrs == {"units": "1", "long_name": "factor drawn for vehicle.mass"}


def test_a_value_drawn_is_in_its_unit():
    delay = Parameter(input="autopilot.delay", distribution=Uniform(low=0.0, high=0.02), factor=False)
    d = stage(parameters=(delay,))
    found = export_room.campaign_dataset(run_campaign(d, 2, 1))
    assert found["drawn.autopilot.delay"].attrs == {"units": "s", "long_name": "value drawn for autopilot.delay"}


def test_both_formats_hold_the_same(partial_campaign, tmp_path):
    one, other = (opened(write_campaign(partial_campaign, tmp_path / name)) for name in ("c.nc", "c.zarr"))
    with one, other:
        xr.testing.assert_identical(one.load(), other.load())


def test_a_lost_chunk_of_zarr_reads_as_nan_and_a_flipped_bit_is_found(partial_campaign, tmp_path):
    path = write_campaign(partial_campaign, tmp_path / "c.zarr")
    chunks = sorted((path / "engine_peak" / "c").iterdir())
    assert len(chunks) == 3
    chunks[0].unlink()
    with opened(path) as found:
        assert np.all(np.isnan(found["engine_peak"].values[:10]))
        assert not np.any(np.isnan(found["engine_peak"].values[20:]))
    data = bytearray(chunks[2].read_bytes())
    data[len(data) // 2] ^= 1
    chunks[2].write_bytes(data)
    with opened(path) as found, pytest.raises(Exception, match=r"(?i)checksum"):
        found["engine_peak"].load()


def test_an_export_that_fails_leaves_nothing(partial_campaign, tmp_path, monkeypatch, capsys):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, "to_zarr", full)
    with pytest.raises(InputError, match="No space left"):
        write_campaign(partial_campaign, tmp_path / "c.zarr")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["s"]
    monkeypatch.setattr(export_room.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"sloshpy\[zarr\]"):
        write_campaign(partial_campaign, tmp_path / "c.zarr")
    write_example("upper_stage", tmp_path)
    file = write_example("upper_stage_dispersed", tmp_path)
    for name in ("c.csv", "none/c.nc"):
        with pytest.raises(SystemExit) as ended:
            main(["disperse", str(file), "--cases", "5", "--seed", "1", "--export", str(tmp_path / name)])
        assert ended.value.code == 2
        assert "export" in capsys.readouterr().err
