"""Reading: what was written comes back labelled; what is no result is refused."""

import csv
from pathlib import Path

import h5py
import numpy as np
import pytest

from relnav_sim.results import layout, open_results
from relnav_sim.results.block import ResultsError
from relnav_sim.results.export import export_series, export_summary


def test_facts(result: Path, facts) -> None:
    with open_results(result) as results:
        assert results.campaign_name == "trial <script>"
        assert results.campaign_text.startswith("name: trial  # Größe in m\n") and len(results.campaign_text) > 100_000
        assert results.campaign_content["clock"] == {"step_s": 0.2}
        assert results.seed == 2**80 + 1
        assert results.cases == ("scale=1", "scale=2") and results.filters == ("ekf", "alpha_0.5")
        assert results.runs == (0, 1, 2, 3, 4) and results.planned_runs == 5 and results.missing() == {}
        assert results.variables("id1") == {"sensors.radar.scale": 2}
        assert results.constants == {"mu_m3_s2": 3.986004418e14, "truth_zonals": 4}
        assert results.provenance == facts
        assert results.provenance.command_line == "relnav run 'my campaign.yaml'"
        assert results.provenance.started == "2026-01-02T03:04:05+00:00"
        assert {"relnav", "python", "numpy", "h5py"} <= set(results.provenance.versions)


def test_series_and_summary_give_back_the_blocks(result: Path, make_block) -> None:
    with open_results(str(result)) as results:
        summary = results.summary()
        assert summary["case"].tolist() == [0] * 10 + [1] * 10
        assert summary["filter"].tolist() == (["ekf"] * 5 + ["alpha_0.5"] * 5) * 2
        assert summary["run"].tolist() == list(range(5)) * 4
        assert summary["failed"].dtype == bool
        for case, label in enumerate(results.cases):
            block = make_block(case, range(5))
            np.testing.assert_array_equal(results.time_s(label), block.time_s)
            np.testing.assert_array_equal(results.truth(case), block.relative)
            for name, one in block.filters.items():
                rows = (summary["case"] == case) & (summary["filter"] == name)
                np.testing.assert_array_equal(summary["r_rms_m"][rows], one.summary["rms"][:, 0, 6])
                np.testing.assert_array_equal(summary["settled_vy_max_m_s"][rows], one.summary["max"][:, 1, 4])
                np.testing.assert_array_equal(summary["settled_v_p99_m_s"][rows], one.summary["quantile"][:, 1, 1, 2])
                coverage = one.summary["coverage"][:, 0, 1, 1]
                np.testing.assert_array_equal(summary["position_coverage_90"][rows], coverage)
                np.testing.assert_array_equal(summary["cpu_us_per_step"][rows], one.summary["cpu_per_step"])
                np.testing.assert_array_equal(results.statistic(case, name, "rms"), one.summary["rms"])
                for what in ("error", "sigma", "nis", "nees"):
                    whole = getattr(results, what)(label, name)
                    assert whole.dtype == np.float64
                    np.testing.assert_array_equal(whole, getattr(one, what))
                series = results.series(f"id{case}", name, 3)
                np.testing.assert_array_equal(series.error, one.error[3])
                np.testing.assert_array_equal(series.nis, one.nis[3])
                np.testing.assert_array_equal(series.truth, block.relative[3])
                assert (series.case, series.filter, series.run) == (label, name, 3)


def test_diagnostics(result: Path) -> None:
    with open_results(result) as results:
        ekf, alpha = results.diagnostics(1, "ekf"), results.diagnostics(1, "alpha_0.5")
    assert ekf.keys() == {"rejected"} and alpha.keys() == {"ess", "rejected"}
    assert ekf["rejected"].tolist() == [18, 19, 20, 21, 22]
    np.testing.assert_array_equal(alpha["rejected"], [18, 19, 20, np.nan, np.nan])
    assert alpha["ess"].tolist() == [13, 14, 15, 16, 17]
    with open_results(result) as results:
        summary = results.summary()
    mine = (summary["case"] == 1) & (summary["filter"] == "alpha_0.5")
    np.testing.assert_array_equal(summary["diagnostic_ess"][mine], alpha["ess"])
    assert np.isnan(summary["diagnostic_ess"][summary["filter"] == "ekf"]).all()


def test_extra_states(result: Path, make_block) -> None:
    with open_results(result) as results:
        assert results.augmented(1, "ekf") is None
        extra = results.augmented(1, "alpha_0.5")
    expected = make_block(1, range(5)).filters["alpha_0.5"].augmented
    assert extra.names == ("range_bias", "azimuth_bias") and extra.units == ("m", "rad")
    assert extra.mean.shape == (5, 2, 2) and extra.error.shape == (5, 7, 2)
    for part in ("estimate", "error", "sigma", "mean", "rms"):
        assert getattr(extra, part).dtype == np.float64
        np.testing.assert_array_equal(getattr(extra, part), getattr(expected, part))


def test_questions_without_an_answer(result: Path) -> None:
    with open_results(result) as results:
        with pytest.raises(ResultsError, match="no case 'nope'; there are 'scale=1', 'scale=2'"):
            results.error("nope", "ekf")
        with pytest.raises(ResultsError, match="no filter"):
            results.error(0, "ukf")
        with pytest.raises(ResultsError, match="no run 7"):
            results.series(0, "ekf", 7)
        with pytest.raises(ResultsError, match="no statistic 'x'"):
            results.statistic(0, "ekf", "x")


def test_files_that_are_no_results(tmp_path: Path, old_result: Path) -> None:
    path = tmp_path / "r.h5"
    with pytest.raises(ResultsError, match="no such file"):
        open_results(path)
    path.write_bytes(old_result.read_bytes()[:5000])
    with pytest.raises(ResultsError, match="damaged"):
        open_results(path)
    with h5py.File(path, "w") as file:
        file.attrs["format"] = 3
    with pytest.raises(ResultsError, match="not written by relnav"):
        open_results(path)
    path.write_bytes(old_result.read_bytes())
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = layout.FORMAT_VERSION + 1
    with pytest.raises(ResultsError, match="format version is 3; this relnav reads up to 2"):
        open_results(path)
    path.write_bytes(old_result.read_bytes())
    with h5py.File(path, "r+") as file:
        file.attrs["campaign_content"] = "[" * 100_000
    with pytest.raises(ResultsError, match="campaign_content"):
        open_results(path)


def _replace(path: Path, source: Path, make) -> None:
    path.write_bytes(source.read_bytes())
    with h5py.File(path, "r+") as file:
        group = file["case_000/ekf"]
        del group["nees"]
        make(group)


def test_hostile_datasets_are_refused(tmp_path: Path, old_result: Path) -> None:
    """Data from elsewhere, code-like types and sizes that would exhaust memory never get as far as being read."""
    path = tmp_path / "r.h5"
    (tmp_path / "secret").write_bytes(bytes(5 * 7 * 4))
    virtual = h5py.VirtualLayout((5, 7), "<f4")
    virtual[...] = h5py.VirtualSource(str(old_result), "case_000/alpha_0.5/nees", (5, 7))

    def link(group: h5py.Group) -> None:
        group["nees"] = h5py.ExternalLink(str(old_result), "/case_000/alpha_0.5/nees")

    def soft(group: h5py.Group) -> None:
        group["nees"] = h5py.SoftLink("/case_000/alpha_0.5/nees")

    makers = (
        (link, "is a link"),
        (soft, "is a link"),
        (lambda g: g.create_virtual_dataset("nees", virtual), "other files"),
        (
            lambda g: g.create_dataset("nees", (5, 7), "<f4", external=[(str(tmp_path / "secret"), 0, 140)]),
            "other files",
        ),
        (lambda g: g.create_dataset("nees", (5, 7), h5py.vlen_dtype(np.float32)), "layout differs"),
        (lambda g: g.create_dataset("nees", (5, 7), h5py.string_dtype()), "layout differs"),
        (lambda g: g.create_dataset("nees", (5, 7), h5py.opaque_dtype("M8[s]")), "layout differs"),
        (lambda g: g.create_dataset("nees", (5,), "<f4"), "layout differs"),
        (lambda g: g.create_dataset("nees", (6, 7), "<f4"), "layout differs"),
        (lambda g: g.create_group("nees"), "missing"),
        (lambda g: None, "missing"),
    )
    for make, words in makers:
        _replace(path, old_result, make)
        with open_results(path) as results, pytest.raises(ResultsError, match=words):
            results.nees(0, "ekf")
    path.write_bytes(old_result.read_bytes())
    with h5py.File(path, "r+") as file:
        group = file["case_000/ekf"]
        for name in ("run", "time", "nees"):
            del group[name]
        group.create_dataset("run", (10**6,), "<i8")
        group.create_dataset("time", (10**6,), "<f8")
        group.create_dataset("nees", (10**6, 10**6), "<f4", chunks=(1, 10**5))
    with open_results(path) as results, pytest.raises(ResultsError, match="declares more data"):
        results.nees(0, "ekf")


def test_csv(result: Path, tmp_path: Path) -> None:
    with open_results(result) as results:
        summary = results.summary()
        export_summary(results, tmp_path / "summary.csv")
        export_series(results, tmp_path / "series.csv")
        error = results.error("scale=2", "alpha_0.5")
    with open(tmp_path / "summary.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == list(summary) and len(rows) == 20
    assert [float(row["settled_r_rms_m"]) for row in rows] == summary["settled_r_rms_m"].tolist()
    with open(tmp_path / "series.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 2 * 5 * 7
    assert rows[0]["nis"] == ""
    last = [float(rows[-1][f"{c}_error_{layout.quantity_unit(c)}"]) for c in layout.COMPONENTS]
    assert last == error[-1, -1].tolist()
