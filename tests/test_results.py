"""Every result prints itself, becomes a dataset with units that NetCDF takes, and remembers its source."""

import numpy as np
import pytest
import xarray as xr

from cases import paper_case
from sloshpy.assess import assess
from sloshpy.dynamics import closed_loop_poles, frequency_response, open_loop
from sloshpy.limit_cycle import degradation_map, growth_curve, limit_cycles, periodic_orbit, predict_limit_cycle
from sloshpy.simulation import simulate
from sloshpy.stability import (
    damping_sensitivity,
    damping_sweep,
    danger_zone,
    disc_margin_curve,
    margin_table,
    margins,
    required_damping,
    required_damping_map,
    root_locus,
    track_modes,
)

CASE = paper_case()
RESULTS = {
    "margins": (lambda: margins(CASE, 0.048), "1.0183", "nichols_disc_margin"),
    "margins of a batch": (lambda: margins(CASE, np.array([[0.01], [0.048]])), "1 unstable", "nichols_disc_margin"),
    "margin table": (lambda: margin_table(CASE, 0.048), "gain-stabilised", "delay"),
    "sensitivity": (lambda: damping_sensitivity(CASE, 0.048), "d growth per 1 %", "growth_slope"),
    "mode tracks": (lambda: track_modes([CASE, CASE], np.array([0.0, 1.0]), 0.02), "LOX slosh", "participation"),
    "poles": (lambda: closed_loop_poles(open_loop(CASE, 0.0)), "13.56 s", "growth"),
    "response": (
        lambda: frequency_response(open_loop(CASE, 0.02), np.geomspace(1, 4, 20)),
        "20 frequencies",
        "loop_real",
    ),
    "required": (lambda: required_damping(CASE), "4.7358 %", "required"),
    "map": (lambda: required_damping_map(CASE, station=np.linspace(-4.0, 14.0, 7)), "worst of 7 stations", "departure"),
    "locus": (lambda: root_locus(CASE, gain=np.geomspace(0.01, 10.0, 30)), "2.12481j", "real"),
    "sweep": (lambda: damping_sweep(CASE, np.array([0.01, 0.048])), "unstable", "gain_db"),
    "curve": (lambda: disc_margin_curve(CASE), "4.7358 %", "disc_margin"),
    "zone": (lambda: danger_zone(CASE), "13.1836 m behind", "aft"),
    "cycle": (lambda: limit_cycles(CASE)[0], "0.2244 m", "slosh"),
    "orbit": (lambda: periodic_orbit(CASE), "stable periodic orbit at 0.3394 Hz", "slosh_real"),
    "degradation": (
        lambda: degradation_map(CASE, gain_db=np.array([0.0, 4.0]), delay=np.array([0.0, 0.1])),
        "the paper's point: 4.304 dB",
        "tvc",
    ),
    "limit cycle": (lambda: predict_limit_cycle(CASE), "4.304 dB", "tvc_amplitude"),
    "growth": (lambda: growth_curve(CASE, amplitude=np.linspace(0.01, 0.5, 9)), "doubles in", "growth"),
    "history": (lambda: simulate(CASE, 20.0), "20.0 s", "slosh"),
    "review": (lambda: assess(CASE), "PASS", "stable"),
}


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_prints_what_matters_and_goes_to_netcdf_and_back(name, tmp_path):
    make, said, variable = RESULTS[name]
    result = make()
    assert said in str(result)
    dataset = result.to_dataset()
    path = tmp_path / "result.nc"
    dataset.to_netcdf(path, engine="h5netcdf")
    with xr.open_dataset(path, engine="h5netcdf") as back:
        np.testing.assert_array_equal(back[variable].values, dataset[variable].values)
        dimensioned = [v for v in back.data_vars.values() if v.dtype.kind == "f"]
        assert all("units" in v.attrs for v in dimensioned)


def test_results_remember_what_they_were_made_from():
    assert margins(CASE, 0.02).source.damping[0] == 0.02
    assert closed_loop_poles(open_loop(CASE, 0.02)).source.damping[0] == 0.02
    assert frequency_response(open_loop(CASE, 0.02), np.array([1.0])).source.damping[0] == 0.02
    assert required_damping(CASE).source.plant.tanks == ("LOX",)
    assert danger_zone(CASE).case is CASE
    assert predict_limit_cycle(CASE).case is CASE
    assert growth_curve(CASE, amplitude=np.array([0.1])).case is CASE
    assert periodic_orbit(CASE).case is CASE
    assert simulate(CASE, 5.0).case is CASE


def test_a_limit_cycle_prints_its_amplitude_and_kind():
    assert "stable limit cycle at 0.3394 Hz: LOX 0.2244 m" in str(limit_cycles(CASE)[0])
