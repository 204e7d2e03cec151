"""What a result tells by sensor, and files of relnav 0.1, which do not."""

import csv
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from relnav_sim.measurements.channel import Channel
from relnav_sim.results import layout, open_results
from relnav_sim.results.block import ResultsError
from relnav_sim.results.export import export_series, export_summary
from relnav_sim.results.merge import merge_pieces
from relnav_sim.results.pieces import result_pieces, shard_piece

EARLIER = Path(__file__).parents[1] / "reference" / "result_0_1_1.h5"
"""Written by relnav 0.1.1 (commit 4350891): three runs of an ekf with a radar that is out from 30 to 40 s."""
SENSORS = "alpha_0.5"


def test_it_is_read_as_it_was_written(result: Path, make_block) -> None:
    expected = make_block(1, range(5)).filters[SENSORS].by_sensor
    with open_results(result) as results:
        found = results.by_sensor(1, SENSORS)
        assert found.names == results.sensors == ("radar", "camera")
        for spec in layout.BY_SENSOR:
            part = spec.name.removeprefix("sensor_")
            assert getattr(found, part).dtype == np.dtype(spec.dtype)
            np.testing.assert_array_equal(getattr(found, part), getattr(expected, part))
        np.testing.assert_array_equal(results.dof_sum(1, SENSORS)[0], np.where(
            expected.dof_sum[0].sum(axis=-1) > 0, expected.dof_sum[0].sum(axis=-1),
            3 * results.statistic(1, SENSORS, "updates")[0],
        ))  # fmt: skip
        one = results.series(1, SENSORS, 3)
        np.testing.assert_array_equal(one.nis_by["camera"], expected.nis[3, :, 1])
        np.testing.assert_array_equal(one.dof_by["radar"], expected.dof[3, :, 0])
        assert results.by_sensor(1, "ekf") is None and results.series(1, "ekf", 3).nis_by == {}


def test_channels_are_named_with_their_units(result: Path) -> None:
    with open_results(result) as results:
        channels = results.channels("scale=2")
    assert channels["radar"] == (Channel("range", "m", "range"), Channel("azimuth", "rad", "azimuth", True))
    assert [channel.unit for channel in channels["camera"]] == ["rad"]


@pytest.mark.parametrize("damage", ['{"radar": [{"name": 1}]}', '{"radar": 3}', '{"radar": [{"odd": 1}]}', "[]"])
def test_damaged_channels_are_refused(old_result: Path, tmp_path: Path, damage: str) -> None:
    path = tmp_path / "damaged.h5"
    path.write_bytes(old_result.read_bytes())
    with h5py.File(path, "r+") as file:
        file["case_000"].attrs["channels"] = damage
    with pytest.raises(ResultsError, match="channels"):
        open_results(path)


def test_merging_keeps_the_bits(tmp_path: Path, make_block, make_header, write, facts, result: Path) -> None:
    """Other blocks, and results in place of shards."""
    split = write(tmp_path / "s", [make_block(case, runs) for case in (0, 1) for runs in ([4], [1, 3], [0, 2])])
    merge_pieces([shard_piece(path) for path in split], make_header(), facts, tmp_path / "shards.h5")
    merge_pieces(result_pieces(tmp_path / "shards.h5"), make_header(), facts, tmp_path / "again.h5")
    with open_results(result) as one:
        for path in (tmp_path / "shards.h5", tmp_path / "again.h5"):
            with open_results(path) as other:
                for spec in layout.BY_SENSOR:
                    part = spec.name.removeprefix("sensor_")
                    a, b = (getattr(r.by_sensor(1, SENSORS), part) for r in (one, other))
                    assert a.tobytes() == b.tobytes(), part
                assert other.channels(0) == one.channels(0)


def test_as_columns(result: Path, tmp_path: Path) -> None:
    with open_results(result) as results:
        summary, found = results.summary(), results.by_sensor(0, SENSORS)
        export_summary(results, tmp_path / "summary.csv")
        export_series(results, tmp_path / "series.csv")
    rows = (summary["filter"] == SENSORS) & (summary["case"] == 0)
    np.testing.assert_array_equal(summary["settled_dof_sum_camera"][rows], found.dof_sum[:, 1, 1])
    np.testing.assert_array_equal(summary["nis_sum_radar"][rows], found.nis_sum[:, 0, 0])
    assert np.isnan(summary["updates_radar"][summary["filter"] == "ekf"]).all()
    with open(tmp_path / "series.csv", newline="", encoding="utf-8") as file:
        series = [row for row in csv.DictReader(file) if row["filter"] == SENSORS and row["case_label"] == "scale=1"]
    assert [float(row["dof_camera"]) for row in series] == found.dof[..., 1].ravel().tolist()
    with open(tmp_path / "summary.csv", newline="", encoding="utf-8") as file:
        assert {"nis_lag1_camera", "settled_updates_radar"} <= set(next(csv.reader(file)))


def test_xarray_opens_it_by_sensor(result: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    group = f"case_000/{SENSORS}"
    with xarray.open_dataset(result, group=group, engine="h5netcdf") as data, open_results(result) as own:
        assert data["sensor_nis"].dims == ("run", "time", "sensor")
        camera = data["sensor_readings"].sel(sensor="camera", run=2)
        np.testing.assert_array_equal(camera, own.by_sensor(0, SENSORS).readings[2, :, 1])
        xarray.testing.assert_equal(own.to_xarray()[group].ds["sensor_dof"].load(), data["sensor_dof"])


def test_a_file_of_relnav_0_1_has_three_degrees_of_freedom() -> None:
    with open_results(EARLIER) as results:
        assert results.by_sensor(0, "ekf") is None and results.sensors == () and results.channels(0) == {}
        assert results.dof_sum(0, "ekf").tolist() == [[3 * 50, 3 * 31]] * 3
        known = np.isfinite(results.nis(0, "ekf"))
        np.testing.assert_array_equal(results.dof(0, "ekf"), np.where(known, 3, 0))
        assert known.sum(axis=1).tolist() == [10, 10, 10]  # 12 stored epochs after the start, two of them without radar
        mean = results.nis_sum(0, "ekf") / results.statistic(0, "ekf", "updates")
        np.testing.assert_allclose(mean, results.statistic(0, "ekf", "nis_mean"), rtol=1e-15)
        assert results.to_xarray()["case_000/ekf"].ds["nis"].shape == (3, 13)
        assert "nis_sum_radar" not in results.summary()


def test_pieces_without_sensors_join_those_with(tmp_path: Path, make_block, make_header, write, facts) -> None:
    """Runs of relnav 0.1 beside new ones: no degrees are known of the former, which count as 3 each."""
    blocks = [make_block(case, runs) for case in (0, 1) for runs in ([0, 1, 2], [3, 4])]
    bare = {name: replace(one, by_sensor=None) for name, one in blocks[0].filters.items()}
    shards = write(tmp_path / "s", [replace(blocks[0], filters=bare), *blocks[1:]])
    merge_pieces([shard_piece(path) for path in shards], make_header(), facts, tmp_path / "mixed.h5")
    with open_results(tmp_path / "mixed.h5") as results:
        found = results.by_sensor(0, SENSORS)
        assert np.isnan(found.nis[:3]).all() and (found.dof_sum[:3] == 0).all()
        updates = results.statistic(0, SENSORS, "updates")
        np.testing.assert_array_equal(results.dof_sum(0, SENSORS)[:3], 3 * updates[:3])
        np.testing.assert_array_equal(found.nis_sum[3:], blocks[1].filters[SENSORS].by_sensor.nis_sum)
