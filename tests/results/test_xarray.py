"""xarray opens every group by itself, with names, units and coordinates."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from relnav_sim.results import layout, open_results

xarray = pytest.importorskip("xarray")


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_every_group_opens_unaided(engine: str, result: Path) -> None:
    pytest.importorskip({"h5netcdf": "h5netcdf", "netcdf4": "netCDF4"}[engine])
    groups = ["/", "constants"]
    with h5py.File(result) as file:
        file.visititems(lambda name, item: groups.append(name) if isinstance(item, h5py.Group) else None)
    assert len(groups) == 2 + 1 + 2 * 4
    opened = {}
    for group in groups:
        with xarray.open_dataset(result, group=group, engine=engine) as data:
            opened[group] = data.load()
            assert not [dim for dim in data.sizes if dim.startswith("phony")]
    ekf = opened["case_000/ekf"]
    assert {spec.name for spec in layout.FILTER} <= set(ekf.data_vars)
    for spec in layout.FILTER:
        assert ekf[spec.name].dims == spec.dims
        assert ekf[spec.name].attrs["units"] == spec.units
    with open_results(result) as results:
        wanted = results.statistic(0, "ekf", "rms")[:, 1, 6]
        np.testing.assert_array_equal(ekf["rms"].sel(span="settled", quantity="r"), wanted)
        np.testing.assert_array_equal(ekf["error"].sel(run=2, component="vz"), results.error(0, "ekf")[2, :, 5])
    assert ekf["time"].dtype == np.float64 and ekf["time"].values[-1] == 60
    assert ekf["level"].values.tolist() == list(layout.LEVELS)
    assert opened["case_000/failures"]["reason"].values.tolist() == ["covariance not positive definite"]
    assert opened["case_001/failures"].sizes["failure"] == 0


def test_the_tree(result: Path) -> None:
    with open_results(result) as results:
        tree = results.to_xarray()
        error = results.error(1, "alpha_0.5")
        rms = results.statistic(1, "alpha_0.5", "rms")
    assert tree.attrs["campaign_name"] == "trial <script>"
    assert set(tree["case_001"].children) == {"ekf", "alpha_0.5", "failures"}
    found = tree["case_001/alpha_0.5"].ds
    np.testing.assert_array_equal(found["error"].sel(run=[4, 2], component="vx")[:, ::-2], error[[4, 2], ::-2, 3])
    np.testing.assert_array_equal(found["rms"].sel(span="whole"), rms[:, 0])
    assert found["rms"].attrs["long_name"] == next(s.long_name for s in layout.SUMMARY if s.name == "rms")
    assert tree["case_000/failures"].ds["filter"].values.tolist() == ["ekf"]


def test_the_tree_is_what_xarray_itself_opens(result: Path) -> None:
    pytest.importorskip("h5netcdf")
    with open_results(result) as results:
        tree = results.to_xarray()
    for name in ("case_000", "case_000/ekf", "case_000/failures", "case_001/alpha_0.5", "case_001/failures"):
        with xarray.open_dataset(result, group=name, engine="h5netcdf") as data:
            ours = tree[name].to_dataset().load()[list(data.data_vars)]
            xarray.testing.assert_equal(ours, data.load())


def test_without_xarray_one_sentence(result: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from relnav_sim.results.block import ResultsError

    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with open_results(result) as results, pytest.raises(ResultsError, match=r"pip install 'relnav-sim\[xarray\]'"):
        results.to_xarray()
