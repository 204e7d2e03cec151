"""Names of filters survive a CSV file, and a mistyped name finds the one that was meant."""

import io

import pandas as pd
import pytest

from relnav_sim.campaign.file_model import check_name
from relnav_sim.filters.registry import create_filter
from relnav_sim.near_names import nearest

MISSING = ["", "N/A", "NA", "NULL", "NaN", "None", "n/a", "nan", "null", "-nan", "1.#IND", "<NA>", "#N/A", "Nan", "na"]


@pytest.mark.parametrize("name", [*MISSING, "nan_filter", "NA2", "none-1", "ekf"])
def test_a_name_that_is_accepted_is_read_back_as_written(name: str) -> None:
    try:
        check_name(name)
    except ValueError:
        assert name in MISSING
    else:
        assert pd.read_csv(io.StringIO(f"filter,rms\n{name},1\nekf,2\n"))["filter"][0] == name


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("UKF", "ukf"), ("Ekf", "ekf"), ("sr-ukf", "sr_ukf"), ("SR UKF", "sr_ukf"), ("gauss", "gaussian_sum"),
        ("efk", "ekf"), ("xyzzy", None), ("", None),
    ],
)  # fmt: skip
def test_the_nearest_name(word: str, meant: str | None) -> None:
    assert nearest(word, ["kf", "ekf", "ukf", "sr_ukf", "gaussian_sum"]) == meant


def test_the_library_says_it_too() -> None:
    with pytest.raises(ValueError, match="did you mean 'ukf'"):
        create_filter("UKF", None, None)  # type: ignore[arg-type]
