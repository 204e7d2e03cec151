"""The layout is complete, and the file says the same."""

from pathlib import Path

import h5py
import numpy as np

from relnav_sim.conventions import RESERVED_NAMES
from relnav_sim.results import layout
from relnav_sim.results.block import FilterResult


def test_every_dataset_in_the_file_is_in_the_layout_and_described(result: Path) -> None:
    known = {spec.name: spec for spec in (*layout.FILTER, *layout.OWN, layout.TRUTH, *layout.LIMITS)}
    tables = {spec.name: spec for spec in layout.FAILURES}
    seen = set()

    def visit(path: str, item: object) -> None:
        if not isinstance(item, h5py.Dataset):
            return
        name = path.split("/")[-1]
        spec = tables[name] if "failures" in path and name in tables else known.get(name, layout.DIMENSIONS.get(name))
        assert spec is not None, path
        seen.add(name)
        assert item.attrs["long_name"] == spec.long_name
        assert item.attrs.get("units", "") == spec.units
        if isinstance(spec, layout.Dataset):
            assert [dim[0].name.split("/")[-1] for dim in item.dims] == list(spec.dims)
        if spec.dtype != "str":
            assert item.dtype == np.dtype(spec.dtype)

    with h5py.File(result) as file:
        file.visititems(visit)
        assert set(file["case_000"]) == {"alpha_0.5", "ekf", *RESERVED_NAMES}
        assert set(file["case_000/ekf"]) >= {spec.name for spec in layout.FILTER}
    assert seen >= set(known) | set(tables)


def test_every_dataset_has_units_and_a_meaning() -> None:
    for spec in (*layout.FILTER, *layout.OWN, layout.TRUTH, *layout.LIMITS, *layout.FAILURES):
        assert spec.long_name and (spec.units or spec.dtype == "str")
        assert set(spec.dims) <= set(layout.DIMENSIONS)


def test_the_documentation_has_every_dataset_as_it_is() -> None:
    text = (Path(__file__).parents[2] / "docs" / "results-file.md").read_text(encoding="utf-8")
    for spec in (*layout.FILTER, *layout.OWN, layout.TRUTH, *layout.LIMITS, *layout.FAILURES):
        meaning = spec.long_name.replace("|", "\\|")
        kind = spec.dtype.lstrip("<|")
        row = f"| `{spec.name}` | {', '.join(spec.dims)} | {spec.units or '-'} | {kind} | {meaning} |"
        assert row in text, row
    for dimension in layout.DIMENSIONS.values():
        entries = ", ".join(map(str, dimension.values)) if dimension.values else "from the data"
        assert f"| `{dimension.name}` | {dimension.units or '-'} | " in text
        assert f" | {entries} | {dimension.long_name} |" in text


def test_columns_are_distinct_and_named_with_their_unit() -> None:
    names = [column for spec in layout.SUMMARY for column, _ in layout.columns(spec)]
    assert len(names) == len(set(names))
    expected = {
        "failed", "x_mean_m", "settled_vz_std_m_s", "r_rms_m", "v_max_m_s", "r_median_m", "settled_v_p99_m_s",
        "anees", "settled_position_anees", "coverage_95", "velocity_coverage_50", "nis_mean", "settled_nis_lag1",
        "convergence_s", "convergence_5m_s", "outside_late", "cpu_us_per_step", "epochs", "settled_updates",
        "log_likelihood",
    }  # fmt: skip
    assert expected <= set(names)


def test_all_failed_fits_the_layout() -> None:
    arrays = FilterResult.all_failed(3, 4).arrays()
    assert list(arrays) == [spec.name for spec in layout.FILTER]
    assert arrays["failed"].tolist() == [1, 1, 1]
    assert np.isnan(arrays["error"]).all() and arrays["error"].shape == (3, 4, 6)
