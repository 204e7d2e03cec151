"""Small summaries of campaigns: written, read, checked, compared."""

import json

import numpy as np
import pytest

from replication.compare import compared
from replication.extract import Extract, digest, read_extract, rounded, write_extract
from replication.measured import Measured


def extract(values=(1.0, 2.0, None), runs=(0, 1, 2), hash="abc"):
    case = {
        "label": "base",
        "variables": {"clock.step_s": 1, "start": {"kind": "dispersed", "position_sigma_m": [1, 1, 1]}},
        "failed_runs": 1,
        "end_s": 6000.0,
        "bound": [0.1, 0.001],
        "columns": {"ekf": {"settled_r_rms_m": list(values)}},
        "curves": [{"kind": "norms", "time_s": [0.0, 1.0], "filters": {"ekf": {"r_low": [1.0, None]}}}],
    }
    content = {"runs": list(runs), "settle_s": 500.0, "cpu_hours": 0.1, "filters": ["ekf"], "cases": [case]}
    return Extract("two_step", hash, content)


def test_an_extract_comes_back(tmp_path):
    path = tmp_path / "two_step.json"
    write_extract(extract(), path)
    back = read_extract(path)
    assert back == extract()
    measured = Measured({"two_step": back})
    np.testing.assert_array_equal(measured.values("two_step", 0, "ekf", "settled_r_rms_m"), [1, 2, np.nan])
    np.testing.assert_array_equal(measured.values("two_step", 0, "ekf", "settled_r_rms_m", [1, 7]), [2, np.nan])
    assert measured.window("two_step", 0) == "500\N{EN DASH}6000 s"
    assert measured.case("two_step", {"start": {"position_sigma_m": 1}}) == 0
    with pytest.raises(KeyError, match="no case"):
        measured.case("two_step", {"clock.step_s": 2})
    time, curves = measured.curves("two_step", 0, "norms")
    assert len(time) == 2 and np.isnan(curves["ekf"]["r_low"][1])


def test_a_number_that_was_changed_is_refused(tmp_path):
    path = tmp_path / "two_step.json"
    write_extract(extract(), path)
    path.write_text(path.read_text(encoding="utf-8").replace("[1.0,2.0,null]", "[1.0,2.1,null]"), encoding="utf-8")
    with pytest.raises(ValueError, match="digest"):
        read_extract(path)


@pytest.mark.parametrize("text", ["{}", "[]", "nothing", json.dumps({"campaign": "two_step"})])
def test_another_file_is_refused(tmp_path, text):
    path = tmp_path / "two_step.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match="no summary of a campaign"):
        read_extract(path)


def test_the_digest_is_of_the_content():
    assert digest(extract()) == digest(extract())
    assert digest(extract()) != digest(extract(values=(1.0, 2.0, 3.0)))
    assert digest(extract()) != digest(extract(hash="abd"))


def test_figures_have_six_digits():
    assert rounded(1.23456789e-7) == 1.23457e-7
    assert rounded(float("nan")) is None


def test_the_same_runs_are_compared():
    assert compared(extract(), extract(values=(0.5, 1.0, 2.0, None), runs=(9, 0, 1, 2))).agrees
    assert compared(extract(), extract()).numbers == 3
    other = compared(extract(), extract(values=(1.0, 2.002, None)))
    assert (other.agrees, other.differing) == (False, 1)
    assert other.worst == pytest.approx(1e-3, rel=2e-3)
    assert "DIFFERS" in other.in_words() and "run 1" in other.in_words()
    assert compared(extract(), extract(values=(1.0, None, None))).differing == 1
    nothing = compared(extract(), extract(runs=(7, 8, 9)))
    assert not nothing.agrees and "nothing to compare" in nothing.in_words()
